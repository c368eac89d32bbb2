//! `bench evaluate`: from two folders or two descriptor files to `R@1: 98.8, R@5: 99.7, …`.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use vpr_core::{
    GroundTruth, Observer as _, Ranking,
    metrics::{Positives, auc_pr, recall_at},
};
use vpr_data::layout::vpr_bench::GroundTruthFile;
use vpr_report::cli::{self, Bar, DataArgs, Outcome};
use vpr_study::{Runner, Sources, reading::ReadingArgs, technique::hand_crafted};

#[cfg(feature = "networks")]
use super::{
    by_network::{self, Asked},
    encoder::EncoderArgs,
};
use super::{
    named::Named,
    predictions::{self, Saving},
    retrieved::{Retrieved, nearest},
};

/// The flags of VPR-methods-evaluation, in kebab case; the names with underscores work too.
#[derive(clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "one per flag")]
pub(crate) struct EvaluateArgs {
    /// A dataset by name, such as `corridor` or the generated `world/street`, with its own truth
    #[arg(
        long,
        value_name = "NAME",
        conflicts_with_all = ["database_folder", "database_descriptors", "ground_truth"]
    )]
    dataset: Option<String>,
    /// Folder of the reference images; their positions are those of --database-poses, or of
    /// `@utm_east@utm_north@…` names
    #[arg(long, alias = "database_folder", value_name = "DIR", requires = "queries_folder")]
    database_folder: Option<PathBuf>,
    /// Folder of the query images
    #[arg(long, alias = "queries_folder", value_name = "DIR", requires = "database_folder")]
    queries_folder: Option<PathBuf>,
    /// Technique that describes the images: hog, hog-thesis, cohog, or a network of `bench methods`
    #[arg(long, default_value = "hog", value_name = "NAME")]
    method: String,
    #[cfg(feature = "networks")]
    #[command(flatten)]
    encoder: EncoderArgs,
    #[command(flatten)]
    data: DataArgs,
    /// Descriptors of the references, one row each: .npy, or any format of docs/formats.md
    #[arg(
        long,
        alias = "database_descriptors",
        value_name = "NPY",
        requires = "queries_descriptors",
        conflicts_with = "database_folder"
    )]
    database_descriptors: Option<PathBuf>,
    /// Descriptors of the queries
    #[arg(
        long,
        alias = "queries_descriptors",
        value_name = "NPY",
        requires = "database_descriptors"
    )]
    queries_descriptors: Option<PathBuf>,
    /// Poses of the references: a table, or any format of docs/formats.md; by name if both files
    /// have names, by order otherwise
    #[arg(long, alias = "database_poses", value_name = "PATH", requires = "queries_poses")]
    database_poses: Option<PathBuf>,
    /// Poses of the queries
    #[arg(long, alias = "queries_poses", value_name = "PATH", requires = "database_poses")]
    queries_poses: Option<PathBuf>,
    #[command(flatten)]
    reading: ReadingArgs,
    /// Correct references per query, VPR-Bench's `ground_truth_new.npy`; instead of positions
    #[arg(long, alias = "ground_truth", value_name = "NPY", conflicts_with = "database_poses")]
    ground_truth: Option<PathBuf>,
    /// A reference is correct within this many metres, the limit included
    #[arg(long, alias = "positive_dist_threshold", default_value_t = 25.0, value_name = "M")]
    positive_dist_threshold: f64,
    /// Which N of recall@N to print
    #[arg(long, alias = "recall_values", num_args = 1.., default_values_t = [1, 5, 10, 20], value_name = "N")]
    recall_values: Vec<usize>,
    /// Print the area under the precision-recall curve of the best matches too
    #[arg(long, alias = "auc_pr", conflicts_with = "no_labels")]
    auc_pr: bool,
    /// Only retrieve; positions are unknown
    #[arg(long, alias = "no_labels")]
    no_labels: bool,
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
    let retrieved = match (&args.dataset, &args.database_folder, &args.queries_folder) {
        (Some(id), _, _) => from_dataset(args, id, k)?,
        (_, Some(references), Some(queries)) => from_folders(args, queries, references, k)?,
        _ => from_descriptors(args, k)?,
    };
    let truth = match &retrieved.truth {
        _ if args.no_labels => None,
        Some(truth) => Some(truth.clone()),
        None => Some(truth(args, &retrieved)?),
    };
    if let Some(truth) = &truth {
        cli::print(&format!("{}\n", recalls(args, &retrieved.ranking, truth)?))?;
        if let Some(alone) = &retrieved.alone {
            cli::print(&format!("{} (images one by one)\n", recalls(args, alone, truth)?))?;
        }
        if args.auc_pr {
            print_auc_pr(&retrieved, truth)?;
        }
    }
    predictions::save(&args.saving(), &retrieved, truth.as_ref())?;
    Ok(Outcome::Success)
}

