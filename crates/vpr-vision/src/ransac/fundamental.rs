//! Epipolar geometry of uncalibrated images.

use super::{
    Correspondence,
    algebra::{
        Normalization, hartley, orthogonal_complement, product, smallest_eigenvector,
        transpose_times,
    },
    geometry::{Geometry, Matrix},
};

/// Referenceᵀ · model · query = 0.
pub(super) struct Fundamental;

impl Geometry for Fundamental {
    const SAMPLE: usize = 8;

    /// The normalised eight-point method (Hartley 1997).
    fn fit(sample: &[Correspondence], models: &mut Vec<Matrix>) {
        let Ok(sample) = <&[Correspondence; 8]>::try_from(sample) else { return };
        let frames = frames(sample);
        let rows = sample.map(|it| frames.equation(&it));
        let ([null], _) = orthogonal_complement(rows);
        models.extend(frames.model(null));
    }

    /// The same of all in the sense of least squares.
    fn refit(inliers: &[Correspondence], models: &mut Vec<Matrix>) {
        let frames = frames(inliers);
        let mut squares = [[0.0; 9]; 9];
        for it in inliers {
            let row = frames.equation(it);
            for (sums, &a) in squares.iter_mut().zip(&row) {
                for (sum, &b) in sums.iter_mut().zip(&row) {
                    *sum += a * b;
                }
            }
        }
        models.extend(frames.model(smallest_eigenvector(squares)));
    }

    #[inline(always)]
    fn explains(model: &Matrix, x: f64, y: f64, u: f64, v: f64, below: f64) -> bool {
        is_near_epipolar(model, x, y, u, v, below)
    }
}

/// Whether the Sampson distance, squared, is below a bound.
#[inline(always)]
pub(super) fn is_near_epipolar(m: &Matrix, x: f64, y: f64, u: f64, v: f64, below: f64) -> bool {
    let [a, b, c] = m.map(|row| row[0] * x + row[1] * y + row[2]);
    let d = m[0][0] * u + m[1][0] * v + m[2][0];
    let e = m[0][1] * u + m[1][1] * v + m[2][1];
    let off = a * u + b * v + c;
    let slope = a * a + b * b + d * d + e * e;
    // At both epipoles there is no direction to measure in.
    let slope = if slope > 1e-12 { slope } else { 1.0 };
    off * off < below * slope
}

/// The equation that a correspondence is for the nine entries of a model.
pub(super) fn equation([x, y]: [f64; 2], [u, v]: [f64; 2]) -> [f64; 9] {
    [u * x, u * y, u, v * x, v * y, v, x, y, 1.0]
}

/// Frames in which the points of either image are near 1.
struct Frames {
    query: Normalization,
    reference: Normalization,
}

fn frames(points: &[Correspondence]) -> Frames {
    Frames {
        query: hartley(points.iter().map(|it| it.query)),
        reference: hartley(points.iter().map(|it| it.reference)),
    }
}

impl Frames {
    fn equation(&self, it: &Correspondence) -> [f64; 9] {
        equation(self.query.apply(it.query), self.reference.apply(it.reference))
    }

    /// In pixels, of rank 2: less the part along the direction that is mapped nearest to 0.
    fn model(&self, [a, b, c, d, e, f, g, h, i]: [f64; 9]) -> Option<Matrix> {
        let full = [[a, b, c], [d, e, f], [g, h, i]];
        let lost = smallest_eigenvector(transpose_times(&full, &full));
        let flat = full.map(|row| {
            let along = row[0] * lost[0] + row[1] * lost[1] + row[2] * lost[2];
            [0, 1, 2].map(|at| row[at] - along * lost[at])
        });
        let model =
            product(&transpose_times(&self.reference.matrix(), &flat), &self.query.matrix());
        model.as_flattened().iter().all(|it| it.is_finite()).then_some(model)
    }
}
