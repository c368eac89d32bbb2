//! SIFT on a dense grid at several scales, as `VLFeat`'s `vl_phow` gives it, and its square root.
//!
//! Bosch et al., *Image Classification Using Random Forests and Ferns* (2007), in the fast variant of
//! `VLFeat` 0.9.20: orientations of gradients are spread over bins by a triangle, and each bin counts
//! by the mean of a Gaussian window over it. Angles are exact here, where `VLFeat`'s have a polynomial,
//! and values keep their fraction, where `vl_phow` rounds them to bytes unless it is told not to.
//!
//! Arandjelović and Zisserman, *Three things everyone should know to improve object retrieval* (2012),
//! for the square root.

use ndarray::Array2;
use pulp::Arch;
use serde::{Deserialize, Serialize};
use vpr_core::{Descriptors, Error, Result};

use crate::image::GrayImage;

/// Orientations of a histogram, over a full turn.
const ORIENTATIONS: usize = 8;
/// Spatial bins along one side.
const SIDE: usize = 4;
/// Length of a descriptor.
pub const DIM: usize = SIDE * SIDE * ORIENTATIONS;
/// No value of a unit descriptor stays above this, before it is scaled to unit length again.
const CLIP: f32 = 0.2;

type Histogram = [f32; ORIENTATIONS];

/// Where descriptors are taken, and of what size; the default is `vl_phow`'s, as 24/7's code calls it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DenseSiftParams {
    /// Sides of a spatial bin in pixels, one per scale.
    pub bins: Vec<usize>,
    /// Distance of one descriptor to the next, in pixels.
    pub step: usize,
    /// The image is blurred by a Gaussian of the bin's side divided by this.
    pub magnification: f32,
    /// Standard deviation of the Gaussian window, in bins.
    pub window: f32,
    /// Descriptors whose gradients (of intensities of 0 to 1) sum to less than this per pixel are zero.
    pub contrast: f32,
}

impl Default for DenseSiftParams {
    fn default() -> Self {
        let bins = vec![4, 6, 8, 10];
        Self { bins, step: 2, magnification: 6.0, window: 1.5, contrast: 0.005 }
    }
}

impl DenseSiftParams {
    fn check(&self) -> Result<()> {
        let refuse = |name, value: String, reason| Err(Error::Parameter { name, value, reason });
        if self.bins.is_empty() || self.bins.iter().any(|bin| !(1..=64).contains(bin)) {
            let reason = "one or more sides of 1 to 64 pixels";
            return refuse("bins", format!("{:?}", self.bins), reason);
        }
        if self.step == 0 {
            return refuse("step", "0".to_owned(), "must be positive");
        }
        for (name, value) in [("magnification", self.magnification), ("window", self.window)] {
            if !(0.1..=100.0).contains(&value) {
                return refuse(name, value.to_string(), "must be from 0.1 to 100");
            }
        }
        Ok(())
    }
}

/// The descriptors of an image, scale by scale: of each `n × 128`, unit length or zero, rows of the grid
/// from the top. A descriptor is `bins from the top × bins from the left × orientations`.
///
/// With `root`, values are the square roots of those of a descriptor that sums to one.
///
/// # Errors
///
/// [`Error::Parameter`] for parameters out of range, or an image smaller than a descriptor of the
/// smallest scale.
pub fn describe(
    image: &GrayImage,
    params: &DenseSiftParams,
    root: bool,
) -> Result<Vec<Descriptors>> {
    params.check()?;
    let largest = params.bins.iter().copied().max().unwrap_or(1);
    let scales: Vec<Descriptors> = params
        .bins
        .iter()
        .map(|&bin| {
            let first = (SIDE - 1) * (largest - bin) / 2;
            let scale = Scale { image, params, bin, first, root };
            Arch::new().dispatch(|| scale.describe())
        })
        .collect::<Result<_>>()?;
    if scales.iter().all(Descriptors::is_empty) {
        return Err(Error::Parameter {
            name: "image",
            value: format!("{}x{}", image.width(), image.height()),
            reason: "is smaller than one dense descriptor",
        });
    }
    Ok(scales)
}

