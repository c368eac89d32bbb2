//! Local entropy of a gray image.

use ndarray::{Array2, ArrayView2};

use crate::image::GrayImage;

/// Sums of `h · log₂ h` are kept in units of 2⁻⁴⁰: integers do not drift while the disk slides.
const SCALE: f64 = (1u64 << 40) as f64;

/// Shannon entropy in bits, 0 to 8, of the gray values in a disk around every pixel, height × width.
///
/// The disk holds the pixels at a distance of at most `radius`; at the border only those inside of the image count.
/// Agrees with `skimage.filters.rank.entropy(image, skimage.morphology.disk(radius))` to 1e-10.
///
/// # Panics
///
/// Never: an image has height × width bytes.
#[must_use]
pub fn local_entropy(image: &GrayImage, radius: u8) -> Array2<f64> {
    let pixels = ArrayView2::from_shape((image.height(), image.width()), image.as_slice())
        .expect("height × width bytes");
    let disk = half_widths(radius);
    let mut histogram = Histogram::with_capacity(disk.iter().map(|half| 2 * half + 1).sum());
    let mut entropy = Array2::zeros(pixels.dim());
    for ((y, x), entropy) in entropy.indexed_iter_mut() {
        if x == 0 {
            histogram.clear();
        }
        for (row, half) in rows_inside(&disk, y, image.height()) {
            if x == 0 {
                (0..=half.min(image.width() - 1)).for_each(|x| histogram.add(pixels[(row, x)]));
                continue;
            }
            if x > half {
                histogram.remove(pixels[(row, x - half - 1)]);
            }
            if x + half < image.width() {
                histogram.add(pixels[(row, x + half)]);
            }
        }
        *entropy = histogram.entropy();
    }
    entropy
}

/// How far the rows of a disk reach to either side, topmost row first.
fn half_widths(radius: u8) -> Vec<usize> {
    let radius = usize::from(radius);
    let reach = |row: usize| (radius * radius - row.abs_diff(radius).pow(2)).isqrt();
    (0..=2 * radius).map(reach).collect()
}

/// The rows of a disk around row `y` that are inside of the image, and their half widths.
fn rows_inside(disk: &[usize], y: usize, height: usize) -> impl Iterator<Item = (usize, usize)> {
    let radius = disk.len() / 2;
    (y.saturating_sub(radius)..=(y + radius).min(height - 1))
        .map(move |row| (row, disk[row + radius - y]))
}

/// Counts of gray values, and the sum of `h · log₂ h` over them.
struct Histogram {
    counts: [u16; 256],
    n_pixels: usize,
    sum: i64,
    /// `h · log₂ h` for every count.
    terms: Vec<i64>,
}

impl Histogram {
    /// For at most `n_pixels` pixels.
    fn with_capacity(n_pixels: usize) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "2^16 · log₂ 2^16 · 2^40 is 2^60")]
        let term = |h: usize| (h as f64 * (h.max(1) as f64).log2() * SCALE).round() as i64;
        let terms = (0..=n_pixels).map(term).collect();
        Self { counts: [0; 256], n_pixels: 0, sum: 0, terms }
    }

    fn clear(&mut self) {
        (self.counts, self.n_pixels, self.sum) = ([0; 256], 0, 0);
    }

    fn add(&mut self, value: u8) {
        let count = &mut self.counts[usize::from(value)];
        self.sum -= self.terms[usize::from(*count)];
        *count += 1;
        self.sum += self.terms[usize::from(*count)];
        self.n_pixels += 1;
    }

    fn remove(&mut self, value: u8) {
        let count = &mut self.counts[usize::from(value)];
        self.sum -= self.terms[usize::from(*count)];
        *count -= 1;
        self.sum += self.terms[usize::from(*count)];
        self.n_pixels -= 1;
    }

    /// `−Σ p log₂ p` with `p = h / n`, which is `(n log₂ n − Σ h log₂ h) / n`.
    fn entropy(&self) -> f64 {
        (self.terms[self.n_pixels] - self.sum) as f64 / SCALE / self.n_pixels as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::ImageSize;

    fn entropy_of(width: usize, pixels: &[u8], radius: u8) -> Array2<f64> {
        let size = ImageSize { width, height: pixels.len() / width };
        local_entropy(&GrayImage::new(size, pixels.to_vec()).unwrap(), radius)
    }

    #[test]
    fn flat_patches_have_none() {
        assert!(entropy_of(9, &[77; 63], 5).iter().all(|&bits| bits == 0.0));
    }

    #[test]
    fn one_other_pixel_in_a_cross() {
        // skimage gives the same for disk(1): three of four alike at the edges, four of five in the middle.
        let entropy = entropy_of(3, &[0, 0, 0, 0, 7, 0, 0, 0, 0], 1);
        let (edge, middle) = (0.811_278_124_459_132_8, 0.721_928_094_887_362_3);
        let expected = [0.0, edge, 0.0, edge, middle, edge, 0.0, edge, 0.0];
        for (actual, expected) in entropy.iter().zip(expected) {
            assert!((actual - expected).abs() < 1e-11, "{entropy}");
        }
    }

    #[test]
    fn the_disk_of_radius_five_has_81_pixels() {
        assert_eq!(half_widths(5), [0, 3, 4, 4, 4, 5, 4, 4, 4, 3, 0]);
        let distinct: Vec<u8> = (0..121).collect();
        let middle = entropy_of(11, &distinct, 5)[(5, 5)];
        assert!((middle - 81f64.log2()).abs() < 1e-11);
    }

    #[test]
    fn a_disk_larger_than_the_image_counts_the_image() {
        assert!(entropy_of(2, &[1, 1, 2, 2], 9).iter().all(|bits| (bits - 1.0).abs() < 1e-11));
        assert_eq!(entropy_of(1, &[3], 5).len(), 1);
    }
}
