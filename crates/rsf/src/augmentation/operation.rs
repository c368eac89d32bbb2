//! One change of an image with all of its numbers.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_vision::image::RgbImage;

use super::{
    Planar, colour, filter,
    warp::{self, Corners},
};

/// A change with all of its numbers: the same image gives the same bytes. What has a name of
/// Kornia's does what Kornia does with these parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum Operation {
    /// Kornia's `RandomPerspective`: corners, clockwise from the upper left, go from `start` to
    /// `end`, pixels.
    Perspective {
        /// Where they are.
        start: [[f64; 2]; 4],
        /// Where they go.
        end: [[f64; 2]; 4],
    },
    /// Kornia's `RandomAffine`; positive angles turn clockwise.
    Affine {
        /// Pixels to the right and down.
        translation: [f64; 2],
        /// Along both axes.
        scale: [f64; 2],
        /// Turn, degrees.
        degrees: f64,
        /// Along both axes, degrees.
        shear: [f64; 2],
    },
    /// Kornia's `RandomRotation`; positive angles turn anti-clockwise.
    Rotation {
        /// Turn, degrees.
        degrees: f64,
    },
    /// Kornia's `RandomResizedCrop`: this part at the size of the whole.
    ResizedCrop {
        /// First column.
        left: usize,
        /// First row.
        top: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// Kornia's `RandomHorizontalFlip`.
    HorizontalFlip,
    /// Kornia's `ColorJiggle`: brightness is added, the others multiply or turn.
    ColorJiggle {
        /// 1 leaves it.
        brightness: f64,
        /// 1 leaves it.
        contrast: f64,
        /// 1 leaves it.
        saturation: f64,
        /// Share of the circle of hues; 0 leaves it.
        hue: f64,
        /// Which of the four comes first, second, ….
        order: [usize; 4],
    },
    /// Kornia's `RandomGrayscale`.
    Grayscale,
    /// Kornia's `RandomGamma`.
    Gamma {
        /// Exponent.
        gamma: f64,
        /// Factor.
        gain: f64,
    },
    /// Kornia's `RandomPosterize`.
    Posterize {
        /// Bits that stay, up to 8.
        bits: u32,
    },
    /// Kornia's `RandomEqualize`.
    Equalize,
    /// Kornia's `RandomGaussianBlur`.
    GaussianBlur {
        /// Width of the kernel, odd.
        kernel: usize,
        /// Standard deviation, pixels.
        sigma: f64,
    },
    /// Kornia's `RandomMotionBlur`.
    MotionBlur {
        /// Width of the kernel, odd.
        kernel: usize,
        /// Turn of the movement, anti-clockwise.
        degrees: f64,
        /// From −1, back, to 1, forward.
        direction: f64,
    },
    /// Kornia's `RandomGaussianNoise` of mean 0; Kornia draws from another generator.
    GaussianNoise {
        /// Standard deviation.
        std: f64,
        /// Decides the draws.
        seed: u64,
    },
    /// Kornia's `RandomErasing`.
    Erasing {
        /// First column.
        left: usize,
        /// First row.
        top: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// What is put there.
        value: f64,
    },
    /// Kornia's `RandomSnow`: what is dark becomes lighter.
    Snow {
        /// Lightness below which it does.
        coefficient: f64,
        /// How many times as light.
        brightness: f64,
    },
    /// Ours, Kornia has none: a grey veil that is thickest above, where things are far, and thins
    /// towards the lower edge.
    Fog {
        /// Share of the veil at the upper edge.
        density: f64,
        /// Its grey.
        grey: f64,
    },
    /// Ours, Kornia has none: what is dark vanishes, little colour stays, and noise comes with the
    /// gain.
    Night {
        /// From 0, day, to 1.
        darkness: f64,
        /// Decides the noise.
        seed: u64,
    },
}

impl Operation {
    /// What it makes of an image, of the same size. A matrix without inverse leaves the image.
    #[must_use]
    pub fn apply(&self, image: &RgbImage) -> RgbImage {
        match self {
            Self::Perspective { .. }
            | Self::Affine { .. }
            | Self::Rotation { .. }
            | Self::ResizedCrop { .. } => self.warped(image).unwrap_or_else(|| image.clone()),
            _ => {
                let mut planar = Planar::of(image);
                self.change(&mut planar);
                planar.into_image()
            }
        }
    }

