//! A dataset: its images, its poses and what is correct.

use std::path::{Path, PathBuf};

use crate::layout::{
    seven_scenes,
    utm_names::UtmFolder,
    vpr_bench::{GroundTruthFile, image_folder},
};
use crate::manifest::{DataRoots, DatasetEntry, Layout, Tolerance};
use vpr_core::{Error, GroundTruth, PlanarPosition, Poses, Provenance, Result};

/// The images of a dataset and what is correct; images are paths, not yet read.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// Short name.
    pub id: String,
    /// Name as the thesis writes it.
    pub name: String,
    /// Images of the queries, in the order of their indices.
    pub queries: Vec<PathBuf>,
    /// Images of the references, in the order of their indices.
    pub references: Vec<PathBuf>,
    /// Which references are correct for which query.
    pub truth: GroundTruth,
    /// How many entries of the ground truth pointed past the references and were dropped.
    pub n_clamped: usize,
    /// Poses of queries and references, if the layout has them.
    pub poses: Option<(Poses, Poses)>,
    /// Whether the images are real (`measured`) or drawn (`generated`).
    pub provenance: Provenance,
}

impl Dataset {
    /// Opens a dataset of the manifest.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] or [`Error::Format`] with the folder or file that is missing, empty or
    /// malformed; the latter also if the ground truth is not about as many queries as there are
    /// images. [`Error::Parameter`] if the layout is not one of image files; for archives see
    /// [`crate::layout::npz_images`].
    pub fn open(entry: &DatasetEntry, roots: &DataRoots) -> Result<Self> {
        let folder = roots.find(&entry.path)?;
        match entry.layout {
            Layout::VprBench => Self::open_vpr_bench(entry, &folder),
            Layout::ImagePairs => Self::open_pairs(entry, &folder),
            Layout::UtmNames => Self::open_utm(entry, &folder),
            Layout::SevenScenes => Self::open_seven_scenes(entry, &folder),
            Layout::Npz | Layout::InvarianceScores => {
                let reason = "its layout is not one of query and reference image files";
                Err(Error::Parameter { name: "dataset", value: entry.id.clone(), reason })
            }
        }
    }

    fn open_vpr_bench(entry: &DatasetEntry, folder: &Path) -> Result<Self> {
        let queries = image_folder(&folder.join("query"))?;
        let references = image_folder(&folder.join("ref"))?;
        let path = folder.join("ground_truth_new.npy");
        let (file, _) = GroundTruthFile::read_for(&path, queries.len(), references.len())?;
        if file.len() != queries.len() {
            let reason = format!("{}, but query/ has {} images", file.len(), queries.len());
            return Err(Error::format(file.path, "number of rows", reason));
        }
        let (truth, n_clamped) = file.truth(references.len())?;
        Ok(Self::new(entry, queries, references, truth).with_clamped(n_clamped))
    }

    fn open_pairs(entry: &DatasetEntry, folder: &Path) -> Result<Self> {
        let queries = image_folder(&folder.join("query"))?;
        let references = image_folder(&folder.join("ref"))?;
        Self::of_pairs(entry, queries, references)
    }

    /// Two traverses that are aligned frame by frame.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if the entry's tolerance is not in frames.
    pub fn of_pairs(
        entry: &DatasetEntry,
        queries: Vec<PathBuf>,
        references: Vec<PathBuf>,
    ) -> Result<Self> {
        let Tolerance::Frames(tolerance) = entry.tolerance else {
            let reason = "image pairs need a tolerance in frames";
            return Err(Error::Parameter { name: "dataset", value: entry.id.clone(), reason });
        };
        let truth = GroundTruth::within_frames(queries.len(), references.len(), tolerance);
        let poses = entry.spacing_m.map(|spacing| {
            let along = |n: usize| {
                Poses::Planar(
                    (0..n).map(|i| PlanarPosition::new(i as f64 * spacing, 0.0)).collect(),
                )
            };
            (along(queries.len()), along(references.len()))
        });
        Ok(Self { poses, ..Self::new(entry, queries, references, truth) })
    }

    fn open_seven_scenes(entry: &DatasetEntry, folder: &Path) -> Result<Self> {
        let (queries, references) = seven_scenes::open(folder)?;
        let Tolerance::Metres(radius) = entry.tolerance else {
            let reason = "positions need a tolerance in metres";
            return Err(Error::Parameter { name: "dataset", value: entry.id.clone(), reason });
        };
        let truth = GroundTruth::within_radius(&queries.poses, &references.poses, radius)?;
        let dataset = Self::new(entry, queries.images, references.images, truth);
        Ok(Self { poses: Some((queries.poses, references.poses)), ..dataset })
    }

    fn open_utm(entry: &DatasetEntry, folder: &Path) -> Result<Self> {
        let queries = UtmFolder::open(&folder.join("queries"))?;
        let references = UtmFolder::open(&folder.join("database"))?;
        let Tolerance::Metres(radius) = entry.tolerance else {
            let reason = "positions need a tolerance in metres";
            return Err(Error::Parameter { name: "dataset", value: entry.id.clone(), reason });
        };
        if let (Some(first), Some(second)) = (queries.zone, references.zone)
            && first != second
        {
            let reason = format!("queries lie in UTM zone {first}, the database in {second}");
            return Err(Error::format(folder, "file names", reason));
        }
        let poses = (queries.poses(), references.poses());
        let truth = GroundTruth::within_radius(&poses.0, &poses.1, radius)?;
        let dataset = Self::new(entry, queries.images, references.images, truth);
        Ok(Self { poses: Some(poses), ..dataset })
    }

    fn new(
        entry: &DatasetEntry,
        queries: Vec<PathBuf>,
        references: Vec<PathBuf>,
        truth: GroundTruth,
    ) -> Self {
        let (id, name, provenance) = (entry.id.clone(), entry.name.clone(), entry.provenance);
        Self { id, name, queries, references, truth, n_clamped: 0, poses: None, provenance }
    }

    fn with_clamped(self, n_clamped: usize) -> Self {
        Self { n_clamped, ..self }
    }
}
