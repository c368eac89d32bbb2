//! Worlds on disk: rendered once into a folder named by the recipe's digest, checked on reuse.

use std::{
    fs,
    path::{Path, PathBuf},
};

use image::{
    ExtendedColorType, ImageEncoder, RgbImage,
    codecs::{jpeg::JpegEncoder, png::PngEncoder},
};
use ndarray::Array2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use vpr_core::{Error, Poses, Result};
use vpr_data::Dataset;
use vpr_files::npy;

use crate::{
    family::{Plan, Shot, plan, truth},
    layout::{self, Side},
    overlap::{self, Survey},
    partial::{self, Partial},
    recipe::{Recipe, SevenScenes},
    render::{Exposure, View, render},
};

/// Changes with every change of the bytes that any recipe gives; part of the folder's name.
pub const RENDERER: u32 = 5;

/// Quality of JPEG files.
const QUALITY: u8 = 92;
/// Its presence says that a folder is complete; its contents say what must be in it.
const STAMP: &str = "world.json";

/// A world that lies complete in a cache folder.
#[derive(Clone, Debug)]
pub struct World {
    /// What it was rendered from.
    pub recipe: Recipe,
    /// Where it lies.
    pub folder: PathBuf,
    /// Its images and ground truth, as the reader of its layout gives them.
    pub dataset: Dataset,
}

/// What must be in a complete folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stamp {
    label: String,
    renderer: u32,
    recipe: String,
    n_files: usize,
    n_bytes: u64,
    sha256: String,
}

impl World {
    /// Opens a world from `cache`, or renders it there first. `done` is called after every image.
    ///
    /// A folder is only trusted if its stamp is there and agrees with every file; otherwise it is
    /// removed and rendered again. Rendering writes to a temporary folder beside it and renames
    /// that at the end, so a killed render or a full disk leaves nothing that would be opened; what
    /// it leaves is removed by the next render in this cache, never what a living process holds.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the cache cannot be written or read, and those of [`Dataset::open`].
    pub fn open(recipe: &Recipe, cache: &Path, done: &(dyn Fn() + Sync)) -> Result<Self> {
        let text = toml::to_string(recipe)
            .map_err(|cause| Error::format(&recipe.name, "recipe", cause.to_string()))?;
        let folder = cache.join(folder_name(recipe, &text)?);
        if !is_complete(&folder)? {
            if folder.exists() {
                fs::remove_dir_all(&folder).map_err(Error::io(&folder))?;
            }
            write(recipe, &text, cache, &folder, done)?;
        }
        let dataset = layout::open(recipe, &folder)?;
        Ok(Self { recipe: recipe.clone(), folder, dataset })
    }

    /// Number of images that a recipe makes: references, queries and further views.
    ///
    /// # Errors
    ///
    /// Those of reading the files that the recipe names.
    pub fn count(recipe: &Recipe) -> Result<usize> {
        if recipe.stage.is_some() || recipe.seven_scenes.is_some() {
            let plan = plan(recipe)?;
            return Ok(plan.references.len() + plan.queries.len());
        }
        // The others need no scenes to tell.
        let grid = recipe.street.and_then(|street| street.grid);
        let n_views = grid.map_or(0, |grid| grid.rows * grid.columns);
        let n_queries = recipe.places.div_ceil(recipe.query_every) + recipe.new_places;
        Ok(recipe.places + n_queries + n_views)
    }

    /// The images of one side, in their order; [`Side::Grid`] has none unless the recipe asks.
    ///
    /// # Errors
    ///
    /// Those of [`Self::poses`].
    pub fn images(&self, side: Side) -> Result<Vec<PathBuf>> {
        match side {
            Side::References => Ok(self.dataset.references.clone()),
            Side::Queries => Ok(self.dataset.queries.clone()),
            Side::Grid => layout::grid_images(&self.recipe, &self.folder),
        }
    }

    /// Full poses (`world_from_camera`, metres, z up) of one side's images, in their order.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] or [`Error::Format`] if the pose table is not there or malformed.
    pub fn poses(&self, side: Side) -> Result<Poses> {
        layout::poses(&self.folder, side)
    }

