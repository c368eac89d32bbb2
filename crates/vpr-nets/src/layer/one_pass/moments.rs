//! Normalisation by mean and variance over sets of planes, and its gradient: batch normalisation
//! (Ioffe and Szegedy, ICML 2015) and group normalisation (Wu and He, ECCV 2018).
//!
//! burn takes some two dozen passes for both ways, with copies between. Sums of a plane are taken by
//! 16 lanes, those of a set in f64, so that no bit depends on the processor or on the threads.

use pulp::Arch;
use rayon::prelude::*;

use super::{LANES, ROWS_PER_TASK, for_rows, sum};

/// Which planes share a mean and a variance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sharing {
    /// Those of a channel, over all images: batch normalisation.
    Channel,
    /// Those of so many groups of channels, image by image: group normalisation.
    Groups(usize),
}

/// Sizes of a map `[images, channels, plane]` that is normalised.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sets {
    pub(crate) images: usize,
    pub(crate) channels: usize,
    pub(crate) plane: usize,
    pub(crate) sharing: Sharing,
    /// Added to the variance.
    pub(crate) epsilon: f32,
}

/// Mean and variance (over n, not n − 1) of every set.
#[derive(Clone, Debug)]
pub(crate) struct Moments {
    pub(crate) mean: Vec<f32>,
    pub(crate) variance: Vec<f32>,
}

/// Gradients of a map, of the scale and of the shift.
#[derive(Clone, Debug)]
pub(crate) struct Gradients {
    pub(crate) map: Vec<f32>,
    pub(crate) gamma: Vec<f32>,
    pub(crate) beta: Vec<f32>,
}

impl Sets {
    /// Number of sets.
    pub(crate) fn len(&self) -> usize {
        match self.sharing {
            Sharing::Channel => self.channels,
            Sharing::Groups(n) => self.images * n,
        }
    }

    /// The set of a plane.
    fn of(&self, plane: usize) -> usize {
        match self.sharing {
            Sharing::Channel => plane % self.channels,
            Sharing::Groups(n) => plane / (self.channels / n),
        }
    }

    /// Values of a set.
    fn size(&self) -> f64 {
        (self.images * self.channels * self.plane) as f64 / self.len() as f64
    }

    /// Adds up a number per plane to one per set.
    fn gathered(&self, of_planes: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut sums = vec![0.0; self.len()];
        for (plane, value) in of_planes.enumerate() {
            sums[self.of(plane)] += value;
        }
        sums
    }

