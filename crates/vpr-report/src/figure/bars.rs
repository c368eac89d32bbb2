//! Bars of categories, beside each other, with the interval of each.

use std::fmt::Write as _;

use super::{
    Curve, Style,
    draw::{number, tenths},
    plan::Frame,
};

/// Room that the bars of one category take, of the distance to the next.
const SHARE: f64 = 0.8;

/// What the axes must reach beside the points: half a category to the sides, and zero.
pub(super) fn reach(curves: &[Curve]) -> Option<([f64; 2], f64)> {
    let bars = curves.iter().filter(|it| it.shape == super::Shape::Bars);
    let positions = || bars.clone().flat_map(|it| it.points.iter().map(|point| point.0));
    let ends = positions().fold(None, |ends: Option<[f64; 2]>, x| {
        Some(ends.map_or([x, x], |[low, high]| [low.min(x), high.max(x)]))
    })?;
    Some(([ends[0] - 0.5, ends[1] + 0.5], 0.0))
}

/// The `nth` of `n` bars of every category.
pub(super) fn bars(
    frame: &Frame<'_>,
    (nth, n): (usize, usize),
    curve: &Curve,
    style: Style,
) -> String {
    let width = SHARE / n as f64;
    let mut out = String::new();
    for (index, &(x, y)) in curve.points.iter().enumerate() {
        let left = x - SHARE / 2.0 + nth as f64 * width;
        let corners = [(left + 0.06 * width, 0.0), (left + 0.94 * width, y)];
        let [Some(foot), Some(head)] = corners.map(|it| frame.place(it)) else { continue };
        let ([left, bottom], [right, top]) =
            ([foot.0, foot.1].map(tenths), [head.0, head.1].map(tenths));
        let [x0, y0, x1, y1] = [left, bottom, right, top].map(number);
        let path = format!("M{x0} {y0}V{y1}H{x1}V{y0}Z");
        let _ = writeln!(out, "<path class=\"m c{}\" d=\"{path}\"/>", style.colour);
        if let Some(&(low, high)) = curve.band.get(index) {
            let middle = x - SHARE / 2.0 + (nth as f64 + 0.5) * width;
            let ends = [(middle, low), (middle, high)].map(|it| frame.place(it));
            let [Some(low), Some(high)] = ends else { continue };
            let [x, low, high] = [low.0, low.1, high.1].map(|it| number(tenths(it)));
            let _ = writeln!(out, "<path fill=\"none\" stroke=\"#222\" d=\"M{x} {low}V{high}\"/>");
        }
    }
    out
}
