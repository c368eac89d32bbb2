//! An image as planes of values in 0 to 1.

use vpr_vision::image::{ImageSize, RgbImage, from_pixels};

/// Red, green and blue one after another, values in 0 to 1.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Planar {
    size: ImageSize,
    values: Vec<f64>,
}

impl Planar {
    pub(super) fn of(image: &RgbImage) -> Self {
        let value = |channel| image.as_slice().iter().skip(channel).step_by(3);
        let values = (0..3).flat_map(value).map(|byte| f64::from(*byte) / 255.0).collect();
        Self { size: image.size(), values }
    }

    #[cfg(test)]
    pub(super) fn grey(width: usize, height: usize, value: f64) -> Self {
        Self { size: ImageSize { width, height }, values: vec![value; 3 * width * height] }
    }

    pub(super) fn into_image(self) -> RgbImage {
        let plane = self.size.width * self.size.height;
        let at = |index: usize| super::byte(255.0 * self.values[index % 3 * plane + index / 3]);
        from_pixels(self.size, (0..3 * plane).map(at).collect())
    }

    pub(super) fn width(&self) -> usize {
        self.size.width
    }

    pub(super) fn height(&self) -> usize {
        self.size.height
    }

    pub(super) fn planes_mut(&mut self) -> impl Iterator<Item = &mut [f64]> {
        let plane = (self.size.width * self.size.height).max(1);
        self.values.chunks_mut(plane)
    }

    /// Changes every value; what leaves 0 to 1 is cut, as Kornia does.
    pub(super) fn each(&mut self, mut change: impl FnMut(f64) -> f64) {
        self.values.iter_mut().for_each(|value| *value = change(*value).clamp(0.0, 1.0));
    }

    /// Changes every pixel.
    pub(super) fn pixels(&mut self, mut change: impl FnMut([f64; 3]) -> [f64; 3]) {
        let plane = self.size.width * self.size.height;
        for at in 0..plane {
            let channels = [at, plane + at, 2 * plane + at];
            let changed = change(channels.map(|it| self.values[it]));
            for (it, value) in channels.into_iter().zip(changed) {
                self.values[it] = value;
            }
        }
    }
}
