//! From an image to the panels that a convolution multiplies.
//!
//! The image is copied once into planes, one per channel and phase of the stride, with its padding.
//! Then what one kernel element sees of a run of output pixels is a run of one plane, for any
//! stride and dilation, and lowering (`im2col`) is copying.

use std::borrow::Cow;

use super::{geometry::Geometry, multiply::Lanes, multiply::TILE};

/// One image, ready for [`Planes::lower`].
pub(super) struct Planes<'a> {
    values: Cow<'a, [f32]>,
    /// Height and width of one plane.
    size: [usize; 2],
    /// Where each kernel element starts in the planes of a channel.
    starts: Vec<usize>,
    /// Values per channel.
    per_channel: usize,
    output: [usize; 2],
}

impl<'a> Planes<'a> {
    /// Lays out one image of `geometry`, `[channels, height, width]`.
    pub(super) fn new(image: &'a [f32], geometry: &Geometry, output: [usize; 2]) -> Self {
        let Geometry { kernel, stride, dilation, .. } = *geometry;
        let reach = |axis: usize| (kernel[axis] - 1) * dilation[axis];
        let size: [usize; 2] =
            std::array::from_fn(|axis| output[axis] + reach(axis) / stride[axis]);
        let plane = size[0] * size[1];
        let starts = (0..kernel[0] * kernel[1]).map(|element| {
            let offset = [element / kernel[1] * dilation[0], element % kernel[1] * dilation[1]];
            let phase = offset[0] % stride[0] * stride[1] + offset[1] % stride[1];
            phase * plane + offset[0] / stride[0] * size[1] + offset[1] / stride[1]
        });
        let starts = starts.collect();
        let per_channel = plane * stride[0] * stride[1];
        let is_itself =
            stride == [1, 1] && size == geometry.input[2..] && geometry.before == [0, 0];
        let values = if is_itself {
            Cow::Borrowed(image)
        } else {
            Cow::Owned(phases(image, geometry, size, per_channel))
        };
        Self { values, size, starts, per_channel, output }
    }

    /// The depths `depths` of the panel whose first column is output pixel `first`.
    pub(super) fn lower(&self, first: usize, depths: std::ops::Range<usize>, panel: &mut [Lanes]) {
        let runs = self.runs(first);
        let n_elements = self.starts.len();
        let (mut channel, mut element) = (depths.start / n_elements, depths.start % n_elements);
        for lanes in panel.iter_mut().take(depths.len()) {
            let start = channel * self.per_channel + self.starts[element];
            if let [(from, to, TILE)] = runs[..] {
                debug_assert_eq!(to, 0, "one run fills the panel");
                lanes.copy_from_slice(&self.values[start + from..][..TILE]);
            } else {
                self.gather(start, &runs, lanes);
            }
            element += 1;
            if element == n_elements {
                (channel, element) = (channel + 1, 0);
            }
        }
    }

    /// Copies runs that lie apart. Each takes 16 values along, where there are as many, which the
    /// next run overwrites: copies of known length are no calls.
    fn gather(&self, start: usize, runs: &[(usize, usize, usize)], lanes: &mut Lanes) {
        let mut wide = [0.0; 2 * TILE];
        for &(from, to, n) in runs {
            let source = &self.values[start + from..];
            if let Some(source) = source.first_chunk::<TILE>() {
                wide[to..to + TILE].copy_from_slice(source);
            } else {
                wide[to..to + n].copy_from_slice(&source[..n]);
            }
        }
        lanes.copy_from_slice(&wide[..TILE]);
    }

    /// What 16 weights from `first` on are multiplied with at some output pixels: a row per pixel.
    pub(super) fn lower_weights(
        &self,
        first: usize,
        pixels: std::ops::Range<usize>,
        panel: &mut [Lanes],
    ) {
        let n_elements = self.starts.len();
        let n_weights = self.values.len() / self.per_channel * n_elements;
        let width = self.output[1];
        for lane in 0..TILE {
            let weight = first + lane;
            if weight >= n_weights {
                for row in panel.iter_mut() {
                    row[lane] = 0.0;
                }
                continue;
            }
            let start = weight / n_elements * self.per_channel + self.starts[weight % n_elements];
            let mut pixel = pixels.start;
            while pixel < pixels.end {
                let (row, column) = (pixel / width, pixel % width);
                let n = (width - column).min(pixels.end - pixel);
                let source = &self.values[start + row * self.size[1] + column..][..n];
                for (to, &from) in panel[pixel - pixels.start..].iter_mut().zip(source) {
                    to[lane] = from;
                }
                pixel += n;
            }
        }
    }

    /// Runs of a panel's pixels: where in a plane, where in the panel, how many.
    fn runs(&self, first: usize) -> Vec<(usize, usize, usize)> {
        let [height, width] = self.output;
        let mut runs = Vec::with_capacity(TILE);
        let last = (first + TILE).min(height * width);
        let mut pixel = first;
        while pixel < last {
            let (row, column) = (pixel / width, pixel % width);
            let n = (width - column).min(last - pixel);
            let from = row * self.size[1] + column;
            match runs.last_mut() {
                // Planes as wide as the output: the run goes on.
                Some((start, _, length)) if *start + *length == from => *length += n,
                _ => runs.push((from, pixel - first, n)),
            }
            pixel += n;
        }
        runs
    }
}

/// Copies an image into its phases, with zeros where the padding is.
fn phases(image: &[f32], geometry: &Geometry, size: [usize; 2], per_channel: usize) -> Vec<f32> {
    let Geometry { stride, before, .. } = *geometry;
    let [_, n_channels, height, width] = geometry.input;
    let mut values = vec![0.0; n_channels * per_channel];
    for (channel, planes) in
        image.chunks_exact(height * width).zip(values.chunks_exact_mut(per_channel))
    {
        for (index, row) in planes.chunks_exact_mut(size[1]).enumerate() {
            let (phase, y) = (index / size[0], index % size[0]);
            let y = y * stride[0] + phase / stride[1];
            let Some(y) = y.checked_sub(before[0]).filter(|&y| y < height) else { continue };
            let source = &channel[y * width..][..width];
            let offset = phase % stride[1];
            // First and last column of the plane that lie inside the image.
            let first = before[1].saturating_sub(offset).div_ceil(stride[1]);
            let start = first * stride[1] + offset - before[1];
            let inside = row.iter_mut().skip(first);
            if stride[1] == 1 {
                let n = (size[1].saturating_sub(first)).min(width.saturating_sub(start));
                row[first..first + n].copy_from_slice(&source[start..start + n]);
            } else {
                let source = source.iter().skip(start).step_by(stride[1]);
                for (to, &from) in inside.zip(source) {
                    *to = from;
                }
            }
        }
    }
    values
}
