//! The 19 lights of the Point Features dataset: table 3.4, figure 3.6.

use vpr_core::{Definition, Provenance};
use vpr_report::{
    figure::{Curve, Figure, Panel, Shape},
    table::{Cell, Table},
};

/// Azimuth and elevation of each light in degrees, about the centre of the table (Aanæs et al.).
///
/// The thesis' caption calls the first column θ and says θ is the elevation; elevations of 264°
/// do not exist, so the first is the azimuth.
pub(super) const LIGHTS: [(f64, f64); 19] = [
    (264.0, 57.0),
    (277.0, 57.0),
    (227.0, 68.0),
    (245.0, 72.0),
    (270.0, 73.0),
    (297.0, 72.0),
    (314.0, 68.0),
    (174.0, 74.0),
    (170.0, 80.0),
    (152.0, 86.0),
    (28.0, 86.0),
    (10.0, 80.0),
    (6.0, 74.0),
    (125.0, 65.0),
    (109.0, 68.0),
    (89.0, 69.0),
    (69.0, 68.0),
    (53.0, 64.0),
    (97.0, 56.0),
];

pub(super) fn run(table: &mut Table) -> Option<Figure> {
    let note =
        "stated by the thesis, which swaps the names: its θ is the azimuth, its φ the elevation";
    for (led, (azimuth, elevation)) in (1..).zip(LIGHTS) {
        let row = format!("LED {led}");
        for (definition, columns) in
            [(Definition::Published, ["θ", "φ"]), (Definition::Corrected, ["azimuth", "elevation"])]
        {
            for (column, value) in columns.into_iter().zip([azimuth, elevation]) {
                let cell = Cell::new(&row, column, value, Provenance::Published, 1);
                table.push(cell.defined(definition).noted(note));
            }
        }
    }
    None
}

/// Where the lights are seen from above, at unit length: table 3.4 has no distances.
pub(super) fn from_above(table: &mut Table) -> Figure {
    let note = "of unit length, from the angles of table 3.4 (corrected names)";
    let mut points = Vec::new();
    for (led, (azimuth, elevation)) in (1..).zip(LIGHTS) {
        let (sin, cos) = f64::to_radians(azimuth).sin_cos();
        let across = f64::to_radians(elevation).cos();
        points.push((across * cos, across * sin));
        for (column, value) in [("x", across * cos), ("y", across * sin)] {
            let row = format!("LED {led}");
            table.push(Cell::new(row, column, value, Provenance::Published, 1).noted(note));
        }
    }
    let curve = Curve::new("LED", points).of(Provenance::Published).shaped(Shape::Points);
    let panel = Panel {
        title: "from above".into(),
        x_label: "x, of unit length".into(),
        y_label: "y, of unit length".into(),
        curves: vec![curve],
        ..Panel::default()
    };
    Figure { panels: vec![panel] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_lie_in_the_unit_circle_and_the_lowest_farthest_out() {
        let mut table = Table::new("figure-3.6", "lights");
        let figure = from_above(&mut table);
        let far: Vec<f64> =
            figure.panels[0].curves[0].points.iter().map(|(x, y)| x.hypot(*y)).collect();
        assert!(far.iter().all(|&it| it < 1.0));
        let farthest = (0..19).max_by(|&a, &b| far[a].total_cmp(&far[b])).unwrap();
        let lowest = (0..19).min_by(|&a, &b| LIGHTS[a].1.total_cmp(&LIGHTS[b].1)).unwrap();
        assert_eq!((far.len(), farthest), (19, lowest));
    }

    #[test]
    fn elevations_are_above_the_table() {
        assert!(LIGHTS.iter().all(|(azimuth, elevation)| {
            (0.0..360.0).contains(azimuth) && (0.0..=90.0).contains(elevation)
        }));
    }
}
