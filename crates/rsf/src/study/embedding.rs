//! Descriptors of places and of the training domain in a plane: figure 4.1.

use nalgebra::{DMatrix, SymmetricEigen};
use vpr_core::{Descriptors, Error as CoreError};
use vpr_report::{
    figure::{Curve, Figure, Panel, Shape},
    table::{Cell, Table},
};
use vpr_study::Sources;

use super::Place;
use crate::Result;

/// Images of a place, at most.
const SHOWN: usize = 120;
/// Columns: means along both directions.
const AXES: [&str; 2] = ["first axis", "second axis"];
/// What the training domain is called.
const DOMAIN: &str = "training domain";

/// The plane of the two directions in which all descriptors together vary most. The thesis shows
/// T-SNE, which keeps neighbours and no distances; here distances are those of the plane.
pub(super) fn run(
    table: &mut Table,
    training: &str,
    places: &[Place],
    sources: &Sources<'_>,
) -> Result<Option<Figure>> {
    let describe = |images: &[std::path::PathBuf], name: &str| -> Result<Descriptors> {
        let runner = sources.runner("default")?.ok_or(CoreError::Empty("default network"))?;
        let step = images.len().div_ceil(SHOWN).max(1);
        let images: Vec<_> = images.iter().step_by(step).cloned().collect();
        let rows = sources.features(&runner, &images, name)?.into_descriptors();
        Ok(rows.ok_or(CoreError::Empty("descriptors"))?)
    };
    let Some(domain) = sources.images(training)? else {
        return Err(CoreError::Empty("images of the training domain").into());
    };
    let mut all = vec![(DOMAIN, domain.provenance, describe(&domain.references, DOMAIN)?)];
    for place in places {
        let Some(dataset) = place.at_hand(&AXES, table, sources)? else { continue };
        let rows = describe(&dataset.references, &dataset.name)?;
        all.push((&place.name, dataset.provenance, rows));
    }
    let plane = plane(&all.iter().map(|it| &it.2).collect::<Vec<_>>());
    let mut panel = Panel {
        x_label: "first principal direction".to_owned(),
        y_label: "second principal direction".to_owned(),
        ..Panel::default()
    };
    for (name, origin, rows) in &all {
        let points: Vec<(f64, f64)> = (0..rows.len())
            .map(|row| {
                let along = |axis: usize| -> f64 {
                    let row = rows.row(row);
                    (0..row.len()).map(|it| f64::from(row[it]) * plane[(it, axis)]).sum()
                };
                (along(0), along(1))
            })
            .collect();
        let n = points.len();
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n as f64;
        table.push(Cell::new(*name, AXES[0], mean(|it| it.0), *origin, n));
        table.push(Cell::new(*name, AXES[1], mean(|it| it.1), *origin, n));
        panel.curves.push(Curve::new(*name, points).of(*origin).shaped(Shape::Points));
    }
    Ok(Some(Figure { panels: vec![panel] }))
}

/// The two directions of largest variance, signs such that the largest number of each is positive.
fn plane(sets: &[&Descriptors]) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = sets
        .iter()
        .flat_map(|set| (0..set.len()).map(|row| set.row(row).mapv(f64::from).to_vec()))
        .collect();
    let (n, dim) = (rows.len(), rows.first().map_or(0, Vec::len));
    let matrix = DMatrix::from_fn(n, dim, |row, column| rows[row][column]);
    let mean = matrix.row_mean();
    let centred = DMatrix::from_fn(n, dim, |row, column| matrix[(row, column)] - mean[column]);
    let SymmetricEigen { eigenvectors, eigenvalues } = centred.tr_mul(&centred).symmetric_eigen();
    let mut order: Vec<usize> = (0..dim).collect();
    order.sort_by(|a, b| eigenvalues[*b].total_cmp(&eigenvalues[*a]).then(a.cmp(b)));
    DMatrix::from_fn(dim, 2, |row, axis| {
        let column = eigenvectors.column(order[axis]);
        column[row] * column[column.iamax()].signum()
    })
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn the_plane_is_where_descriptors_vary_most() {
        let set = Descriptors::new(array![
            [9.0, 1.0, 0.0],
            [-9.0, 1.0, 0.0],
            [0.0, 1.0, 2.0],
            [0.0, 1.0, -2.0]
        ])
        .unwrap();
        let plane = plane(&[&set]);
        let expected = DMatrix::from_row_slice(3, 2, &[1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        assert!((plane - expected).abs().max() < 1e-9);
    }
}
