//! How far generated places are from real ones, in the eyes of a technique: one PCA plot as in
//! figure 4.1, Fréchet distances between sets, and nearest neighbours across sets.

use std::{path::PathBuf, sync::Arc};

use nalgebra::{DMatrix, DVector};
use ndarray::Array2;
use serde::Deserialize;
use vpr_core::{
    Descriptors, Provenance, Result,
    knn::{Pca, PcaParams},
};
use vpr_data::Dataset;
use vpr_report::{
    figure::{Curve, Figure, Panel, Shape},
    table::{Cell, Table},
};

use vpr_study::{Features, Runner};

use super::{super::Context, techniques};

/// Which sets are compared.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Likeness {
    /// Real datasets.
    pub real: Vec<String>,
    /// Generated ones.
    pub generated: Vec<String>,
    /// Images of each, evenly spaced along its references.
    pub images: usize,
    /// Principal components in which distances are measured.
    pub components: usize,
}

/// The projected descriptors of one dataset.
struct Cloud {
    name: String,
    is_real: bool,
    /// `n × components`.
    points: Array2<f64>,
}

pub(super) fn run(
    table: &mut Table,
    figure: &mut Figure,
    likeness: &Likeness,
    context: Context<'_>,
) -> Result<()> {
    let mut sets: Vec<(Arc<Dataset>, bool)> = Vec::new();
    for (ids, is_real) in [(&likeness.real, true), (&likeness.generated, false)] {
        for id in ids {
            if let Some(dataset) = context.images(id)? {
                sets.push((dataset, is_real));
            } else {
                let why = context.sources.why_absent(id, "images")?;
                table.push(Cell::absent("likeness to real places", id, why));
            }
        }
    }
    if !sets.iter().any(|(_, is_real)| *is_real) {
        return Ok(());
    }
    for runner in techniques(context)? {
        let column = runner.column;
        let Some(clouds) = clouds(runner, &sets, likeness, context)? else {
            continue;
        };
        report(table, column, &clouds);
        figure.panels.push(panel(column, &clouds));
    }
    Ok(())
}

/// Describes evenly spaced references of every set and projects all together; `None` for a
/// technique without one vector per image.
fn clouds(
    runner: &Runner,
    sets: &[(Arc<Dataset>, bool)],
    likeness: &Likeness,
    context: Context<'_>,
) -> Result<Option<Vec<Cloud>>> {
    let mut rows: Vec<f32> = Vec::new();
    let mut lengths = Vec::new();
    let mut dim = 0;
    for (dataset, _) in sets {
        let images = evenly(&dataset.references, likeness.images);
        let what = format!("{} on {}", runner.column, dataset.name);
        let features = context.sources.features(runner, &images, &what)?;
        let Features::Vectors(descriptors) = features else { return Ok(None) };
        dim = descriptors.dim();
        lengths.push(descriptors.len());
        rows.extend(descriptors.as_slice());
    }
    let n: usize = lengths.iter().sum();
    let all = Array2::from_shape_fn((n, dim), |(row, value)| rows[row * dim + value]);
    let all = Descriptors::new(all)?;
    let params = PcaParams { n_components: likeness.components, whiten: false };
    let projected = Pca::fit(&all, &params)?.apply(&all)?;
    let mut start = 0;
    let cloud = |((dataset, is_real), n): (&(Arc<Dataset>, bool), usize)| {
        let shape = (n, likeness.components);
        let points = Array2::from_shape_fn(shape, |(row, component)| {
            f64::from(projected.view()[[start + row, component]])
        });
        start += n;
        Cloud { name: dataset.name.clone(), is_real: *is_real, points }
    };
    Ok(Some(sets.iter().zip(lengths).map(cloud).collect()))
}

fn evenly(images: &[PathBuf], n: usize) -> Vec<PathBuf> {
    let n = n.min(images.len());
    (0..n).map(|index| images[index * images.len() / n].clone()).collect()
}

/// All are measured, also those among generated sets: the components and the unit of length are those
/// of all sets together, real ones among them.
fn report(table: &mut Table, column: &str, clouds: &[Cloud]) {
    let scale = spread(clouds);
    let mut of_kind: [Vec<f64>; 3] = Default::default();
    for (first, a) in clouds.iter().enumerate() {
        for b in &clouds[first + 1..] {
            let kind = match (a.is_real, b.is_real) {
                (true, true) => 0,
                (false, false) => 1,
                _ => 2,
            };
            of_kind[kind].push(frechet(&a.points, &b.points) / scale);
        }
    }
    let kinds = ["real to real", "generated to generated", "real to generated"];
    for (kind, distances) in kinds.into_iter().zip(&of_kind) {
        let row = format!("likeness: Fréchet distance, {kind}");
        if distances.is_empty() {
            table.push(Cell::absent(row, column, "fewer than two such sets at hand"));
            continue;
        }
        let mean = distances.iter().sum::<f64>() / distances.len() as f64;
        let (low, high) = distances
            .iter()
            .fold((f64::INFINITY, 0.0_f64), |(low, high), &it| (low.min(it), high.max(it)));
        let note = format!(
            "mean over pairs of sets, {low:.3} to {high:.3}, in units of the pooled standard deviation"
        );
        table.push(Cell::new(row, column, mean, Provenance::Measured, distances.len()).noted(note));
    }
    let (share, chance) = same_kind(clouds);
    let n = clouds.iter().map(|cloud| cloud.points.nrows()).sum();
    let note = format!(
        "of images whose nearest neighbour in another set is of their own kind, real or generated; {chance:.3} if kinds could not be told apart"
    );
    let row = "likeness: share told apart by the nearest other set";
    table.push(Cell::new(row, column, share, Provenance::Measured, n).noted(note));
}

