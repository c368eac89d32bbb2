//! Which matches are correct, from what the user has.

use std::path::PathBuf;

use anyhow::bail;
use vpr_core::{GroundTruth, Poses, map::Names};
use vpr_data::truth::{Side, Sides};
use vpr_report::cli;

use super::input::Input;

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
        let (Some(queries), Some(references)) = (self.query_poses(input)?, &input.poses) else {
            bail!(
                "no positions: give --map-poses and --query-poses, or --ground-truth, --labels or \
                 --same-index"
            );
        };
        let radius = self.other.positive_dist_threshold;
        Ok(GroundTruth::within_radius(&queries, references, radius)?)
    }

    /// Where the queries are, if that is known.
    pub(crate) fn query_poses(&self, input: &Input) -> anyhow::Result<Option<Poses>> {
        input.query_poses(self.query_poses.as_deref())
    }
}

/// What a truth is told of one side.
fn side(n: usize, names: Option<&Names>) -> Side {
    match names {
        Some(names) if names.len() == n => Side::named(names.iter().map(str::to_owned).collect()),
        _ => Side::numbered(n),
    }
}
