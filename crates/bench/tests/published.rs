//! Our metrics on the author's published scores, against the official definitions under scikit-learn.
//!
//! Oracle: `data/golden/metrics/vprbench_oracle.csv`, six decimals, hence the tolerance of 1e-6. Runs
//! where `VPR_DATA` names a folder with VPR-Bench's files; says `skipped:` otherwise.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a test fails by panicking and says what it skips"
)]
#![expect(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test fails by panicking and says what it skips"
)]

use std::path::{Path, PathBuf};

use std::sync::Arc;

use vpr_core::{
    Definition, Evaluation, Judged, Similarities,
    metrics::{self, Positives, recall_at},
};
use vpr_data::layout::vpr_bench::{read_areas, read_curves};
use vpr_study::{Describe as _, HandCrafted, Sources, Stored, Technique};
use vpr_vision::{cohog::CoHogParams, hog::HogParams};

const TOLERANCE: f64 = 1e-6;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn data() -> Option<Sources<'static>> {
    let Some(folder) = std::env::var_os("VPR_DATA") else {
        println!("skipped: VPR_DATA is not set");
        return None;
    };
    let workspace = workspace().join("data");
    Some(Sources::new([Path::new(&folder), &workspace], &workspace.join("worlds"), &()))
}

/// One line of the oracle: dataset id, technique, values by column name.
fn oracle() -> Vec<(&'static str, Technique, csv::StringRecord, csv::StringRecord)> {
    let path = workspace().join("data/golden/metrics/vprbench_oracle.csv");
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let lines = reader.records().map(|line| {
        let line = line.unwrap();
        let dataset = if &line[0] == "corridor" { "corridor" } else { "spedtest" };
        let technique = Technique::ALL.into_iter().find(|it| it.stored_name() == &line[1]).unwrap();
        (dataset, technique, header.clone(), line)
    });
    lines.collect()
}

#[test]
fn all_columns_of_the_oracle_are_reproduced() {
    let Some(data) = data() else { return };
    let lines = oracle();
    assert_eq!(lines.len(), 20);
    for (dataset, technique, header, line) in lines {
        let stored = data.stored(dataset, technique).unwrap().expect("published matches at hand");
        let judged = Judged::new(&stored.scores.best().reference, &stored.truth).unwrap();
        let evaluation =
            Evaluation::of_confidence(&stored.scores.best().confidence, &judged).unwrap();
        let (confidence, correct) = (evaluation.confidence(), judged.correct());
        let recall = |n| recall_at(n, stored.scores.ranking()?, &stored.truth);
        let published = Positives::Published;
        let computed = [
            ("auc_pr_trapz", evaluation.auc_pr(Definition::Published)),
            ("average_precision", evaluation.average_precision(Definition::Published)),
            ("auc_pr_slam_recall(GTP_denominator)", evaluation.auc_pr(Definition::Corrected)),
            ("auc_roc", metrics::auc_roc(confidence, correct)),
            ("ep", metrics::extended_precision(confidence, correct, published)),
            (
                "precision_at_first_full_recall",
                metrics::precision_at_full_recall(Definition::Published, confidence, correct),
            ),
            ("r@1", recall(1)),
            ("r@5", recall(5)),
            ("r@10", recall(10)),
            ("r@19", recall(19)),
            ("r@20", recall(20)),
        ];
        for (column, value) in computed {
            let index = header.iter().position(|it| it == column).unwrap();
            let expected: f64 = line[index].parse().unwrap();
            let value = value.unwrap();
            assert!(
                (value - expected).abs() <= TOLERANCE,
                "{dataset} {} {column}: {value} is not {expected}",
                technique.name()
            );
        }
    }
}

#[test]
fn stored_best_matches_follow_from_the_stored_scores() {
    let Some(data) = data() else { return };
    for (dataset, technique, _, _) in oracle() {
        let stored = data.stored(dataset, technique).unwrap().expect("published matches at hand");
        let (similarities, best) = (stored.scores.similarities(), stored.scores.best());
        assert_eq!(similarities.best(), *best, "{dataset} {}", technique.name());
    }
}