/// Root of the total variance of all points together.
fn spread(clouds: &[Cloud]) -> f64 {
    let points = || clouds.iter().flat_map(|cloud| cloud.points.rows());
    let n = points().count().max(1) as f64;
    let dim = clouds.first().map_or(0, |cloud| cloud.points.ncols());
    let variance = |component: usize| {
        let mean = points().map(|point| point[component]).sum::<f64>() / n;
        points().map(|point| (point[component] - mean).powi(2)).sum::<f64>() / n
    };
    (0..dim).map(variance).sum::<f64>().sqrt()
}

/// Fréchet distance of the normal distributions fitted to two sets (Dowson and Landau 1982).
fn frechet(a: &Array2<f64>, b: &Array2<f64>) -> f64 {
    let ((mean_a, a), (mean_b, b)) = (moments(a), moments(b));
    let root = square_root(&a);
    let cross = square_root(&(&root * &b * &root));
    let squared = (mean_a - mean_b).norm_squared() + a.trace() + b.trace() - 2.0 * cross.trace();
    squared.max(0.0).sqrt()
}

fn moments(points: &Array2<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let (n, dim) = points.dim();
    let matrix = DMatrix::from_fn(n, dim, |row, column| points[[row, column]]);
    let mean = matrix.row_mean().transpose();
    let centred = DMatrix::from_fn(n, dim, |row, column| points[[row, column]] - mean[column]);
    let covariance = centred.transpose() * centred / (n.max(2) as f64 - 1.0);
    (mean, covariance)
}

/// The root of a symmetric positive semi-definite matrix.
fn square_root(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let symmetric = (matrix + matrix.transpose()) * 0.5;
    let eigen = symmetric.symmetric_eigen();
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    &eigen.eigenvectors * DMatrix::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}

/// Share of images whose nearest neighbour among the other sets is of their kind, and what that
/// share would be if neighbours were drawn at random.
fn same_kind(clouds: &[Cloud]) -> (f64, f64) {
    let (mut n_same, mut n, mut chance) = (0.0, 0.0, 0.0);
    for (own, cloud) in clouds.iter().enumerate() {
        let others = || clouds.iter().enumerate().filter(move |(other, _)| *other != own);
        let size = |cloud: &Cloud| cloud.points.nrows() as f64;
        let total: f64 = others().map(|(_, other)| size(other)).sum();
        let alike: f64 = others()
            .filter(|(_, other)| other.is_real == cloud.is_real)
            .map(|(_, other)| size(other))
            .sum();
        for point in cloud.points.rows() {
            let distances = others().flat_map(|(_, other)| {
                let distance = |row: ndarray::ArrayView1<'_, f64>| {
                    row.iter().zip(&point).map(|(a, b)| (a - b).powi(2)).sum::<f64>()
                };
                other.points.rows().into_iter().map(move |row| (distance(row), other.is_real))
            });
            let nearest = distances.min_by(|a, b| a.0.total_cmp(&b.0));
            n += 1.0;
            n_same += f64::from(nearest.is_some_and(|(_, is_real)| is_real == cloud.is_real));
            chance += alike / total;
        }
    }
    (n_same / n, chance / n)
}

fn panel(column: &str, clouds: &[Cloud]) -> Panel {
    let curve = |cloud: &Cloud| {
        let name =
            if cloud.is_real { format!("{} (real)", cloud.name) } else { cloud.name.clone() };
        let points = cloud.points.rows().into_iter().map(|point| (point[0], point[1])).collect();
        Curve::new(name, points).shaped(Shape::Points)
    };
    Panel {
        title: format!("{column} of real and generated places"),
        x_label: "first principal component".into(),
        y_label: "second".into(),
        curves: clouds.iter().map(curve).collect(),
        ..Panel::default()
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn normals_that_are_shifted_or_widened_have_known_distances() {
        // Variance 2/3·... of the corners of a square: equal in both directions, uncorrelated.
        let square = array![[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
        let shifted = &square + &array![[3.0, 4.0]];
        assert!(frechet(&square, &square) < 1e-9);
        assert!((frechet(&square, &shifted) - 5.0).abs() < 1e-9);
        // Twice as wide: both standard deviations differ by √(4/3).
        let distance = frechet(&square, &(2.0 * &square));
        assert!((distance - (2.0 * 4.0 / 3.0_f64).sqrt()).abs() < 1e-9, "{distance}");
    }

    #[test]
    fn kinds_far_apart_are_told_apart_and_mixed_ones_are_not() {
        let cloud = |is_real, at: f64| Cloud {
            name: String::new(),
            is_real,
            points: array![[at, 0.0], [at + 1.0, 0.0]],
        };
        let apart = [cloud(true, 0.0), cloud(true, 0.2), cloud(false, 90.0), cloud(false, 90.3)];
        let (share, chance) = same_kind(&apart);
        assert!((share - 1.0).abs() < 1e-12 && (chance - 1.0 / 3.0).abs() < 1e-12);
        let crossed = [cloud(true, 0.0), cloud(false, 0.1), cloud(true, 50.0), cloud(false, 50.1)];
        assert!(same_kind(&crossed).0 < 1e-12);
    }

    #[test]
    fn images_are_taken_evenly() {
        let images: Vec<PathBuf> = (0..10).map(|n| PathBuf::from(n.to_string())).collect();
        assert_eq!(evenly(&images, 4), ["0", "2", "5", "7"].map(PathBuf::from));
        assert_eq!(evenly(&images, 99).len(), 10);
    }
}