    /// What moves pixels.
    fn warped(&self, image: &RgbImage) -> Option<RgbImage> {
        let size = (image.width(), image.height());
        let [right, bottom] = [size.0, size.1].map(|it| it as f64 - 1.0);
        match *self {
            Self::Perspective { start, end } => {
                warp::warp(image, &warp::perspective(&start, &end)?, Corners::Stretched)
            }
            Self::Affine { translation, scale, degrees, shear } => {
                let matrix = warp::affine(size, translation, scale, degrees, shear);
                warp::warp(image, &matrix, Corners::Centred)
            }
            Self::Rotation { degrees } => {
                let matrix = warp::about([right / 2.0, bottom / 2.0], [1.0; 2], degrees);
                warp::warp(image, &matrix, Corners::Aligned)
            }
            Self::ResizedCrop { left, top, width, height } => {
                let (x, y) = (left as f64, top as f64);
                let (to_x, to_y) = (x + width as f64 - 1.0, y + height as f64 - 1.0);
                let from = [[x, y], [to_x, y], [to_x, to_y], [x, to_y]];
                let to = [[0.0, 0.0], [right, 0.0], [right, bottom], [0.0, bottom]];
                warp::warp(image, &warp::perspective(&from, &to)?, Corners::Aligned)
            }
            _ => None,
        }
    }

    /// What changes values.
    fn change(&self, image: &mut Planar) {
        match *self {
            Self::HorizontalFlip => {
                let width = image.width();
                for plane in image.planes_mut() {
                    plane.chunks_mut(width).for_each(<[f64]>::reverse);
                }
            }
            Self::ColorJiggle { brightness, contrast, saturation, hue, order } => {
                for which in order {
                    match which {
                        0 => colour::brightness(image, brightness),
                        1 => colour::contrast(image, contrast),
                        2 => colour::saturation(image, saturation),
                        _ => colour::hue(image, hue),
                    }
                }
            }
            Self::Grayscale => colour::grayscale(image),
            Self::Gamma { gamma, gain } => colour::gamma(image, gamma, gain),
            Self::Posterize { bits } => colour::posterize(image, bits),
            Self::Equalize => colour::equalize(image),
            Self::GaussianBlur { kernel, sigma } => filter::gaussian(image, kernel, sigma),
            Self::MotionBlur { kernel, degrees, direction } => {
                filter::motion(image, kernel, degrees, direction);
            }
            Self::GaussianNoise { std, seed } => noise(image, std, seed),
            Self::Erasing { left, top, width, height, value } => {
                let columns = image.width();
                for plane in image.planes_mut() {
                    for row in plane.chunks_mut(columns).skip(top).take(height) {
                        row.iter_mut().skip(left).take(width).for_each(|it| *it = value);
                    }
                }
            }
            Self::Snow { coefficient, brightness } => colour::snow(image, coefficient, brightness),
            Self::Fog { density, grey } => {
                let (columns, rows) = (image.width(), image.height());
                for plane in image.planes_mut() {
                    for (number, row) in plane.chunks_mut(columns).enumerate() {
                        let veil = density * (1.0 - 0.7 * number as f64 / rows as f64);
                        for it in row.iter_mut() {
                            *it += veil * (grey - *it);
                        }
                    }
                }
            }
            Self::Night { darkness, seed } => {
                colour::gamma(image, 1.0 + 2.0 * darkness, 1.0 - 0.4 * darkness);
                colour::saturation(image, 1.0 - 0.6 * darkness);
                noise(image, 0.05 * darkness, seed);
            }
            Self::Perspective { .. }
            | Self::Affine { .. }
            | Self::Rotation { .. }
            | Self::ResizedCrop { .. } => {}
        }
    }
}

/// Box and Muller's normal numbers, added.
fn noise(image: &mut Planar, std: f64, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    image.each(|value| {
        let (u, v): (f64, f64) = (random.random(), random.random());
        let radius = (-2.0 * (1.0 - u).ln()).sqrt();
        value + std * radius * (std::f64::consts::TAU * v).cos()
    });
}
