//! What is kept of one dataset is never taken for another's, and a replaced image is seen.

use std::{fs, sync::Arc};

use vpr_core::GroundTruth;
use vpr_data::Dataset;
use vpr_study::{Direction, Sources};

const WORLD: &str = "world/street?places=4&camera.width=80&camera.height=60";

#[test]
fn datasets_that_share_their_first_query_have_scores_of_their_own() {
    let cache = tempfile::tempdir().unwrap();
    let sources = Sources::new([], cache.path(), &());
    let whole = sources.images(WORLD).unwrap().unwrap();
    let part = |queries: [usize; 2]| Dataset {
        queries: queries.map(|it| whole.queries[it].clone()).to_vec(),
        truth: GroundTruth::within_frames(2, whole.references.len(), 1),
        ..(*whole).clone()
    };
    let hog = sources.runner("hog").unwrap().unwrap();
    let scores = |dataset: &Dataset| sources.scores(&hog, dataset, Direction::AsReleased).unwrap();
    let (first, second) = (scores(&part([0, 1])), scores(&part([0, 3])));
    assert_eq!(first.similarities().view().row(0), second.similarities().view().row(0));
    assert_ne!(first.similarities().view().row(1), second.similarities().view().row(1));
    assert!(Arc::ptr_eq(&first, &scores(&part([0, 1]))), "computed once");
    assert_eq!(scores(&whole).similarities().n_queries(), 4);
    let swapped = sources.scores(&hog, &whole, Direction::Swapped).unwrap();
    assert_ne!(swapped.similarities(), scores(&whole).similarities());
}

#[test]
fn a_replaced_image_is_described_again() {
    let cache = tempfile::tempdir().unwrap();
    let sources = Sources::new([], cache.path(), &());
    let dataset = sources.images(WORLD).unwrap().unwrap();
    let hog = sources.runner("hog").unwrap().unwrap();
    let scores = || sources.scores(&hog, &dataset, Direction::AsReleased).unwrap();
    let before = scores();
    fs::copy(&dataset.queries[2], &dataset.queries[0]).unwrap();
    let after = scores();
    assert_eq!(after.similarities().view().row(0), after.similarities().view().row(2));
    assert_ne!(after.similarities(), before.similarities());
}
