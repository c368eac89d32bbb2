//! `bench evaluate`: from two folders, two descriptor files or a matrix of scores to
//! `R@1: 98.8, R@5: 99.7, …`.

use anyhow::ensure;
use vpr_core::{GroundTruth, Provenance};
use vpr_report::cli::{self, Outcome, ReportArgs};

use super::{
    input::Input,
    input_args::InputArgs,
    predictions::{Place, Saving},
    report,
    result::{self, OutputFormat},
    retrieved::Retrieved,
    second_stage::SecondStageArgs,
};

/// The flags of VPR-methods-evaluation, in kebab case; the names with underscores work too.
#[derive(clap::Args)]
pub(crate) struct EvaluateArgs {
    #[command(flatten)]
    input: InputArgs,
    /// Technique that describes the images: hog, hog-thesis, cohog, dense-vlad, hog-vlad, or a network of `bench methods`
    #[arg(long, default_value = "hog", value_name = "NAME")]
    method: String,
    /// Which N of recall@N to print
    #[arg(long, alias = "recall_values", num_args = 1.., default_values_t = [1, 5, 10, 20], value_name = "N")]
    recall_values: Vec<usize>,
    /// Print the area under the precision-recall curve of the best matches too
    #[arg(long, alias = "auc_pr", conflicts_with = "no_labels")]
    auc_pr: bool,
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
    second_stage: SecondStageArgs,
    #[command(flatten)]
    report: ReportArgs,
}

pub(crate) fn run(args: &EvaluateArgs) -> anyhow::Result<Outcome> {
    args.input.start_threads()?;
    ensure!(args.recall_values.iter().all(|&n| n > 0), "`recall-values` 0: recall@0 is no metric");
    let largest = args.recall_values.iter().copied().max().unwrap_or(1);
    let k = largest.max(args.num_preds_to_save).max(args.second_stage.rerank.unwrap_or(0));
    // What can be wrong is found before the work: the method, the truth, and where results are saved.
    args.input.check_method(&args.method)?;
    let input = Input::open(&args.input)?;
    let source = args.input.truth.source();
    let truth = if args.input.no_labels {
        None
    } else {
        Some(input.truth(source.as_ref(), args.input.truth.positive_dist_threshold)?)
    };
    args.report.check()?;
    let place = Place::create(&args.saving())?;
    let (input, truth) =
        if args.input.skip_bad { input.without_bad(truth)? } else { (input, truth) };
    let provenance = input.provenance;
    let retrieved = input.retrieve(&args.input, &args.method, k)?;
    let (values, folders) = (&args.recall_values, args.input.data.folders());
    let retrieved = args.second_stage.apply(retrieved, truth.as_ref(), values, k, &folders)?;
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
    report::write(
        &args.input,
        &args.report,
        &[(args.input.content(&args.method), &retrieved)],
        truth.as_ref(),
    )?;
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
