//! Peaks of a plane of scores.

use ndarray::Array2;
use vpr_core::{Descriptors, Result};
use vpr_vision::features::{LocalDescriptors, LocalFeatures};

use super::map::Plane;

/// A pixel that is a peak.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Peak {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) score: f32,
}

/// Features of these peaks. `rows` holds `dim` values per peak, which are scaled to unit length;
/// `scale` takes columns and rows of the plane to pixels of the image.
///
/// # Errors
///
/// [`vpr_core::Error::NotFinite`] if the network gave NaN.
pub(super) fn described(
    peaks: &[Peak],
    rows: Vec<f32>,
    dim: usize,
    scale: [f32; 2],
) -> Result<LocalFeatures> {
    let rows = Array2::from_shape_vec((peaks.len(), dim), rows).expect("one row per peak");
    LocalFeatures::new(
        peaks.iter().map(|it| [it.x as f32 * scale[0], it.y as f32 * scale[1]]).collect(),
        peaks.iter().map(|it| it.score).collect(),
        LocalDescriptors::Float(Descriptors::new(rows)?.normalized()),
    )
}

/// Pixels above `threshold` that are the maximum of their window, in raster order. Windows reach `radius` pixels and
/// end where the image does; equal maxima are all peaks.
pub(super) fn maxima(plane: &Plane, radius: usize, threshold: f32) -> Vec<Peak> {
    let highest = window_maxima(plane, radius);
    let is_peak = |at: usize| plane.values[at] == highest.values[at];
    pixels(plane, |at| plane.values[at] > threshold && is_peak(at))
}

/// Pixels above `threshold` that are greater than all others of their window, in raster order. Only pixels whose whole
/// window is inside of the image can be.
pub(super) fn strict_maxima(plane: &Plane, radius: usize, threshold: f32) -> Vec<Peak> {
    let Plane { height, width, .. } = *plane;
    let alone = |x: usize, y: usize, score: f32| {
        (y - radius..=y + radius).all(|row| {
            (x - radius..=x + radius)
                .all(|column| (column == x && row == y) || score > plane.at(column, row))
        })
    };
    let inside = |at: usize, len: usize| at >= radius && at + radius < len;
    maxima(plane, radius, threshold)
        .into_iter()
        .filter(|it| inside(it.x, width) && inside(it.y, height) && alone(it.x, it.y, it.score))
        .collect()
}

/// Maxima of their window, then twice the maxima of what no window of an earlier one covers, as the released
/// SuperPoint suppresses. All in raster order.
pub(super) fn repeated_maxima(plane: &Plane, radius: usize, threshold: f32) -> Vec<Peak> {
    let highest = window_maxima(plane, radius);
    let mut peaks: Vec<bool> =
        plane.values.iter().zip(&highest.values).map(|(value, high)| value == high).collect();
    for _ in 0..2 {
        let marks = peaks.iter().map(|&peak| f32::from(u8::from(peak))).collect();
        let covered = window_maxima(&Plane { values: marks, ..*plane }, radius);
        let rest = plane.values.iter().zip(&covered.values);
        let rest = rest.map(|(&value, &mark)| if mark > 0.0 { 0.0 } else { value }).collect();
        let rest = Plane { values: rest, ..*plane };
        let highest = window_maxima(&rest, radius);
        for (at, peak) in peaks.iter_mut().enumerate() {
            *peak |= rest.values[at] == highest.values[at] && covered.values[at] == 0.0;
        }
    }
    pixels(plane, |at| peaks[at] && plane.values[at] > threshold)
}

/// The `n` strongest, in raster order; ties by raster order. All if there are not more.
pub(super) fn strongest(peaks: &[Peak], n: usize) -> Vec<Peak> {
    let mut order = by_score(peaks);
    order.truncate(n);
    order.sort_unstable();
    order.into_iter().map(|index| peaks[index]).collect()
}

/// Indices from the strongest to the weakest; ties by lower index.
pub(super) fn by_score(peaks: &[Peak]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..peaks.len()).collect();
    order.sort_by(|&a, &b| peaks[b].score.total_cmp(&peaks[a].score));
    order
}

fn pixels(plane: &Plane, wanted: impl Fn(usize) -> bool) -> Vec<Peak> {
    let of = |at: usize| Peak { x: at % plane.width, y: at / plane.width, score: plane.values[at] };
    (0..plane.values.len()).filter(|&at| wanted(at)).map(of).collect()
}

/// The maximum of the window around each pixel; windows end where the image does.
fn window_maxima(plane: &Plane, radius: usize) -> Plane {
    let Plane { height, width, .. } = *plane;
    let mut rows = plane.values.clone();
    if width > 0 {
        for (from, to) in plane.values.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
            for shift in 1..=radius.min(width - 1) {
                raise(&mut to[..width - shift], &from[shift..]);
                raise(&mut to[shift..], &from[..width - shift]);
            }
        }
    }
    let mut both = rows.clone();
    for shift in 1..=radius.min(height.saturating_sub(1)) {
        let (moved, kept) = (shift * width, (height - shift) * width);
        raise(&mut both[..kept], &rows[moved..]);
        raise(&mut both[moved..], &rows[..kept]);
    }
    Plane { values: both, height, width }
}

fn raise(to: &mut [f32], by: &[f32]) {
    for (to, &by) in to.iter_mut().zip(by) {
        *to = if by > *to { by } else { *to };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(rows: &[&[u8]]) -> Plane {
        let values = rows.iter().flat_map(|row| row.iter().map(|&it| f32::from(it))).collect();
        Plane { values, height: rows.len(), width: rows[0].len() }
    }

    fn places(peaks: &[Peak]) -> Vec<(usize, usize)> {
        peaks.iter().map(|it| (it.x, it.y)).collect()
    }

    #[test]
    fn windows_end_where_the_image_does() {
        let image = plane(&[&[9, 1, 1, 1], &[1, 1, 1, 5], &[1, 7, 1, 1], &[1, 1, 1, 1]]);
        assert_eq!(places(&maxima(&image, 1, 1.0)), [(0, 0), (3, 1), (1, 2)]);
        assert_eq!(places(&strict_maxima(&image, 1, 1.0)), [(1, 2)]);
        assert_eq!(places(&maxima(&image, 9, 1.0)), [(0, 0)]);
    }

    #[test]
    fn plateaus_have_no_strict_maximum() {
        let image = plane(&[&[0, 0, 0, 0], &[0, 4, 4, 0], &[0, 0, 0, 0]]);
        assert_eq!(places(&maxima(&image, 1, 0.0)), [(1, 1), (2, 1)]);
        assert_eq!(places(&strict_maxima(&image, 1, 0.0)), []);
    }

    #[test]
    fn what_no_window_covers_is_searched_again() {
        // 8 hides 7 from the first pass, but its window does not cover 6.
        let image = plane(&[&[8, 7, 6, 0, 0]]);
        assert_eq!(places(&maxima(&image, 1, 0.0)), [(0, 0)]);
        assert_eq!(places(&repeated_maxima(&image, 1, 0.0)), [(0, 0), (2, 0)]);
    }

    #[test]
    fn the_strongest_keep_their_order() {
        let image = plane(&[&[3, 0, 5, 0, 3, 0, 4]]);
        let peaks = maxima(&image, 1, 0.0);
        assert_eq!(places(&strongest(&peaks, 3)), [(0, 0), (2, 0), (6, 0)]);
        assert_eq!(strongest(&peaks, 9).len(), 4);
        assert_eq!(by_score(&peaks), [1, 3, 0, 2]);
    }
}
