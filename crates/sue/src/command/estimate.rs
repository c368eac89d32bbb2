//! `sue estimate`: one uncertainty per query, as soon as its batch is done.

use std::{fmt::Write as _, path::PathBuf};

use anyhow::{bail, ensure};
use clap::ValueEnum;
use sue::{EstimatorChoice, Threshold, UncertaintyEstimator as _, Variance, Variances};
use vpr_core::Retrieval;
use vpr_files::{npy, replace};
use vpr_report::cli::{self, Outcome};

use super::{
    input::{Input, InputArgs, name_of},
    threshold::{Origin, ThresholdArg},
};

/// Estimator, map, queries and output.
#[derive(clap::Args)]
pub(crate) struct EstimateArgs {
    /// Which estimator
    #[arg(long, value_enum, default_value_t = EstimatorChoice::Sue, value_name = "NAME")]
    estimator: EstimatorChoice,
    /// Variances that an encoder predicted with the queries' descriptors; their mean is the
    /// uncertainty, instead of the estimator's
    #[arg(long, value_name = "NPY", conflicts_with = "estimator")]
    variances: Option<PathBuf>,
    #[command(flatten)]
    input: InputArgs,
    /// Format of the output
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT")]
    format: OutputFormat,
    /// Also say whether each match is accepted: uncertainties below this are. A number, `everything`,
    /// `nothing`, or a file that `sue calibrate --json` wrote
    #[arg(long, value_name = "U|FILE", allow_hyphen_values = true)]
    threshold: Option<ThresholdArg>,
    /// Write there instead of stdout
    #[arg(long, short, value_name = "PATH")]
    out: Option<PathBuf>,
}

/// Formats of the output.
#[derive(Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum OutputFormat {
    /// One line per query
    #[default]
    Csv,
    /// An array of objects
    Json,
    /// The uncertainties alone, f64; needs `--out`
    Npy,
}

/// Collects or prints the text of finished batches.
struct Sink {
    text: String,
    keep: bool,
}

impl Sink {
    fn add(&mut self, text: &str) -> anyhow::Result<()> {
        if self.keep {
            self.text.push_str(text);
            return Ok(());
        }
        cli::print(text)
    }
}

pub(crate) fn run(args: &EstimateArgs) -> anyhow::Result<Outcome> {
    let is_npy = args.format == OutputFormat::Npy;
    ensure!(!is_npy || args.out.is_some(), "`--format npy` needs `--out`: it is no text");
    args.out.iter().try_for_each(|path| cli::check_out(path))?;
    let input = args.input.open(&[args.estimator])?;
    if args.variances.is_none() {
        input.check_poses(&[args.estimator])?;
    }
    // A threshold of an estimator says nothing about variances.
    let origin =
        args.variances.is_none().then(|| Origin::new(args.estimator, input.settings, input.scale));
    let threshold = args.threshold.as_ref().map(|it| it.open(origin.as_ref())).transpose()?;
    let variances = args.variances.as_deref().map(npy::read_f32).transpose()?;
    if let (Some(variances), Some(path)) = (&variances, &args.variances) {
        let (n, n_queries) = (variances.nrows(), input.n_queries());
        ensure!(n == n_queries, "{}: {n} rows for {n_queries} queries", path.display());
    }
    let prepared = args.estimator.prepare(&input.settings, input.poses.as_ref())?;
    let mut sink = Sink { text: String::new(), keep: args.out.is_some() };
    let (mut all, mut n_lone) = (Vec::new(), 0);
    input.each_batch(|first, retrieval| {
        let uncertainty = if let Some(values) = &variances {
            let rows = values.slice(ndarray::s![first..first + retrieval.len(), ..]);
            Variance::named("variance").estimate(&Variances::new(rows)?)?
        } else {
            n_lone += prepared.n_lone(retrieval);
            prepared.estimate(retrieval)?
        };
        if is_npy {
            all.extend(&uncertainty);
            return Ok(());
        }
        // The header comes with the first lines: an error has none before it.
        let head = if first == 0 { header(args.format, threshold) } else { "" };
        let lines = lines(args.format, &input, first, retrieval, &uncertainty, threshold);
        sink.add(&(head.to_owned() + &lines))
    })?;
    sink.add(if args.format == OutputFormat::Json { "\n]\n" } else { "" })?;
    match (&args.out, is_npy) {
        (Some(path), true) => {
            let column = ndarray::ArrayView2::from_shape((all.len(), 1), &all)?;
            npy::write_f64(path, column)?;
        }
        (Some(path), false) => replace(path, sink.text.as_bytes())?,
        (None, true) => bail!("`--format npy` needs `--out`"),
        (None, false) => {}
    }
    args.warn_of_lone(n_lone, &input);
    Ok(Outcome::Success)
}

impl EstimateArgs {
    /// Says so where most uncertainties are near 0 since one reference has all the weight. A
    /// threshold that was calibrated with them has seen that.
    fn warn_of_lone(&self, n_lone: usize, input: &Input) {
        let n = input.n_queries();
        if 2 * n_lone <= n || matches!(self.threshold, Some(ThresholdArg::File(_))) {
            return;
        }
        cli::note(&format!(
            "warning: in {n_lone} of {n} queries the best reference weighs a thousand times as much as the \
             next, so that the spread is near 0, however wrong the match: accept by a threshold of `sue \
             calibrate` only, or let more references count with a smaller --lambda (it is {})",
            input.settings.sue.lambda
        ));
    }
}

fn header(format: OutputFormat, threshold: Option<Threshold>) -> &'static str {
    match (format, threshold) {
        (OutputFormat::Csv, None) => "query,reference,distance,uncertainty\n",
        (OutputFormat::Csv, Some(_)) => "query,reference,distance,uncertainty,accepted\n",
        (OutputFormat::Json, _) => "[",
        (OutputFormat::Npy, _) => "",
    }
}

fn lines(
    format: OutputFormat,
    input: &Input,
    first: usize,
    retrieval: &Retrieval,
    uncertainty: &[f64],
    threshold: Option<Threshold>,
) -> String {
    let mut text = String::new();
    for (row, &uncertainty) in uncertainty.iter().enumerate() {
        let query = name_of(input.query_names.as_ref(), first + row);
        let reference = name_of(input.names.as_ref(), retrieval.indices(row)[0]);
        let distance = retrieval.distances(row)[0];
        let accepted = threshold.map(|threshold| threshold.accepts(uncertainty));
        if format == OutputFormat::Json {
            let mut object = serde_json::json!({
                "query": query, "reference": reference, "distance": distance,
                "uncertainty": uncertainty,
            });
            if let Some(accepted) = accepted {
                object["accepted"] = accepted.into();
            }
            let comma = if first + row == 0 { "" } else { "," };
            let _ = write!(text, "{comma}\n{object}");
        } else {
            let _ = write!(
                text,
                "{},{},{distance:?},{uncertainty:?}",
                quoted(&query),
                quoted(&reference)
            );
            if let Some(accepted) = accepted {
                let _ = write!(text, ",{accepted}");
            }
            text.push('\n');
        }
    }
    text
}

/// A field of a CSV line.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        return format!("\"{}\"", field.replace('"', "\"\""));
    }
    field.to_owned()
}
