//! Worlds in memory: images rendered when they are asked for, nothing on disk.

use image::RgbImage;
use rayon::prelude::*;
use vpr_core::{GroundTruth, Pose, Result};

use crate::{
    family::{Plan, plan, tour, truth},
    layout::{self, Side},
    recipe::Recipe,
    traverse::Traverse,
    world::take,
};

/// A world that is never written: for training, for sweeps over a nuisance, for tests.
///
/// Building the scenes takes a tenth of a second or so; every image is rendered anew each time.
/// Images are those that [`crate::World`] would write, before JPEG.
///
/// ```
/// let size = [("places", "4"), ("camera.width", "80"), ("camera.height", "60"), ("camera.focal", "57.5")];
/// let recipe = vpr_worlds::recipe_with("street-snow", &size)?;
/// let scenery = vpr_worlds::Scenery::new(&recipe)?;
/// let queries = scenery.images(vpr_worlds::Side::Queries);
/// assert_eq!((queries.len(), queries[0].dimensions()), (4, (80, 60)));
/// assert!(scenery.ground_truth().is_correct(3, 3));
/// # Ok::<(), vpr_core::Error>(())
/// ```
pub struct Scenery {
    plan: Plan,
    recipe: Recipe,
}

impl Scenery {
    /// Builds the scenes of a recipe.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Format`] names the key that is out of its range; those of reading the
    /// files that the recipe names.
    pub fn new(recipe: &Recipe) -> Result<Self> {
        recipe.checked(recipe.name.as_ref())?;
        let mut plan = plan(recipe)?;
        layout::in_reading_order(recipe.layout, &mut plan);
        Ok(Self { plan, recipe: recipe.clone() })
    }

    /// Number of images of one side.
    #[must_use]
    pub fn len(&self, side: Side) -> usize {
        side.shots(&self.plan).len()
    }

    /// Whether one side has no images: only [`Side::Grid`] may have none.
    #[must_use]
    pub fn is_empty(&self, side: Side) -> bool {
        self.len(side) == 0
    }

    /// Renders one image, `camera.width × camera.height`, 8-bit sRGB.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn image(&self, side: Side, index: usize) -> RgbImage {
        take(&self.plan, &side.shots(&self.plan)[index]).0
    }

    /// Renders all images of one side, on all threads of the pool; the same for any number.
    #[must_use]
    pub fn images(&self, side: Side) -> Vec<RgbImage> {
        (0..self.len(side)).into_par_iter().map(|index| self.image(side, index)).collect()
    }

    /// Where one image is taken: `world_from_camera`, metres, z up.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn pose(&self, side: Side, index: usize) -> Pose {
        self.plan.world_from_scene * side.shots(&self.plan)[index].pose
    }

    /// The place along the route that an image shows; `None` for a new place.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn place(&self, side: Side, index: usize) -> Option<usize> {
        side.shots(&self.plan)[index].place
    }

    /// The correct references of every query by the recipe's tolerance.
    #[must_use]
    pub fn ground_truth(&self) -> GroundTruth {
        truth(self.recipe.tolerance, &self.plan.queries, &self.plan.references)
    }
}

/// One image of a city that was visited several times.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// Number of the place, 0 to `recipe.places - 1`.
    pub place: usize,
    /// Number of the visit.
    pub visit: usize,
    /// Where it was taken: `world_from_camera`, metres, z up.
    pub pose: Pose,
    /// 8-bit sRGB.
    pub image: RgbImage,
}

/// Every place of a `street` recipe photographed once per visit: the training set of a descriptor.
///
/// The recipe says seed, number of places, camera and streets; its own two traverses are not
/// used. Each visit has its light, weather, traffic, shops and viewpoint, and its own draw of all
/// that is random. Photographs come place by place, within a place visit by visit.
///
/// ```
/// use vpr_worlds::{Traverse, photograph_city, recipe_with};
///
/// let size = [("places", "3"), ("camera.width", "64"), ("camera.height", "48"), ("seed", "9")];
/// let mut dusk = Traverse::default();
/// dusk.condition.darkness = 0.4;
/// dusk.offset.jitter = 1.0;
/// let city = photograph_city(&recipe_with("train-city", &size)?, &[Traverse::default(), dusk])?;
/// assert_eq!(city.len(), 6);
/// assert_eq!((city[1].place, city[1].visit), (0, 1));
/// # Ok::<(), vpr_core::Error>(())
/// ```
///
/// # Errors
///
/// [`vpr_core::Error::Format`] names the key that is out of its range, or says that the recipe is
/// not of the `street` family.
pub fn photograph_city(recipe: &Recipe, visits: &[Traverse]) -> Result<Vec<Photograph>> {
    recipe.checked(recipe.name.as_ref())?;
    for visit in visits {
        visit.checked(recipe.name.as_ref())?;
    }
    let plan = tour(recipe, visits)?;
    let photographs = plan.references.par_iter().enumerate().map(|(index, shot)| Photograph {
        place: index / visits.len(),
        visit: index % visits.len(),
        pose: shot.pose,
        image: take(&plan, shot).0,
    });
    Ok(photographs.collect())
}
