//! Datasets by name, generated and real ones alike.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Once,
};

use ndarray::{Array3, Axis};
use sha2::{Digest, Sha256};
use vpr_core::{
    Error, Observer, Result,
    dataset::{
        DataRoots, Dataset, DatasetEntry, Layout, Manifest, Tolerance,
        layout::npz_images::FramePairs,
    },
    map::replace,
};

use crate::{
    catalog::recipe_with,
    recipe::{self, Recipe},
    world::{World, hex},
};

/// What the names of generated datasets begin with.
const PREFIX: &str = "world/";

/// Whether a dataset of this name is rendered on the spot.
#[must_use]
pub fn is_world(id: &str) -> bool {
    id.starts_with(PREFIX)
}

/// The recipe of `world/<name>`, or of `world/<name>?key=value&key=value` with some keys set.
///
/// # Errors
///
/// As [`recipe_with`]; [`Error::Parameter`] for a setting that is not `key=value`.
pub fn named_recipe(id: &str) -> Result<Recipe> {
    let (name, settings) = id.split_once('?').unwrap_or((id, ""));
    let reason = "settings are written world/name?key=value&key=value";
    let settings = settings
        .split('&')
        .filter(|setting| !setting.is_empty())
        .map(|setting| {
            let wrong = || Error::Parameter { name: "dataset", value: id.to_owned(), reason };
            setting.split_once('=').ok_or_else(wrong)
        })
        .collect::<Result<Vec<_>>>()?;
    recipe_with(name, &settings)
}

/// What is known of a generated dataset before it is rendered, as the manifest says it of others.
///
/// # Errors
///
/// As [`named_recipe`].
pub fn entry(id: &str) -> Result<DatasetEntry> {
    let recipe = named_recipe(id)?;
    let layout = match recipe.layout {
        recipe::Layout::VprBench => Layout::VprBench,
        recipe::Layout::Utm => Layout::UtmNames,
        recipe::Layout::SevenScenes => Layout::SevenScenes,
    };
    Ok(DatasetEntry {
        id: id.to_owned(),
        name: format!("{} (generated)", recipe.name),
        layout,
        path: PathBuf::from(id),
        matches: None,
        queries: None,
        references: None,
        tolerance: match recipe.tolerance {
            recipe::Tolerance::Frames(frames) => Tolerance::Frames(frames),
            recipe::Tolerance::RadiusM(radius) => Tolerance::Metres(radius),
        },
        spacing_m: None,
        frames: None,
        origin: format!("generated here; counterpart: {}", recipe.counterpart),
        licence: "MIT OR Apache-2.0".to_owned(),
        note: None,
    })
}

/// Opens the dataset called `id`: images, ground truth, poses of the kind its layout has (planar
/// in metres, or six degrees of freedom), and whether it is real or generated.
///
/// `world/<name>`, with or without settings (see [`named_recipe`]), is rendered into `cache` unless
/// it is there; any other name is looked up in the built-in manifest and is `None` if its images
/// are not in `roots`. Images that lie in one archive are unpacked into `cache`.
///
/// # Errors
///
/// [`Error::Unknown`] with the names there are, those of [`World::open`], and those of
/// [`Dataset::open`] for data that is there but malformed. Data without images is `None`.
pub fn open_named(
    id: &str,
    roots: &DataRoots,
    cache: &Path,
    observer: &dyn Observer,
) -> Result<Option<Dataset>> {
    if is_world(id) {
        return render(id, roots, cache, observer).map(Some);
    }
    let manifest = Manifest::builtin();
    let entry = manifest.find(id)?;
    let Ok(folder) = roots.find(&entry.path) else { return Ok(None) };
    let images = match entry.layout {
        Layout::VprBench | Layout::ImagePairs => "query",
        Layout::UtmNames => "queries",
        Layout::SevenScenes if !has_sequence(&folder) => return Ok(None),
        Layout::SevenScenes => ".",
        Layout::Npz => return unpack(entry, &folder, cache).map(Some),
        Layout::InvarianceScores => return Ok(None),
    };
    // Ground truths are published without the images.
    let is_at_hand = roots.find(&entry.path.join(images)).is_ok();
    is_at_hand.then(|| Dataset::open(entry, roots)).transpose()
}

fn render(id: &str, roots: &DataRoots, cache: &Path, observer: &dyn Observer) -> Result<Dataset> {
    let recipe = named_recipe(id)?.along_real_paths(roots);
    let n_images = World::count(&recipe)?;
    let begun = Once::new();
    let done = || {
        begun.call_once(|| observer.start(&format!("rendering {id}"), n_images));
        observer.step();
    };
    let world = World::open(&recipe, cache, &done)?;
    if begun.is_completed() {
        observer.end();
    }
    Ok(Dataset { id: id.to_owned(), ..world.dataset })
}

/// Whether a 7-Scenes folder has images, not only lists of poses.
fn has_sequence(folder: &Path) -> bool {
    folder.join("seq-01").is_dir()
}

/// Writes the frames of an archive as PNG files, those that are not there yet byte by byte.
fn unpack(entry: &DatasetEntry, folder: &Path, cache: &Path) -> Result<Dataset> {
    let pairs = FramePairs::read(folder, entry.frames)?;
    let mut digest = Sha256::new();
    for side in [&pairs.references, &pairs.queries] {
        digest.update(side.as_standard_layout().as_slice().unwrap_or_default());
    }
    let short = hex(&digest.finalize()[..8]);
    let root = cache.join(format!("{}-{short}", entry.id));
    let queries = unpack_side(&pairs.queries, &pairs.frames, &root.join("query"))?;
    let references = unpack_side(&pairs.references, &pairs.frames, &root.join("ref"))?;
    Dataset::of_pairs(entry, queries, references)
}

fn unpack_side(images: &Array3<u8>, frames: &[usize], folder: &Path) -> Result<Vec<PathBuf>> {
    fs::create_dir_all(folder).map_err(Error::io(folder))?;
    let (_, height, width) = images.dim();
    let length =
        |n: usize| u32::try_from(n).map_err(|err| Error::format(folder, "size", err.to_string()));
    let (height, width) = (length(height)?, length(width)?);
    let mut paths = Vec::new();
    for (image, frame) in images.axis_iter(Axis(0)).zip(frames) {
        let path = folder.join(format!("{frame:07}.png"));
        let levels: Vec<u8> = image.iter().copied().collect();
        let bytes = encode(&levels, width, height)
            .map_err(|cause| Error::format(&path, "image", cause.to_string()))?;
        if fs::read(&path).ok().as_ref() != Some(&bytes) {
            replace(&path, &bytes)?;
        }
        paths.push(path);
    }
    Ok(paths)
}

fn encode(levels: &[u8], width: u32, height: u32) -> image::ImageResult<Vec<u8>> {
    use image::{ExtendedColorType, ImageEncoder as _, codecs::png::PngEncoder};
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(levels, width, height, ExtendedColorType::L8)?;
    Ok(bytes)
}
