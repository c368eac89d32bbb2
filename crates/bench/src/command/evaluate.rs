//! `bench evaluate`: from two folders, two descriptor files or a matrix of scores to
//! `R@1: 98.8, R@5: 99.7, …`.

use std::path::PathBuf;

use anyhow::ensure;
use vpr_core::{GroundTruth, Observer as _, Provenance};
use vpr_report::cli::{self, Bar, DataArgs, Outcome, ReportArgs};
use vpr_study::{Runner, TruthArgs, reading::ReadingArgs, technique::hand_crafted};

#[cfg(feature = "networks")]
use super::{
    by_network::{self, Asked},
    encoder::EncoderArgs,
};
use super::{
    input::Input,
    named::Named,
    predictions::{Place, Saving},
    report,
    result::{self, OutputFormat},
    retrieved::Retrieved,
};

/// The flags of VPR-methods-evaluation, in kebab case; the names with underscores work too.
#[derive(clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "one per flag")]
pub(crate) struct EvaluateArgs {
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
    /// Technique that describes the images: hog, hog-thesis, cohog, or a network of `bench methods`
    #[arg(long, default_value = "hog", value_name = "NAME")]
    pub(super) method: String,
    #[cfg(feature = "networks")]
    #[command(flatten)]
    encoder: EncoderArgs,
    #[command(flatten)]
    pub(super) data: DataArgs,
    /// Leave out images that cannot be decoded, and list them, instead of stopping at the first
    #[arg(long, alias = "skip_bad")]
    skip_bad: bool,
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
    /// Which N of recall@N to print
    #[arg(long, alias = "recall_values", num_args = 1.., default_values_t = [1, 5, 10, 20], value_name = "N")]
    recall_values: Vec<usize>,
    /// Print the area under the precision-recall curve of the best matches too
    #[arg(long, alias = "auc_pr", conflicts_with = "no_labels")]
    auc_pr: bool,
    /// Only retrieve; positions are unknown
    #[arg(
        long,
        alias = "no_labels",
        conflicts_with_all = ["ground_truth", "labels", "same_index"]
    )]
    pub(super) no_labels: bool,
    /// How the numbers are printed
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT")]
    format: OutputFormat,
    /// How many predictions to save for each query
    #[arg(long, alias = "num_preds_to_save", default_value_t = 0, value_name = "N")]
    num_preds_to_save: usize,
    /// Save only predictions of queries whose best reference is wrong
    #[arg(long, alias = "save_only_wrong_preds", conflicts_with = "no_labels")]
    save_only_wrong_preds: bool,
    /// Save the descriptors as `.npy`
    #[arg(long, alias = "save_descriptors")]
    save_descriptors: bool,
    /// Name of the folder below `logs/` where results are saved
    #[arg(long, alias = "log_dir", default_value = "default", value_name = "NAME")]
    log_dir: String,
    #[command(flatten)]
    pub(super) report: ReportArgs,
    /// Threads; all processors by default
    #[arg(long, alias = "num_workers", value_name = "N")]
    num_workers: Option<usize>,
}

pub(crate) fn run(args: &EvaluateArgs) -> anyhow::Result<Outcome> {
    if let Some(n) = args.num_workers {
        rayon::ThreadPoolBuilder::new().num_threads(n).build_global()?;
    }
    ensure!(args.recall_values.iter().all(|&n| n > 0), "`recall-values` 0: recall@0 is no metric");
    let largest = args.recall_values.iter().copied().max().unwrap_or(1);
    let k = largest.max(args.num_preds_to_save);
    // What can be wrong is found before the work: the truth, and where results are saved.
    let input = Input::open(args)?;
    let source = args.truth.source();
    let truth = if args.no_labels {
        None
    } else {
        Some(input.truth(source.as_ref(), args.truth.positive_dist_threshold)?)
    };
    let place = Place::create(&args.saving())?;
    let (input, truth) = if args.skip_bad { input.without_bad(truth)? } else { (input, truth) };
    let provenance = input.provenance;
    let retrieved = input.retrieve(args, k)?;
    let mut files = Vec::new();
    if let Some(truth) = &truth {
        print(args, provenance, &retrieved, truth)?;
        if place.is_some() {
            let format = result::format_of(OutputFormat::Csv);
            let (values, auc_pr) = (&args.recall_values, args.auc_pr);
            let table = result::table(values, auc_pr, provenance, &retrieved, truth)?;
            files.push(("metrics.csv", table.render(format)));
        }
    }
    report::write(args, &retrieved, truth.as_ref())?;
    if let Some(place) = place {
        place.save(&args.saving(), &retrieved, truth.as_ref(), &files)?;
    }
    Ok(Outcome::Success)
}

/// Prints the numbers: stdout has what other programs read, the line goes to stderr then.
fn print(
    args: &EvaluateArgs,
    provenance: Provenance,
    retrieved: &Retrieved,
    truth: &GroundTruth,
) -> anyhow::Result<()> {
    let mut text = result::line(&args.recall_values, &retrieved.ranking, truth)? + "\n";
    if let Some(alone) = &retrieved.alone {
        let line = result::line(&args.recall_values, alone, truth)?;
        text += &(line + " (images one by one)\n");
    }
    if args.auc_pr {
        text += &(result::auc_pr_line(retrieved, truth)? + "\n");
    }
    match args.format {
        OutputFormat::Line | OutputFormat::Table => cli::print(&text)?,
        OutputFormat::Csv | OutputFormat::Json => cli::note(text.trim_end()),
    }
    if args.format != OutputFormat::Line {
        let format = result::format_of(args.format);
        let (values, auc_pr) = (&args.recall_values, args.auc_pr);
        let table = result::table(values, auc_pr, provenance, retrieved, truth)?;
        cli::print(&table.render_within(format, cli::columns()))?;
    }
    Ok(())
}

impl EvaluateArgs {
    /// Whether what is correct follows from positions.
    pub(super) fn needs_positions(&self) -> bool {
        !self.no_labels && self.truth.source().is_none()
    }

    /// What is saved, and where.
    fn saving(&self) -> Saving<'_> {
        Saving {
            n_predictions: self.num_preds_to_save,
            only_wrong: self.save_only_wrong_preds,
            descriptors: self.save_descriptors,
            log_dir: &self.log_dir,
        }
    }

    /// Describes and matches two sets of images by the method asked for.
    pub(super) fn match_images(
        &self,
        queries: Named,
        references: Named,
        k: usize,
    ) -> anyhow::Result<Retrieved> {
        let Some(Runner { technique, .. }) = hand_crafted(&self.method) else {
            #[cfg(feature = "networks")]
            {
                let folders = self.data.folders();
                let asked = Asked {
                    method: &self.method,
                    encoder: &self.encoder,
                    data: &folders,
                    threads: self.num_workers,
                };
                return by_network::retrieve(&asked, queries, references, k);
            }
            #[cfg(not(feature = "networks"))]
            anyhow::bail!(
                "`{}` is no technique without a network, and this program was built without \
                 networks: add `--features vpr-bench/networks` to cargo's flags",
                self.method
            );
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
