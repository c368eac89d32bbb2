//! `rsf augment`: what fine-tuning may make of an image.

use std::path::PathBuf;

use rsf::{Operation, Preset};
use vpr_report::cli::{self, Outcome};
use vpr_vision::image::{self, ImageSize, RgbImage, from_pixels, resize_bilinear};

/// Largest side of a tile.
const TILE: usize = 160;

/// An image, and how it is changed.
#[derive(clap::Args)]
pub(crate) struct AugmentArgs {
    /// The image
    #[arg(long, value_name = "FILE")]
    image: PathBuf,
    /// The sheet to write: the image, then one tile for every augmentation, then variants
    #[arg(long, value_name = "PNG")]
    preview: PathBuf,
    /// Which augmentations
    #[arg(long, value_enum, default_value_t, value_name = "NAME")]
    augmentations: Preset,
    /// Variants with all of them
    #[arg(long, default_value_t = 8)]
    variants: u64,
    /// Decides the draws
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

pub(crate) fn run(args: &AugmentArgs) -> anyhow::Result<Outcome> {
    cli::check_out(&args.preview)?;
    let image = tile(&image::decode(&args.image)?)?;
    let augmentations = args.augmentations.augmentations();
    let size = (image.width(), image.height());
    let mut tiles = vec![image.clone()];
    let mut lines = vec!["image".to_owned()];
    for augmentation in &augmentations.0 {
        let always = rsf::Augmentations(vec![rsf::Augmentation { p: 1.0, ..augmentation.clone() }]);
        let operations: Vec<Operation> = always.draw(size, args.seed);
        lines.extend(operations.iter().map(|it| format!("{} {it:?}", augmentation.change.name())));
        tiles.push(always.apply(&image, args.seed));
    }
    for variant in 0..args.variants {
        let seed = args.seed + variant;
        let names: Vec<String> =
            augmentations.draw(size, seed).iter().map(|it| format!("{it:?}")).collect();
        lines.push(format!("seed {seed}: {}", names.join(", ")));
        tiles.push(augmentations.apply(&image, seed));
    }
    image::write_png(&sheet(&tiles), &args.preview)?;
    let numbered = lines.iter().enumerate().map(|(at, line)| format!("{at}\t{line}\n"));
    cli::print(&numbered.collect::<String>())?;
    Ok(Outcome::Success)
}

/// The image, no larger than a tile.
fn tile(image: &RgbImage) -> vpr_core::Result<RgbImage> {
    let longest = image.width().max(image.height());
    if longest <= TILE {
        return Ok(image.clone());
    }
    let side = |it: usize| (it * TILE / longest).max(1);
    resize_bilinear(image, ImageSize { width: side(image.width()), height: side(image.height()) })
}

/// Tiles of one size in rows of five.
fn sheet(tiles: &[RgbImage]) -> RgbImage {
    const COLUMNS: usize = 5;
    const GAP: usize = 4;
    let (width, height) = tiles.first().map_or((1, 1), |it| (it.width(), it.height()));
    let size = ImageSize {
        width: COLUMNS * (width + GAP) + GAP,
        height: tiles.len().div_ceil(COLUMNS) * (height + GAP) + GAP,
    };
    let mut pixels = vec![255; 3 * size.width * size.height];
    for (number, tile) in tiles.iter().enumerate() {
        let left = GAP + number % COLUMNS * (width + GAP);
        let top = GAP + number / COLUMNS * (height + GAP);
        for (row, line) in tile.as_slice().chunks(3 * width).enumerate() {
            let at = 3 * ((top + row) * size.width + left);
            pixels[at..at + line.len()].copy_from_slice(line);
        }
    }
    from_pixels(size, pixels)
}
