//! The report of `sue evaluate`: the same matches, ordered by every estimator.

use vpr_core::{GroundTruth, Poses, Retrieval};
use vpr_report::{
    cli::{self, ReportArgs},
    report::{Dataset, Match, Report, Run},
};

use super::input::{Input, name_of};

/// Matches per query that a report keeps.
const RANKS: usize = 20;

/// What one estimator says about the best matches.
pub(super) fn run(estimator: &str, retrieval: &Retrieval, uncertainty: Vec<f64>) -> Run {
    let matches = |query: usize| {
        let ranked = retrieval.indices(query).into_iter().zip(retrieval.distances(query));
        let found = ranked.take(RANKS).map(|(&reference, &distance)| Match {
            reference,
            distance: f64::from(distance),
            inliers: None,
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

/// Writes the report that the flags ask for.
pub(super) fn write(
    args: &ReportArgs,
    input: &Input,
    (query_poses, truth): (Option<&Poses>, &GroundTruth),
    runs: Vec<Run>,
) -> anyhow::Result<()> {
    let names = |n: usize, names: Option<&vpr_core::map::Names>| {
        (0..n).map(|index| name_of(names, index)).collect()
    };
    let dataset = Dataset {
        name: "queries on the map".to_owned(),
        queries: names(input.n_queries(), input.query_names.as_ref()),
        references: names(input.n_references(), input.names.as_ref()),
        poses: query_poses.zip(input.poses.as_ref()),
        truth: Some(truth),
        thumbnails: None,
        similarities: None,
    };
    args.write(&Report {
        title: "Uncertainty of matches".to_owned(),
        facts: vec![
            ("command".to_owned(), cli::command_line()),
            ("program".to_owned(), format!("sue {}", env!("CARGO_PKG_VERSION"))),
        ],
        datasets: vec![dataset],
        runs,
        budget: args.budget(),
    })
}
