//! Images in memory: decoded once, read many times.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use fast_image_resize::{
    FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer,
    images::{Image, ImageRef},
    pixels::U8x3,
};
use image::RgbImage;
use rayon::prelude::*;

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
    #[must_use]
    pub fn new(bytes: Vec<u8>, (width, height): (usize, usize)) -> Self {
        Self { bytes, width, height }
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

fn decode(path: &Path) -> anyhow::Result<RgbImage> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    let image = image::load_from_memory(&bytes).with_context(|| path.display().to_string())?;
    Ok(image.to_rgb8())
}

/// Images of any size as planes of values in 0 to 1, resized by an antialiased bilinear filter.
///
/// # Errors
///
/// An image that cannot be read or decoded, by its path.
pub fn planes(paths: &[PathBuf], (width, height): (usize, usize)) -> anyhow::Result<Vec<f32>> {
    let plane = width * height;
    let mut values = vec![0.0; 3 * plane * paths.len()];
    values.par_chunks_mut(3 * plane).zip(paths).try_for_each(|(values, path)| {
        let image = decode(path)?;
        let (from_width, from_height) = image.dimensions();
        let source = ImageRef::new(from_width, from_height, image.as_raw(), PixelType::U8x3)?;
        let (to_width, to_height) = (u32::try_from(width)?, u32::try_from(height)?);
        let mut target = Image::new(to_width, to_height, PixelType::U8x3);
        let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Bilinear));
        // `Resizer::resize` would compile thirteen kinds of pixels, for minutes.
        let (Some(source), Some(mut typed)) =
            (source.typed_image::<U8x3>(), target.typed_image_mut::<U8x3>())
        else {
            bail!("pixels of another kind");
        };
        Resizer::new().resize_typed(&source, &mut typed, &options)?;
        for (index, byte) in target.buffer().iter().enumerate() {
            values[index % 3 * plane + index / 3] = f32::from(*byte) / 255.0;
        }
        anyhow::Ok(())
    })?;
    Ok(values)
}
