//! The 19 lights of the Point Features dataset: table 3.4.

use vpr_core::{Definition, Provenance};
use vpr_report::{
    figure::Figure,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elevations_are_above_the_table() {
        assert!(LIGHTS.iter().all(|(azimuth, elevation)| {
            (0.0..360.0).contains(azimuth) && (0.0..=90.0).contains(elevation)
        }));
    }
}
