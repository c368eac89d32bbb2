//! One preparation of descriptors for studies and commands.

use std::path::Path;

use sue::Result;
use vpr_core::{
    Error,
    knn::{Metric, RowLengths},
    map::metric_name,
};
use vpr_report::cli;

/// Whether descriptors are scaled to length 1.
#[derive(clap::Args)]
pub(crate) struct NormalizationArgs {
    /// Scale descriptors to length 1, as the studies do [default: with a warning, where they are not
    /// and the estimator depends on how long they are]
    #[arg(long, conflicts_with_all = ["no_normalize", "distances", "similarities"])]
    normalize: bool,
    /// Take descriptors as they are, whatever their lengths
    #[arg(long, conflicts_with_all = ["distances", "similarities"])]
    no_normalize: bool,
}

/// How descriptors are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Scale {
    /// As they are: of length 1.
    Unit,
    /// Scaled to length 1.
    ToUnit,
    /// As they are: of other lengths.
    Other,
}

/// A file of descriptors and how long they are.
pub(super) struct Measured<'a> {
    pub(super) path: &'a Path,
    pub(super) lengths: Option<RowLengths>,
}

impl NormalizationArgs {
    /// How descriptors that were made for `metric` and have these lengths are compared;
    /// `needs_length_1` if an estimator depends on lengths.
    pub(super) fn decide(
        &self,
        metric: Metric,
        sides: &[Measured<'_>],
        needs_length_1: bool,
    ) -> Result<Scale> {
        if self.normalize {
            return Ok(Scale::ToUnit);
        }
        let is_cosine = metric == Metric::Cosine && !self.no_normalize;
        if metric != Metric::Euclidean && !is_cosine {
            let value = metric_name(metric).to_owned();
            let reason = "estimators need Euclidean distances; --normalize compares directions";
            return Err(Error::Parameter { name: "metric", value, reason }.into());
        }
        let long: Vec<String> = sides.iter().filter_map(not_unit).collect();
        if is_cosine {
            return Ok(Scale::ToUnit);
        }
        if long.is_empty() {
            return Ok(Scale::Unit);
        }
        let long = long.join("; ");
        let (said, scale) = if self.no_normalize {
            (
                "lambda, and thresholds of descriptors of length 1, do not fit these distances",
                Scale::Other,
            )
        } else if needs_length_1 {
            (
                "they are scaled to length 1, as the studies do; --normalize does so without a \
                 warning, --no-normalize takes them as they are",
                Scale::ToUnit,
            )
        } else {
            (
                "they are taken as they are, and thresholds of descriptors of length 1 do not fit \
                 these distances; --normalize scales them",
                Scale::Other,
            )
        };
        cli::note(&format!("warning: {long}: {said}"));
        Ok(scale)
    }
}

/// What is said of descriptors that do not have length 1.
fn not_unit(side: &Measured<'_>) -> Option<String> {
    let lengths = side.lengths.filter(|it| !it.is_unit())?;
    let [shortest, longest] = [lengths.shortest, lengths.longest].map(short);
    Some(format!("{}: descriptors are {shortest} to {longest} long, not 1", side.path.display()))
}

/// Four digits.
fn short(value: f64) -> String {
    if value == 0.0 || (0.01..1e4).contains(&value) {
        format!("{value:.3}")
    } else {
        format!("{value:.3e}")
    }
}

/// The distance of unit descriptors whose cosine distance this is, `√(2 − 2 cos)`.
#[expect(clippy::cast_possible_truncation, reason = "distances are f32")]
pub(super) fn unit_distance(cosine_distance: f32) -> f32 {
    (2.0 * f64::from(cosine_distance)).sqrt() as f32
}
