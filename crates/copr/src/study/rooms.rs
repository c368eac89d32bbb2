//! Generated rooms that take the part of the seven scenes, as an encoder sees them.

use std::{ops::Range, path::PathBuf, sync::Arc};

use serde::{Deserialize, Serialize};
use vpr_core::{Error as CoreError, Map};
use vpr_data::Dataset;
use vpr_study::technique::Found;

use super::{Context, encoder, real};
use crate::Result;

/// One of the seven scenes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// Column in tables.
    pub name: String,
    /// What its lists of poses and its recipe are called after.
    pub key: String,
    /// Sequences of the map, in the order of their names.
    pub references: Vec<String>,
    /// Sequences of the queries.
    pub queries: Vec<String>,
    /// The sequence that stays in the map when others are left out.
    pub kept: String,
    /// Span of the grid around an anchor in world x and y, metres. The thesis gives none: these are
    /// recovered from its oracle rows.
    #[serde(default)]
    pub span_m: [f64; 2],
}

/// Which camera paths a room is seen along.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Paths {
    /// Those of 7-Scenes, where they are at hand.
    Real,
    /// Our own, in every clone.
    Own,
}

/// How the rooms are rendered and described.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rooms {
    /// Images of the map.
    pub places: usize,
    /// One query for so many images of the map.
    pub query_every: usize,
    /// Further settings of the recipes, such as `camera.width=160`.
    #[serde(default)]
    pub settings: Vec<String>,
    /// Every so many-th image of a sequence is an anchor.
    pub every: usize,
    /// The camera paths.
    pub paths: Vec<Paths>,
    /// Techniques that describe the images.
    pub encoders: Vec<String>,
}

/// Images with poses, as an encoder sees them.
#[derive(Clone, Debug)]
pub struct Side {
    /// Descriptors and poses.
    pub map: Map,
    /// Its sequences.
    pub sequences: Vec<Range<usize>>,
}

/// A room as an encoder sees it.
#[derive(Clone, Debug)]
pub struct Room {
    /// The images to localize.
    pub queries: Side,
    /// The map.
    pub references: Side,
    /// Rows of the sequence that stays in the map when others are left out.
    pub kept: Range<usize>,
}

impl Paths {
    /// How the paths are called in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Real => "room along real paths",
            Self::Own => "room",
        }
    }
}

impl Rooms {
    /// The generated dataset of a scene.
    #[must_use]
    pub fn world(&self, scene: &Scene) -> String {
        let sizes = format!("places={}&query_every={}", self.places, self.query_every);
        let settings = std::iter::once(sizes).chain(self.settings.iter().cloned());
        let settings: Vec<String> = settings.collect();
        format!("world/seven-scenes-{}?{}", scene.key, settings.join("&"))
    }

    /// What rows on a room are of.
    #[must_use]
    pub fn label(encoder: &str, paths: Paths) -> String {
        format!("{encoder}, {}", paths.name())
    }

    /// The images of a room, rendered where they are not, or why they cannot be.
    ///
    /// # Errors
    ///
    /// Images that cannot be rendered.
    pub fn images(
        &self,
        scene: &Scene,
        paths: Paths,
        context: Context<'_>,
    ) -> Result<Result<Arc<Dataset>, String>> {
        let sources = match paths {
            Paths::Own => context.bare,
            Paths::Real if real::RealScene::open(scene, context.sources)?.is_none() => {
                return Ok(Err(context.sources.why_absent("7scenes-poses", "poses")?));
            }
            Paths::Real => context.sources,
        };
        let none = || CoreError::Empty("images of a generated room");
        Ok(Ok(sources.images(&self.world(scene))?.ok_or_else(none)?))
    }

    /// A room, or why it is not at hand.
    ///
    /// # Errors
    ///
    /// Images that cannot be rendered or described; a sequence that is kept and is none of the
    /// scene's.
    pub fn open(
        &self,
        scene: &Scene,
        encoder: &str,
        paths: Paths,
        context: Context<'_>,
    ) -> Result<Result<Room, String>> {
        let position = scene.references.iter().position(|it| *it == scene.kept);
        let kept = position.ok_or_else(|| {
            let (name, known) = (scene.kept.clone(), scene.references.join(", "));
            CoreError::Unknown { kind: "sequence", name, known }
        })?;
        let dataset = match self.images(scene, paths, context)? {
            Ok(dataset) => dataset,
            Err(why) => return Ok(Err(why)),
        };
        let runner = match encoder::find(encoder, context.sources)? {
            Found::Runs(runner) => runner,
            Found::Absent(why) => return Ok(Err(why)),
        };
        let none = || CoreError::Empty("poses of a generated room");
        let (query_poses, poses) = dataset.poses.clone().ok_or_else(none)?;
        let describe = |images: &[PathBuf], poses, n_sequences| -> Result<Side> {
            let what = format!("{encoder} on {}", scene.name);
            let rows = context.sources.features(&runner, images, &what)?.into_descriptors();
            let reason = "gives no descriptors of one length: choose another";
            let (name, value) = ("encoders", encoder.to_owned());
            let rows = rows.ok_or(CoreError::Parameter { name, value, reason })?;
            let sequences = even(rows.len(), n_sequences);
            Ok(Side { map: Map::new(rows, poses)?, sequences })
        };
        let queries = describe(&dataset.queries, query_poses, scene.queries.len())?;
        let references = describe(&dataset.references, poses, scene.references.len())?;
        let kept = references.sequences[kept].clone();
        Ok(Ok(Room { queries, references, kept }))
    }
}

/// `n` rows in as many parts: images are taken evenly from sequences of equal length.
fn even(n: usize, parts: usize) -> Vec<Range<usize>> {
    let parts = parts.max(1);
    (0..parts).map(|part| part * n / parts..(part + 1) * n / parts).collect()
}