/// One scale of an image.
struct Scale<'a> {
    image: &'a GrayImage,
    params: &'a DenseSiftParams,
    bin: usize,
    /// Where the centre of the first bin lies, along both axes: all scales have the same centres.
    first: usize,
    root: bool,
}

impl Scale<'_> {
    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    fn describe(&self) -> Result<Descriptors> {
        let (width, height) = (self.image.width(), self.image.height());
        let (columns, rows) = (self.starts(width), self.starts(height));
        if columns.is_empty() || rows.is_empty() {
            return Descriptors::new(Array2::zeros((0, DIM)));
        }
        let blurred = blur(self.image, self.bin as f32 / self.params.magnification);
        let gradients = orientations(&blurred, width, height);
        let grid = Grid::new(&gradients, [width, height], [&columns, &rows], self.bin);
        let weights = window(self.bin, self.params.window);
        let area = ((SIDE - 1) * self.bin + 1).pow(2) as f32;
        let mut descriptors = Vec::with_capacity(rows.len() * columns.len() * DIM);
        for &top in &rows {
            for &left in &columns {
                let mut values = [0.0; DIM];
                for (at, histogram) in
                    values.as_chunks_mut::<ORIENTATIONS>().0.iter_mut().enumerate()
                {
                    let (y, x) = (at / SIDE, at % SIDE);
                    let spread = grid.at(left + x * self.bin, top + y * self.bin);
                    let weight = weights[y] * weights[x];
                    for (value, spread) in histogram.iter_mut().zip(spread) {
                        *value = weight * spread;
                    }
                }
                self.finish(&mut values, area);
                descriptors.extend(values);
            }
        }
        let shape = (rows.len() * columns.len(), DIM);
        Descriptors::new(Array2::from_shape_vec(shape, descriptors).expect("rows × columns"))
    }

    /// Where the first bins of descriptors have their centres, along an axis.
    fn starts(&self, len: usize) -> Vec<usize> {
        let reach = (SIDE - 1) * self.bin;
        (self.first..len.saturating_sub(reach)).step_by(self.params.step).collect()
    }

    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    fn finish(&self, values: &mut [f32; DIM], area: f32) {
        if sum(values, |it| it) / area < self.params.contrast {
            *values = [0.0; DIM];
            return;
        }
        let scale = |values: &mut [f32; DIM]| {
            let length = sum(values, |it| it * it).sqrt().max(f32::MIN_POSITIVE);
            for it in values {
                *it /= length;
            }
        };
        scale(values);
        for it in values.iter_mut() {
            *it = it.min(CLIP);
        }
        if self.root {
            let sum = sum(values, |it| it);
            for it in values.iter_mut() {
                *it = (*it / sum).sqrt();
            }
        } else {
            scale(values);
        }
    }
}

/// The sum over a descriptor, orientation by orientation: no addition waits for the one before.
#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
fn sum(values: &[f32; DIM], term: impl Fn(f32) -> f32) -> f32 {
    let mut sums = [0.0; ORIENTATIONS];
    for histogram in values.as_chunks::<ORIENTATIONS>().0 {
        sums.iter_mut().zip(histogram).for_each(|(sum, &value)| *sum += term(value));
    }
    sums.iter().sum()
}

/// What each bin along an axis counts: the mean of the window over it, times its side.
fn window(bin: usize, window: f32) -> [f32; SIDE] {
    let side = bin as f32;
    let sigma = side * window;
    std::array::from_fn(|at| {
        let centre = side * (at as f32 - 0.5 * (SIDE - 1) as f32);
        let off = |x: usize| ((x as f32 - side + 1.0 - centre) / sigma).powi(2);
        let sum: f32 = (0..2 * bin - 1).map(|x| (-0.5 * off(x)).exp()).sum();
        sum / (2 * bin - 1) as f32 * side
    })
}

