//! Matches as a picture.

use kornia_image::ImageSize;
use kornia_imgproc::draw::draw_line;
use vpr_core::{Error, Result};

use super::Match;
use crate::{features::LocalFeatures, image::RgbImage};

/// Keypoints without a match.
const KEYPOINT: [u8; 3] = [255, 220, 60];
/// Matches that the geometry explains, and those it does not.
const INLIER: [u8; 3] = [60, 220, 90];
const OUTLIER: [u8; 3] = [230, 60, 60];

/// Both images side by side, keypoints as crosses, matches as lines: inliers green and on top, others red.
///
/// # Errors
///
/// [`Error::Mismatch`] if there is not one entry of `inliers` per match, [`Error::OutOfRange`] if a match names a
/// feature that is not there, [`Error::Parameter`] if an image has no pixels.
pub fn draw(
    images: [&RgbImage; 2],
    features: [&LocalFeatures; 2],
    matches: &[Match],
    inliers: &[bool],
) -> Result<RgbImage> {
    if inliers.len() != matches.len() {
        let (expected, actual) = (matches.len(), inliers.len());
        return Err(Error::Mismatch { what: "inlier marks, one per match", expected, actual });
    }
    let shift = images[0].width();
    let mut picture = side_by_side(images)?;
    for (features, shift) in features.into_iter().zip([0, shift]) {
        for &point in features.keypoints() {
            cross(&mut picture, pixel(point, shift), KEYPOINT);
        }
    }
    for (wanted, color) in [(false, OUTLIER), (true, INLIER)] {
        for (it, _) in matches.iter().zip(inliers).filter(|(_, inlier)| **inlier == wanted) {
            let from = place(features[0], it.query, 0)?;
            let to = place(features[1], it.reference, shift)?;
            draw_line(&mut picture, from, to, color, 1);
            cross(&mut picture, from, color);
            cross(&mut picture, to, color);
        }
    }
    Ok(picture)
}

/// The two images next to each other, aligned at the top, black where one is lower.
fn side_by_side(images: [&RgbImage; 2]) -> Result<RgbImage> {
    let width = images[0].width() + images[1].width();
    let height = images[0].height().max(images[1].height());
    if images.iter().any(|it| it.width() * it.height() == 0) {
        let value = format!("{width}x{height}");
        return Err(Error::Parameter { name: "image", value, reason: "must have pixels" });
    }
    let mut pixels = vec![0; width * height * 3];
    for (image, start) in images.into_iter().zip([0, images[0].width() * 3]) {
        let row = image.width() * 3;
        for (from, to) in image.as_slice().chunks_exact(row).zip(pixels.chunks_exact_mut(width * 3))
        {
            to[start..start + row].copy_from_slice(from);
        }
    }
    Ok(RgbImage::new(ImageSize { width, height }, pixels).expect("height × width × 3 bytes"))
}

fn place(features: &LocalFeatures, index: usize, shift: usize) -> Result<(i64, i64)> {
    let len = features.len();
    let point = features.keypoints().get(index);
    point.map(|&it| pixel(it, shift)).ok_or(Error::OutOfRange {
        what: "matched feature",
        index,
        len,
    })
}

#[expect(clippy::cast_possible_truncation, reason = "lines are clipped to the image")]
fn pixel([x, y]: [f32; 2], shift: usize) -> (i64, i64) {
    let whole = |it: f32| it.round().clamp(-1e6, 1e6) as i64;
    (whole(x) + i64::try_from(shift).unwrap_or(0), whole(y))
}

fn cross(picture: &mut RgbImage, (x, y): (i64, i64), color: [u8; 3]) {
    draw_line(picture, (x - 2, y), (x + 2, y), color, 1);
    draw_line(picture, (x, y - 2), (x, y + 2), color, 1);
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;
    use vpr_core::Descriptors;

    use super::*;
    use crate::features::LocalDescriptors;

    fn features(points: &[[f32; 2]]) -> LocalFeatures {
        let rows = Descriptors::new(Array2::zeros((points.len(), 2))).unwrap();
        let scores = vec![1.0; points.len()];
        LocalFeatures::new(points.to_vec(), scores, LocalDescriptors::Float(rows)).unwrap()
    }

    fn color(picture: &RgbImage, x: usize, y: usize) -> &[u8] {
        &picture.as_slice()[(y * picture.width() + x) * 3..][..3]
    }

    #[test]
    fn inliers_are_green_and_outliers_red() {
        let image =
            |width, height| RgbImage::from_size_val(ImageSize { width, height }, 9).unwrap();
        let (left, right) = (image(40, 30), image(50, 20));
        let a = features(&[[10.0, 5.0], [10.0, 15.0], [-50.0, 4.0]]);
        let b = features(&[[30.0, 5.0], [30.0, 15.0], [4.0, 900.0]]);
        let pair = |index| Match { query: index, reference: index, distance: 0.0 };
        let matches = [pair(0), pair(1), pair(2)];
        let picture = draw([&left, &right], [&a, &b], &matches, &[true, false, false]).unwrap();
        assert_eq!(picture.size(), ImageSize { width: 90, height: 30 });
        assert_eq!(color(&picture, 40, 5), INLIER);
        assert_eq!(color(&picture, 40, 15), OUTLIER);
        assert_eq!(color(&picture, 60, 25), [0, 0, 0]);
        assert!(draw([&left, &right], [&a, &b], &matches, &[true]).is_err());
        assert!(draw([&left, &right], [&a, &b], &[pair(3)], &[true]).is_err());
    }
}
