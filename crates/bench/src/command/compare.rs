//! `bench compare`: several methods on the same queries, and which of them differ.

use std::path::PathBuf;

use anyhow::ensure;
use bench::comparison::{Comparison, Found, Metric, Protocol};
use clap::ValueEnum;
use vpr_core::metrics::{McNemar, bootstrap::Resampling};
use vpr_report::cli::{self, Outcome, ReportArgs};

use super::{
    compared::{self, Compared},
    input_args::InputArgs,
    report,
    result::{self, OutputFormat},
    retrieved::Retrieved,
    several::{Several, refuse_files},
};

/// Which methods, on what, and how they are compared.
#[derive(clap::Args)]
pub(crate) struct CompareArgs {
    /// Two methods or more, each `[LABEL=]METHOD`: a technique as in `bench evaluate --method`, two
    /// files of descriptors as QUERIES,REFERENCES, or a file of similarities
    #[arg(required = true, num_args = 2.., value_name = "METHOD")]
    methods: Vec<String>,
    #[command(flatten)]
    input: InputArgs,
    /// Files of scores are distances; lower is nearer
    #[arg(long)]
    scores_are_distances: bool,
    /// Which N of recall@N to compare by
    #[arg(long, alias = "recall_values", num_args = 1.., default_values_t = [1, 5, 10], value_name = "N")]
    recall_values: Vec<usize>,
    /// P-value of McNemar's test, by which R@N is compared; AUC-PR by the paired bootstrap
    #[arg(long, value_enum, default_value_t)]
    test: Test,
    /// Methods are called different at a p-value of at most this, after Holm's correction for all
    /// pairs of a metric
    #[arg(long, default_value_t = 0.05, value_name = "P")]
    level: f64,
    /// Say how many queries are needed to see a difference as large as the one found with this chance
    #[arg(long, default_value_t = 0.8, value_name = "P")]
    power: f64,
    /// Resamples of the paired bootstrap
    #[arg(long, default_value_t = 2000, value_parser = cli::at_least_one, value_name = "N")]
    resamples: usize,
    /// Seed of the resamples
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// How the numbers are printed
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT")]
    format: OutputFormat,
    /// Also write which method is right on which query, as CSV
    #[arg(long, value_name = "FILE")]
    per_query: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum Test {
    /// With half the chance of the observed counts: near the level
    #[default]
    MidP,
    /// Never above the level
    Exact,
}

pub(crate) fn run(args: &CompareArgs) -> anyhow::Result<Outcome> {
    args.input.start_threads()?;
    check(args)?;
    let several = Several {
        methods: &args.methods,
        input: &args.input,
        scores_are_distances: args.scores_are_distances,
        k: args.recall_values.iter().copied().max().unwrap_or(1),
    };
    let (found, truth, provenance) = several.retrieve()?;
    let protocol = args.protocol();
    warn_of_few_resamples(args);
    let borrowed: Vec<Found<'_>> = found
        .iter()
        .map(|(_, it)| Found { ranking: &it.ranking, confidence: &it.confidence })
        .collect();
    let comparison = Comparison::new(&borrowed, &truth, protocol.clone())?;
    let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
    let compared = Compared {
        names: &names,
        comparison: &comparison,
        protocol: &protocol,
        truth: &truth,
        provenance,
    };
    let text = compared.lines()?;
    match args.format {
        OutputFormat::Line => cli::print(&text)?,
        OutputFormat::Table => {
            let format = result::format_of(args.format);
            let [methods, pairs] = [compared.methods()?, compared.pairs()];
            let rendered = [methods, pairs].map(|it| it.render_within(format, cli::columns()));
            cli::print(&(rendered.join("\n") + "\n" + &compared.verdicts()?))?;
        }
        OutputFormat::Csv | OutputFormat::Json => {
            cli::note(text.trim_end());
            let mut table = compared.methods()?;
            table.cells.extend(compared.pairs().cells);
            cli::print(&table.render(result::format_of(args.format)))?;
        }
    }
    if let Some(path) = &args.per_query {
        let text = compared::per_query(&found, &truth)?;
        vpr_files::replace(path, text.as_bytes())?;
    }
    let runs: Vec<(&str, &Retrieved)> =
        found.iter().map(|(name, it)| (name.as_str(), it)).collect();
    report::write(&args.input, &args.report, &runs, Some(&truth))?;
    Ok(Outcome::Success)
}

impl CompareArgs {
    fn protocol(&self) -> Protocol {
        Protocol {
            metrics: metrics(&self.recall_values),
            test: match self.test {
                Test::MidP => McNemar::MidP,
                Test::Exact => McNemar::Exact,
            },
            level: self.level,
            power: self.power,
            resampling: Resampling {
                n_resamples: self.resamples,
                seed: self.seed,
                ..Resampling::default()
            },
        }
    }
}

fn metrics(recall_values: &[usize]) -> Vec<Metric> {
    recall_values.iter().map(|&n| Metric::RecallAt(n)).chain([Metric::AucPr]).collect()
}

fn check(args: &CompareArgs) -> anyhow::Result<()> {
    ensure!(args.recall_values.iter().all(|&n| n > 0), "`recall-values` 0: recall@0 is no metric");
    refuse_files(&args.input)?;
    if let Some(path) = &args.per_query {
        cli::check_out(path)?;
    }
    args.report.check()
}

/// With few resamples no p-value of AUC-PR can be small enough after correction.
fn warn_of_few_resamples(args: &CompareArgs) {
    let pairs = args.methods.len() * (args.methods.len() - 1) / 2;
    let smallest = 2.0 / (args.resamples + 1) as f64 * pairs as f64;
    if smallest > args.level {
        cli::note(&format!(
            "warning: with {} resamples and {pairs} pairs no corrected p-value of AUC-PR is below \
             {smallest:.3}; raise --resamples",
            args.resamples
        ));
    }
}
