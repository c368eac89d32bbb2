//! CoHOG on the images of the Corridor dataset, where the shared data is at hand.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]
#![expect(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a test may panic, and says why it does not run"
)]

use std::{env, fs, path::Path};

use vpr_core::{GroundTruth, Result, metrics};
use vpr_vision::cohog::{CoHog, CoHogDescriptor, CoHogParams, n_fallbacks, similarities};
use vpr_vision::image::decode;

/// Recall@1 of the scores published with VPR-Bench.
const PUBLISHED: f64 = 0.622;

fn describe(cohog: &CoHog, folder: &Path) -> Result<Vec<CoHogDescriptor>> {
    let mut paths: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.iter().map(|path| cohog.describe(&decode(path)?)).collect()
}

#[test]
fn recall_is_within_five_points_of_the_published() {
    let Some(data) = env::var_os("VPR_DATA") else {
        eprintln!("skipped: VPR_DATA is not set, the Corridor images are needed");
        return;
    };
    let corridor = Path::new(&data).join("vpr-bench/datasets/corridor");
    let cohog = CoHog::new(CoHogParams::default()).unwrap();
    let queries = describe(&cohog, &corridor.join("query")).unwrap();
    let references = describe(&cohog, &corridor.join("ref")).unwrap();
    assert_eq!((queries.len(), references.len(), n_fallbacks(&queries)), (111, 111, 0));

    let ranking = similarities(&queries, &references).unwrap().ranked(1).unwrap();
    let nearby = |query: usize| (query.saturating_sub(2)..=(query + 2).min(110)).collect();
    let truth = GroundTruth::from_lists((0..111).map(nearby).collect(), 111).unwrap();
    let recall = metrics::recall_at(1, &ranking, &truth).unwrap();
    assert!((recall - PUBLISHED).abs() <= 0.05, "recall@1 is {recall}, published {PUBLISHED}");
}
