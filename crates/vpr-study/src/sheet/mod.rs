//! A contact sheet of small framed images: rows with titles, numbers below the images.

mod font;

use std::path::PathBuf;

use image::{
    ExtendedColorType, ImageEncoder as _, Rgb, RgbImage,
    codecs::png::{CompressionType, FilterType, PngEncoder},
    imageops,
};
use rayon::prelude::*;
use vpr_core::{Error, Result};
use vpr_report::page;

/// Size of one image inside of its frame.
const TILE: (u32, u32) = (84, 63);
/// Width of a frame and of the gap around it.
const BORDER: u32 = 3;
const GAP: u32 = 4;
/// Lines of text below a tile.
const CAPTION: u32 = 2;
/// Levels of a colour, so that a sheet stays small.
const STEP: u8 = 16;

const PAPER: Rgb<u8> = Rgb([255; 3]);
const INK: Rgb<u8> = Rgb([34; 3]);
/// Grey; the blue and the vermilion of the figures, which colour-blind eyes tell apart.
const QUERY: Rgb<u8> = Rgb([120, 120, 120]);
const CORRECT: Rgb<u8> = Rgb([0, 114, 178]);
const WRONG: Rgb<u8> = Rgb([213, 94, 0]);

/// The colour around an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// Grey: an image that is neither right nor wrong.
    Neutral,
    /// Blue, with ✓ before the name: a correct reference.
    Correct,
    /// Vermilion, with ✗ before the name: a wrong reference.
    Wrong,
}

/// A framed image and what is said below it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tile {
    /// The file.
    pub image: PathBuf,
    /// What it is; about 12 letters.
    pub name: String,
    /// Its frame.
    pub frame: Frame,
    /// A distance, an uncertainty; about 15 letters.
    pub remark: String,
}

impl Tile {
    /// A query, by its index among the images.
    #[must_use]
    pub fn query(images: &[PathBuf], index: usize, remark: String) -> Self {
        let name = format!("query {index}");
        Self { image: images[index].clone(), name, frame: Frame::Neutral, remark }
    }

    /// A reference, by its index among the images.
    #[must_use]
    pub fn reference(images: &[PathBuf], index: usize, correct: bool, remark: String) -> Self {
        let frame = if correct { Frame::Correct } else { Frame::Wrong };
        Self { image: images[index].clone(), name: format!("ref {index}"), frame, remark }
    }
}

/// Rows of tiles with a title each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ContactSheet(Vec<Row>);

#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Row {
    /// Empty if the row belongs to the one above.
    title: String,
    tiles: Vec<Tile>,
}

impl ContactSheet {
    /// Whether nothing was added.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds tiles side by side under a title.
    pub fn add_row(&mut self, title: impl Into<String>, tiles: Vec<Tile>) {
        self.0.push(Row { title: title.into(), tiles });
    }

    /// Adds columns of tiles under a title, the first tiles side by side in one row, and so on.
    pub fn add_columns(&mut self, title: impl Into<String>, columns: Vec<Vec<Tile>>) {
        let height = columns.iter().map(Vec::len).max().unwrap_or(0);
        let mut title = title.into();
        for rank in 0..height {
            let tiles = columns.iter().filter_map(|column| column.get(rank).cloned()).collect();
            self.0.push(Row { title: std::mem::take(&mut title), tiles });
        }
    }

