//! From an image to a network's input: size, interpolation, channels, normalisation.

use fast_image_resize::{
    FilterType, PixelTrait, PixelType, ResizeAlg, ResizeError, ResizeOptions, Resizer,
    images::{Image, ImageRef},
    pixels,
};
use vpr_core::Error;
use vpr_vision::image::{
    ImageSize, MAX_PIXELS, RgbImage, equalize_luma, gray, resize_bicubic, resize_bilinear,
};

use crate::Result;

/// How images become the input of a network.
///
/// A value `x` of 0 to 255 in channel `c` becomes `(x · scale − mean[c]) / std[c]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Preprocessing {
    /// Which size images get.
    pub size: Size,
    /// How they get it.
    pub interpolation: Interpolation,
    /// Which channels the network sees.
    pub channels: Channels,
    /// Usually 1/255, or 1 for networks of Caffe.
    pub scale: f32,
    /// Subtracted, in the order of the channels.
    pub mean: [f32; 3],
    /// Divided by.
    pub std: [f32; 3],
    /// Whether the histogram of an image's luma is equalised first.
    pub equalize: bool,
    /// Whether resized values keep their fraction, as when tensors are resized after they were
    /// normalised; otherwise they are rounded to 8 bits, as images are.
    pub resize_after_normalize: bool,
}

/// Which size images get.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Always this one; the aspect ratio is not kept.
    Fixed {
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
    },
    /// The shorter side gets this length, the longer one follows.
    ShorterSide(usize),
    /// The image's own.
    Native,
    /// The image's own, each side rounded to the nearest multiple of this.
    NativeMultipleOf(usize),
}

/// How images are resized.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// OpenCV's `INTER_LINEAR`: two taps, no antialiasing.
    BilinearOpenCv,
    /// OpenCV's `INTER_CUBIC`: four taps, no antialiasing.
    BicubicOpenCv,
    /// Pillow's and torchvision's bilinear with antialiasing.
    Bilinear,
    /// Pillow's and torchvision's bicubic with antialiasing.
    Bicubic,
    /// The nearest pixel.
    Nearest,
}

/// Which channels a network sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channels {
    /// Red, green, blue.
    Rgb,
    /// Blue, green, red, as networks of Caffe do.
    Bgr,
    /// Luma by ITU-R BT.601.
    Gray,
}

impl Preprocessing {
    /// `ImageNet`'s mean and standard deviation, RGB, values of 0 to 1, antialiased bilinear.
    #[must_use]
    pub fn image_net(height: usize, width: usize) -> Self {
        Self {
            size: Size::Fixed { height, width },
            interpolation: Interpolation::Bilinear,
            channels: Channels::Rgb,
            scale: 1.0 / 255.0,
            mean: [0.485, 0.456, 0.406],
            std: [0.229, 0.224, 0.225],
            equalize: false,
            resize_after_normalize: false,
        }
    }

    /// Number of channels.
    #[must_use]
    pub fn n_channels(&self) -> usize {
        if self.channels == Channels::Gray { 1 } else { 3 }
    }

    /// The size that an image of `size` gets.
    #[must_use]
    pub fn target(&self, size: ImageSize) -> ImageSize {
        match self.size {
            Size::Fixed { height, width } => ImageSize { width, height },
            Size::Native => size,
            Size::NativeMultipleOf(step) => {
                let round = |side: usize| ((side + step / 2) / step).max(1) * step;
                ImageSize { width: round(size.width), height: round(size.height) }
            }
            // torchvision rounds the longer side down.
            Size::ShorterSide(shorter) => {
                let longer =
                    |long: usize, short: usize| (shorter * long / short.max(1)).max(shorter);
                if size.width <= size.height {
                    ImageSize { width: shorter, height: longer(size.height, size.width) }
                } else {
                    ImageSize { width: longer(size.width, size.height), height: shorter }
                }
            }
        }
    }

    /// The input that an image becomes: `channels × height × width` values, and its size.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the image has no pixels or would get more than [`MAX_PIXELS`].
    pub fn apply(&self, image: &RgbImage) -> Result<(Vec<f32>, ImageSize)> {
        let size = self.target(image.size());
        let equalized = self.equalize.then(|| equalize_luma(image));
        let image = equalized.as_ref().unwrap_or(image);
        match self.channels {
            Channels::Gray => {
                let gray = gray(image);
                let values = self.resized::<1>(gray.as_slice(), gray.size(), size)?;
                Ok((self.normalized::<1>(&values, [0]), size))
            }
            Channels::Rgb | Channels::Bgr => {
                let values = self.resized::<3>(image.as_slice(), image.size(), size)?;
                let order = if self.channels == Channels::Rgb { [0, 1, 2] } else { [2, 1, 0] };
                Ok((self.normalized::<3>(&values, order), size))
            }
        }
    }

