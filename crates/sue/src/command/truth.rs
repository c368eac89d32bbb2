//! Which matches are correct, from what the user has.

use std::path::PathBuf;

use anyhow::{bail, ensure};
use vpr_core::GroundTruth;
use vpr_data::layout::vpr_bench::GroundTruthFile;
use vpr_report::cli;

use super::input::Input;

/// Positions with a radius, or lists.
#[derive(clap::Args)]
pub(crate) struct TruthArgs {
    /// Poses of the queries, if their descriptors did not come with them
    #[arg(long, value_name = "PATH", conflicts_with = "ground_truth")]
    query_poses: Option<PathBuf>,
    /// Correct references per query, VPR-Bench's `ground_truth_new.npy`; instead of positions
    #[arg(long, alias = "ground_truth", value_name = "NPY")]
    ground_truth: Option<PathBuf>,
    /// A reference is correct within this many metres, the limit included
    #[arg(long, alias = "positive_dist_threshold", default_value_t = 25.0, value_name = "M")]
    positive_dist_threshold: f64,
}

impl TruthArgs {
    /// The correct references of every query.
    pub(crate) fn truth(&self, input: &Input) -> anyhow::Result<GroundTruth> {
        let (n_queries, n_references) = (input.n_queries(), input.n_references());
        if let Some(path) = &self.ground_truth {
            let file = GroundTruthFile::read(path)?;
            let n = file.len();
            ensure!(n == n_queries, "{}: {n} rows for {n_queries} queries", path.display());
            let (truth, n_clamped) = file.truth(n_references)?;
            if n_clamped > 0 {
                let path = path.display();
                cli::note(&format!(
                    "warning: {path}: {n_clamped} entries point past the {n_references} references and are dropped"
                ));
            }
            return Ok(truth);
        }
        let queries = input.query_poses(self.query_poses.as_deref())?;
        let (Some(queries), Some(references)) = (queries, &input.poses) else {
            bail!("no positions: give --map-poses and --query-poses, or --ground-truth");
        };
        Ok(GroundTruth::within_radius(&queries, references, self.positive_dist_threshold)?)
    }
}