#[test]
fn areas_between_the_published_curves_are_the_stored_ones() {
    let Some(data) = data() else { return };
    let file = |name: &str| {
        let path = format!("vpr-bench/invariance_dict/{name}.pkl");
        data.locate(path.as_ref()).unwrap().expect("invariance dictionaries at hand")
    };
    let variations = [
        ("viewpoint_variations", "viewpoint_variations"),
        ("illumination_variations", "illumination_variation"),
    ];
    let mut n_curves = 0;
    for (areas, curves) in variations {
        let areas = read_areas(&file(&format!("{areas}_ABC_dict"))).unwrap();
        let same = read_curves(&file(&format!("{curves}_varied_scores_dict"))).unwrap();
        let other = read_curves(&file(&format!("{curves}_mismatch_scores_dict"))).unwrap();
        for (technique, stored) in areas {
            let (same, other) = (&same[&technique], &other[&technique]);
            let area = metrics::area_between_curves(Definition::Published, same, other).unwrap();
            assert!((area - stored).abs() <= 1e-9, "{technique}: {area} is not {stored}");
            n_curves += 1;
        }
    }
    assert_eq!(n_curves, 16);
}

/// Our scores of a technique on Corridor's images, and the stored ones.
fn corridor(
    data: &Sources<'_>,
    technique: Technique,
    ours: &HandCrafted,
) -> (Similarities, Arc<Stored>) {
    let stored = data.stored("corridor", technique).unwrap().expect("published matches at hand");
    let images = data.images("corridor").unwrap().expect("images at hand");
    let queries = ours.encode(&images.queries, &|| ()).unwrap();
    let references = ours.encode(&images.references, &|| ()).unwrap();
    (queries.match_with(&references).unwrap().similarities, stored)
}

/// Mean and largest absolute difference of two score matrices.
fn difference(ours: &Similarities, stored: &Stored) -> (f64, f64) {
    let apart: Vec<f64> = ours
        .view()
        .iter()
        .zip(stored.scores.similarities().view())
        .map(|(a, b)| (a - b).abs())
        .collect();
    let largest = apart.iter().copied().fold(0.0, f64::max);
    (apart.iter().sum::<f64>() / apart.len() as f64, largest)
}

fn recall_at_1(similarities: &Similarities, stored: &Stored) -> f64 {
    recall_at(1, &similarities.ranked(1).unwrap(), &stored.truth).unwrap()
}

/// Share of queries whose best reference is the stored one.
fn same_best(similarities: &Similarities, stored: &Stored) -> f64 {
    let best = similarities.best().reference;
    let same = best.iter().zip(&stored.scores.best().reference).filter(|(a, b)| a == b).count();
    same as f64 / best.len() as f64
}

/// OpenCV itself differs from the published matrix by .0023 on average: other image decoders.
#[test]
fn hog_in_the_released_configuration_gives_the_published_scores() {
    let Some(data) = data() else { return };
    let hog = HandCrafted::Hog(HogParams::RELEASED);
    let (ours, stored) = corridor(&data, Technique::Hog, &hog);
    let (mean, largest) = difference(&ours, &stored);
    println!(
        "HOG on Corridor: mean difference {mean:.5}, largest {largest:.5}, same best {:.3}, R@1 {:.4}",
        same_best(&ours, &stored),
        recall_at_1(&ours, &stored)
    );
    assert!(mean <= 0.003, "{mean}");
    let (thesis, _) = corridor(&data, Technique::Hog, &HandCrafted::Hog(HogParams::THESIS));
    assert!(difference(&thesis, &stored).0 > 0.03, "the thesis' configuration is another one");
}

#[test]
fn cohog_recalls_as_published() {
    let Some(data) = data() else { return };
    let cohog = HandCrafted::CoHog(CoHogParams::default());
    let (ours, stored) = corridor(&data, Technique::CoHog, &cohog);
    let (mean, largest) = difference(&ours, &stored);
    let (recall, published) =
        (recall_at_1(&ours, &stored), recall_at_1(stored.scores.similarities(), &stored));
    println!(
        "CoHOG on Corridor: mean difference {mean:.6}, largest {largest:.5}, same best {:.3}, R@1 {recall:.4}",
        same_best(&ours, &stored)
    );
    assert!((published - 0.622).abs() < 5e-4, "{published}");
    assert!((recall - published).abs() <= 0.05, "{recall}");
}