    /// `task` of every plane's values in some maps.
    fn of_planes<const M: usize, const N: usize>(
        &self,
        maps: [&[f32]; M],
        task: impl Fn(usize, [&[f32]; M]) -> [f32; N] + Sync,
    ) -> Vec<[f32; N]> {
        let mut results = vec![[0.0; N]; self.images * self.channels];
        results.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(chunk, results)| {
            Arch::new().dispatch(
                #[inline(always)]
                || {
                    for (index, result) in results.iter_mut().enumerate() {
                        let plane = chunk * ROWS_PER_TASK + index;
                        let mut of_plane: [&[f32]; M] = [&[]; M];
                        for (values, map) in of_plane.iter_mut().zip(maps) {
                            *values = &map[plane * self.plane..][..self.plane];
                        }
                        *result = task(plane, of_plane);
                    }
                },
            );
        });
        results
    }

    /// Mean and variance of every set of a map.
    #[expect(clippy::cast_possible_truncation, reason = "moments are f32, as the map")]
    pub(crate) fn moments(&self, map: &[f32]) -> Moments {
        let sums = self.of_planes(
            [map],
            #[inline(always)]
            |_, [x]| [sum(x, |x| x)],
        );
        let mean = self.gathered(sums.iter().map(|it| f64::from(it[0])));
        let mean: Vec<f32> = mean.into_iter().map(|it| (it / self.size()) as f32).collect();
        let squares = self.of_planes(
            [map],
            #[inline(always)]
            |plane, [x]| {
                let mean = mean[self.of(plane)];
                [sum(x, |x| (x - mean) * (x - mean))]
            },
        );
        let variance = self.gathered(squares.iter().map(|it| f64::from(it[0])));
        let variance = variance.into_iter().map(|it| (it / self.size()) as f32).collect();
        Moments { mean, variance }
    }

    /// `(x − mean) / √(variance + ε) · γ + β`.
    pub(crate) fn normalize(
        &self,
        map: &[f32],
        moments: &Moments,
        [gamma, beta]: [&[f32]; 2],
    ) -> Vec<f32> {
        let mut normed = vec![0.0; map.len()];
        for_rows(
            &mut normed,
            self.plane,
            #[inline(always)]
            |first, rows| {
                let source = map[first * self.plane..].chunks_exact(self.plane);
                for (index, (row, x)) in rows.chunks_exact_mut(self.plane).zip(source).enumerate() {
                    let (set, channel) = (self.of(first + index), (first + index) % self.channels);
                    let scale = gamma[channel] / (moments.variance[set] + self.epsilon).sqrt();
                    let (mean, shift) = (moments.mean[set], beta[channel]);
                    for (normed, x) in row.iter_mut().zip(x) {
                        *normed = (x - mean) * scale + shift;
                    }
                }
            },
        );
        normed
    }

    /// Gradients of [`Sets::normalize`] by all it depends on, the map's moments among it.
    #[expect(clippy::cast_possible_truncation, reason = "gradients are f32, as the map")]
    pub(crate) fn gradients(
        &self,
        map: &[f32],
        moments: &Moments,
        gamma: &[f32],
        output: &[f32],
    ) -> Gradients {
        let inverse: Vec<f32> =
            moments.variance.iter().map(|it| 1.0 / (it + self.epsilon).sqrt()).collect();
        // Σ dy and Σ dy x̂ of every plane.
        let sums = self.of_planes(
            [map, output],
            #[inline(always)]
            |plane, [x, dy]| {
                let set = self.of(plane);
                let mean = moments.mean[set];
                [sum(dy, |dy| dy), sum_of_products(x, dy, mean) * inverse[set]]
            },
        );
        let mut parameters = [0, 1].map(|_| vec![0.0; self.channels]);
        for (plane, of_plane) in sums.iter().enumerate() {
            for (sums, &value) in parameters.iter_mut().zip(of_plane) {
                sums[plane % self.channels] += f64::from(value);
            }
        }
        let [beta, gamma_sums] =
            parameters.map(|sums| sums.into_iter().map(|it| it as f32).collect::<Vec<_>>());
        let [mean, projection] = [0, 1].map(|which| {
            let scaled = sums
                .iter()
                .enumerate()
                .map(|(plane, it)| f64::from(it[which]) * f64::from(gamma[plane % self.channels]));
            let means = self.gathered(scaled).into_iter().map(|it| (it / self.size()) as f32);
            means.collect::<Vec<_>>()
        });
        let mut gradient = vec![0.0; map.len()];
        for_rows(
            &mut gradient,
            self.plane,
            #[inline(always)]
            |first, rows| {
                let source = map[first * self.plane..].chunks_exact(self.plane);
                let output = output[first * self.plane..].chunks_exact(self.plane);
                let rows = rows.chunks_exact_mut(self.plane).zip(source.zip(output));
                for (index, (row, (x, dy))) in rows.enumerate() {
                    let set = self.of(first + index);
                    let scale = gamma[(first + index) % self.channels];
                    let (inverse, shift) = (inverse[set], moments.mean[set]);
                    let (mean, projection) = (mean[set], projection[set]);
                    for (gradient, (x, dy)) in row.iter_mut().zip(x.iter().zip(dy)) {
                        let normed = (x - shift) * inverse;
                        *gradient = inverse * (scale * dy - mean - normed * projection);
                    }
                }
            },
        );
        Gradients { map: gradient, gamma: gamma_sums, beta }
    }
}

/// Σ (x − mean) y, by 16 partial sums.
#[inline(always)]
fn sum_of_products(x: &[f32], y: &[f32], mean: f32) -> f32 {
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for (x, y) in x.iter().zip(y) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += (x - mean) * y;
        }
    }
    for (sum, (x, y)) in sums.iter_mut().zip(x_rest.iter().zip(y_rest)) {
        *sum += (x - mean) * y;
    }
    sums.iter().sum()
}
