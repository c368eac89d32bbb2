//! Plane-to-plane mappings.

use super::{
    Correspondence,
    algebra::{hartley, product, smallest_eigenvector},
    geometry::{Geometry, Matrix},
};

/// Reference = model · query.
pub(super) struct Homography;

impl Geometry for Homography {
    const SAMPLE: usize = 4;

    /// No three points on a line in either image, and every triangle keeps its orientation, or every one changes it.
    #[inline]
    fn is_fair(sample: &[Correspondence]) -> bool {
        const TRIANGLES: [[usize; 3]; 4] = [[0, 1, 2], [1, 2, 3], [0, 2, 3], [0, 1, 3]];
        let mut turned = 0;
        for triangle in TRIANGLES {
            let before = area(triangle.map(|corner| sample[corner].query));
            let after = area(triangle.map(|corner| sample[corner].reference));
            if before.abs() < FLAT || after.abs() < FLAT {
                return false;
            }
            turned += usize::from(before * after < 0.0);
        }
        turned == 0 || turned == TRIANGLES.len()
    }

    fn fit(sample: &[Correspondence], models: &mut Vec<Matrix>) {
        if let &[a, b, c, d] = sample {
            models.extend(normalized(of_quad([a, b, c, d])));
        }
    }

    fn refit(inliers: &[Correspondence], models: &mut Vec<Matrix>) {
        models.extend(nearest(inliers));
    }

    #[inline(always)]
    fn explains(model: &Matrix, x: f64, y: f64, u: f64, v: f64, below: f64) -> bool {
        let [p, q, w] = model.map(|row| row[0] * x + row[1] * y + row[2]);
        let (across, down) = (p - u * w, q - v * w);
        across * across + down * down < below * (w * w)
    }
}

/// Triangles of less area, in square pixels, are flat.
const FLAT: f64 = 1e-3;

fn area([a, b, c]: [[f64; 2]; 3]) -> f64 {
    0.5 * cross(minus(b, a), minus(c, a))
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn minus(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// The mapping of four correspondences, in closed form.
///
/// With the first point of either image as origin, A q = w r with w = 1 + g · q. The fourth point is s q₁ + t q₂ in one
/// image and s′ r₁ + t′ r₂ in the other, whence s w₁ = s′ w₃, t w₂ = t′ w₃, and w₃ = (1 − s − t) / (1 − s′ − t′). These
/// are ratios of areas of triangles: as sound as the sample is fair.
fn of_quad([origin, a, b, c]: [Correspondence; 4]) -> Matrix {
    let [q1, q2, q3] = [a, b, c].map(|it| minus(it.query, origin.query));
    let [r1, r2, r3] = [a, b, c].map(|it| minus(it.reference, origin.reference));
    let (square, s, t) = (cross(q1, q2), cross(q3, q2), cross(q1, q3));
    let (s_r, t_r) = (cross(r3, r2), cross(r1, r3));
    // What s and t here lack, a division by [q₁ q₂], and s′ and t′ by [r₁ r₂], cancels.
    let rest = cross(minus(q1, q3), minus(q2, q3)) / cross(minus(r1, r3), minus(r2, r3));
    let (w1, w2) = (s_r / s * rest, t_r / t * rest);
    // Columns · [q₁ q₂]⁻¹, for a row of them.
    let unmix = |one: f64, two: f64| {
        [(one * q2[1] - two * q1[1]) / square, (two * q1[0] - one * q2[0]) / square]
    };
    let g = unmix(w1 - 1.0, w2 - 1.0);
    let back = 1.0 - g[0] * origin.query[0] - g[1] * origin.query[1];
    let row = |axis: usize| {
        let [x, y] = unmix(w1 * r1[axis], w2 * r2[axis]);
        let moved = origin.reference[axis];
        let shifted = moved - x * origin.query[0] - y * origin.query[1];
        let [gx, gy] = g.map(|it| it * moved);
        [x + gx, y + gy, shifted - gx * origin.query[0] - gy * origin.query[1]]
    };
    [row(0), row(1), [g[0], g[1], back]]
}

/// The mapping nearest to correspondences in the algebraic sense: direct linear transformation of normalised points
/// (Hartley & Zisserman 2004, algorithm 4.2).
pub(super) fn nearest(points: &[Correspondence]) -> Option<Matrix> {
    let query = hartley(points.iter().map(|it| it.query));
    let reference = hartley(points.iter().map(|it| it.reference));
    let mut squares = [[0.0; 9]; 9];
    for it in points {
        let ([x, y], [u, v]) = (query.apply(it.query), reference.apply(it.reference));
        let rows = [
            [x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y, -u],
            [0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y, -v],
        ];
        for row in rows {
            for (sums, &a) in squares.iter_mut().zip(&row) {
                for (sum, &b) in sums.iter_mut().zip(&row) {
                    *sum += a * b;
                }
            }
        }
    }
    let [a, b, c, d, e, f, g, h, i] = smallest_eigenvector(squares);
    let model = product(&[[a, b, c], [d, e, f], [g, h, i]], &query.matrix());
    normalized(product(&reference.inverse(), &model))
}

/// The model with 1 in the corner; `None` if it is not finite or flattens the plane.
fn normalized(model: Matrix) -> Option<Matrix> {
    let model = model.map(|row| row.map(|it| it / model[2][2]));
    let [[a, b, c], [d, e, f], [g, h, i]] = model;
    let volume = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
    (volume.abs() >= 1e-8 && model.as_flattened().iter().all(|it| it.is_finite())).then_some(model)
}
