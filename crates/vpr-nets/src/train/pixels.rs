//! Images in memory: decoded once, read many times.

use std::path::{Path, PathBuf};

use fast_image_resize::{
    FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer,
    images::{Image, ImageRef},
    pixels::U8x3,
};
use rayon::prelude::*;
use vpr_core::{Error, Result};
use vpr_vision::image;

/// One image: rows of red, green, blue.
#[derive(Clone, Copy, Debug)]
pub struct Pixels<'a> {
    /// `3 × width × height` bytes.
    pub bytes: &'a [u8],
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// Images of one size, back to back.
#[derive(Clone, Debug)]
pub struct Album {
    bytes: Vec<u8>,
    width: usize,
    height: usize,
}

impl Pixels<'_> {
    /// The colour between pixels, in 0 to 1; the border goes on outside.
    #[must_use]
    pub fn bilinear(&self, x: f32, y: f32) -> [f32; 3] {
        let (x, y) =
            (x.clamp(0.0, (self.width - 1) as f32), y.clamp(0.0, (self.height - 1) as f32));
        let (left, top) = (x.floor(), y.floor());
        let (across, down) = (x - left, y - top);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let (left, top) = (left as usize, top as usize);
        let (right, bottom) = ((left + 1).min(self.width - 1), (top + 1).min(self.height - 1));
        let at = |column: usize, row: usize, channel: usize| {
            f32::from(self.bytes[3 * (row * self.width + column) + channel])
        };
        [0, 1, 2].map(|channel| {
            let above = at(left, top, channel) * (1.0 - across) + at(right, top, channel) * across;
            let below =
                at(left, bottom, channel) * (1.0 - across) + at(right, bottom, channel) * across;
            (above * (1.0 - down) + below * down) / 255.0
        })
    }
}

impl Album {
    /// Images of this width and height, back to back.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if the bytes are no whole number of images.
    pub fn new(bytes: Vec<u8>, (width, height): (usize, usize)) -> Result<Self> {
        let each = 3 * width * height;
        if each == 0 || !bytes.len().is_multiple_of(each) {
            let expected = bytes.len().div_ceil(each.max(1)) * each;
            return Err(Error::Mismatch { what: "bytes of images", expected, actual: bytes.len() });
        }
        Ok(Self { bytes, width, height })
    }

    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bytes.len() / (3 * self.width * self.height)
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// One image.
    ///
    /// # Panics
    ///
    /// If there are not so many.
    #[must_use]
    pub fn get(&self, index: usize) -> Pixels<'_> {
        let each = 3 * self.width * self.height;
        let bytes = &self.bytes[index * each..(index + 1) * each];
        Pixels { bytes, width: self.width, height: self.height }
    }
}

/// Images of any size as planes of values in 0 to 1, `n × 3 × height × width`, resized by an
/// antialiased bilinear filter.
///
/// # Errors
///
/// Those of [`image::decode`], by path.
pub fn planes(paths: &[PathBuf], (width, height): (usize, usize)) -> Result<Vec<f32>> {
    let plane = width * height;
    let mut values = vec![0.0; 3 * plane * paths.len()];
    values
        .par_chunks_mut((3 * plane).max(1))
        .zip(paths)
        .try_for_each(|(values, path)| fill(values, path, (width, height)))?;
    Ok(values)
}

fn fill(values: &mut [f32], path: &Path, (width, height): (usize, usize)) -> Result<()> {
    let image = image::decode(path)?;
    let refused = |reason: String| Error::format(path, "size", reason);
    let narrow = |n: usize| u32::try_from(n).map_err(|cause| refused(cause.to_string()));
    let (from, pixels) = ((narrow(image.width())?, narrow(image.height())?), image.as_slice());
    let source = ImageRef::new(from.0, from.1, pixels, PixelType::U8x3)
        .map_err(|cause| refused(cause.to_string()))?;
    let mut target = Image::new(narrow(width)?, narrow(height)?, PixelType::U8x3);
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Bilinear));
    // `Resizer::resize` would compile thirteen kinds of pixels, for minutes.
    let (Some(source), Some(mut typed)) =
        (source.typed_image::<U8x3>(), target.typed_image_mut::<U8x3>())
    else {
        return Err(refused("pixels of another kind".to_owned()));
    };
    let resized = Resizer::new().resize_typed(&source, &mut typed, &options);
    resized.map_err(|cause| refused(cause.to_string()))?;
    let plane = width * height;
    for (index, byte) in target.buffer().iter().enumerate() {
        values[index % 3 * plane + index / 3] = f32::from(*byte) / 255.0;
    }
    Ok(())
}
