//! Dense maps in memory and what is retrieved from them.

use std::path::{Path, PathBuf};

use ndarray::{Axis, concatenate};
use serde::Deserialize;
use vpr_core::{Definition, Descriptors, Map, retrieve};

use super::Context;
use crate::{
    Blended, Control, Controlled, Error, GaussianParams, GaussianProcess, LinearInterpolation,
    MOST_TARGETS, Options, Outside, PlaneFit, PlaneParams, PoseErrors, Regressor, Result, Targets,
    Told, net::NetworkRegressor, regressed,
};

/// How descriptors are regressed.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "method", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Method {
    /// Between two anchors.
    LinearInterpolation,
    /// A plane through four.
    Plane {
        /// As released or as the thesis says.
        definition: Definition,
        /// See [`PlaneParams::tolerance`].
        #[serde(default = "fine")]
        tolerance: f64,
    },
    /// The network H.
    Network {
        /// Its weights, relative to a data folder.
        weights: PathBuf,
        /// Whether to mend the lengths of its descriptors (C-1).
        #[serde(default)]
        renormalise: bool,
        /// From how many of the nearest anchors; without it from its own alone, as in the thesis.
        #[serde(default)]
        anchors: Option<usize>,
    },
    /// A Gaussian process over poses, of many anchors.
    GaussianProcess {},
    /// What should not help.
    Control {
        /// Which.
        control: Control,
        /// The weights of the H whose rows are shuffled; without them those of a plane are.
        #[serde(default)]
        weights: Option<PathBuf>,
    },
}

/// Within it several anchors count about alike, metres: two steps of the grids of table 6.1.
const NEAR_M: f64 = 0.1;

fn fine() -> f64 {
    PlaneParams::default().tolerance
}

/// A method that can be run.
pub(super) struct Ready {
    pub(super) regressor: Box<dyn Regressor>,
    pub(super) options: Options,
    /// What the dense map is called in tables.
    pub(super) map: String,
    pub(super) definition: Option<&'static str>,
}

fn name_of(definition: Definition) -> &'static str {
    match definition {
        Definition::Published => "published",
        Definition::Corrected => "corrected",
    }
}

impl Method {
    /// Rows that stand for this method in tables.
    pub(super) fn map(&self) -> String {
        let name = match self {
            Self::LinearInterpolation => "Lin. Interp.",
            Self::Plane { .. } => "Lin. Reg.",
            Self::GaussianProcess {} => "Gaussian process",
            Self::Network { anchors: Some(n), .. } => {
                return format!("dense map, Non-lin. Reg. from {n} anchors");
            }
            Self::Network { renormalise: false, .. } => "Non-lin. Reg.",
            Self::Network { renormalise: true, .. } => "Non-lin. Reg., unit length",
            Self::Control { control: Control::Random, .. } => "random rows",
            Self::Control { control: Control::Shuffled, weights: None } => "shuffled rows",
            Self::Control { control: Control::Shuffled, weights: Some(_) } => {
                "Non-lin. Reg. shuffled"
            }
            Self::Control { control: Control::Copied, .. } => "anchors copied",
        };
        format!("dense map, {name}")
    }

    /// The same with the weights of a place or an encoder, where their name says `{place}` or
    /// `{encoder}`.
    pub(super) fn at(&self, name: &str) -> Self {
        let of = |weights: &PathBuf| {
            let weights = weights.to_string_lossy();
            PathBuf::from(weights.replace("{place}", name).replace("{encoder}", name))
        };
        match self {
            Self::Network { weights, renormalise, anchors } => {
                let (weights, renormalise, anchors) = (of(weights), *renormalise, *anchors);
                Self::Network { weights, renormalise, anchors }
            }
            Self::Control { control, weights: Some(weights) } => {
                Self::Control { control: *control, weights: Some(of(weights)) }
            }
            other => other.clone(),
        }
    }

    /// Whether it is H with its own rows, not a control of it.
    pub(super) fn is_network(&self) -> bool {
        matches!(self, Self::Network { renormalise: false, anchors: None, .. })
    }

    /// Whether it is H with its rows shuffled.
    pub(super) fn is_shuffled_network(&self) -> bool {
        matches!(self, Self::Control { control: Control::Shuffled, weights: Some(_) })
    }