impl EvaluateArgs {
    /// Whether what is correct follows from positions.
    fn needs_positions(&self) -> bool {
        !self.no_labels && self.ground_truth.is_none()
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
}

/// `R@1: 98.8, R@5: 99.7, …`
fn recalls(args: &EvaluateArgs, ranking: &Ranking, truth: &GroundTruth) -> anyhow::Result<String> {
    let entries = args.recall_values.iter().map(|&n| {
        let recall = recall_at(n, ranking, truth)?;
        Ok(format!("R@{n}: {:.1}", 100.0 * recall))
    });
    Ok(entries.collect::<vpr_core::Result<Vec<String>>>()?.join(", "))
}

/// Prints AUC-PR in both definitions.
fn print_auc_pr(retrieved: &Retrieved, truth: &GroundTruth) -> anyhow::Result<()> {
    let ranking = &retrieved.ranking;
    let best: Vec<_> = (0..ranking.len()).map(|query| ranking.indices(query)[0]).collect();
    let correct = truth.judge(&best)?;
    let area = |positives| auc_pr(&retrieved.confidence, &correct, positives);
    let (published, corrected) = (area(Positives::Published)?, area(Positives::corrected(truth))?);
    cli::print(&format!("AUC-PR: {published:.3} (published), {corrected:.3} (corrected)\n"))?;
    Ok(())
}

/// Describes and matches the images of two folders.
fn from_folders(
    args: &EvaluateArgs,
    queries: &Path,
    references: &Path,
    k: usize,
) -> anyhow::Result<Retrieved> {
    let named = |folder: &Path, poses: &Option<PathBuf>| {
        Named::folder(folder, poses.as_deref(), args.reading.poses, args.needs_positions())
    };
    let queries = named(queries, &args.queries_poses)?;
    let references = named(references, &args.database_poses)?;
    match_images(args, queries, references, k)
}

/// Describes and matches the images of a dataset.
fn from_dataset(args: &EvaluateArgs, id: &str, k: usize) -> anyhow::Result<Retrieved> {
    let bar = Bar::default();
    let sources = Sources::new([&*args.data.data, Path::new("data")], &args.data.cache, &bar);
    let Some(dataset) = sources.images(id)? else { bail!(sources.why_absent(id, "images")?) };
    let (query_poses, reference_poses) = dataset.poses.clone().unzip();
    let named = |names: &[PathBuf], poses| Named {
        names: names.to_vec(),
        poses,
        coordinates: None,
        place: PathBuf::from(id),
    };
    let queries = named(&dataset.queries, query_poses);
    let references = named(&dataset.references, reference_poses);
    let retrieved = match_images(args, queries, references, k)?;
    Ok(Retrieved { truth: Some(dataset.truth.clone()), ..retrieved })
}

/// Describes and matches two sets of images by the method asked for.
fn match_images(
    args: &EvaluateArgs,
    queries: Named,
    references: Named,
    k: usize,
) -> anyhow::Result<Retrieved> {
    let Some(Runner { technique, .. }) = hand_crafted(&args.method) else {
        #[cfg(feature = "networks")]
        {
            let asked = Asked {
                method: &args.method,
                encoder: &args.encoder,
                data: &args.data.data,
                threads: args.num_workers,
            };
            return by_network::retrieve(&asked, queries, references, k);
        }
        #[cfg(not(feature = "networks"))]
        bail!(
            "`{}` is no technique without a network, and this program was built without networks: \
             add `--features vpr-bench/networks` to cargo's flags",
            args.method
        );
    };
    let bar = Bar::default();
    let n = queries.names.len() + references.names.len();
    bar.start("images", n);
    let step = || bar.step();
    let query_features = technique.encode(&queries.names, &step)?;
    let reference_features = technique.encode(&references.names, &step)?;
    bar.end();
    let matched = query_features.match_with(&reference_features)?;
    let ranking = matched.similarities.ranked(k)?;
    let descriptors = query_features.into_descriptors().zip(reference_features.into_descriptors());
    let confidence = matched.similarities.best().confidence;
    Ok(Retrieved::new([queries, references], ranking, confidence, descriptors))
}

/// Retrieves from two files of descriptors by Euclidean distance.
fn from_descriptors(args: &EvaluateArgs, k: usize) -> anyhow::Result<Retrieved> {
    let (Some(references), Some(queries)) = (&args.database_descriptors, &args.queries_descriptors)
    else {
        bail!(
            "give --dataset, --database-folder and --queries-folder, or --database-descriptors and --queries-descriptors"
        );
    };
    let read = |rows: &Path, poses: &Option<PathBuf>| {
        Named::rows(rows, poses.as_deref(), args.reading, args.needs_positions())
    };
    let (named_queries, query_rows) = read(queries, &args.queries_poses)?;
    let (named_references, reference_rows) = read(references, &args.database_poses)?;
    nearest(named_queries, named_references, query_rows, reference_rows, k)
        .with_context(|| format!("{} and {}", queries.display(), references.display()))
}

/// Which references are correct: from a file, or by distance.
fn truth(args: &EvaluateArgs, retrieved: &Retrieved) -> anyhow::Result<GroundTruth> {
    let (queries, references) = (&retrieved.queries, &retrieved.references);
    if let Some(path) = &args.ground_truth {
        let file = GroundTruthFile::read(path)?;
        ensure!(
            file.len() == queries.names.len(),
            "{}: {} rows for {} queries",
            path.display(),
            file.len(),
            queries.names.len()
        );
        let (truth, n_clamped) = file.truth(references.names.len())?;
        if n_clamped > 0 {
            cli::note(&format!(
                "warning: {}: {n_clamped} entries point past the {} references and are dropped",
                path.display(),
                references.names.len()
            ));
        }
        return Ok(truth);
    }
    let (Some(query_poses), Some(reference_poses)) = (&queries.poses, &references.poses) else {
        bail!(
            "no positions: give --database-poses and --queries-poses, --ground-truth, or --no-labels"
        );
    };
    queries.check_comparable(references)?;
    Ok(GroundTruth::within_radius(query_poses, reference_poses, args.positive_dist_threshold)?)
}
