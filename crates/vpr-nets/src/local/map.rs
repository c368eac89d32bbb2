//! Maps of features on the host: read from a tensor, sampled at positions between pixels.

use burn::tensor::Tensor;

/// One image's map, `height × width` positions of `channels` values each.
#[derive(Clone, Debug)]
pub(super) struct FeatureMap {
    values: Vec<f32>,
    channels: usize,
    height: usize,
    width: usize,
}

/// One image's plane of values, row after row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plane {
    pub(super) values: Vec<f32>,
    pub(super) height: usize,
    pub(super) width: usize,
}

/// How values between pixels are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sampling {
    /// Two taps along each axis.
    Bilinear,
    /// Four taps along each axis, Keys' kernel with a = −0.75.
    Bicubic,
}

/// The values of a tensor, row-major.
pub(super) fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data_as::<f32>().try_to_vec().expect("just converted to f32")
}

impl FeatureMap {
    /// Splits `n × channels × height × width`.
    pub(super) fn from_tensor(maps: Tensor<4>) -> Vec<Self> {
        let [_, channels, height, width] = maps.dims();
        let all = values(maps.permute([0, 2, 3, 1]));
        let of = |values: &[f32]| Self { values: values.to_vec(), channels, height, width };
        all.chunks_exact(channels * height * width).map(of).collect()
    }

    /// Number of values at a position.
    pub(super) fn channels(&self) -> usize {
        self.channels
    }

    /// Width and height.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The values at a pixel.
    pub(super) fn at(&self, x: usize, y: usize) -> &[f32] {
        let start = (y * self.width + x) * self.channels;
        &self.values[start..start + self.channels]
    }

    /// The values at (x, y) in pixels of this map, whose centres have whole coordinates. Pixels outside are zero, as
    /// in PyTorch's `grid_sample`.
    pub(super) fn sample(&self, [x, y]: [f32; 2], sampling: Sampling) -> Vec<f32> {
        let mut sum = vec![0.0; self.channels];
        let ((left, across), (top, down)) = match sampling {
            Sampling::Bilinear => (bilinear(x), bilinear(y)),
            Sampling::Bicubic => (bicubic(x), bicubic(y)),
        };
        for (row, wy) in (top..).zip(down) {
            for (column, wx) in (left..).zip(across) {
                let Some((column, row)) = self.inside(column, row) else { continue };
                let weight = wx * wy;
                for (sum, value) in sum.iter_mut().zip(self.at(column, row)) {
                    *sum += weight * value;
                }
            }
        }
        sum
    }

    fn inside(&self, x: i64, y: i64) -> Option<(usize, usize)> {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        (x < self.width && y < self.height).then_some((x, y))
    }
}

impl Plane {
    /// Splits `n × 1 × height × width`.
    pub(super) fn from_tensor(maps: Tensor<4>) -> Vec<Self> {
        let [_, channels, height, width] = maps.dims();
        assert_eq!(channels, 1, "a plane has one channel");
        let of = |values: &[f32]| Self { values: values.to_vec(), height, width };
        values(maps).chunks_exact(height * width).map(of).collect()
    }

    /// The value at a pixel.
    pub(super) fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// The value of the pixel nearest to (x, y), halves to the even one; zero outside.
    pub(super) fn nearest(&self, [x, y]: [f32; 2]) -> f32 {
        let (x, y) = (x.round_ties_even(), y.round_ties_even());
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f32 && y < self.height as f32;
        if inside { self.at(index(x), index(y)) } else { 0.0 }
    }

    /// The value between pixels; see [`FeatureMap::sample`].
    pub(super) fn bilinear(&self, [x, y]: [f32; 2]) -> f32 {
        let ((left, across), (top, down)) = (bilinear(x), bilinear(y));
        let mut sum = 0.0;
        for (row, wy) in (top..).zip(down).take(2) {
            for (column, wx) in (left..).zip(across).take(2) {
                let (Ok(x), Ok(y)) = (usize::try_from(column), usize::try_from(row)) else {
                    continue;
                };
                if x < self.width && y < self.height {
                    sum += wx * wy * self.at(x, y);
                }
            }
        }
        sum
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a pixel of an image")]
fn index(value: f32) -> usize {
    value as usize
}

#[expect(clippy::cast_possible_truncation, reason = "a pixel near an image")]
fn whole(value: f32) -> i64 {
    value.floor() as i64
}

/// First pixel and weights along one axis; the last two weights are zero.
fn bilinear(position: f32) -> (i64, [f32; 4]) {
    let t = position - position.floor();
    (whole(position), [1.0 - t, t, 0.0, 0.0])
}

/// First pixel and weights along one axis.
fn bicubic(position: f32) -> (i64, [f32; 4]) {
    const A: f32 = -0.75;
    let near = |t: f32| ((A + 2.0) * t - (A + 3.0)) * t * t + 1.0;
    let far = |t: f32| ((A * t - 5.0 * A) * t + 8.0 * A) * t - 4.0 * A;
    let t = position - position.floor();
    (whole(position) - 1, [far(t + 1.0), near(t), near(1.0 - t), far(2.0 - t)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> FeatureMap {
        let values = (0..5 * 6).flat_map(|at| [(at % 6) as f32, (at / 6) as f32]).collect();
        FeatureMap { values, channels: 2, height: 5, width: 6 }
    }

    #[test]
    fn a_ramp_is_sampled_as_by_hand() {
        // Cubic weights with A = −0.75, as PyTorch's, keep a ramp only half-way between pixels:
        // −.10546875 · 1 + .87890625 · 2 + .26171875 · 3 − .03515625 · 4 = 2.296875.
        for (sampling, x) in [(Sampling::Bilinear, 2.25), (Sampling::Bicubic, 2.296_875)] {
            let found = ramp().sample([2.25, 1.5], sampling);
            assert!((found[0] - x).abs() < 1e-5 && (found[1] - 1.5).abs() < 1e-5, "{found:?}");
        }
    }

    #[test]
    fn outside_is_zero() {
        for sampling in [Sampling::Bilinear, Sampling::Bicubic] {
            assert_eq!(ramp().sample([-3.0, 2.0], sampling), [0.0, 0.0]);
            assert_eq!(ramp().sample([1e9, -1e9], sampling), [0.0, 0.0]);
        }
        assert_eq!(ramp().sample([-0.5, 2.0], Sampling::Bilinear), [0.0, 1.0]);
    }

    #[test]
    fn the_nearest_pixel_of_a_half_is_even() {
        let plane = Plane { values: vec![1.0, 2.0, 3.0, 4.0], height: 2, width: 2 };
        assert_eq!(plane.nearest([0.5, 0.0]), 1.0);
        assert_eq!(plane.nearest([1.5, 0.0]), 0.0);
        assert_eq!(plane.nearest([0.6, 0.6]), 4.0);
        assert_eq!(plane.bilinear([0.5, 0.5]), 2.5);
        assert_eq!(plane.bilinear([1.5, 0.0]), 1.0);
    }
}
