//! Recipes: worlds as data, checked before anything is built; one file per family table.

mod campus;
mod interior;
mod rail;
mod settings;
mod seven_scenes;
mod stage;
mod street;

use std::path::Path;

pub use campus::Campus;
pub use interior::{Interior, Kind};
pub use rail::Rail;
use serde::{Deserialize, Serialize};
pub use seven_scenes::SevenScenes;
pub use stage::{Stage, StageKind};
pub use street::{Grid, Street};
use vpr_core::Error;
use vpr_data::DataRoots;

use crate::{
    camera::Camera,
    refusal::{Refusal, between, count},
    traverse::Traverse,
};

/// A world: which places, seen how, written in which layout.
///
/// Exactly one of the family tables (`street`, `rail`, …) is present.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// Its name after `world/`.
    pub name: String,
    /// The published dataset whose part it takes.
    pub counterpart: String,
    /// Decides everything that the numbers leave open.
    pub seed: u64,
    /// The folders and names that the images get.
    pub layout: Layout,
    /// Number of places along the references' route.
    pub places: usize,
    /// Number of further queries at places that no reference shows.
    #[serde(default)]
    pub new_places: usize,
    /// Every how many-th place has a query.
    #[serde(default = "one")]
    pub query_every: usize,
    /// When a reference is correct.
    pub tolerance: Tolerance,
    /// The camera of both traverses.
    #[serde(default)]
    pub camera: Camera,
    /// Also write a depth image per image.
    #[serde(default)]
    pub depth: bool,
    /// Also write the overlap of every query with every reference.
    #[serde(default)]
    pub overlap: bool,
    /// The map's traverse.
    #[serde(default)]
    pub references: Traverse,
    /// The traverse to be localized.
    #[serde(default)]
    pub queries: Traverse,
    /// City blocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub street: Option<Street>,
    /// One railway track.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rail: Option<Rail>,
    /// A path between buildings and lawns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub campus: Option<Campus>,
    /// Corridors and rooms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interior: Option<Interior>,
    /// A few places under measured viewpoints and lights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<Stage>,
    /// Rooms of a few square metres and a hand-held camera.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seven_scenes: Option<SevenScenes>,
}

/// The folders and names of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// `query/0000000.jpg`, `ref/0000000.jpg`, `ground_truth_new.npy`.
    VprBench,
    /// `images/test/{database,queries}/@easting@northing@….jpg`.
    Utm,
    /// `seq-01/frame-000000.{color.png,depth.png,pose.txt}`; references in the first sequence, queries
    /// in the second, further views in the third.
    SevenScenes,
}

/// When a reference is correct for a query; exactly one is given.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Tolerance {
    /// Up to this many places apart along the route.
    Frames(usize),
    /// Up to this many metres apart in the plane, the limit included.
    RadiusM(f64),
}

/// The line of a byte, and the key that line sets.
fn place(text: &str, at: usize) -> String {
    let before = text.get(..at).unwrap_or(text);
    let number = before.matches('\n').count() + 1;
    let line = text.lines().nth(number - 1).unwrap_or_default();
    match line.split_once('=') {
        Some((key, _)) => format!("line {number}, `{}`", key.trim()),
        None => format!("line {number}"),
    }
}

fn one() -> usize {
    1
}

impl Recipe {
    /// Reads and checks a recipe; `path` is for messages.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] names the key that is unknown, missing or out of its range.
    pub fn parse(text: &str, path: &Path) -> vpr_core::Result<Self> {
        let recipe: Self = toml::from_str(text).map_err(|error| {
            let place =
                error.span().map_or_else(|| "recipe".to_owned(), |span| place(text, span.start));
            Error::format(path, place, error.message())
        })?;
        recipe.checked(path)?;
        Ok(recipe)
    }

    /// Reads a recipe file and sets some of its keys, as [`crate::recipe_with`] does.
    ///
    /// # Errors
    ///
    /// [`Error::Io`], and those of [`Self::parse`].
    pub fn read_with(path: &Path, settings: &[(&str, &str)]) -> vpr_core::Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Error::io(path))?;
        Self::parse_with(&text, path, settings)
    }

    /// The steps of a route with this distance between them at which images are taken: the places,
    /// then, far enough from them that no reference is correct, the new ones.
    pub(crate) fn steps(&self, spacing_m: f64) -> Vec<usize> {
        let gap = match self.tolerance {
            Tolerance::RadiusM(radius) if self.new_places > 0 => {
                (radius / spacing_m).ceil() as usize + 4
            }
            _ => 0,
        };
        let new = self.places + gap..self.places + gap + self.new_places;
        (0..self.places).chain(new).collect()
    }

    /// Lets rooms be seen along the published camera paths of 7-Scenes where a data folder has
    /// them (`7scenes/poses`); recipes that name a folder themselves, and all others, stay as they
    /// are.
    #[must_use]
    pub fn along_real_paths(mut self, roots: &DataRoots) -> Self {
        if let Some(scenes) = &mut self.seven_scenes
            && scenes.poses.is_none()
        {
            scenes.poses = roots.find(Path::new("7scenes/poses")).ok();
        }
        self
    }

    /// Checks all numbers; `path` is for messages.
    pub(crate) fn checked(&self, path: &Path) -> vpr_core::Result<()> {
        self.check().map_err(|refusal| Error::format(path, refusal.key, refusal.reason))
    }

    fn check(&self) -> Result<(), Refusal> {
        count("places", self.places, 1, 20_000)?;
        count("new_places", self.new_places, 0, 20_000)?;
        count("query_every", self.query_every, 1, 20_000)?;
        count("camera.width", self.camera.width as usize, 16, 2_048)?;
        count("camera.height", self.camera.height as usize, 16, 2_048)?;
        between("camera.focal", self.camera.focal, 10.0, 10_000.0)?;
        between("camera.distortion", self.camera.distortion, -0.3, 0.3)?;
        if !self.camera.is_one_to_one() {
            let reason = format!("{} folds the corners of the image", self.camera.distortion);
            return Err(Refusal { key: "camera.distortion", reason });
        }
        if let Tolerance::RadiusM(radius) = self.tolerance {
            between("tolerance.radius_m", radius, 0.0, 10_000.0)?;
        }
        if matches!(self.tolerance, Tolerance::Frames(_)) && self.layout != Layout::VprBench {
            let reason = "only the layout vpr-bench has a file for frames; give radius_m";
            return Err(Refusal { key: "tolerance.frames", reason: reason.to_owned() });
        }
        if self.new_places > 0 && self.stage.is_some() {
            let reason = "a stage has a second place already";
            return Err(Refusal { key: "new_places", reason: reason.to_owned() });
        }
        for traverse in [&self.references, &self.queries] {
            traverse.check()?;
        }
        let families: [Option<Result<(), Refusal>>; 6] = [
            self.street.as_ref().map(Street::check),
            self.rail.as_ref().map(Rail::check),
            self.campus.as_ref().map(Campus::check),
            self.interior.as_ref().map(Interior::check),
            self.stage.map(|_| Ok(())),
            self.seven_scenes.as_ref().map(SevenScenes::check),
        ];
        let n_families = families.iter().flatten().count();
        if n_families != 1 {
            let reason = format!("{n_families} families are given, not one");
            return Err(Refusal {
                key: "street, rail, campus, interior, stage, seven_scenes",
                reason,
            });
        }
        families.into_iter().flatten().collect()
    }
}