    /// Depth along the optical axis in metres, `height × width`, infinite where nothing is within
    /// the format's range; for recipes with `depth = true`.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if there is no depth image, [`Error::Format`] if it is not one.
    ///
    /// # Panics
    ///
    /// If `index` is not below the number of images of that side.
    pub fn depth(&self, side: Side, index: usize) -> Result<Array2<f32>> {
        let images = self.images(side)?;
        let within = images[index].strip_prefix(&self.folder).unwrap_or(&images[index]);
        let path = self.folder.join(layout::depth_path(self.recipe.layout, side, within));
        let bytes = fs::read(&path).map_err(Error::io(&path))?;
        let image = image::load_from_memory_with_format(&bytes, image::ImageFormat::Png)
            .map_err(|cause| Error::format(&path, "image", cause.to_string()))?
            .to_luma16();
        let unit = layout::depth_unit(self.recipe.layout) as f32;
        Ok(Array2::from_shape_fn(
            (image.height() as usize, image.width() as usize),
            |(row, column)| match image.get_pixel(column as u32, row as u32).0[0] {
                u16::MAX => f32::INFINITY,
                value => f32::from(value) * unit,
            },
        ))
    }

    /// Share of every query's static surface points that every reference sees,
    /// `n_queries × n_references`; for recipes with `overlap = true`.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if the recipe did not ask for it, [`Error::Format`] if it is malformed.
    pub fn overlap(&self) -> Result<Array2<f32>> {
        Ok(npy::read_f32(&self.folder.join("overlap.npy"))?)
    }
}

/// One image of a plan with its exposure.
pub(crate) fn take(plan: &Plan, shot: &Shot) -> (RgbImage, Exposure) {
    let light = &plan.lights[shot.light];
    let view = View {
        scene: &plan.scenes[shot.scene],
        foreground: &shot.foreground,
        light,
        lamp: shot.lamp,
        camera: &shot.camera,
        pose: &shot.pose,
    };
    let exposure = render(&view);
    let width = shot.camera.width as usize;
    let image =
        shot.film.develop(&exposure.colours, width, light.max_gain, shot.falling, shot.seed);
    (image, exposure)
}

fn folder_name(recipe: &Recipe, text: &str) -> Result<String> {
    let files =
        recipe.seven_scenes.as_ref().map(SevenScenes::files).transpose()?.unwrap_or_default();
    let digest = Sha256::new()
        .chain_update(RENDERER.to_le_bytes())
        .chain_update(text)
        .chain_update(files)
        .finalize();
    let short = hex(&digest[..8]);
    Ok(format!("{}-{short}", recipe.name))
}

fn write(
    recipe: &Recipe,
    text: &str,
    cache: &Path,
    folder: &Path,
    done: &(dyn Fn() + Sync),
) -> Result<()> {
    partial::sweep(cache);
    let partial = Partial::create(cache)?;
    let root = partial.path();
    let mut plan = plan(recipe)?;
    layout::in_reading_order(recipe.layout, &mut plan);
    let surveys = [
        write_side(recipe, &plan, Side::References, root, done)?,
        write_side(recipe, &plan, Side::Queries, root, done)?,
    ];
    write_side(recipe, &plan, Side::Grid, root, done)?;
    let truth = truth(recipe.tolerance, &plan.queries, &plan.references);
    for (path, bytes) in layout::side_files(recipe, &plan, &truth) {
        save(&root.join(path), &bytes)?;
    }
    if recipe.overlap {
        let shares = overlap::matrix(&surveys[1], &surveys[0]);
        npy::write_f32(&root.join("overlap.npy"), shares.view())?;
    }
    save(&root.join("recipe.toml"), text.as_bytes())?;
    let stamp = stamp_of(root, recipe)?;
    let json = serde_json::to_vec_pretty(&stamp)
        .map_err(|cause| Error::format(root, STAMP, cause.to_string()))?;
    save(&root.join(STAMP), &json)?;
    match partial.publish(folder) {
        Ok(()) => Ok(()),
        // Somebody else finished the same world first.
        Err(_) if is_complete(folder)? => Ok(()),
        Err(cause) => Err(Error::io(folder)(cause)),
    }
}

