//! Contact sheets: a few places of a world, as references see them and as queries do.

use image::{Rgb, RgbImage, imageops::replace};
use rayon::prelude::*;

use crate::{
    family::{Shot, plan},
    recipe::Recipe,
    world::take,
};

/// White between the images, pixels.
const GAP: u32 = 4;

/// A sheet of `n` queries spread over the world, each beside the reference nearest to it.
///
/// Nothing is written or cached.
///
/// # Errors
///
/// Those of reading the files that the recipe names.
pub fn preview(recipe: &Recipe, n: usize, columns: usize) -> vpr_core::Result<RgbImage> {
    let plan = plan(recipe)?;
    let n = n.clamp(1, plan.queries.len());
    let nearest = |query: &Shot| {
        let distance =
            |shot: &Shot| (shot.pose.translation.vector - query.pose.translation.vector).norm();
        plan.references.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    };
    let picks: Vec<&Shot> = (0..n)
        .map(|k| &plan.queries[(2 * k + 1) * plan.queries.len() / (2 * n)])
        .flat_map(|query| [nearest(query).unwrap_or(query), query])
        .collect();
    let images: Vec<RgbImage> = picks.par_iter().map(|shot| take(&plan, shot).0).collect();
    let (width, height) = (recipe.camera.width + GAP, recipe.camera.height + GAP);
    let columns = 2 * columns.clamp(1, n) as u32;
    let rows = (images.len() as u32).div_ceil(columns);
    let mut sheet = RgbImage::from_pixel(columns * width, rows * height, Rgb([255; 3]));
    for (index, image) in (0_u32..).zip(&images) {
        let (x, y) = (index % columns * width, index / columns * height);
        replace(&mut sheet, image, i64::from(x), i64::from(y));
    }
    Ok(sheet)
}
