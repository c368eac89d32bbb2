//! Which matches are correct, from what the user has.

use std::path::PathBuf;

use anyhow::bail;
use vpr_core::{GroundTruth, map::Names};
use vpr_data::truth::{Side, Sides};
use vpr_report::cli;

use super::input::{Input, poses_of};

/// Positions with a radius, or any other truth.
#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct TruthArgs {
    /// Poses of the queries, if their descriptors did not come with them
    #[arg(long, value_name = "PATH")]
    query_poses: Option<PathBuf>,
    #[command(flatten)]
    other: vpr_study::TruthArgs,
}

impl TruthArgs {
    /// The correct references of every query.
    pub(crate) fn truth(&self, input: &Input) -> anyhow::Result<GroundTruth> {
        let given = self.query_poses.as_ref();
        let given = given
            .map(|path| poses_of(path, input.query_names.as_ref(), input.n_queries()))
            .transpose()?;
        if let Some(source) = self.other.source() {
            let sides = Sides {
                queries: side(input.n_queries(), input.query_names.as_ref()),
                references: side(input.n_references(), input.names.as_ref()),
            };
            let found = source.truth(&sides)?;
            for note in &found.notes {
                cli::note(&format!("note: {note}"));
            }
            return Ok(found.truth);
        }
        if let (Some((_, Some(queries))), Some(map)) = (&given, &input.about.coordinates)
            && queries != map
        {
            let (first, second) = (map.to_string(), queries.to_string());
            return Err(sue::Error::OtherCoordinates { first, second }.into());
        }
        let queries = given.map(|it| it.0).or_else(|| input.query_poses.clone());
        let (Some(queries), Some(references)) = (queries, &input.poses) else {
            bail!(
                "no positions: give --map-poses and --query-poses, or --ground-truth, --labels or \
                 --same-index"
            );
        };
        let radius = self.other.positive_dist_threshold;
        Ok(GroundTruth::within_radius(&queries, references, radius)?)
    }
}

/// What a truth is told of one side.
fn side(n: usize, names: Option<&Names>) -> Side {
    match names {
        Some(names) if names.len() == n => Side::named(names.iter().map(str::to_owned).collect()),
        _ => Side::numbered(n),
    }
}