/// Intensities of 0 to 1 under a Gaussian that reaches four standard deviations; the border repeats.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few pixels")]
fn blur(image: &GrayImage, sigma: f32) -> Vec<f32> {
    let (width, height) = (image.width(), image.height());
    let reach = (4.0 * sigma).ceil() as usize;
    let raw = |k: usize| (-0.5 * ((k as f32 - reach as f32) / sigma).powi(2)).exp();
    let kernel: Vec<f32> = (0..=2 * reach).map(raw).collect();
    let total: f32 = kernel.iter().sum();
    let kernel: Vec<f32> = kernel.iter().map(|it| it / total).collect();
    let intensities: Vec<f32> = image.as_slice().iter().map(|&it| f32::from(it) / 255.0).collect();
    let mut down = vec![0.0; width * height];
    for (y, row) in down.chunks_exact_mut(width).enumerate() {
        for (k, weight) in kernel.iter().enumerate() {
            let source = (y + k).saturating_sub(reach).min(height - 1);
            let source = &intensities[source * width..][..width];
            row.iter_mut().zip(source).for_each(|(sum, value)| *sum += weight * value);
        }
    }
    let mut across = vec![0.0; width * height];
    let mut padded = vec![0.0; width + 2 * reach];
    for (row, source) in across.chunks_exact_mut(width).zip(down.chunks_exact(width)) {
        padded[..reach].fill(source[0]);
        padded[reach..reach + width].copy_from_slice(source);
        padded[reach + width..].fill(source[width - 1]);
        for (k, weight) in kernel.iter().enumerate() {
            row.iter_mut().zip(&padded[k..]).for_each(|(sum, value)| *sum += weight * value);
        }
    }
    across
}

/// The length of each pixel's gradient, shared by the two orientations nearest to its own.
#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an orientation")]
#[inline(always)]
fn orientations(intensities: &[f32], width: usize, height: usize) -> Vec<Histogram> {
    // One-sided at the border, half of the two-sided difference inside.
    let slope = |at: usize, len: usize, value: &dyn Fn(usize) -> f32| match at {
        _ if len == 1 => 0.0,
        0 => value(1) - value(0),
        _ if at + 1 == len => value(at) - value(at - 1),
        _ => 0.5 * (value(at + 1) - value(at - 1)),
    };
    let mut histograms = vec![[0.0; ORIENTATIONS]; width * height];
    for y in 0..height {
        for x in 0..width {
            let dx = slope(x, width, &|x| intensities[y * width + x]);
            let dy = slope(y, height, &|y| intensities[y * width + x]);
            let length = (dx * dx + dy * dy).sqrt();
            let turn = dy.atan2(dx) / std::f32::consts::TAU;
            let position = (turn - turn.floor()) * ORIENTATIONS as f32;
            let (lower, share) = (position as usize, position.fract());
            let histogram = &mut histograms[y * width + x];
            histogram[lower % ORIENTATIONS] = (1.0 - share) * length;
            histogram[(lower + 1) % ORIENTATIONS] = share * length;
        }
    }
    histograms
}

/// Orientations spread over triangles, at the centres of bins that descriptors use.
struct Grid {
    /// Where a column of the image is kept; nothing reads the others.
    column: Vec<usize>,
    row: Vec<usize>,
    n_columns: usize,
    spread: Vec<Histogram>,
}

