//! Epipolar geometry of calibrated images, by the five-point method (Nistér 2004).

use super::{
    Correspondence,
    algebra::orthogonal_complement,
    fundamental::{equation, is_near_epipolar},
    geometry::{Geometry, Matrix},
    polynomial::real_roots,
};

/// Referenceᵀ · model · query = 0, for points at focal length 1.
pub(super) struct Essential;

impl Geometry for Essential {
    const SAMPLE: usize = 5;

    fn fit(sample: &[Correspondence], models: &mut Vec<Matrix>) {
        let Ok(sample) = <&[Correspondence; 5]>::try_from(sample) else { return };
        let rows = sample.map(|it| equation(it.query, it.reference));
        let (basis, independence) = orthogonal_complement(rows);
        if independence > 1e-8 {
            of_basis(&basis, models);
        }
    }

    /// One more sample, the first five: there is no linear method for all.
    fn refit(inliers: &[Correspondence], models: &mut Vec<Matrix>) {
        Self::fit(&inliers[..Self::SAMPLE], models);
    }

    #[inline(always)]
    fn explains(model: &Matrix, x: f64, y: f64, u: f64, v: f64, below: f64) -> bool {
        is_near_epipolar(model, x, y, u, v, below)
    }
}

/// Of x, y, z and 1.
type Linear = [f64; 4];
/// Of x², xy, xz, x, y², yz, y, z², z and 1.
type Quadratic = [f64; 10];
/// Of x³, y³, x²y, xy², x²z, x², y²z, y², xyz, xy, xz², xz, x, yz², yz, y, z³, z², z and 1: Nistér's order.
type Cubic = [f64; 20];

/// Where products of linear terms are among quadratic ones.
const SQUARES: [[usize; 4]; 4] = [[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]];
/// Where products of quadratic and linear terms are among cubic ones.
const CUBES: [[usize; 4]; 10] = [
    [0, 2, 4, 5],
    [2, 3, 8, 9],
    [4, 8, 10, 11],
    [5, 9, 11, 12],
    [3, 1, 6, 7],
    [8, 6, 13, 14],
    [9, 7, 14, 15],
    [10, 13, 16, 17],
    [11, 14, 17, 18],
    [12, 15, 18, 19],
];

fn add_square(sum: &mut Quadratic, factor: f64, a: &Linear, b: &Linear) {
    for (a, places) in a.iter().zip(&SQUARES) {
        for (b, &place) in b.iter().zip(places) {
            sum[place] += factor * a * b;
        }
    }
}

fn add_cube(sum: &mut Cubic, a: &Quadratic, b: &Linear) {
    for (a, places) in a.iter().zip(&CUBES) {
        for (b, &place) in b.iter().zip(places) {
            sum[place] += a * b;
        }
    }
}

/// Essential matrices among x X + y Y + z Z + W.
fn of_basis(basis: &[[f64; 9]; 4], models: &mut Vec<Matrix>) {
    let Some(reduced) = reduced(constraints(basis)) else { return };
    // Rows 4 to 9 begin with x²z, x², y²z, y², xyz and xy. A row less z times the next has no such term left, and is
    // linear in x and y with polynomials of z, from the constant up.
    let rows = [4, 6, 8].map(|at| {
        let (a, b) = (&reduced[at], &reduced[at + 1]);
        let less = |from: usize| -> [f64; 4] {
            [a[from + 2], a[from + 1] - b[from + 2], a[from] - b[from + 1], -b[from]]
        };
        let last = [a[19], a[18] - b[19], a[17] - b[18], a[16] - b[17], -b[16]];
        (less(10), less(13), last)
    });
    for z in real_roots(&determinant(&rows)) {
        let at = rows.map(|(x, y, last)| [value(&x, z), value(&y, z), value(&last, z)]);
        let Some([x, y, one]) = null_vector(&at) else { continue };
        let factors = [x, y, z * one, one];
        let entry = |at: usize| (0..4).map(|of| factors[of] * basis[of][at]).sum::<f64>();
        let model = [0, 3, 6].map(|row| [0, 1, 2].map(|column| entry(row + column)));
        let size = model.as_flattened().iter().map(|it| it * it).sum::<f64>().sqrt();
        let model = model.map(|row| row.map(|it| it / size));
        if model.as_flattened().iter().all(|it| it.is_finite()) {
            models.push(model);
        }
    }
}

