//! Generated places: streets, railways, rooms and stages with exact poses and depth, in which
//! every nuisance is a known number.
//!
//! A [`Recipe`] is data; [`World::open`] renders it once into a cache folder, in the layout of the
//! dataset it stands in for, and opens it with the reader that real data uses. The same recipe and
//! version give the same bytes on any number of threads. Results on these worlds are labelled
//! `generated` wherever they are printed: they never stand in for a real dataset.
//!
//! ```
//! let cache = tempfile::tempdir()?;
//! // Three places of a city, photographed again by night.
//! let settings = [
//!     ("places", "3"),
//!     ("camera.width", "80"),
//!     ("camera.height", "60"),
//!     ("queries.condition.darkness", "0.9"),
//! ];
//! let recipe = vpr_worlds::recipe_with("world/street", &settings)?;
//! let world = vpr_worlds::World::open(&recipe, cache.path(), &|| {})?;
//!
//! assert_eq!(world.dataset.references.len(), 3);
//! assert!(world.dataset.truth.is_correct(0, 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Scenes are built with z up, in metres; poses are `world_from_camera`, the camera looks along
//! its z axis and its y axis points down.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "pixels and lattice cells are small; geometry is rendered in f32"
)]

mod camera;
mod catalog;
pub mod cities;
mod condition;
mod depth;
mod family;
mod film;
mod geometry;
mod layout;
mod light;
mod material;
mod named;
mod noise;
mod overlap;
mod partial;
mod parts;
mod preview;
mod recipe;
mod refusal;
mod render;
mod scene;
mod scenery;
mod seed;
mod traverse;
mod world;

use std::path::Path;

pub use camera::Camera;
pub use catalog::{names, recipe, recipe_with};
pub use condition::Condition;
pub use depth::{Depth, depths};
pub use family::LIGHTS_DEG;
pub use film::Film;
pub use layout::Side;
pub use named::{Worlds, is_world, named_recipe};
pub use preview::preview;
pub use recipe::{
    Campus, Grid, Interior, Kind, Layout, Rail, Recipe, SevenScenes, Stage, StageKind, Street,
    Tolerance,
};
pub use scenery::{Photograph, Scenery, photograph_city};
pub use traverse::{Offset, Traverse};
pub use world::{RENDERER, World};

/// Opens the world called `name` (with or without `world/`), rendering it into `cache` if it is
/// not there yet.
///
/// # Errors
///
/// [`vpr_core::Error::Unknown`] with all names, and those of [`World::open`].
pub fn open(name: &str, cache: &Path) -> vpr_core::Result<vpr_data::Dataset> {
    Ok(World::open(&recipe(name)?, cache, &|| {})?.dataset)
}
