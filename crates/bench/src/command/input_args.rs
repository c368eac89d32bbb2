//! The flags that name two sides and what is correct, the same in `bench evaluate`, `compare` and
//! `audit`.

use std::path::PathBuf;

use vpr_core::Observer as _;
use vpr_report::cli::{Bar, DataArgs};
use vpr_study::{Runner, TruthArgs, reading::ReadingArgs, technique::hand_crafted};

#[cfg(feature = "networks")]
use super::{
    by_network::{self, Asked},
    encoder::EncoderArgs,
};
use super::{named::Named, retrieved::Retrieved};

/// Two sides, how they are read, and which references are correct.
#[derive(clap::Args, Clone)]
pub(crate) struct InputArgs {
    /// A dataset by name, such as `corridor` or the generated `world/street`, with its own truth
    /// unless another is given
    #[arg(
        long,
        value_name = "NAME",
        conflicts_with_all = ["database_folder", "database_descriptors", "similarities", "distances"]
    )]
    pub(super) dataset: Option<String>,
    /// Folder of the reference images; their positions are those of --database-poses, or of
    /// `@utm_east@utm_north@…` names; none are needed with another truth or --no-labels
    #[arg(long, alias = "database_folder", value_name = "DIR", requires = "queries_folder")]
    pub(super) database_folder: Option<PathBuf>,
    /// Folder of the query images
    #[arg(long, alias = "queries_folder", value_name = "DIR", requires = "database_folder")]
    pub(super) queries_folder: Option<PathBuf>,
    #[cfg(feature = "networks")]
    #[command(flatten)]
    pub(super) encoder: EncoderArgs,
    #[command(flatten)]
    pub(super) data: DataArgs,
    /// Leave out images that cannot be decoded, and list them, instead of stopping at the first
    #[arg(long, alias = "skip_bad")]
    pub(super) skip_bad: bool,
    /// Descriptors of the references, one row each: .npy, or any format of docs/formats.md
    #[arg(
        long,
        alias = "database_descriptors",
        value_name = "FILE",
        requires = "queries_descriptors",
        conflicts_with_all = ["database_folder", "similarities", "distances"]
    )]
    pub(super) database_descriptors: Option<PathBuf>,
    /// Descriptors of the queries
    #[arg(
        long,
        alias = "queries_descriptors",
        value_name = "FILE",
        requires = "database_descriptors"
    )]
    pub(super) queries_descriptors: Option<PathBuf>,
    /// How similar every query is to every reference, a row per query, instead of images: .npy, an
    /// .npz of one array, text, or VPR-Bench's stored matches; higher is more similar
    #[arg(long, value_name = "FILE", conflicts_with_all = ["database_folder", "distances"])]
    pub(super) similarities: Option<PathBuf>,
    /// The same as distances; lower is nearer
    #[arg(long, value_name = "FILE", conflicts_with = "database_folder")]
    pub(super) distances: Option<PathBuf>,
    /// The rows of the scores are the references, as the tutorial of VPR has them
    #[arg(long)]
    pub(super) scores_transposed: bool,
    /// Poses of the references: a table, or any format of docs/formats.md; by name if both files
    /// have names, by order otherwise
    #[arg(long, alias = "database_poses", value_name = "FILE", requires = "queries_poses")]
    pub(super) database_poses: Option<PathBuf>,
    /// Poses of the queries
    #[arg(long, alias = "queries_poses", value_name = "FILE", requires = "database_poses")]
    pub(super) queries_poses: Option<PathBuf>,
    #[command(flatten)]
    pub(super) reading: ReadingArgs,
    #[command(flatten)]
    pub(super) truth: TruthArgs,
    /// Only retrieve; positions are unknown
    #[arg(
        long,
        alias = "no_labels",
        conflicts_with_all = ["ground_truth", "labels", "same_index"]
    )]
    pub(super) no_labels: bool,
    /// Threads; all processors by default
    #[arg(long, alias = "num_workers", value_name = "N")]
    pub(super) num_workers: Option<usize>,
}

impl InputArgs {
    /// As many threads as were asked for.
    pub(super) fn start_threads(&self) -> anyhow::Result<()> {
        if let Some(n) = self.num_workers {
            rayon::ThreadPoolBuilder::new().num_threads(n).build_global()?;
        }
        Ok(())
    }

    /// Whether the two sides are images.
    pub(super) fn has_images(&self) -> bool {
        self.dataset.is_some() || self.database_folder.is_some()
    }

    /// What a report calls what was compared: images go by the method.
    pub(super) fn content<'a>(&self, method: &'a str) -> &'a str {
        match (self.has_images(), &self.database_descriptors) {
            (true, _) => method,
            (false, Some(_)) => "descriptors",
            (false, None) => "scores",
        }
    }

    /// Whether what is correct follows from positions.
    pub(super) fn needs_positions(&self) -> bool {
        !self.no_labels && self.truth.source().is_none()
    }

    /// Before the work: whether images, if that is what is given, can be described by this method.
    pub(super) fn check_method(&self, method: &str) -> anyhow::Result<()> {
        if !self.has_images() || hand_crafted(method).is_some() {
            return Ok(());
        }
        #[cfg(feature = "networks")]
        return by_network::check(method, &self.encoder);
        #[cfg(not(feature = "networks"))]
        Err(without_networks(method))
    }

    /// Describes and matches two sets of images by the method asked for.
    pub(super) fn match_images(
        &self,
        method: &str,
        queries: Named,
        references: Named,
        k: usize,
    ) -> anyhow::Result<Retrieved> {
        let Some(Runner { technique, .. }) = hand_crafted(method) else {
            #[cfg(feature = "networks")]
            {
                let folders = self.data.folders();
                let asked = Asked {
                    method,
                    encoder: &self.encoder,
                    data: &folders,
                    threads: self.num_workers,
                };
                return by_network::retrieve(&asked, queries, references, k);
            }
            #[cfg(not(feature = "networks"))]
            return Err(without_networks(method));
        };
        let bar = Bar::default();
        bar.start("images", queries.len() + references.len());
        let step = || bar.step();
        let query_features = technique.encode(&queries.names, &step)?;
        let reference_features = technique.encode(&references.names, &step)?;
        bar.end();
        let matched = query_features.match_with(&reference_features)?;
        let descriptors =
            query_features.into_descriptors().zip(reference_features.into_descriptors());
        Ok(Retrieved {
            descriptors,
            ..Retrieved::of_scores([queries, references], matched.similarities, k)?
        })
    }
}

#[cfg(not(feature = "networks"))]
fn without_networks(method: &str) -> anyhow::Error {
    anyhow::anyhow!(
        "`{method}` is no technique without a network, and this program was built without \
         networks: add `--features vpr-bench/networks` to cargo's flags"
    )
}
