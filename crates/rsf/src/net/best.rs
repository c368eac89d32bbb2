//! The best network so far, as a file of a run's folder.

use std::{
    fs,
    path::{Path, PathBuf},
};

use vpr_core::Error as CoreError;
use vpr_nets::{
    model::Tunable,
    weights::{self, Precision},
};

use super::Score;
use crate::Result;

/// What it is called; step and score follow.
const BEST: &str = "best-";

/// Whether a score is better than another: by recall, then by gap.
pub(super) fn is_better(new: &Score, old: &Score) -> bool {
    (new.recall, new.gap) > (old.recall, old.gap)
}

/// Keeps a network if none is better. One that a killed run had reached after
/// its last checkpoint is reached again, with the same score.
pub(super) fn keep_if_best<N: Tunable>(
    folder: &Path,
    step: usize,
    score: Score,
    network: &N,
) -> Result<()> {
    let before = best(folder)?;
    if before.as_ref().is_some_and(|(_, old, _)| !is_better(&score, old)) {
        return Ok(());
    }
    let (recall, gap) = (score.recall.to_bits(), score.gap.to_bits());
    let path = folder.join(format!("{BEST}{step}-{recall:016x}-{gap:016x}.safetensors"));
    weights::save(network, &path, &[], Precision::Single)?;
    if let Some((_, _, old)) = before {
        fs::remove_file(&old).map_err(CoreError::io(&old))?;
    }
    Ok(())
}

/// Step, score (without its number of variants) and file of the best network in a folder.
pub(super) fn best(folder: &Path) -> Result<Option<(usize, Score, PathBuf)>> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).map_err(CoreError::io(folder))? {
        let path = entry.map_err(CoreError::io(folder))?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let parts = name.strip_prefix(BEST).and_then(|name| name.strip_suffix(".safetensors"));
        let parsed = parts.and_then(|parts| {
            let mut parts = parts.split('-');
            let step = parts.next()?.parse::<usize>().ok()?;
            let mut bits = || Some(f64::from_bits(u64::from_str_radix(parts.next()?, 16).ok()?));
            Some((step, Score { recall: bits()?, gap: bits()?, n: 0 }))
        });
        all.extend(parsed.map(|(step, score)| (step, score, path)));
    }
    let order = |a: &(usize, Score, PathBuf), b: &(usize, Score, PathBuf)| {
        let by_score = a.1.recall.total_cmp(&b.1.recall).then(a.1.gap.total_cmp(&b.1.gap));
        by_score.then(b.0.cmp(&a.0))
    };
    Ok(all.into_iter().max_by(order))
}
