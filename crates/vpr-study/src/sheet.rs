//! A contact sheet of small framed images.

use std::path::PathBuf;

use image::{
    ExtendedColorType, ImageEncoder as _, Rgb, RgbImage,
    codecs::png::{CompressionType, FilterType, PngEncoder},
    imageops,
};
use rayon::prelude::*;
use vpr_core::{Error, Result};
use vpr_report::page;

/// Size of one tile inside of its frame.
const TILE: (u32, u32) = (64, 48);
/// Width of a frame and of the gap around it.
const BORDER: u32 = 3;
const GAP: u32 = 2;
/// Levels of a colour, so that a sheet stays small.
const STEP: u8 = 16;

/// One image and the colour around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// A query, by index, grey.
    Query(usize),
    /// A reference, by index, green if it is correct and red if not.
    Reference(usize, bool),
}

/// Rows of tiles.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ContactSheet(Vec<Vec<Frame>>);

impl ContactSheet {
    /// Adds tiles side by side.
    pub fn add_row(&mut self, row: Vec<Frame>) {
        self.0.push(row);
    }

    /// Adds columns of tiles, the first tiles side by side in one row, and so on.
    pub fn add_columns(&mut self, columns: Vec<Vec<Frame>>) {
        let height = columns.iter().map(Vec::len).max().unwrap_or(0);
        for rank in 0..height {
            self.0.push(columns.iter().filter_map(|column| column.get(rank).copied()).collect());
        }
    }

    /// Draws all tiles into a PNG file.
    ///
    /// # Errors
    ///
    /// The first image that cannot be read, by its path.
    pub fn draw(&self, queries: &[PathBuf], references: &[PathBuf]) -> Result<page::Sheet> {
        let canvas = self.canvas(queries, references)?;
        let mut png = Vec::new();
        PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::NoFilter)
            .write_image(&canvas, canvas.width(), canvas.height(), ExtendedColorType::Rgb8)
            .map_err(|cause| Error::format("contact sheet", "image", cause.to_string()))?;
        let legend = "Grey: query; green: correct reference; red: wrong reference.";
        Ok(page::Sheet { png, legend })
    }

    fn canvas(&self, queries: &[PathBuf], references: &[PathBuf]) -> Result<RgbImage> {
        let columns = self.0.iter().map(Vec::len).max().unwrap_or(0);
        let side =
            |n: usize, tile: u32| u32::try_from(n).unwrap_or(0) * (tile + 2 * BORDER + GAP) + GAP;
        let mut canvas = RgbImage::from_pixel(
            side(columns, TILE.0).max(1),
            side(self.0.len(), TILE.1).max(1),
            Rgb([255; 3]),
        );
        let places: Vec<(usize, usize, Frame)> = self
            .0
            .iter()
            .enumerate()
            .flat_map(|(row, frames)| frames.iter().enumerate().map(move |(x, &it)| (row, x, it)))
            .collect();
        let tiles: Vec<Result<RgbImage>> =
            places.par_iter().map(|(_, _, frame)| tile(*frame, queries, references)).collect();
        for ((row, column, _), tile) in places.iter().zip(tiles) {
            let (x, y) = (side(*column, TILE.0), side(*row, TILE.1));
            imageops::replace(&mut canvas, &tile?, i64::from(x), i64::from(y));
        }
        Ok(canvas)
    }
}

/// One image with its frame.
fn tile(frame: Frame, queries: &[PathBuf], references: &[PathBuf]) -> Result<RgbImage> {
    let (path, colour) = match frame {
        Frame::Query(query) => (&queries[query], Rgb([120, 120, 120])),
        Frame::Reference(reference, true) => (&references[reference], Rgb([40, 160, 60])),
        Frame::Reference(reference, false) => (&references[reference], Rgb([210, 40, 40])),
    };
    let image = vpr_vision::image::decode(path)?;
    let side = |it: usize| u32::try_from(it).unwrap_or(u32::MAX);
    let (width, height) = (side(image.width()), side(image.height()));
    let pixels = image.as_slice().to_vec();
    let Some(image) = RgbImage::from_raw(width, height, pixels) else {
        let (expected, actual) = (image.width() * image.height(), image.as_slice().len());
        let what = "pixels of an image";
        return Err(Error::Mismatch { what, expected, actual });
    };
    let mut small = imageops::thumbnail(&image, TILE.0, TILE.1);
    for pixel in small.pixels_mut() {
        pixel.0 = pixel.0.map(|it| it / STEP * STEP + STEP / 2);
    }
    let mut framed = RgbImage::from_pixel(TILE.0 + 2 * BORDER, TILE.1 + 2 * BORDER, colour);
    imageops::replace(&mut framed, &small, i64::from(BORDER), i64::from(BORDER));
    Ok(framed)
}