impl Grid {
    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    fn new(
        gradients: &[Histogram],
        [width, height]: [usize; 2],
        [columns, rows]: [&[usize]; 2],
        bin: usize,
    ) -> Self {
        let (columns, column) = used(columns, width, bin);
        let (rows, row) = used(rows, height, bin);
        let weight = |k: usize| {
            let off = k.abs_diff(bin - 1);
            (bin - off) as f32 / (bin * bin) as f32
        };
        let kernel: Vec<f32> = (0..2 * bin - 1).map(weight).collect();
        let source =
            |at: usize, k: usize, len: usize| (at + k).saturating_sub(bin - 1).min(len - 1);
        let mut spread = Vec::with_capacity(rows.len() * columns.len());
        let mut down = vec![[0.0; ORIENTATIONS]; width];
        for &y in &rows {
            down.fill([0.0; ORIENTATIONS]);
            for (k, weight) in kernel.iter().enumerate() {
                let row = &gradients[source(y, k, height) * width..][..width];
                let pairs = down.as_flattened_mut().iter_mut().zip(row.as_flattened());
                pairs.for_each(|(sum, value)| *sum += weight * value);
            }
            for &x in &columns {
                let mut sums = [0.0; ORIENTATIONS];
                for (k, weight) in kernel.iter().enumerate() {
                    let values = &down[source(x, k, width)];
                    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
                }
                spread.push(sums);
            }
        }
        Self { column, row, n_columns: columns.len(), spread }
    }

    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    fn at(&self, x: usize, y: usize) -> &Histogram {
        &self.spread[self.row[y] * self.n_columns + self.column[x]]
    }
}

/// The centres of bins along an axis that any descriptor uses, and where each is kept.
fn used(starts: &[usize], len: usize, bin: usize) -> (Vec<usize>, Vec<usize>) {
    let mut is_used = vec![false; len];
    for start in starts {
        (0..SIDE).for_each(|at| is_used[start + at * bin] = true);
    }
    let centres: Vec<usize> = (0..len).filter(|&at| is_used[at]).collect();
    let mut place = vec![0; len];
    for (at, &centre) in centres.iter().enumerate() {
        place[centre] = at;
    }
    (centres, place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::ImageSize;

    fn gray(width: usize, height: usize, pixel: impl Fn(usize, usize) -> usize) -> GrayImage {
        let pixel = |at: usize| u8::try_from(pixel(at % width, at / width) % 256).unwrap();
        let pixels = (0..width * height).map(pixel).collect();
        GrayImage::new(ImageSize { width, height }, pixels).unwrap()
    }

    #[test]
    fn every_scale_has_its_grid_and_unit_rows() {
        let image = gray(60, 50, |x, y| x * 7 + y * y);
        let params = DenseSiftParams::default();
        let scales = describe(&image, &params, true).unwrap();
        // VLFeat: (len - first - 3 bins - 1) / step + 1, first = 9, 6, 3, 0.
        let n = |len: usize, bin: usize, first: usize| (len - first - 3 * bin - 1) / 2 + 1;
        for (scale, (bin, first)) in scales.iter().zip([(4, 9), (6, 6), (8, 3), (10, 0)]) {
            assert_eq!(scale.len(), n(60, bin, first) * n(50, bin, first), "bin {bin}");
            for row in scale.view().outer_iter() {
                let length: f32 = row.iter().map(|it| it * it).sum();
                assert!((length - 1.0).abs() < 1e-5, "{length}");
            }
        }
    }

    /// A ramp along x has gradients of direction 0 only.
    #[test]
    fn a_ramp_has_one_orientation_and_a_wall_none() {
        let params = DenseSiftParams { bins: vec![4], ..Default::default() };
        let ramp = describe(&gray(30, 30, |x, _| 5 * x), &params, false).unwrap();
        for (at, value) in ramp[0].row(0).iter().enumerate() {
            assert_eq!(*value > 1e-3, at % ORIENTATIONS == 0, "{at}: {value}");
        }
        let wall = describe(&gray(30, 30, |_, _| 9), &params, false).unwrap();
        assert!(wall[0].as_slice().iter().all(|&it| it == 0.0));
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        let image = gray(12, 12, |x, _| x);
        let refused =
            |params: &DenseSiftParams| describe(&image, params, true).unwrap_err().to_string();
        assert!(refused(&DenseSiftParams::default()).starts_with("`image` = 12x12"));
        let params = DenseSiftParams { step: 0, ..Default::default() };
        assert!(refused(&params).starts_with("`step` = 0"));
        let params = DenseSiftParams { bins: vec![0], ..Default::default() };
        assert!(refused(&params).starts_with("`bins` = [0]"));
        let params = DenseSiftParams { window: f32::NAN, ..Default::default() };
        assert!(refused(&params).starts_with("`window` = NaN"));
    }
}
