//! Targets and strategies as they are typed.

use std::{path::PathBuf, str::FromStr};

use anyhow::{bail, ensure};
use clap::ValueEnum;
use copr::{
    Anchors, Frame, GaussianParams, GaussianProcess, Grid, LinearInterpolation, Outside, PlaneFit,
    PlaneParams, Regressor, Targets, net::NetworkRegressor,
};
use nalgebra::Vector3;
use vpr_core::{Definition, Poses};
use vpr_data::exchange::{self, Format};

/// Where descriptors are regressed; one of the five is given.
#[derive(clap::Args)]
#[group(skip)]
pub(crate) struct PlacementArgs {
    /// Targets so many metres apart: around every anchor with --span, else everywhere within --reach
    /// of one
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    grid: Option<f64>,
    /// How far a grid around an anchor spans in world x and y, in metres
    #[arg(long, value_name = "XxY", requires = "grid", allow_hyphen_values = true)]
    span: Option<Span>,
    /// How far from an anchor one grid over the whole map reaches, in metres
    #[arg(long, value_name = "M", requires = "grid", conflicts_with = "span")]
    reach: Option<f64>,
    /// So many targets between every two neighbouring anchors
    #[arg(long, value_name = "N", conflicts_with_all = ["grid", "lane", "at"])]
    between: Option<usize>,
    /// One target beside every anchor, by these metres
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, conflicts_with_all = ["grid", "at"])]
    lane: Option<Offset>,
    /// In whose axes --lane is given
    #[arg(long, value_enum, default_value_t, value_name = "FRAME")]
    frame: Frame,
    /// Targets at the poses in this file
    #[arg(long, value_name = "PATH", conflicts_with = "grid")]
    at: Option<PathBuf>,
}

/// How descriptors are regressed.
#[derive(clap::Args)]
pub(crate) struct StrategyArgs {
    /// The strategy; without it the network if --weights are given, else the plane
    #[arg(long, value_enum, value_name = "NAME")]
    regressor: Option<Strategy>,
    /// As released, or as the thesis says: of a plane fit and of a grid
    #[arg(long, value_enum, default_value_t = DefinitionArg::Corrected, value_name = "NAME")]
    definition: DefinitionArg,
    /// Weights of the network H, as `copr train regressor` writes them
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    /// Anchors of a plane fit
    #[arg(long, default_value_t = 4, value_name = "N")]
    neighbours: usize,
    /// Directions in which the anchors of a plane extend less than this share of their greatest
    /// extent count as none
    #[arg(long, default_value_t = 1e-6, value_name = "SHARE")]
    tolerance: f64,
    /// What becomes of targets outside of what the anchors of a plane span
    #[arg(long, value_enum, default_value_t, value_name = "WHAT")]
    outside: Outside,
}

/// A strategy of thesis §6.2.2.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Strategy {
    /// Linear interpolation between the neighbours along the sequence
    Linear,
    /// A plane through the nearest anchors
    Plane,
    /// A Gaussian process over the poses of up to sixteen anchors
    Gaussian,
    /// The network H, from the anchor that a target was placed from
    Network,
}

/// See [`Definition`].
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum DefinitionArg {
    /// As the released code does it
    Published,
    /// As the thesis says
    Corrected,
}

/// `1.0x0.6`
#[derive(Clone, Copy)]
struct Span([f64; 2]);

/// `-1.8,0,0`
#[derive(Clone, Copy)]
struct Offset([f64; 3]);

impl FromStr for Span {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('x').map(|(x, y)| (x.trim().parse(), y.trim().parse()));
        match parsed {
            Some((Ok(x), Ok(y))) => Ok(Self([x, y])),
            _ => Err(format!("`{text}` is not two lengths as in 1.0x0.6")),
        }
    }
}

impl FromStr for Offset {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split(',').map(|it| it.trim().parse::<f64>());
        let numbers = numbers.collect::<Result<Vec<f64>, _>>().map_err(|err| err.to_string())?;
        numbers.try_into().map(Self).map_err(|_| format!("`{text}` is not X,Y,Z in metres"))
    }
}

impl PlacementArgs {
    /// The targets around these anchors.
    pub(crate) fn targets<'a>(
        &self,
        anchors: &'a Anchors,
        strategy: &StrategyArgs,
    ) -> anyhow::Result<Targets<'a>> {
        if let Some(step) = self.grid {
            return Ok(match (self.span, self.reach) {
                (Some(Span(span)), _) => {
                    Targets::around(anchors, &Grid::new(span, step, strategy.definition())?)?
                }
                (None, Some(reach)) => Targets::global(anchors, step, reach)?,
                (None, None) => bail!("`--grid` needs `--span` or `--reach`"),
            });
        }
        if let Some(n) = self.between {
            return Ok(Targets::between(anchors, n)?);
        }
        if let Some(Offset([x, y, z])) = self.lane {
            return Ok(Targets::lane(anchors, Vector3::new(x, y, z), self.frame)?);
        }
        if let Some(path) = &self.at {
            let poses = exchange::read(Format::guess(path)?, path)?.poses;
            let none = || vpr_core::Error::Empty("poses").in_file(path);
            let poses: Poses = poses.ok_or_else(none)?;
            let poses = poses.six_dof().map_err(|err| err.in_file(path))?;
            return Ok(Targets::listed(anchors, poses)?);
        }
        bail!("no target: give one of `--grid`, `--between`, `--lane`, `--at`")
    }
}

impl StrategyArgs {
    fn definition(&self) -> Definition {
        match self.definition {
            DefinitionArg::Published => Definition::Published,
            DefinitionArg::Corrected => Definition::Corrected,
        }
    }

    /// The regressor for descriptors of this length, by this encoder if that is known.
    pub(crate) fn regressor(
        &self,
        dim: usize,
        encoder: Option<&str>,
    ) -> anyhow::Result<Box<dyn Regressor>> {
        let named = if self.weights.is_some() { Strategy::Network } else { Strategy::Plane };
        let strategy = self.regressor.unwrap_or(named);
        ensure!(
            strategy == Strategy::Network || self.weights.is_none(),
            "`--weights` are those of `--regressor network`"
        );
        Ok(match strategy {
            Strategy::Linear => Box::new(LinearInterpolation),
            Strategy::Plane => Box::new(PlaneFit::new(PlaneParams {
                definition: self.definition(),
                n_anchors: self.neighbours,
                tolerance: self.tolerance,
                outside: self.outside,
            })?),
            Strategy::Gaussian => Box::new(GaussianProcess::new(GaussianParams::default())?),
            Strategy::Network => {
                let Some(path) = &self.weights else {
                    bail!("`--regressor network` needs `--weights`")
                };
                let network = NetworkRegressor::open(path)?;
                let found = network.dimension();
                let path = path.display();
                ensure!(
                    found == dim,
                    "{path}: of {found} values, the map's descriptors have {dim}"
                );
                if let (Some(network), Some(map)) = (network.encoder(), encoder) {
                    ensure!(
                        network == map,
                        "{path}: trained on `{network}`, the map is of `{map}`"
                    );
                }
                Box::new(network)
            }
        })
    }
}
