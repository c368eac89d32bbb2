//! `bench compare`: several methods on the same queries, and which of them differ.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use bench::comparison::{Comparison, Found, Metric, Protocol};
use clap::ValueEnum;
use vpr_core::{
    GroundTruth, Provenance,
    metrics::{McNemar, bootstrap::Resampling},
};
use vpr_report::cli::{self, Outcome, ReportArgs};

use super::{
    compared::{self, Compared},
    input::Input,
    input_args::InputArgs,
    report,
    result::{self, OutputFormat},
    retrieved::Retrieved,
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

/// What a method is.
#[derive(Debug, PartialEq)]
enum Spec<'a> {
    Technique(&'a str),
    Descriptors(&'a str, &'a str),
    Scores(&'a str),
}

pub(crate) fn run(args: &CompareArgs) -> anyhow::Result<Outcome> {
    args.input.start_threads()?;
    check(args)?;
    let (found, truth, provenance) = retrieve_all(args)?;
    let protocol = Protocol {
        metrics: metrics(&args.recall_values),
        test: match args.test {
            Test::MidP => McNemar::MidP,
            Test::Exact => McNemar::Exact,
        },
        level: args.level,
        power: args.power,
        resampling: Resampling {
            n_resamples: args.resamples,
            seed: args.seed,
            ..Resampling::default()
        },
    };
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

fn metrics(recall_values: &[usize]) -> Vec<Metric> {
    recall_values.iter().map(|&n| Metric::RecallAt(n)).chain([Metric::AucPr]).collect()
}

fn check(args: &CompareArgs) -> anyhow::Result<()> {
    ensure!(args.recall_values.iter().all(|&n| n > 0), "`recall-values` 0: recall@0 is no metric");
    let input = &args.input;
    let files = [&input.database_descriptors, &input.similarities, &input.distances];
    ensure!(
        files.iter().all(|it| it.is_none()),
        "`bench compare` takes files as methods: QUERIES,REFERENCES or SIMILARITIES"
    );
    ensure!(!input.no_labels, "`no-labels`: nothing can be compared without a truth");
    if let Some(path) = &args.per_query {
        cli::check_out(path)?;
    }
    Ok(())
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

/// What every method found, by name, with the one truth.
#[expect(clippy::type_complexity, reason = "used once")]
fn retrieve_all(
    args: &CompareArgs,
) -> anyhow::Result<(Vec<(String, Retrieved)>, GroundTruth, Provenance)> {
    let k = args.recall_values.iter().copied().max().unwrap_or(1);
    let source = args.input.truth.source();
    let radius = args.input.truth.positive_dist_threshold;
    let (mut images, mut truth) = (None, None);
    let mut provenance = Provenance::Measured;
    if args.input.has_images() {
        let input = Input::open(&args.input)?;
        let known = Some(input.truth(source.as_ref(), radius)?);
        let (input, known) =
            if args.input.skip_bad { input.without_bad(known)? } else { (input, known) };
        provenance = input.provenance;
        (images, truth) = (Some(input), known);
    }
    let mut found: Vec<(String, Retrieved)> = Vec::new();
    for method in &args.methods {
        let (label, spec) = spec(method);
        ensure!(found.iter().all(|(name, _)| name != label), "two methods are called `{label}`");
        let retrieved = match &spec {
            Spec::Technique(name) => {
                let Some(input) = images.clone() else {
                    bail!(
                        "`{name}` is no file, and as a technique it needs images: give --dataset, or \
                         --database-folder and --queries-folder"
                    );
                };
                input.retrieve(&args.input, name, k)?
            }
            Spec::Descriptors(..) | Spec::Scores(_) => {
                let flags = flags_of(args, &spec, truth.is_some());
                let input = Input::open(&flags)?;
                if truth.is_none() {
                    truth = Some(input.truth(source.as_ref(), radius)?);
                }
                input.retrieve(&flags, label, k)?
            }
        };
        let known = truth.as_ref().context("no truth")?;
        fits(method, &retrieved, known)?;
        // Matrices are not kept, but the first for the report.
        let similarities = retrieved.similarities.filter(|_| found.is_empty());
        let retrieved = Retrieved { descriptors: None, similarities, ..retrieved };
        found.push((label.to_owned(), retrieved));
    }
    let truth = truth.context("no truth")?;
    Ok((found, truth, provenance))
}

fn fits(method: &str, found: &Retrieved, truth: &GroundTruth) -> anyhow::Result<()> {
    let (queries, references) = (found.queries.len(), found.references.len());
    let (n, m) = (truth.len(), truth.n_references());
    ensure!(
        (queries, references) == (n, m),
        "`{method}` has {queries} queries and {references} references; the others have {n} and {m}"
    );
    Ok(())
}

/// The flags with which `bench evaluate` would open the files of a method.
fn flags_of(args: &CompareArgs, spec: &Spec<'_>, has_truth: bool) -> InputArgs {
    let mut flags = args.input.clone();
    (flags.dataset, flags.queries_folder, flags.database_folder) = (None, None, None);
    flags.no_labels = has_truth;
    match *spec {
        Spec::Technique(_) => {}
        Spec::Descriptors(queries, references) => {
            flags.queries_descriptors = Some(queries.into());
            flags.database_descriptors = Some(references.into());
        }
        Spec::Scores(path) if args.scores_are_distances => flags.distances = Some(path.into()),
        Spec::Scores(path) => flags.similarities = Some(path.into()),
    }
    flags
}

/// The label of a method, and what it is.
fn spec(method: &str) -> (&str, Spec<'_>) {
    let (label, content) = match method.split_once('=') {
        Some((label, content)) if !Path::new(method).is_file() => (label, content),
        _ => (method, method),
    };
    let spec = match content.split_once(',') {
        _ if Path::new(content).is_file() => Spec::Scores(content),
        Some((queries, references)) => Spec::Descriptors(queries, references),
        None => Spec::Technique(content),
    };
    (label, spec)
}
