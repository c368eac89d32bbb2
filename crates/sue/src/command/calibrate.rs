//! `sue calibrate`: a threshold with a promise, in words or as JSON.

use clap::ValueEnum;
use sue::{
    EstimatorChoice,
    calibrate::{PrecisionGoal, Scope, calibrate_false_acceptance, calibrate_precision},
};
use vpr_core::Judged;
use vpr_report::{
    cli::{self, Outcome, ReportArgs},
    report::Run,
};

use super::{
    input::InputArgs, pictures::PicturesArgs, report, threshold::Origin, truth::TruthArgs,
};

/// The promise, and the queries it rests on.
#[derive(clap::Args)]
pub(crate) struct CalibrateArgs {
    /// Which estimator
    #[arg(long, value_enum, default_value_t = EstimatorChoice::Sue, value_name = "NAME")]
    estimator: EstimatorChoice,
    /// Share of accepted matches that must be correct
    #[arg(long, default_value_t = 0.95, value_name = "P")]
    precision: f64,
    /// Share of all calibration sets that may break the promise. Sets that give no threshold keep it;
    /// of those that give one, at most R divided by their share break it
    #[arg(long, default_value_t = 0.1, value_name = "R")]
    risk: f64,
    /// Whose precision is promised
    #[arg(long, value_enum, default_value_t = ScopeChoice::Population)]
    scope: ScopeChoice,
    /// Instead of a precision: largest chance that a wrong match is accepted
    #[arg(long, value_name = "RATE", conflicts_with_all = ["precision", "risk", "scope"])]
    false_acceptance: Option<f64>,
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    truth: TruthArgs,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    pictures: PicturesArgs,
    /// Print one JSON object instead of a sentence; `sue estimate --threshold FILE` reads it
    #[arg(long)]
    json: bool,
}

/// Whose precision is promised.
#[derive(Clone, Copy, ValueEnum)]
enum ScopeChoice {
    /// Of all queries there could be
    Population,
    /// Of the next accepted matches, as many as in calibration
    NextBatch,
}

pub(crate) fn run(args: &CalibrateArgs) -> anyhow::Result<Outcome> {
    args.report.check()?;
    let input = args.input.open(&[args.estimator])?;
    input.check_poses(&[args.estimator])?;
    let pictures = args.pictures.open(&input)?;
    let truth = args.truth.truth(&input)?;
    let retrieval = input.retrieve()?;
    let best = retrieval.best();
    let judged = Judged::new(&best, &truth)?;
    let prepared = args.estimator.prepare(&input.settings, input.poses.as_ref())?;
    let uncertainty = prepared.estimate(&retrieval)?;
    let (words, object, threshold) = if let Some(rate) = args.false_acceptance {
        let result = calibrate_false_acceptance(&uncertainty, judged.correct(), rate)?;
        (result.to_string(), serde_json::to_value(result)?, result.threshold)
    } else {
        let scope = match args.scope {
            ScopeChoice::Population => Scope::Population,
            ScopeChoice::NextBatch => Scope::NextBatch,
        };
        let goal = PrecisionGoal { precision: args.precision, risk: args.risk, scope };
        let result = calibrate_precision(&uncertainty, judged.correct(), goal)?;
        (result.to_string(), serde_json::to_value(result)?, result.threshold)
    };
    if args.report.path.is_some() {
        let poses = args.truth.query_poses(&input)?;
        let limit = report::at_most(threshold, &uncertainty);
        let inliers = args.pictures.inliers(&pictures, &best)?;
        let run = report::run(prepared.name(), &retrieval, uncertainty, inliers.as_deref());
        let runs = vec![Run { threshold: Some(limit), ..run }];
        let promise = Some(("promise", words.as_str()));
        let places = (poses.as_ref(), &truth);
        report::write(&args.report, &input, places, &pictures, runs, promise)?;
    }
    if !args.json {
        cli::print(&format!("{words}\n"))?;
        return Ok(Outcome::Success);
    }
    let origin = Origin::new(args.estimator, input.settings, input.scale);
    let mut object = object;
    object["guarantee"] = words.into();
    for (key, value) in serde_json::to_value(origin)?.as_object().into_iter().flatten() {
        object[key] = value.clone();
    }
    cli::print(&format!("{object:#}\n"))?;
    Ok(Outcome::Success)
}
