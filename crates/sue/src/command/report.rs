//! The report of `sue evaluate`, the same matches ordered by every estimator, and that of
//! `sue calibrate`, what a threshold accepts.

use sue::Threshold;
use vpr_core::{GroundTruth, Poses, Retrieval};
use vpr_report::{
    cli::{self, ReportArgs},
    report::{Dataset, Match, Report, Run},
};
use vpr_study::thumbnails;

use super::{
    input::{Input, name_of},
    pictures::Pictures,
};

/// Matches per query that a report keeps.
const RANKS: usize = 20;

/// What one estimator says about the best matches, with the inliers of each if they were counted.
pub(super) fn run(
    estimator: &str,
    retrieval: &Retrieval,
    uncertainty: Vec<f64>,
    inliers: Option<&[usize]>,
) -> Run {
    let matches = |query: usize| {
        let ranked = retrieval.indices(query).into_iter().zip(retrieval.distances(query));
        let of_best = inliers.and_then(|it| it.get(query).copied());
        let found = ranked.take(RANKS).enumerate().map(|(rank, (&reference, &distance))| Match {
            reference,
            distance: f64::from(distance),
            inliers: of_best.filter(|_| rank == 0),
        });
        found.collect()
    };
    Run {
        name: estimator.to_owned(),
        matches: (0..retrieval.len()).map(matches).collect(),
        uncertainty: Some(uncertainty),
        estimator: Some(format!("uncertainty by {estimator}")),
        ..Run::default()
    }
}

/// The largest uncertainty that a threshold accepts: reports accept what is at most theirs. Just below
/// all of them if it accepts none.
pub(super) fn at_most(threshold: Threshold, uncertainty: &[f64]) -> f64 {
    let accepted = uncertainty.iter().copied().filter(|&it| threshold.accepts(it));
    accepted
        .reduce(f64::max)
        .unwrap_or_else(|| uncertainty.iter().copied().fold(f64::INFINITY, f64::min).next_down())
}

/// Writes the report that the flags ask for, with what else its reader must know.
pub(super) fn write(
    args: &ReportArgs,
    input: &Input,
    (query_poses, truth): (Option<&Poses>, &GroundTruth),
    pictures: &Pictures,
    runs: Vec<Run>,
    fact: Option<(&str, &str)>,
) -> anyhow::Result<()> {
    let side = |paths: &Option<Vec<_>>| paths.clone().unwrap_or_default();
    let (of_queries, of_references) = (side(&pictures.queries), side(&pictures.references));
    let made = thumbnails(&of_queries, &of_references);
    let has_pictures = !(of_queries.is_empty() && of_references.is_empty());
    let names = |n: usize, names: Option<&vpr_core::map::Names>| {
        (0..n).map(|index| name_of(names, index)).collect()
    };
    let dataset = Dataset {
        name: "queries on the map".to_owned(),
        queries: names(input.n_queries(), input.query_names.as_ref()),
        references: names(input.n_references(), input.names.as_ref()),
        poses: query_poses.zip(input.poses.as_ref()),
        truth: Some(truth),
        thumbnails: if has_pictures { Some(&made) } else { None },
        similarities: None,
    };
    let mut facts = vec![
        ("command".to_owned(), cli::command_line()),
        ("program".to_owned(), format!("sue {}", env!("CARGO_PKG_VERSION"))),
    ];
    facts.extend(fact.map(|(name, text)| (name.to_owned(), text.to_owned())));
    args.write(&Report {
        title: "Uncertainty of matches".to_owned(),
        facts,
        datasets: vec![dataset],
        runs,
        budget: args.budget(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_accepts_what_the_threshold_accepts() {
        let uncertainty = [3.0, 1.0, 2.0];
        let of = |threshold| {
            let limit = at_most(threshold, &uncertainty);
            uncertainty.map(|it| it <= limit)
        };
        assert_eq!(of(Threshold::below(2.0).unwrap()), [false, true, false], "2 is not below 2");
        assert_eq!(of(Threshold::EVERYTHING), [true; 3]);
        assert_eq!(of(Threshold::NOTHING), [false; 3]);
    }
}
