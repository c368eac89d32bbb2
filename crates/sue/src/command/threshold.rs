//! A threshold that was typed, or that `sue calibrate --json` wrote.

use std::{convert::Infallible, fs, path::PathBuf, str::FromStr};

use anyhow::{Context as _, bail};
use serde::{Deserialize, Serialize};
use sue::{EstimatorChoice, EstimatorSettings, Share, Threshold};

use super::normalization::Scale;

/// What was given for `--threshold`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ThresholdArg {
    /// A number, `everything` or `nothing`.
    Given(Threshold),
    /// A file of `sue calibrate --json`.
    File(PathBuf),
}

/// What a threshold belongs to: with anything else its promise is void.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Origin {
    /// The estimator whose uncertainties were looked at.
    pub(crate) estimator: EstimatorChoice,
    /// What it was told.
    pub(crate) settings: EstimatorSettings,
    /// Whether descriptors were compared at length 1, scaled or not.
    pub(crate) normalized: bool,
}

impl Origin {
    /// The estimator with these settings on descriptors of that scale.
    pub(crate) fn new(
        estimator: EstimatorChoice,
        settings: EstimatorSettings,
        scale: Scale,
    ) -> Self {
        Self { estimator, settings, normalized: scale != Scale::Other }
    }
}

/// What is read of a file of `sue calibrate --json`; a file of someone's own needs no more than the
/// threshold.
#[derive(Deserialize)]
struct Calibration {
    threshold: Threshold,
    estimator: Option<EstimatorChoice>,
    settings: Option<EstimatorSettings>,
    normalized: Option<bool>,
}

impl FromStr for ThresholdArg {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match (text.strip_prefix('@'), text.parse()) {
            (Some(path), _) => Self::File(path.into()),
            (None, Ok(threshold)) => Self::Given(threshold),
            (None, Err(_)) => Self::File(text.into()),
        })
    }
}

impl ThresholdArg {
    /// The threshold; one from a file must have been calibrated for `origin`, if there is one.
    pub(crate) fn open(&self, origin: Option<&Origin>) -> anyhow::Result<Threshold> {
        let path = match self {
            Self::Given(threshold) => return Ok(*threshold),
            Self::File(path) => path,
        };
        let shown = path.display();
        let text = fs::read_to_string(path).with_context(|| {
            format!("--threshold {shown}: no number, `everything` or `nothing`, and no file that can be read")
        })?;
        let read: Calibration = serde_json::from_str(&text)
            .with_context(|| format!("{shown}: not what `sue calibrate --json` writes"))?;
        let Some(now) = origin else {
            if let Some(made) = read.estimator {
                bail!("{shown}: calibrated for `{}`, not for variances", name(made));
            }
            return Ok(read.threshold);
        };
        if let Some(made) = read.estimator.filter(|&it| it != now.estimator) {
            let [made, now] = [made, now.estimator].map(name);
            bail!("{shown}: calibrated for `{made}`, not for `{now}`: give --estimator {made}");
        }
        let is_spatial = now.estimator.needs().poses != Share::None;
        if let Some(made) = read.settings.filter(|it| is_spatial && *it != now.settings) {
            let changes = changes(&made, &now.settings)?;
            bail!("{shown}: calibrated with other settings: {changes}");
        }
        if let Some(made) = read.normalized.filter(|&it| it != now.normalized) {
            let was = if made { "of length 1" } else { "of other lengths, as they were" };
            bail!("{shown}: calibrated with descriptors {was}; see --normalize and --no-normalize");
        }
        Ok(read.threshold)
    }
}

/// The name on the command line.
pub(super) fn name(estimator: EstimatorChoice) -> String {
    let value = clap::ValueEnum::to_possible_value(&estimator);
    value.map(|it| it.get_name().to_owned()).unwrap_or_default()
}

/// The settings that differ, one after the other.
fn changes(made: &EstimatorSettings, now: &EstimatorSettings) -> anyhow::Result<String> {
    let flat = |settings: &EstimatorSettings| -> anyhow::Result<Vec<(String, String)>> {
        let sue = serde_json::to_value(settings.sue)?;
        let fields = sue.as_object().into_iter().flatten();
        let mut all: Vec<_> = fields.map(|(key, value)| (key.clone(), value.to_string())).collect();
        all.push(("nth".to_owned(), settings.nth.to_string()));
        Ok(all)
    };
    let pairs = flat(made)?.into_iter().zip(flat(now)?);
    let changed = pairs.filter(|(made, now)| made != now);
    let lines = changed.map(|((key, made), (_, now))| format!("{key} was {made}, is {now}"));
    Ok(lines.collect::<Vec<_>>().join("; "))
}