    /// Draws all tiles into a PNG file; the legend says what the colours and remarks mean.
    ///
    /// # Errors
    ///
    /// The first image that cannot be read, by its path.
    pub fn draw(&self, legend: &'static str) -> Result<page::Sheet> {
        let canvas = self.canvas()?;
        let mut png = Vec::new();
        PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::NoFilter)
            .write_image(&canvas, canvas.width(), canvas.height(), ExtendedColorType::Rgb8)
            .map_err(|cause| Error::format("contact sheet", "image", cause.to_string()))?;
        Ok(page::Sheet { png, legend })
    }

    fn canvas(&self) -> Result<RgbImage> {
        let side = |n: usize| u32::try_from(n).unwrap_or(0);
        let step = TILE.0 + 2 * BORDER + GAP;
        let columns = self.0.iter().map(|row| row.tiles.len()).max().unwrap_or(0);
        let longest = self.0.iter().map(|row| row.title.chars().count()).max().unwrap_or(0);
        let width = (side(columns) * step).max(side(longest) * 2 * font::ADVANCE) + 2 * GAP;
        // Where each row begins.
        let mut tops = Vec::new();
        let mut bottom = GAP;
        for row in &self.0 {
            bottom += if row.title.is_empty() { 0 } else { 2 * font::LINE + GAP };
            tops.push(bottom);
            bottom += TILE.1 + 2 * BORDER + CAPTION * font::LINE + 2 * GAP;
        }
        let mut canvas = RgbImage::from_pixel(width, bottom, PAPER);
        let places: Vec<(u32, u32, &Tile)> = self
            .0
            .iter()
            .zip(&tops)
            .flat_map(|(row, &top)| {
                row.tiles.iter().enumerate().map(move |(x, it)| (GAP + side(x) * step, top, it))
            })
            .collect();
        let tiles: Vec<Result<RgbImage>> = places.par_iter().map(|(_, _, it)| framed(it)).collect();
        for ((x, y, it), tile) in places.iter().zip(tiles) {
            imageops::replace(&mut canvas, &tile?, i64::from(*x), i64::from(*y));
            let (name, colour) = match it.frame {
                Frame::Neutral => (it.name.clone(), INK),
                Frame::Correct => (format!("✓ {}", it.name), CORRECT),
                Frame::Wrong => (format!("✗ {}", it.name), WRONG),
            };
            let below = y + TILE.1 + 2 * BORDER + 3;
            let fits = |text: &str| -> String {
                text.chars().take((step / font::ADVANCE) as usize).collect()
            };
            font::write(&mut canvas, (*x, below), &fits(&name), 1, colour);
            font::write(&mut canvas, (*x, below + font::LINE), &fits(&it.remark), 1, INK);
        }
        for (row, top) in self.0.iter().zip(tops).filter(|(row, _)| !row.title.is_empty()) {
            font::write(&mut canvas, (GAP, top - 2 * font::LINE), &row.title, 2, INK);
        }
        Ok(canvas)
    }
}

/// One image with its frame.
fn framed(tile: &Tile) -> Result<RgbImage> {
    let colour = match tile.frame {
        Frame::Neutral => QUERY,
        Frame::Correct => CORRECT,
        Frame::Wrong => WRONG,
    };
    let image = vpr_vision::image::decode(&tile.image)?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_and_numbers_are_written_beside_the_colour() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grey.png");
        RgbImage::from_pixel(32, 24, Rgb([200; 3])).save(&path).unwrap();
        let paths = [path];
        let remark = || "d 0.812".to_owned();
        let mut sheet = ContactSheet::default();
        let column = |correct| {
            vec![Tile::query(&paths, 0, remark()), Tile::reference(&paths, 0, correct, remark())]
        };
        sheet.add_columns("SUE: least and most uncertain", vec![column(true), column(false)]);
        let canvas = sheet.canvas().unwrap();
        // A title, two rows of two tiles: nothing stands outside, and every row has its text.
        let (tile_width, tile_height) = (TILE.0 + 2 * BORDER, TILE.1 + 2 * BORDER);
        let top = GAP + 2 * font::LINE + GAP;
        let count = |x: u32, y: u32, width: u32, height: u32, colour: Rgb<u8>| {
            let pixels = (x..x + width).flat_map(|x| (y..y + height).map(move |y| (x, y)));
            pixels.filter(|&(x, y)| *canvas.get_pixel(x, y) == colour).count()
        };
        assert!(count(0, 0, canvas.width(), top, INK) > 300, "a title");
        assert!(count(GAP, top + tile_height, tile_width, 12, INK) > 30, "`query 0`");
        let second = top + tile_height + CAPTION * font::LINE + 2 * GAP;
        let below = second + tile_height;
        assert!(count(GAP, below, tile_width, 12, CORRECT) > 20, "✓ in its colour");
        assert!(count(GAP + tile_width + GAP, below, tile_width, 12, WRONG) > 20, "✗ in its");
        assert!(count(GAP, below + font::LINE, tile_width, 12, INK) > 20, "a distance");
    }
}
