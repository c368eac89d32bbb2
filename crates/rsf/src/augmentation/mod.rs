//! What may lie between a reference and a query of its place: changes of viewpoint and appearance
//! under Kornia's names and parameter meanings (thesis figure 4.3).
//!
//! An [`Augmentation`] has ranges and a probability, an [`Operation`] has numbers. Kornia 0.8 is
//! what is followed; its pixels are floats, ours are rounded to bytes after each operation.

mod colour;
mod filter;
mod operation;
mod planar;
mod preset;
mod warp;

use rand::{Rng, RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use vpr_vision::image::RgbImage;

pub use operation::Operation;
use planar::Planar;
pub use preset::Preset;

/// From one number to another, both included but for rounding.
pub type Range = (f64, f64);

/// Which change is drawn, from which ranges; fields are Kornia's arguments.
#[derive(Clone, Debug, PartialEq)]
pub enum Change {
    /// Corners move inwards by up to half of this share of the image.
    RandomPerspective {
        /// In 0 to 1.
        distortion_scale: f64,
    },
    /// Turned, moved, scaled and sheared about the centre.
    RandomAffine {
        /// Largest turn either way.
        degrees: f64,
        /// Largest shift either way, as shares of width and height.
        translate: (f64, f64),
        /// Scale of both axes.
        scale: Range,
        /// Largest shear along x either way, degrees.
        shear: f64,
    },
    /// Turned about the centre.
    RandomRotation {
        /// Largest turn either way.
        degrees: f64,
    },
    /// A part at the size of the whole.
    RandomResizedCrop {
        /// Its area as a share of the image's.
        scale: Range,
        /// Its aspect ratio over that of the image: unlike Kornia's, which is absolute.
        ratio: Range,
    },
    /// Mirrored: another place, so no preset has it.
    RandomHorizontalFlip,
    /// Brightness, contrast, saturation and hue in random order.
    ColorJiggle {
        /// Largest change either way.
        brightness: f64,
        /// Largest change either way.
        contrast: f64,
        /// Largest change either way.
        saturation: f64,
        /// Largest change either way, a share of the circle.
        hue: f64,
    },
    /// Without colour.
    RandomGrayscale,
    /// Values to a power, times a gain.
    RandomGamma {
        /// Exponent.
        gamma: Range,
        /// Factor.
        gain: Range,
    },
    /// Fewer levels.
    RandomPosterize {
        /// Fewest and most bits that stay.
        bits: (u32, u32),
    },
    /// Every level as often.
    RandomEqualize,
    /// Gaussian blur.
    RandomGaussianBlur {
        /// Width of the kernel, odd.
        kernel_size: usize,
        /// Standard deviation, pixels.
        sigma: Range,
    },
    /// Blur along a line.
    RandomMotionBlur {
        /// Smallest and largest width of the kernel; even ones become odd.
        kernel_size: (usize, usize),
        /// Largest turn either way, degrees.
        angle: f64,
        /// Largest direction either way.
        direction: f64,
    },
    /// Noise of mean 0.
    RandomGaussianNoise {
        /// Standard deviation.
        std: f64,
    },
    /// A rectangle of one value.
    RandomErasing {
        /// Its area as a share of the image's.
        scale: Range,
        /// Its height over its width.
        ratio: Range,
        /// What is put there.
        value: f64,
    },
    /// Snow on what is dark.
    RandomSnow {
        /// Lightness below which it lies.
        snow_coefficient: Range,
        /// How many times as light.
        brightness: Range,
    },
    /// A veil; ours.
    RandomFog {
        /// Share of the veil at the upper edge.
        density: Range,
    },
    /// A dark image; ours.
    RandomNight {
        /// From 0, day, to 1.
        darkness: Range,
    },
}

/// A change and how often it happens.
#[derive(Clone, Debug, PartialEq)]
pub struct Augmentation {
    /// The change.
    pub change: Change,
    /// Its probability, Kornia's `p`.
    pub p: f64,
}

/// Augmentations in the order in which they are applied.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Augmentations(pub Vec<Augmentation>);

impl Augmentations {
    /// The operations that a seed draws for an image of this size.
    #[must_use]
    pub fn draw(&self, size: (usize, usize), seed: u64) -> Vec<Operation> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let drawn = self.0.iter().filter_map(|it| {
            // Always as many draws, so that one probability does not change what follows.
            let own = random.random::<u64>();
            let happens = random.random::<f64>() < it.p;
            happens.then(|| it.change.draw(size, &mut ChaCha8Rng::seed_from_u64(own)))
        });
        drawn.collect()
    }

    /// A variant of an image, the one of this seed.
    #[must_use]
    pub fn apply(&self, image: &RgbImage, seed: u64) -> RgbImage {
        let operations = self.draw((image.width(), image.height()), seed);
        operations.iter().fold(image.clone(), |image, operation| operation.apply(&image))
    }
}

