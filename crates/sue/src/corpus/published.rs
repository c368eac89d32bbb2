//! Matches that VPR-Bench's authors stored: score matrices of ten techniques.

use vpr_core::{
    dataset::{DatasetEntry, layout::vpr_bench::PublishedMatches},
    table::Provenance,
};

use super::{Corpus, Sources, frames, retrieval_of};
use crate::{Result, evaluate::Judged};

/// Name of each technique in tables, and of its folder.
const TECHNIQUES: [(&str, &str); 10] = [
    ("NetVLAD", "NetVLAD"),
    ("RegionVLAD", "RegionVLAD"),
    ("CoHOG", "CoHOG"),
    ("HOG", "HOG"),
    ("AlexNet", "AlexNet_VPR"),
    ("AMOSNet", "AMOSNet"),
    ("HybridNet", "HybridNet"),
    ("CALC", "CALC"),
    ("AP-GeM", "ap-gem-r101"),
    ("DenseVLAD", "denseVLAD"),
];

/// One corpus per technique with stored matches, none without them.
///
/// Scores are cosines, so distances are those of unit descriptors.
pub(super) fn open(entry: &DatasetEntry, sources: &Sources<'_>) -> Result<Vec<Corpus>> {
    let Some(folder) = &entry.matches else { return Ok(Vec::new()) };
    if sources.roots.find(folder).is_err() || entry.ground_truth(sources.roots).is_err() {
        return Ok(Vec::new());
    }
    let truth = entry.ground_truth(sources.roots)?;
    let files = entry.published_matches(sources.roots)?;
    let mut corpora = Vec::new();
    for (name, stored) in TECHNIQUES {
        let Some(file) = files.get(stored) else { continue };
        let matches = PublishedMatches::read(file)?;
        let n_references = matches.similarities.n_references();
        let (truth, _) = truth.truth(n_references)?;
        let retrieval = retrieval_of(&matches.similarities)?;
        corpora.push(Corpus {
            name: entry.name.clone(),
            encoder: format!("{name}, stored scores"),
            provenance: if entry.path.starts_with("fixture") {
                Provenance::Generated
            } else {
                Provenance::Published
            },
            judged: Judged::new(&retrieval.best(), &truth)?,
            retrieval,
            poses: frames(n_references),
            query_poses: None,
            truth,
            images: None,
            variances: None,
            note: Some("frame indices stand for positions".to_owned()),
        });
    }
    Ok(corpora)
}
