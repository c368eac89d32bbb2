//! The report of `bench evaluate` and `bench compare`: what was found, to look at.

use std::path::PathBuf;

use vpr_core::{GroundTruth, Similarities};
use vpr_report::{
    cli::{self, ReportArgs},
    report::{Dataset, Match, Report, Run},
};
use vpr_study::thumbnails;

use super::{input_args::InputArgs, retrieved::Retrieved};

/// Largest number of similarities of which a picture is made.
const MATRIX: usize = 100_000_000;

/// Writes the report that the flags ask for, if any.
pub(super) fn write(
    args: &InputArgs,
    report: &ReportArgs,
    runs: &[(&str, &Retrieved)],
    truth: Option<&GroundTruth>,
) -> anyhow::Result<()> {
    let Some((_, retrieved)) = runs.first().filter(|_| report.path.is_some()) else {
        return Ok(());
    };
    let (queries, references) = (&retrieved.queries, &retrieved.references);
    let pictures = thumbnails(&queries.names, &references.names);
    // Rows of a file of descriptors or scores have no pictures.
    let has_pictures = args.has_images();
    let names = |names: &[PathBuf]| names.iter().map(|it| it.display().to_string()).collect();
    let name = args.dataset.clone().unwrap_or_else(|| "images".to_owned());
    let is_small = |it: &&Similarities| it.n_queries() * it.n_references() <= MATRIX;
    let dataset = Dataset {
        name,
        queries: names(&queries.names),
        references: names(&references.names),
        poses: queries.poses.as_ref().zip(references.poses.as_ref()),
        truth,
        thumbnails: if has_pictures { Some(&pictures) } else { None },
        similarities: retrieved.similarities.as_ref().filter(is_small),
    };
    let names: Vec<&str> = runs.iter().map(|(name, _)| *name).collect();
    let runs = names.iter().zip(runs).map(|(name, (_, retrieved))| run(name, retrieved)).collect();
    report.write(&Report {
        title: format!("{} on {}", names.join(", "), dataset.name),
        facts: vec![
            ("command".to_owned(), cli::command_line()),
            ("protocol".to_owned(), protocol(args, truth)),
            ("program".to_owned(), format!("bench {}", env!("CARGO_PKG_VERSION"))),
        ],
        datasets: vec![dataset],
        runs,
        budget: report.budget(),
    })
}

/// What one method found.
fn run(name: &str, retrieved: &Retrieved) -> Run {
    let matches = |(query, distances): (usize, &Vec<f64>)| {
        let ranked = retrieved.ranking.indices(query).into_iter().zip(distances);
        ranked.map(|(&reference, &distance)| Match { reference, distance, inliers: None }).collect()
    };
    let is_similarity = retrieved.similarities.is_some();
    Run {
        name: name.to_owned(),
        matches: retrieved.distances.iter().enumerate().map(matches).collect(),
        estimator: is_similarity.then(|| "negative similarity of the best match".to_owned()),
        ..Run::default()
    }
}

/// Which references count as correct.
fn protocol(args: &InputArgs, truth: Option<&GroundTruth>) -> String {
    match (truth, args.truth.source(), &args.dataset) {
        (None, ..) => "nothing is judged".to_owned(),
        (_, Some(source), _) => format!("correct references: {source}"),
        (_, _, Some(dataset)) => format!("correct references as `{dataset}` defines them"),
        _ => format!(
            "a reference is correct within {} m, the limit included",
            args.truth.positive_dist_threshold
        ),
    }
}
