//! What an experiment file of chapter 4 can ask for, one file per study.

mod gaps;
mod recalls;

use std::path::PathBuf;

use serde::Deserialize;
use vpr_report::{experiment::Experiment, page::Report};
use vpr_study::Sources;
use vpr_worlds::{Side, World, is_world, named_recipe};

pub use gaps::{Gap, gap};

use crate::{
    ReferenceSet, Result,
    net::{Finetuning, Whitening},
};

/// What to compute; the key `kind` of `[study]` chooses.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Study {
    /// Recall@N before and after fine-tuning: tables 4.1 and 4.3 to 4.6.
    Recalls {
        /// Columns.
        places: Vec<Place>,
        /// Rows; the first is what the others are held against.
        encoders: Vec<Encoder>,
        /// Which N; a column for each, named so if there are several.
        ranks: Vec<usize>,
    },
    /// Sizes of the places, and how far they are from the training domain: table 4.2.
    Gaps {
        /// The generated counterpart of the training set.
        training: String,
        /// Rows.
        places: Vec<Place>,
    },
}

/// A dataset under the name that the thesis has for its original.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Name in tables.
    pub name: String,
    /// The dataset.
    pub dataset: String,
    /// What stands for `{place}` in paths of weights.
    pub key: String,
    /// What stands for `{foreign}`: the key of another place, whose references are none of this one.
    #[serde(default)]
    pub foreign: Option<String>,
}

/// The default network with some weights.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Encoder {
    /// Name in tables.
    pub name: String,
    /// Its weights, relative to a data folder, `{place}` for the key of the place and `{foreign}` for
    /// that of another; those that every clone has if there are none.
    #[serde(default)]
    pub weights: Option<String>,
    /// How `rsf train` makes them: fine-tuning of the place's references, with these settings.
    #[serde(default)]
    pub tuned: Option<Finetuning>,
    /// How `rsf train` makes them: another projection.
    #[serde(default)]
    pub whitened: Option<Whitening>,
    /// Poses of the references are not told to the fine-tuning.
    #[serde(default)]
    pub without_poses: bool,
}

impl Encoder {
    /// Its weights for a place; `None` for those that every clone has.
    #[must_use]
    pub fn weights_for(&self, place: &Place) -> Option<String> {
        let foreign = place.foreign.as_deref().unwrap_or("{foreign}");
        let weights = self.weights.as_ref()?;
        Some(weights.replace("{place}", &place.key).replace("{foreign}", foreign))
    }
}

/// Computes what the experiment asks for, as far as its data is at hand.
///
/// # Errors
///
/// Wrong files name themselves; missing ones make absent cells.
pub fn run(experiment: &Experiment<Study>, sources: &Sources<'_>) -> Result<Report> {
    let mut table = experiment.table();
    match &experiment.study {
        Study::Recalls { places, encoders, ranks } => {
            recalls::run(&mut table, places, (encoders, ranks), sources)?;
        }
        Study::Gaps { training, places } => gaps::run(&mut table, training, places, sources)?,
    }
    experiment.fill_thesis(&mut table);
    Ok(Report::new(table, None))
}

/// The references of a dataset with their poses; `None` if its images are not at hand. A generated
/// world has poses whatever its layout.
///
/// # Errors
///
/// Data that is there but malformed.
pub fn references(sources: &Sources<'_>, id: &str) -> Result<Option<ReferenceSet>> {
    let Some(dataset) = sources.images(id)? else { return Ok(None) };
    let images: Vec<PathBuf> = dataset.references.clone();
    let poses = match &dataset.poses {
        Some((_, references)) => Some(references.clone()),
        None if is_world(id) => {
            let world = World::open(&named_recipe(id)?, sources.cache(), &|| {})?;
            Some(world.poses(Side::References)?)
        }
        None => None,
    };
    Ok(Some(ReferenceSet::new(images, poses)?))
}
