//! Linear algebra of small matrices.

use super::geometry::Matrix;

/// aᵀ b.
pub(super) fn transpose_times(a: &Matrix, b: &Matrix) -> Matrix {
    let entry = |i: usize, j: usize| a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[2][i] * b[2][j];
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)))
}

/// a b.
pub(super) fn product(a: &Matrix, b: &Matrix) -> Matrix {
    a.map(|row| [0, 1, 2].map(|j| row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]))
}

/// Moves a centroid to 0 and scales the mean distance from it to √2 (Hartley 1997).
#[derive(Clone, Copy)]
pub(super) struct Normalization {
    scale: f64,
    center: [f64; 2],
}

pub(super) fn hartley(points: impl ExactSizeIterator<Item = [f64; 2]> + Clone) -> Normalization {
    let n = points.len() as f64;
    let sum = points.clone().fold([0.0, 0.0], |sum, it| [sum[0] + it[0], sum[1] + it[1]]);
    let center = sum.map(|it| it / n);
    let distance = |[x, y]: [f64; 2]| {
        let (x, y) = (x - center[0], y - center[1]);
        (x * x + y * y).sqrt()
    };
    let mean = points.map(distance).sum::<f64>() / n;
    let scale = if mean > 1e-12 { std::f64::consts::SQRT_2 / mean } else { 1.0 };
    Normalization { scale, center }
}

impl Normalization {
    pub(super) fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [(x - self.center[0]) * self.scale, (y - self.center[1]) * self.scale]
    }

    pub(super) fn matrix(&self) -> Matrix {
        let Self { scale, center: [x, y] } = *self;
        [[scale, 0.0, -scale * x], [0.0, scale, -scale * y], [0.0, 0.0, 1.0]]
    }

    pub(super) fn inverse(&self) -> Matrix {
        let Self { scale, center: [x, y] } = *self;
        [[1.0 / scale, 0.0, x], [0.0, 1.0 / scale, y], [0.0, 0.0, 1.0]]
    }
}

/// Of a symmetric matrix the unit vector to its smallest eigenvalue, the first of equals, by Jacobi's rotations
/// (Golub & Van Loan 2013, section 8.5).
pub(super) fn smallest_eigenvector<const N: usize>(mut a: [[f64; N]; N]) -> [f64; N] {
    // Rows of `vectors` are the eigenvectors.
    let mut vectors = [[0.0; N]; N];
    for (at, row) in vectors.iter_mut().enumerate() {
        row[at] = 1.0;
    }
    let trace: f64 = (0..N).map(|at| a[at][at].abs()).sum();
    // Sweeps converge quadratically: about 8 for N = 9.
    for _ in 0..30 {
        let mut largest = 0.0_f64;
        for p in 0..N {
            for q in p + 1..N {
                largest = largest.max(a[p][q].abs());
                rotate(&mut a, &mut vectors, p, q);
            }
        }
        if largest <= 1e-17 * trace {
            break;
        }
    }
    let smaller = |best: usize, at: usize| if a[at][at] < a[best][best] { at } else { best };
    vectors[(1..N).fold(0, smaller)]
}

/// The rotation of axes p and q that makes their entry 0.
fn rotate<const N: usize>(a: &mut [[f64; N]; N], vectors: &mut [[f64; N]; N], p: usize, q: usize) {
    let off = a[p][q];
    if off.abs() < f64::MIN_POSITIVE {
        return;
    }
    let half = 0.5 * (a[q][q] - a[p][p]) / off;
    let tangent = half.signum() / (half.abs() + (half * half + 1.0).sqrt());
    let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
    let sine = tangent * cosine;
    let turn = |x: &mut f64, y: &mut f64| {
        (*x, *y) = (cosine * *x - sine * *y, sine * *x + cosine * *y);
    };
    // p < q
    let (front, rear) = a.split_at_mut(q);
    front[p].iter_mut().zip(&mut rear[0]).for_each(|(x, y)| turn(x, y));
    for row in a.iter_mut() {
        let (front, rear) = row.split_at_mut(q);
        turn(&mut front[p], &mut rear[0]);
    }
    (a[p][q], a[q][p]) = (0.0, 0.0);
    let (front, rear) = vectors.split_at_mut(q);
    front[p].iter_mut().zip(&mut rear[0]).for_each(|(x, y)| turn(x, y));
}

/// An orthonormal basis of the `M` = 9 − `N` dimensions orthogonal to rows, by Householder's reflections with
/// pivoting, and the smallest pivot over the largest, which is about 0 if the rows are dependent.
pub(super) fn orthogonal_complement<const N: usize, const M: usize>(
    mut rows: [[f64; 9]; N],
) -> ([[f64; 9]; M], f64) {
    let mut mirrors = [[0.0; 9]; N];
    let mut pivots = [0.0; N];
    for k in 0..N {
        let length = |row: &[f64; 9]| row[k..].iter().map(|it| it * it).sum::<f64>();
        let longest = (k..N)
            .fold(k, |best, at| if length(&rows[at]) > length(&rows[best]) { at } else { best });
        rows.swap(k, longest);
        let norm = length(&rows[k]).sqrt();
        pivots[k] = norm;
        // The normal has the squared length 2 norm (norm + |leading|), and is scaled to 2.
        let mirror = &mut mirrors[k];
        mirror[k..].copy_from_slice(&rows[k][k..]);
        let leading = mirror[k];
        mirror[k] += if leading < 0.0 { -norm } else { norm };
        let squared = norm * (norm + leading.abs());
        if squared < f64::MIN_POSITIVE {
            *mirror = [0.0; 9];
            continue;
        }
        let scale = 1.0 / squared.sqrt();
        for it in mirror.iter_mut() {
            *it *= scale;
        }
        rows[k + 1..].iter_mut().for_each(|row| reflect(row, &mirrors[k]));
    }
    let mut basis = [[0.0; 9]; M];
    for (at, vector) in basis.iter_mut().enumerate() {
        vector[N + at] = 1.0;
        mirrors.iter().rev().for_each(|mirror| reflect(vector, mirror));
    }
    (basis, pivots[N - 1] / pivots[0])
}

/// The mirror image: less twice the part along a normal, whose squared length is 2.
fn reflect(vector: &mut [f64; 9], normal: &[f64; 9]) {
    let along: f64 = vector.iter().zip(normal).map(|(a, b)| a * b).sum();
    vector.iter_mut().zip(normal).for_each(|(it, normal)| *it -= along * normal);
}
