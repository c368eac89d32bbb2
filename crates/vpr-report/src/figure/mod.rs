//! Figures: panels of curves, and their drawing as SVG.
//!
//! A technique has one colour and one mark in every figure; a panel shows at most eight curves in
//! colour, more become several panels in which the others are grey. Names stand beside the curves'
//! ends or in one legend above the panels, never over them.

mod apart;
mod axis;
mod bars;
mod draw;
mod multiples;
mod plan;
mod text;
mod theme;
mod thin;
mod visible;

#[cfg(test)]
mod tests;

use serde::Serialize;
use vpr_core::Provenance;

pub(crate) use text::escape;
pub(crate) use theme::styles;
pub use theme::{COLOURS, DARK_COLOURS, Mark, Style, style_of};

/// A figure: panels side by side.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Figure {
    /// The panels, in reading order.
    pub panels: Vec<Panel>,
}

/// One coordinate system with its curves.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Panel {
    /// What the panel shows.
    pub title: String,
    /// Quantity and unit of the horizontal axis.
    pub x_label: String,
    /// Quantity and unit of the vertical axis.
    pub y_label: String,
    /// How the horizontal axis is divided.
    pub x_scale: Scale,
    /// How the vertical axis is divided.
    pub y_scale: Scale,
    /// Names of places on the horizontal axis, where numbers would say nothing.
    pub x_ticks: Vec<(f64, String)>,
    /// Where curves settle: the vertical axis holds what they do from here on, and they may leave
    /// the panel before it, as precision does over the first few matches.
    pub settled_from: Option<f64>,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// How an axis is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub enum Scale {
    /// Equal steps are equal differences.
    #[default]
    Linear,
    /// Equal steps are equal factors; values that are not positive are left out.
    Log,
}

/// How the points of a curve are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub enum Shape {
    /// Joined in order.
    #[default]
    Line,
    /// Apart from each other.
    Points,
    /// Bars from zero, one beside the other where curves share an `x`, which counts categories.
    Bars,
    /// As hollow marks: what the thesis says where ours is a curve of the same name.
    Thesis,
}

/// One curve.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Curve {
    /// Who it is about: a technique by its column, an estimator, …; empty if the title says it.
    pub name: String,
    /// Where its numbers come from; curves of different origins are drawn in different panels.
    pub origin: Option<Provenance>,
    /// How it is shown.
    pub shape: Shape,
    /// Points `(x, y)`; one that is not finite breaks a line.
    pub points: Vec<(f64, f64)>,
    /// Lower and upper end of the interval of every point, or nothing.
    pub band: Vec<(f64, f64)>,
}

impl Curve {
    /// Points joined in order.
    #[must_use]
    pub fn new(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points, ..Self::default() }
    }

    /// Says where its numbers come from.
    #[must_use]
    pub fn of(mut self, origin: Provenance) -> Self {
        self.origin = Some(origin);
        self
    }

    /// Shows the points in another way.
    #[must_use]
    pub fn shaped(mut self, shape: Shape) -> Self {
        self.shape = shape;
        self
    }

    /// Adds the interval of every point, lower and upper end.
    #[must_use]
    pub fn within(mut self, band: Vec<(f64, f64)>) -> Self {
        self.band = band;
        self
    }
}
