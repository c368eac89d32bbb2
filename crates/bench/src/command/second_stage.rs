//! What `bench evaluate` does behind retrieval: sequences, and re-ranking by inliers.

use std::{path::PathBuf, time::Instant};

use anyhow::{Context as _, bail, ensure};
use bench::{
    rerank::rerank,
    sequence::{SequenceParams, Window, along_sequences},
};
use vpr_core::GroundTruth;
use vpr_data::DataRoots;
use vpr_report::cli::{self, Bar};
use vpr_study::verification::{LocalMethod, Verifier};
use vpr_vision::hog::similarities;

use super::{result, retrieved::Retrieved};

/// What happens to the retrieved references.
#[derive(clap::Args)]
pub(crate) struct SecondStageArgs {
    /// Match sequences of this many queries in the manner of `SeqSLAM`; images must be in order of time
    #[arg(long, value_name = "LENGTH", value_parser = cli::at_least_one)]
    sequence: Option<usize>,
    /// Where the other queries of a sequence lie
    #[arg(long, value_enum, default_value_t, requires = "sequence", value_name = "WINDOW")]
    sequence_window: Window,
    /// Order the first N references of every query by the inliers of SIFT and a homography
    #[arg(long, value_name = "N", value_parser = cli::at_least_one)]
    pub(super) rerank: Option<usize>,
    /// Order them by a fundamental matrix instead
    #[arg(long, requires = "rerank")]
    rerank_fundamental: bool,
}

impl SecondStageArgs {
    /// Whether anything is asked for.
    fn is_empty(&self) -> bool {
        self.sequence.is_none() && self.rerank.is_none()
    }

    /// Applies what is asked for, and says what it changed and how long it took.
    pub(super) fn apply(
        &self,
        mut retrieved: Retrieved,
        truth: Option<&GroundTruth>,
        recall_values: &[usize],
        k: usize,
        folders: &[PathBuf],
    ) -> anyhow::Result<Retrieved> {
        if self.is_empty() {
            return Ok(retrieved);
        }
        let say = |what: &str, retrieved: &Retrieved, seconds: Option<f64>| {
            said(what, retrieved, truth.map(|it| (it, recall_values)), seconds)
        };
        say("retrieved", &retrieved, None)?;
        if let Some(length) = self.sequence {
            let start = Instant::now();
            retrieved = self.along(length, retrieved, k)?;
            let seconds = start.elapsed().as_secs_f64();
            say(&format!("sequences of {length}"), &retrieved, Some(seconds))?;
        }
        if let Some(n) = self.rerank {
            let n = n.min(retrieved.ranking.k());
            let verifier = self.verifier(folders)?;
            let start = Instant::now();
            by_inliers(&verifier, &mut retrieved, n)?;
            let seconds = start.elapsed().as_secs_f64();
            say(&format!("first {n} by inliers"), &retrieved, Some(seconds))?;
        }
        retrieved.alone = None;
        Ok(retrieved)
    }

    /// What whole sequences find.
    fn along(
        &self,
        length: usize,
        mut retrieved: Retrieved,
        k: usize,
    ) -> anyhow::Result<Retrieved> {
        let window = self.sequence_window;
        let params = SequenceParams { length, window, ..SequenceParams::default() };
        let scores = match (&retrieved.similarities, &retrieved.descriptors) {
            (Some(scores), _) => along_sequences(scores, &params)?,
            (None, Some((queries, references))) => {
                along_sequences(&similarities(queries, references)?, &params)?
            }
            (None, None) => {
                bail!("`--sequence` needs the score of every query with every reference")
            }
        };
        let sides = [retrieved.queries.clone(), retrieved.references.clone()];
        let descriptors = retrieved.descriptors.take();
        Ok(Retrieved { descriptors, ..Retrieved::of_scores(sides, scores, k)? })
    }

    fn verifier(&self, folders: &[PathBuf]) -> anyhow::Result<Verifier> {
        let method =
            if self.rerank_fundamental { LocalMethod::SiftFundamental } else { LocalMethod::Sift };
        let roots = DataRoots::new(folders.iter().cloned());
        method.open(&roots)?.map_err(anyhow::Error::msg)
    }
}

/// Orders the first `n` references of every query by inliers.
fn by_inliers(verifier: &Verifier, retrieved: &mut Retrieved, n: usize) -> anyhow::Result<()> {
    let images = [&retrieved.queries.names[..], &retrieved.references.names[..]];
    ensure!(
        images.iter().all(|side| side.iter().all(|path| path.is_file())),
        "`--rerank` needs the images: give folders or a dataset, not rows or scores"
    );
    let bar = Bar::default();
    let again = rerank(verifier, images, &retrieved.ranking, n, &bar).context("re-ranking")?;
    for (distances, ranks) in retrieved.distances.iter_mut().zip(&again.ranks) {
        *distances = ranks.iter().map(|&rank| distances[rank]).collect();
    }
    retrieved.confidence = again.inliers.iter().map(|&it| it as f64).collect();
    retrieved.ranking = again.ranking;
    Ok(())
}

/// Says what a stage found, and how long it took.
fn said(
    what: &str,
    retrieved: &Retrieved,
    judged: Option<(&GroundTruth, &[usize])>,
    seconds: Option<f64>,
) -> anyhow::Result<()> {
    let line = match judged {
        Some((truth, recall_values)) => result::line(recall_values, &retrieved.ranking, truth)?,
        None => String::new(),
    };
    let n = retrieved.queries.len().max(1) as f64;
    let time = seconds.map_or(String::new(), |it| format!("{:.1} ms per query", 1e3 * it / n));
    let parts: Vec<&str> = [line.as_str(), &time].into_iter().filter(|it| !it.is_empty()).collect();
    cli::note(&format!("{what}: {}", parts.join("; ")));
    Ok(())
}