impl Change {
    /// Its name in Kornia; `RandomFog` and `RandomNight` are ours.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::RandomPerspective { .. } => "RandomPerspective",
            Self::RandomAffine { .. } => "RandomAffine",
            Self::RandomRotation { .. } => "RandomRotation",
            Self::RandomResizedCrop { .. } => "RandomResizedCrop",
            Self::RandomHorizontalFlip => "RandomHorizontalFlip",
            Self::ColorJiggle { .. } => "ColorJiggle",
            Self::RandomGrayscale => "RandomGrayscale",
            Self::RandomGamma { .. } => "RandomGamma",
            Self::RandomPosterize { .. } => "RandomPosterize",
            Self::RandomEqualize => "RandomEqualize",
            Self::RandomGaussianBlur { .. } => "RandomGaussianBlur",
            Self::RandomMotionBlur { .. } => "RandomMotionBlur",
            Self::RandomGaussianNoise { .. } => "RandomGaussianNoise",
            Self::RandomErasing { .. } => "RandomErasing",
            Self::RandomSnow { .. } => "RandomSnow",
            Self::RandomFog { .. } => "RandomFog",
            Self::RandomNight { .. } => "RandomNight",
        }
    }

    /// Draws its numbers for an image of this width and height.
    #[expect(clippy::too_many_lines, reason = "a short arm for each change")]
    pub fn draw(&self, size: (usize, usize), random: &mut impl Rng) -> Operation {
        let [width, height] = [size.0, size.1].map(|it| it as f64);
        match *self {
            Self::RandomPerspective { distortion_scale } => {
                let (right, bottom) = (width - 1.0, height - 1.0);
                let start = [[0.0, 0.0], [right, 0.0], [right, bottom], [0.0, bottom]];
                let inwards = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
                let mut end = start;
                for (corner, sign) in end.iter_mut().zip(inwards) {
                    corner[0] +=
                        sign[0] * distortion_scale * width / 2.0 * within((0.0, 1.0), random);
                    corner[1] +=
                        sign[1] * distortion_scale * height / 2.0 * within((0.0, 1.0), random);
                }
                Operation::Perspective { start, end }
            }
            Self::RandomAffine { degrees, translate, scale, shear } => {
                let degrees = either_way(degrees, random);
                let scale = within(scale, random);
                let x = either_way(translate.0, random) * width;
                let y = either_way(translate.1, random) * height;
                let shear = [either_way(shear, random), 0.0];
                Operation::Affine { translation: [x, y], scale: [scale; 2], degrees, shear }
            }
            Self::RandomRotation { degrees } => {
                Operation::Rotation { degrees: either_way(degrees, random) }
            }
            Self::RandomResizedCrop { scale, ratio } => {
                let (area, ratio) = (within(scale, random), within(ratio, random));
                let part_width = side(width * (area * ratio).sqrt(), size.0);
                let part_height = side(height * (area / ratio).sqrt(), size.1);
                Operation::ResizedCrop {
                    left: random.random_range(0..=size.0.saturating_sub(part_width)),
                    top: random.random_range(0..=size.1.saturating_sub(part_height)),
                    width: part_width,
                    height: part_height,
                }
            }
            Self::RandomHorizontalFlip => Operation::HorizontalFlip,
            Self::ColorJiggle { brightness, contrast, saturation, hue } => {
                let mut factor = |reach: f64| within(((1.0 - reach).max(0.0), 1.0 + reach), random);
                let (brightness, contrast) = (factor(brightness), factor(contrast));
                let saturation = factor(saturation);
                let hue = either_way(hue, random);
                let mut order = [0, 1, 2, 3];
                order.shuffle(random);
                Operation::ColorJiggle { brightness, contrast, saturation, hue, order }
            }
            Self::RandomGrayscale => Operation::Grayscale,
            Self::RandomGamma { gamma, gain } => {
                Operation::Gamma { gamma: within(gamma, random), gain: within(gain, random) }
            }
            Self::RandomPosterize { bits: (fewest, most) } => {
                Operation::Posterize { bits: random.random_range(fewest..=most.max(fewest)) }
            }
            Self::RandomEqualize => Operation::Equalize,
            Self::RandomGaussianBlur { kernel_size, sigma } => {
                Operation::GaussianBlur { kernel: kernel_size | 1, sigma: within(sigma, random) }
            }
            Self::RandomMotionBlur { kernel_size: (least, most), angle, direction } => {
                Operation::MotionBlur {
                    kernel: random.random_range(least..=most.max(least)) | 1,
                    degrees: either_way(angle, random),
                    direction: either_way(direction, random),
                }
            }
            Self::RandomGaussianNoise { std } => {
                Operation::GaussianNoise { std, seed: random.random() }
            }
            Self::RandomErasing { scale, ratio, value } => {
                let (area, ratio) = (within(scale, random) * width * height, within(ratio, random));
                let part_width = side((area / ratio).sqrt(), size.0);
                let part_height = side((area * ratio).sqrt(), size.1);
                Operation::Erasing {
                    left: random.random_range(0..=size.0.saturating_sub(part_width)),
                    top: random.random_range(0..=size.1.saturating_sub(part_height)),
                    width: part_width,
                    height: part_height,
                    value,
                }
            }
            Self::RandomSnow { snow_coefficient, brightness } => Operation::Snow {
                coefficient: within(snow_coefficient, random),
                brightness: within(brightness, random),
            },
            Self::RandomFog { density } => Operation::Fog {
                density: within(density, random),
                grey: within((0.6, 0.9), random),
            },
            Self::RandomNight { darkness } => {
                Operation::Night { darkness: within(darkness, random), seed: random.random() }
            }
        }
    }
}

fn within((low, high): Range, random: &mut impl Rng) -> f64 {
    low + (high - low) * random.random::<f64>()
}

fn either_way(reach: f64, random: &mut impl Rng) -> f64 {
    within((-reach, reach), random)
}

/// A number of pixels from 1 to all.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
fn side(length: f64, all: usize) -> usize {
    (length.round().max(1.0) as usize).min(all.max(1))
}

/// The nearest byte.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
fn byte(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests;
