//! The datasets that tables of chapter 4 have columns for.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use serde::Deserialize;
use vpr_core::{Error as CoreError, GroundTruth, Provenance};
use vpr_data::{Dataset, layout::numbered::images_in_order};
use vpr_report::table::{Cell, Table};
use vpr_study::Sources;
use vpr_worlds::{Side, World, is_world, named_recipe};

use crate::{ReferenceSet, Result};

/// A dataset under the name that the thesis has for its original.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// Name in tables.
    pub name: String,
    /// The dataset, or what this walk is called.
    pub dataset: String,
    /// What stands for `{place}` in paths of weights.
    pub key: String,
    /// What stands for `{foreign}`: the key of another place, whose references are none of this one.
    #[serde(default)]
    pub foreign: Option<String>,
    /// Takes every so-manieth query and reference alone; what was correct by neighbouring frames that
    /// are left out no longer is.
    #[serde(default = "one")]
    pub every: usize,
    /// What a metre of the distances of mining is here: below 1 for rooms.
    #[serde(default = "unscaled")]
    pub scale: f64,
    /// Instead of a dataset of the manifest: one walk round a block more than once.
    #[serde(default)]
    pub laps: Option<Laps>,
}

fn one() -> usize {
    1
}

fn unscaled() -> f64 {
    1.0
}

/// Frames of one walk: a lap is the map, what comes later the queries.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Laps {
    /// Folder of the frames, relative to a data folder.
    pub images: PathBuf,
    /// Table `frame,laps_back,earlier_frame,inliers`: for frames the one that shows its place.
    pub table: PathBuf,
    /// First frame of the map, and the one after its last.
    pub references: (usize, usize),
    /// The same of the queries; those without a row are no queries.
    pub queries: (usize, usize),
    /// A reference so many frames from the one of the table is correct too.
    pub frames: usize,
}

impl Place {
    /// The images with their truth, or why they are not at hand.
    ///
    /// # Errors
    ///
    /// Data that is there but malformed.
    pub fn open(&self, sources: &Sources<'_>) -> Result<Result<Arc<Dataset>, String>> {
        let dataset = match &self.laps {
            Some(laps) => match self.walk(laps, sources)? {
                None => return Ok(Err(format!("{}: no images at hand", self.name))),
                Some(dataset) => Arc::new(dataset),
            },
            None => match sources.images(&self.dataset)? {
                None => return Ok(Err(sources.why_absent(&self.dataset, "images")?)),
                Some(dataset) => dataset,
            },
        };
        if self.every <= 1 {
            return Ok(Ok(dataset));
        }
        let some = |len: usize| (0..len).step_by(self.every).collect::<Vec<usize>>();
        let (queries, references) = (some(dataset.queries.len()), some(dataset.references.len()));
        let taken =
            |all: &[PathBuf], rows: &[usize]| rows.iter().map(|&it| all[it].clone()).collect();
        let poses = dataset.poses.as_ref();
        Ok(Ok(Arc::new(Dataset {
            id: format!("{}, every {}", dataset.id, self.every),
            name: dataset.name.clone(),
            queries: taken(&dataset.queries, &queries),
            references: taken(&dataset.references, &references),
            truth: dataset.truth.selected(&queries, &references)?,
            n_clamped: 0,
            poses: poses.map(|(a, b)| (a.select(&queries), b.select(&references))),
            provenance: dataset.provenance,
        })))
    }

    /// The images with their truth, or absent cells of its row in these columns.
    pub(super) fn at_hand(
        &self,
        columns: &[&str],
        table: &mut Table,
        sources: &Sources<'_>,
    ) -> Result<Option<Arc<Dataset>>> {
        match self.open(sources)? {
            Ok(dataset) => Ok(Some(dataset)),
            Err(why) => {
                for &column in columns {
                    table.push(Cell::absent(&self.name, column, &why));
                }
                Ok(None)
            }
        }
    }

    /// The references with their poses; `None` if the images are not at hand.
    ///
    /// # Errors
    ///
    /// As [`Self::open`].
    pub fn references(&self, sources: &Sources<'_>) -> Result<Option<ReferenceSet>> {
        if self.laps.is_none() && self.every <= 1 {
            return references(sources, &self.dataset);
        }
        let Ok(dataset) = self.open(sources)? else { return Ok(None) };
        let poses = dataset.poses.as_ref().map(|(_, references)| references.clone());
        Ok(Some(ReferenceSet::new(dataset.references.clone(), poses)?))
    }

    fn walk(&self, laps: &Laps, sources: &Sources<'_>) -> Result<Option<Dataset>> {
        let folder = sources.locate(&laps.images)?;
        let (Some(folder), Some(table)) = (folder, sources.locate(&laps.table)?) else {
            return Ok(None);
        };
        let images = images_in_order(&folder)?.images;
        let last = laps.references.1.max(laps.queries.1);
        if last > images.len() {
            let what = "frames of a walk";
            return Err(CoreError::Mismatch { what, expected: last, actual: images.len() }.into());
        }
        let earlier = earlier_frames(&table)?;
        let (first, end) = laps.references;
        let shown = |frame: usize| earlier.get(&frame).copied();
        let known: Vec<(usize, usize)> = (laps.queries.0..laps.queries.1)
            .filter_map(|frame| Some((frame, shown(frame)?)))
            .filter(|(_, shown)| (first..end).contains(shown))
            .collect();
        let correct = |&(_, shown): &(usize, usize)| {
            let from = shown.saturating_sub(laps.frames).max(first);
            (from..(shown + laps.frames + 1).min(end)).map(|it| it - first).collect()
        };
        Ok(Some(Dataset {
            id: self.dataset.clone(),
            name: self.name.clone(),
            queries: known.iter().map(|it| images[it.0].clone()).collect(),
            references: images[first..end].to_vec(),
            truth: GroundTruth::from_lists(known.iter().map(correct).collect(), end - first)?,
            n_clamped: 0,
            poses: None,
            provenance: Provenance::Measured,
        }))
    }
}

/// For each frame the one of the lap before that shows its place.
fn earlier_frames(path: &Path) -> Result<BTreeMap<usize, usize>> {
    let text = fs::read_to_string(path).map_err(CoreError::io(path))?;
    let mut earlier = BTreeMap::new();
    for (number, line) in text.lines().enumerate().skip(1) {
        let row: Vec<Option<usize>> = line.split(',').map(|it| it.trim().parse().ok()).collect();
        match row.as_slice() {
            [Some(frame), Some(1), Some(shown), ..] => {
                earlier.insert(*frame, *shown);
            }
            [Some(_), Some(_), Some(_), ..] => {}
            _ => {
                let place = format!("line {}", number + 1);
                return Err(CoreError::format(path, place, "not three whole numbers").into());
            }
        }
    }
    Ok(earlier)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laps_are_read_by_their_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("loops.csv");
        fs::write(&path, "frame,laps_back,earlier_frame,inliers\n9,1,2,15\n9,2,1,20\n10,1,3,9\n")
            .unwrap();
        assert_eq!(earlier_frames(&path).unwrap(), BTreeMap::from([(9, 2), (10, 3)]));
        fs::write(&path, "frame,laps_back,earlier_frame\n9,one,2\n").unwrap();
        let err = earlier_frames(&path).unwrap_err().to_string();
        assert!(err.contains("loops.csv") && err.contains("line 2"), "{err}");
    }
}