    fn resized<const C: usize>(
        &self,
        pixels: &[u8],
        from: ImageSize,
        to: ImageSize,
    ) -> Result<Vec<f32>> {
        check(from)?;
        check(to)?;
        let floats = |pixels: &[u8]| pixels.iter().copied().map(f32::from).collect();
        if from == to {
            return Ok(floats(pixels));
        }
        let image = || vpr_vision::image::from_pixels::<C>(from, pixels.to_vec());
        match self.interpolation {
            Interpolation::BilinearOpenCv => {
                return Ok(floats(resize_bilinear(&image(), to)?.as_slice()));
            }
            Interpolation::BicubicOpenCv => {
                return Ok(floats(resize_bicubic(&image(), to)?.as_slice()));
            }
            _ => {}
        }
        if !self.resize_after_normalize {
            let kind = if C == 1 { PixelType::U8 } else { PixelType::U8x3 };
            return Ok(floats(&self.filtered(pixels, from, to, kind)?));
        }
        let values: Vec<f32> = floats(pixels);
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
        let kind = if C == 1 { PixelType::F32 } else { PixelType::F32x3 };
        let bytes = self.filtered(&bytes, from, to, kind)?;
        Ok(bytes.as_chunks().0.iter().map(|&chunk| f32::from_ne_bytes(chunk)).collect())
    }

    /// Resizes by convolution with a filter.
    fn filtered(
        &self,
        bytes: &[u8],
        from: ImageSize,
        to: ImageSize,
        kind: PixelType,
    ) -> Result<Vec<u8>> {
        let refuse = |reason: String| Error::format("image", "resize", reason);
        let side = |side: usize| u32::try_from(side).expect("at most 2^26");
        let source = ImageRef::new(side(from.width), side(from.height), bytes, kind)
            .map_err(|err| refuse(err.to_string()))?;
        let mut target = Image::new(side(to.width), side(to.height), kind);
        let algorithm = match self.interpolation {
            Interpolation::Nearest => ResizeAlg::Nearest,
            Interpolation::Bicubic | Interpolation::BicubicOpenCv => {
                ResizeAlg::Convolution(FilterType::CatmullRom)
            }
            Interpolation::Bilinear | Interpolation::BilinearOpenCv => {
                ResizeAlg::Convolution(FilterType::Bilinear)
            }
        };
        let options = ResizeOptions::new().resize_alg(algorithm).use_alpha(false);
        // `Resizer::resize` would compile thirteen kinds of pixels, for minutes.
        let typed = match kind {
            PixelType::U8 => typed::<pixels::U8>(&source, &mut target, &options),
            PixelType::U8x3 => typed::<pixels::U8x3>(&source, &mut target, &options),
            PixelType::F32 => typed::<pixels::F32>(&source, &mut target, &options),
            _ => typed::<pixels::F32x3>(&source, &mut target, &options),
        };
        typed.map_err(|err| refuse(err.to_string()))?;
        Ok(target.into_vec())
    }

    /// Interleaved pixels become normalised planes; plane `c` is channel `order[c]`.
    fn normalized<const C: usize>(&self, values: &[f32], order: [usize; C]) -> Vec<f32> {
        let (pixels, _) = values.as_chunks::<C>();
        let plane = |(channel, &at): (usize, &usize)| {
            let (mean, std) = (self.mean[channel], self.std[channel]);
            pixels.iter().map(move |pixel| (pixel[at] * self.scale - mean) / std)
        };
        order.iter().enumerate().flat_map(plane).collect()
    }
}

/// Resizes between images of one kind of pixel.
fn typed<P: PixelTrait>(
    source: &ImageRef<'_>,
    target: &mut Image<'_>,
    options: &ResizeOptions,
) -> std::result::Result<(), ResizeError> {
    match (source.typed_image::<P>(), target.typed_image_mut::<P>()) {
        (Some(source), Some(mut target)) => {
            Resizer::new().resize_typed(&source, &mut target, options)
        }
        _ => Err(ResizeError::PixelTypesAreDifferent),
    }
}

fn check(size: ImageSize) -> Result<()> {
    match size.width.checked_mul(size.height) {
        Some(1..=MAX_PIXELS) => Ok(()),
        _ => Err(Error::Parameter {
            name: "image_size",
            value: format!("{}x{}", size.width, size.height),
            reason: "an image has at least one pixel and at most 2^26",
        }
        .into()),
    }
}
