//! Panels that show few enough curves: one per origin, at most eight curves in each.

use vpr_core::Provenance;

use super::{Curve, Panel, Shape};

/// Curves in colour in one panel.
pub(super) const MOST: usize = 8;

/// A panel as it is drawn: some curves in colour, the others grey.
pub(super) struct Multiple<'a> {
    pub(super) title: String,
    /// Axes, and all curves that they must hold.
    pub(super) panel: &'a Panel,
    /// Indices of the curves in colour.
    pub(super) shown: Vec<usize>,
    /// Indices of the grey ones.
    pub(super) grey: Vec<usize>,
}

/// Splits panels by origin and by number of curves.
pub(super) fn multiples(panels: &[Panel]) -> Vec<Multiple<'_>> {
    panels.iter().flat_map(split).collect()
}

fn split(panel: &Panel) -> Vec<Multiple<'_>> {
    let mut origins: Vec<Option<Provenance>> = Vec::new();
    for curve in &panel.curves {
        if !origins.contains(&curve.origin) {
            origins.push(curve.origin);
        }
    }
    if origins.is_empty() {
        origins.push(None);
    }
    let mut multiples = Vec::new();
    for &origin in &origins {
        let names = names(panel, origin);
        let parts = names.len().div_ceil(MOST).max(1);
        let length = names.len().div_ceil(parts).max(1);
        for part in 0..parts {
            let names: Vec<&str> = names.iter().skip(part * length).take(length).copied().collect();
            let is_shown =
                |curve: &Curve| curve.origin == origin && names.contains(&curve.name.as_str());
            let (shown, grey): (Vec<usize>, Vec<usize>) =
                (0..panel.curves.len()).partition(|&index| is_shown(&panel.curves[index]));
            let of_origin = origin.filter(|_| origins.len() > 1);
            let of_origin = of_origin.map_or(String::new(), |origin| format!(", {origin}"));
            let of_parts = if parts > 1 {
                format!(" ({}\u{a0}of\u{a0}{parts})", part + 1)
            } else {
                String::new()
            };
            let title = format!("{}{of_origin}{of_parts}", panel.title);
            // What is grey must not hide what is shown.
            let grey = grey.into_iter().filter(|&it| panel.curves[it].shape == Shape::Line);
            multiples.push(Multiple { title, panel, shown, grey: grey.collect() });
        }
    }
    multiples
}

/// Names of the curves of one origin, in order; a curve and the thesis' marks of it share one.
fn names(panel: &Panel, origin: Option<Provenance>) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for curve in panel.curves.iter().filter(|curve| curve.origin == origin) {
        if !names.contains(&&*curve.name) {
            names.push(&curve.name);
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_and_crowds_are_parted() {
        let curve = |index: usize, origin| Curve::new(format!("c{index}"), Vec::new()).of(origin);
        let mut curves: Vec<Curve> = (0..10).map(|it| curve(it, Provenance::Published)).collect();
        curves.extend((0..5).map(|it| curve(it, Provenance::Measured)));
        let panel = Panel { title: "Corridor".into(), curves, ..Panel::default() };
        let panels = [panel];
        let parts = multiples(&panels);
        let titles: Vec<&str> = parts.iter().map(|it| it.title.as_str()).collect();
        assert_eq!(
            titles,
            [
                "Corridor, published (1\u{a0}of\u{a0}2)",
                "Corridor, published (2\u{a0}of\u{a0}2)",
                "Corridor, measured"
            ]
        );
        assert_eq!(parts[1].shown, [5, 6, 7, 8, 9]);
        assert_eq!((parts[2].shown.len(), parts[2].grey.len()), (5, 10));
    }
}
