//! Generated datasets by name.

use std::{
    path::{Path, PathBuf},
    sync::Once,
};

use vpr_core::{Error, Observer, Provenance, Result};
use vpr_data::{DataRoots, Dataset, DatasetEntry, Generator, Layout, Tolerance};

use crate::{
    catalog::recipe_with,
    recipe::{self, Recipe},
    world::World,
};

/// What the names of generated datasets begin with.
const PREFIX: &str = "world/";

/// The generator of `world/<name>` and `world/<name>?key=value&key=value`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Worlds;

impl Generator for Worlds {
    fn makes(&self, id: &str) -> bool {
        is_world(id)
    }

    fn entry(&self, id: &str) -> Result<DatasetEntry> {
        entry(id)
    }

    fn open(
        &self,
        id: &str,
        roots: &DataRoots,
        cache: &Path,
        observer: &dyn Observer,
    ) -> Result<Dataset> {
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
}

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

fn entry(id: &str) -> Result<DatasetEntry> {
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
        every: None,
        origin: format!("generated here; counterpart: {}", recipe.counterpart),
        licence: "MIT OR Apache-2.0".to_owned(),
        note: None,
        provenance: Provenance::Generated,
    })
}
