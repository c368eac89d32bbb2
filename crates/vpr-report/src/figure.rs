//! Figures: panels of curves, and their drawing as SVG.

use serde::Serialize;

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
    /// The curves.
    pub curves: Vec<Curve>,
    /// Whether the points are drawn apart instead of joined.
    pub is_scatter: bool,
}

/// One curve: points joined in order.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// Points `(x, y)`.
    pub points: Vec<(f64, f64)>,
}

mod svg {
    use plotters::{coord::Shift, prelude::*};

    use super::{Figure, Panel};

    /// Size of one panel in pixels.
    const PANEL: (u32, u32) = (420, 330);
    const COLUMNS: usize = 3;

    /// Ten colours that stay apart for most eyes (Tableau 10).
    const COLOURS: [RGBColor; 10] = [
        RGBColor(78, 121, 167),
        RGBColor(242, 142, 43),
        RGBColor(225, 87, 89),
        RGBColor(118, 183, 178),
        RGBColor(89, 161, 79),
        RGBColor(237, 201, 72),
        RGBColor(176, 122, 161),
        RGBColor(255, 157, 167),
        RGBColor(156, 117, 95),
        RGBColor(60, 60, 60),
    ];

    impl Figure {
        /// This figure as an SVG document.
        ///
        /// # Errors
        ///
        /// What the drawing library reports, as text.
        pub fn svg(&self) -> Result<String, String> {
            let columns = self.panels.len().clamp(1, COLUMNS);
            let rows = self.panels.len().div_ceil(columns).max(1);
            let size = |n: usize, side: u32| u32::try_from(n).map_or(side, |n| n * side);
            let mut document = String::new();
            {
                let size = (size(columns, PANEL.0), size(rows, PANEL.1));
                let root = SVGBackend::with_string(&mut document, size).into_drawing_area();
                root.fill(&WHITE).map_err(|err| err.to_string())?;
                for (area, panel) in root.split_evenly((rows, columns)).iter().zip(&self.panels) {
                    draw(area, panel).map_err(|err| format!("{}: {err}", panel.title))?;
                }
                root.present().map_err(|err| err.to_string())?;
            }
            Ok(document)
        }
    }

    fn draw(
        area: &DrawingArea<SVGBackend<'_>, Shift>,
        panel: &Panel,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let (x, y) = (range(panel, |point| point.0), range(panel, |point| point.1));
        let mut chart = ChartBuilder::on(area)
            .caption(&panel.title, ("sans-serif", 15))
            .margin(8)
            .x_label_area_size(34)
            .y_label_area_size(46)
            .build_cartesian_2d(x.0..x.1, y.0..y.1)?;
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .x_desc(&panel.x_label)
            .y_desc(&panel.y_label)
            .label_style(("sans-serif", 11))
            .draw()?;
        for (curve, colour) in panel.curves.iter().zip(COLOURS.iter().cycle()) {
            let style = colour.stroke_width(2);
            if panel.is_scatter {
                let dot = move |point| Circle::new(point, 2, colour.mix(0.7).filled());
                chart
                    .draw_series(curve.points.iter().copied().map(dot))?
                    .label(&curve.name)
                    .legend(move |(x, y)| Circle::new((x + 7, y), 3, colour.filled()));
                continue;
            }
            chart
                .draw_series(LineSeries::new(curve.points.iter().copied(), style))?
                .label(&curve.name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 14, y)], style));
        }
        if panel.curves.iter().any(|curve| !curve.name.is_empty()) {
            chart
                .configure_series_labels()
                .label_font(("sans-serif", 10))
                .background_style(WHITE.mix(0.8))
                .border_style(RGBColor(200, 200, 200))
                .draw()?;
        }
        Ok(())
    }

    /// Smallest and largest coordinate, a little apart even if they are equal.
    fn range(panel: &Panel, coordinate: impl Fn(&(f64, f64)) -> f64) -> (f64, f64) {
        let values = panel.curves.iter().flat_map(|curve| curve.points.iter().map(&coordinate));
        let (low, high) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        if low > high {
            (0.0, 1.0)
        } else if low == high {
            (low - 0.5, high + 0.5)
        } else {
            (low, high)
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;
        use crate::figure::Curve;

        #[test]
        fn every_curve_and_label_is_drawn() {
            let curve =
                |name: &str| Curve { name: name.into(), points: vec![(0.0, 1.0), (1.0, 0.5)] };
            let panel = Panel {
                title: "Corridor".into(),
                x_label: "recall".into(),
                y_label: "precision".into(),
                curves: vec![curve("HOG"), curve("CoHOG")],
                is_scatter: false,
            };
            let svg = Figure { panels: vec![panel.clone(), panel] }.svg().unwrap();
            for text in ["Corridor", "recall", "precision", "HOG", "CoHOG"] {
                assert_eq!(svg.matches(&format!("\n{text}\n")).count(), 2, "{text}");
            }
        }

        #[test]
        fn scattered_points_are_drawn_one_by_one() {
            let points = vec![(0.0, 1.0), (1.0, 0.5), (2.0, 0.7)];
            let curves = vec![Curve { name: "Corridor".into(), points }];
            let panel = Panel { curves, is_scatter: true, ..Panel::default() };
            let svg = Figure { panels: vec![panel] }.svg().unwrap();
            assert_eq!(svg.matches("<circle").count(), 4, "three points and the legend");
        }

        #[test]
        fn an_empty_figure_is_still_a_document() {
            assert!(Figure::default().svg().unwrap().starts_with("<svg"));
            assert!(Figure { panels: vec![Panel::default()] }.svg().is_ok());
        }
    }
}