fn write_side(
    recipe: &Recipe,
    plan: &Plan,
    side: Side,
    root: &Path,
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Survey>> {
    let shots = side.shots(plan);
    let surveys: Vec<Option<Survey>> = shots
        .par_iter()
        .enumerate()
        .map(|(index, shot)| {
            let (image, exposure) = take(plan, shot);
            let path = layout::image_path(recipe.layout, side, index, shot);
            save(&root.join(&path), &encode(&image, &path)?)?;
            if recipe.depth {
                let path = layout::depth_path(recipe.layout, side, &path);
                let bytes = encode_depth(&exposure, shot, layout::depth_unit(recipe.layout));
                save(
                    &root.join(&path),
                    &bytes.map_err(|cause| Error::format(&path, "image", cause.to_string()))?,
                )?;
            }
            done();
            Ok(recipe.overlap.then(|| Survey::new(&shot.camera, &shot.pose, &exposure)))
        })
        .collect::<Result<_>>()?;
    Ok(surveys.into_iter().flatten().collect())
}

fn encode(image: &RgbImage, path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let (width, height) = image.dimensions();
    let colour = ExtendedColorType::Rgb8;
    let written = if path.extension().is_some_and(|extension| extension == "png") {
        PngEncoder::new(&mut bytes).write_image(image, width, height, colour)
    } else {
        JpegEncoder::new_with_quality(&mut bytes, QUALITY).write_image(image, width, height, colour)
    };
    written.map_err(|cause| Error::format(path, "image", cause.to_string()))?;
    Ok(bytes)
}

/// Sixteen bits a pixel; 65535 is "further than that".
fn encode_depth(exposure: &Exposure, shot: &Shot, unit: f64) -> image::ImageResult<Vec<u8>> {
    let counts =
        exposure.depth.iter().map(|&depth| (f64::from(depth) / unit).round().min(65_535.0) as u16);
    let counts: Vec<u8> = counts.flat_map(u16::to_ne_bytes).collect();
    let mut bytes = Vec::new();
    let (width, height) = (shot.camera.width, shot.camera.height);
    PngEncoder::new(&mut bytes).write_image(&counts, width, height, ExtendedColorType::L16)?;
    Ok(bytes)
}

/// Writes a file of a folder under construction: it need not be safe, the folder appears as a whole.
fn save(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(Error::io(parent))?;
    }
    fs::write(path, bytes).map_err(Error::io(path))
}

/// Whether a folder has its stamp and every file is as the stamp says.
fn is_complete(folder: &Path) -> Result<bool> {
    let Ok(json) = fs::read(folder.join(STAMP)) else { return Ok(false) };
    let Ok(stamp) = serde_json::from_slice::<Stamp>(&json) else { return Ok(false) };
    let (n_files, n_bytes, sha256) = digest(folder)?;
    Ok(stamp.renderer == RENDERER
        && (stamp.n_files, stamp.n_bytes, stamp.sha256) == (n_files, n_bytes, sha256))
}

fn stamp_of(root: &Path, recipe: &Recipe) -> Result<Stamp> {
    let (n_files, n_bytes, sha256) = digest(root)?;
    let label = "generated".to_owned();
    Ok(Stamp { label, renderer: RENDERER, recipe: recipe.name.clone(), n_files, n_bytes, sha256 })
}

/// Number, size and digest of all files but the stamp, names included.
fn digest(root: &Path) -> Result<(usize, u64, String)> {
    let mut files = Vec::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).map_err(Error::io(&folder))? {
            let path = entry.map_err(Error::io(&folder))?.path();
            if path.is_dir() {
                folders.push(path);
            } else if path != root.join(STAMP) {
                files.push(path);
            }
        }
    }
    files.sort();
    let parts: Vec<(u64, [u8; 32])> = files
        .par_iter()
        .map(|path| {
            let bytes = fs::read(path).map_err(Error::io(path))?;
            let name = path.strip_prefix(root).unwrap_or(path).to_string_lossy().into_owned();
            let digest =
                Sha256::new().chain_update(name).chain_update([0]).chain_update(&bytes).finalize();
            Ok((bytes.len() as u64, digest.into()))
        })
        .collect::<Result<_>>()?;
    let mut all = Sha256::new();
    for (_, part) in &parts {
        all.update(part);
    }
    let n_bytes = parts.iter().map(|(length, _)| length).sum();
    Ok((files.len(), n_bytes, hex(&all.finalize())))
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    let digits: Vec<String> = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    digits.concat()
}