    /// The regressor, or why it is not at hand.
    pub(super) fn ready(&self, context: Context<'_>) -> Result<Result<Ready, String>> {
        let mut options = Options::default();
        let (regressor, definition): (Box<dyn Regressor>, _) = match self {
            Self::LinearInterpolation => (Box::new(LinearInterpolation), None),
            Self::Plane { definition, tolerance } => {
                let (definition, tolerance) = (*definition, *tolerance);
                let outside = Outside::Flat;
                let params =
                    PlaneParams { definition, tolerance, outside, ..PlaneParams::default() };
                (Box::new(PlaneFit::new(params)?), Some(name_of(definition)))
            }
            Self::GaussianProcess {} => {
                (Box::new(GaussianProcess::new(GaussianParams::default())?), None)
            }
            Self::Network { weights, renormalise, anchors } => {
                options.renormalise = *renormalise;
                let network = match network(weights, context)? {
                    Ok(network) => network,
                    Err(why) => return Ok(Err(why)),
                };
                let definition = name_of(network.definition());
                let network: Box<dyn Regressor> = match anchors {
                    Some(n) => Box::new(Blended::new(Box::new(network), *n, NEAR_M)?),
                    None => Box::new(network),
                };
                (network, Some(definition))
            }
            Self::Control { control, weights } => {
                let of: Box<dyn Regressor> = match weights {
                    None => Box::new(PlaneFit::new(PlaneParams {
                        outside: Outside::Flat,
                        ..PlaneParams::default()
                    })?),
                    Some(weights) => match network(weights, context)? {
                        Ok(network) => Box::new(network),
                        Err(why) => return Ok(Err(why)),
                    },
                };
                // Rows are shuffled among those of one batch: all of them.
                options.batch = MOST_TARGETS;
                (Box::new(Controlled { control: *control, of, seed: context.seed }), None)
            }
        };
        Ok(Ok(Ready { regressor, options, map: self.map(), definition }))
    }
}

/// The network H with these weights, or why they are not at hand.
fn network(weights: &Path, context: Context<'_>) -> Result<Result<NetworkRegressor, String>> {
    let Some(path) = context.sources.locate(weights)? else {
        let weights = weights.display();
        return Ok(Err(format!("{weights} is not at hand; `copr train regressor` makes it")));
    };
    Ok(Ok(NetworkRegressor::open(&path)?))
}

/// The errors of taking each query to be where its nearest reference is.
pub(super) fn localize(references: &Map, queries: &Map) -> Result<PoseErrors> {
    let best = retrieve(queries.descriptors(), references.descriptors(), 1)?.best();
    PoseErrors::of_retrieval(&best, references.poses(), queries.poses())
}

/// Both maps, one after the other.
pub(super) fn joined(first: &Map, second: &Map) -> Result<Map> {
    let rows = concatenate(Axis(0), &[first.descriptors().view(), second.descriptors().view()])
        .map_err(|_| vpr_core::Error::Mismatch {
            what: "dimension of the regressed descriptors",
            expected: first.descriptors().dim(),
            actual: second.descriptors().dim(),
        })?;
    let mut poses = first.poses().clone();
    poses.extend(second.poses())?;
    Ok(Map::new(Descriptors::new(rows)?, poses)?)
}

/// Some rows of a map.
pub(super) fn selected(map: &Map, rows: &[usize]) -> Result<Map> {
    let descriptors = Descriptors::new(map.descriptors().view().select(Axis(0), rows))?;
    Ok(Map::new(descriptors, map.poses().select(rows))?)
}

/// The sparse map and what is regressed from `source` at the targets, or why that has no value.
pub(super) fn densified(
    sparse: &Map,
    source: &Map,
    targets: &Targets<'_>,
    ready: &Ready,
) -> Result<Result<(Map, Told), String>> {
    match regressed(source, targets, &*ready.regressor, ready.options) {
        Ok((rows, told)) => Ok(Ok((joined(sparse, &rows)?, told))),
        // A method that has no value for a target has none for the scene; wrong files are errors.
        Err(
            err @ (Error::TooFewAnchors { .. }
            | Error::Singular { .. }
            | Error::Undetermined { .. }
            | Error::NotFinite { .. }),
        ) => Ok(Err(err.to_string())),
        Err(err) => Err(err),
    }
}

/// What a reader must know of a dense map.
pub(super) fn remark(told: Told) -> Option<String> {
    (told.n_flat > 0).then(|| {
        let n = told.n_flat;
        format!(
            "{n} targets lie outside of what their anchors span and take the nearest point of it"
        )
    })
}
