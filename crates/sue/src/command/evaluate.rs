//! `sue evaluate`: how well estimators tell correct from wrong matches.

use sue::EstimatorChoice;
use vpr_core::{
    Definition, Evaluation, Judged, Provenance,
    metrics::{
        bootstrap::{Interval, Resampling},
        effective,
    },
};
use vpr_report::{
    cli::{self, Outcome, ReportArgs},
    report::Run,
    table::{Cell, Format, Table},
};

use super::{input::InputArgs, pictures::PicturesArgs, report, truth::TruthArgs};

/// Estimators, map, queries and their truth.
#[derive(clap::Args)]
pub(crate) struct EvaluateArgs {
    /// Which estimators; the first is compared with each other one
    #[arg(long, value_enum, num_args = 1.., value_name = "NAME",
        default_values_t = [EstimatorChoice::Sue, EstimatorChoice::L2, EstimatorChoice::Pa])]
    estimator: Vec<EstimatorChoice>,
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    truth: TruthArgs,
    /// Resamples of the bootstrap of differences
    #[arg(long, default_value_t = 2000, value_name = "N")]
    resamples: usize,
    /// Seed of the bootstrap of differences
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    pictures: PicturesArgs,
    /// Format on stdout
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT")]
    format: Format,
}

/// How the intervals of differences are found.
const DIFFERENCE: &str = "paired bootstrap over queries";

pub(crate) fn run(args: &EvaluateArgs) -> anyhow::Result<Outcome> {
    args.report.check()?;
    let input = args.input.open(&args.estimator)?;
    input.check_poses(&args.estimator)?;
    let pictures = args.pictures.open(&input)?;
    let truth = args.truth.truth(&input)?;
    let retrieval = input.retrieve()?;
    let best = retrieval.best();
    let judged = Judged::new(&best, &truth)?;
    let resampling =
        Resampling { n_resamples: args.resamples, seed: args.seed, ..Resampling::default() };
    let title = format!(
        "{} queries, base rate {:.4}: what accepting every match gives",
        judged.len(),
        judged.base_rate()
    );
    let mut table = Table::new("evaluation", title);
    let inliers = args.pictures.inliers(&pictures, &best)?;
    let (mut first, mut runs): (Option<Evaluation<'_>>, Vec<Run>) = (None, Vec::new());
    for choice in &args.estimator {
        let prepared = choice.prepare(&input.settings, input.poses.as_ref())?;
        let uncertainty = prepared.estimate(&retrieval)?;
        let evaluation = Evaluation::new(&uncertainty, &judged)?;
        if args.report.path.is_some() {
            let inliers = inliers.as_deref();
            runs.push(report::run(prepared.name(), &retrieval, uncertainty, inliers));
        }
        push_summary(&mut table, prepared.name(), &evaluation)?;
        match &first {
            None => first = Some(evaluation),
            Some(first) => {
                let difference = evaluation.auc_pr_difference(first, &resampling);
                let place = (prepared.name(), "AUC-PR minus first");
                push(&mut table, place, (difference, DIFFERENCE), judged.len())?;
            }
        }
    }
    cli::print(&table.render_within(args.format, cli::columns()))?;
    if args.report.path.is_some() {
        let poses = args.truth.query_poses(&input)?;
        report::write(&args.report, &input, (poses.as_ref(), &truth), &pictures, runs, None)?;
    }
    Ok(Outcome::Success)
}

fn push_summary(table: &mut Table, row: &str, evaluation: &Evaluation<'_>) -> anyhow::Result<()> {
    let n = evaluation.judged().len();
    for definition in [Definition::Published, Definition::Corrected] {
        let column = format!("AUC-PR, {definition}");
        let interval = evaluation.auc_pr_interval(definition);
        push(table, (row, &column), (interval, effective::METHOD), n)?;
    }
    let interval = evaluation.auc_roc_interval();
    push(table, (row, "AUC-ROC"), (interval, effective::METHOD), n)?;
    let summary = evaluation.summary()?;
    let values = [
        ("AURC", Some(summary.aurc)),
        ("excess AURC", Some(summary.excess_aurc)),
        ("R@95%P", summary.recall_at_95_precision),
    ];
    for (column, value) in values {
        let cell = Cell::new(row, column, 0.0, Provenance::Measured, n);
        table.push(Cell { value: value.map(Into::into), ..cell });
    }
    Ok(())
}

/// A value with its interval and how that was found, or none and why.
fn push(
    table: &mut Table,
    (row, column): (&str, &str),
    (interval, method): (vpr_core::Result<Interval>, &str),
    n: usize,
) -> anyhow::Result<()> {
    let cell = |value: f64| Cell::new(row, column, value, Provenance::Measured, n);
    table.push(match interval {
        Ok(it) => cell(it.estimate).within(it.low, it.high, method),
        Err(err @ vpr_core::Error::Undefined { .. }) => {
            Cell { value: None, ..cell(0.0).noted(err.to_string()) }
        }
        Err(err) => return Err(err.into()),
    });
    Ok(())
}