/// det E = 0 and (E Eᵀ − ½ tr(E Eᵀ)) E = 0.
fn constraints(basis: &[[f64; 9]; 4]) -> [Cubic; 10] {
    let entry = |i: usize, j: usize| -> Linear { [0, 1, 2, 3].map(|of| basis[of][3 * i + j]) };
    let e = [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)));
    let mut gram = [[[0.0; 10]; 3]; 3];
    for (i, row) in gram.iter_mut().enumerate() {
        for (j, sum) in row.iter_mut().enumerate() {
            (0..3).for_each(|k| add_square(sum, 1.0, &e[i][k], &e[j][k]));
        }
    }
    let half: Quadratic =
        std::array::from_fn(|at| 0.5 * (gram[0][0][at] + gram[1][1][at] + gram[2][2][at]));
    for (i, row) in gram.iter_mut().enumerate() {
        row[i].iter_mut().zip(&half).for_each(|(it, half)| *it -= half);
    }
    let mut all = [[0.0; 20]; 10];
    for (row, sum) in all[..9].iter_mut().enumerate() {
        let (i, j) = (row / 3, row % 3);
        (0..3).for_each(|k| add_cube(sum, &gram[i][k], &e[k][j]));
    }
    for column in 0..3 {
        let (next, last) = ((column + 1) % 3, (column + 2) % 3);
        let mut minor = [0.0; 10];
        add_square(&mut minor, 1.0, &e[1][next], &e[2][last]);
        add_square(&mut minor, -1.0, &e[1][last], &e[2][next]);
        add_cube(&mut all[9], &minor, &e[0][column]);
    }
    all
}

/// The first ten columns made the identity, by Gauss and Jordan with partial pivoting; `None` if they cannot be.
fn reduced(mut rows: [Cubic; 10]) -> Option<[Cubic; 10]> {
    for at in 0..10 {
        let larger = |best: usize, row: usize| {
            if rows[row][at].abs() > rows[best][at].abs() { row } else { best }
        };
        let pivot = (at + 1..10).fold(at, larger);
        rows.swap(at, pivot);
        let leading = rows[at][at];
        if leading.is_nan() || leading.abs() < 1e-12 {
            return None;
        }
        rows[at].iter_mut().for_each(|it| *it /= leading);
        let own = rows[at];
        for (row, values) in rows.iter_mut().enumerate() {
            // Rows above the fifth are not looked at again.
            if row != at && (row > at || row >= 4) {
                let factor = values[at];
                values.iter_mut().zip(&own).for_each(|(it, own)| *it -= factor * own);
            }
        }
    }
    Some(rows)
}

type Row = ([f64; 4], [f64; 4], [f64; 5]);

/// A polynomial of degree 10, from the constant up.
fn determinant([a, b, c]: &[Row; 3]) -> [f64; 11] {
    let mut sum = [0.0; 11];
    for ((x, _, _), (_, y, last), (_, y_2, last_2)) in [(a, b, c), (b, c, a), (c, a, b)] {
        let mut minor = [0.0; 8];
        add_product(&mut minor, 1.0, y, last_2);
        add_product(&mut minor, -1.0, y_2, last);
        add_product(&mut sum, 1.0, x, &minor);
    }
    sum
}

fn add_product(sum: &mut [f64], factor: f64, a: &[f64], b: &[f64]) {
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            sum[i + j] += factor * a * b;
        }
    }
}

fn value(polynomial: &[f64], at: f64) -> f64 {
    polynomial.iter().rev().fold(0.0, |sum, it| sum * at + it)
}

/// What is orthogonal to the two rows of a singular matrix that are least parallel.
fn null_vector([a, b, c]: &Matrix) -> Option<[f64; 3]> {
    let cross = |a: &[f64; 3], b: &[f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let squared = |it: &[f64; 3]| it.iter().map(|it| it * it).sum::<f64>();
    let candidates = [cross(a, b), cross(b, c), cross(c, a)];
    let longest = candidates
        .into_iter()
        .reduce(|best, it| if squared(&it) > squared(&best) { it } else { best })?;
    (squared(&longest) > 0.0).then_some(longest)
}
