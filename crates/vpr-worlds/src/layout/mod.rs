//! The folders and names that a world's images get: those of the datasets it stands in for.

mod object_npy;

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use object_npy::ground_truth_npy;
use vpr_core::{Error, GroundTruth, Poses, Provenance};
use vpr_data::{DataRoots, Dataset, DatasetEntry, layout::pose_csv::PoseTable};

use crate::{
    family::{Plan, Shot},
    recipe::{Layout, Recipe, Tolerance},
};

/// Where worlds lie on the UTM grid: zone 31U, near Delft. Only differences mean anything.
const ORIGIN: (f64, f64) = (594_000.0, 5_760_000.0);

/// The two sides of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The map.
    References,
    /// The images to be localized.
    Queries,
    /// Further views for a denser map, if the recipe has any.
    Grid,
}

impl Side {
    pub(crate) fn shots(self, plan: &Plan) -> &[Shot] {
        match self {
            Self::References => &plan.references,
            Self::Queries => &plan.queries,
            Self::Grid => &plan.grid,
        }
    }

    fn folder(self, layout: Layout) -> &'static str {
        match (layout, self) {
            (Layout::VprBench, Self::References) => "ref",
            (Layout::VprBench, Self::Queries) => "query",
            (Layout::VprBench | Layout::Utm, Self::Grid) => "grid",
            (Layout::SevenScenes, Self::Grid) => "seq-03",
            (Layout::Utm, Self::References) => "images/test/database",
            (Layout::Utm, Self::Queries) => "images/test/queries",
            (Layout::SevenScenes, Self::References) => "seq-01",
            (Layout::SevenScenes, Self::Queries) => "seq-02",
        }
    }

    pub(crate) fn pose_table(self) -> &'static str {
        match self {
            Self::References => "references.csv",
            Self::Queries => "queries.csv",
            Self::Grid => "grid.csv",
        }
    }
}

/// The image of a shot, relative to the dataset's folder.
pub(crate) fn image_path(layout: Layout, side: Side, index: usize, shot: &Shot) -> PathBuf {
    let name = match layout {
        Layout::VprBench => format!("{index:07}.jpg"),
        Layout::SevenScenes => format!("frame-{index:06}.color.png"),
        Layout::Utm => {
            let at = shot.pose.translation.vector;
            let forward = shot.pose.rotation * Vector3::z();
            let heading = libm::atan2(forward.x, forward.y).to_degrees().rem_euclid(360.0);
            let pitch = libm::asin(forward.z.clamp(-1.0, 1.0)).to_degrees();
            format!(
                "@{:010.2}@{:010.2}@31@U@@@{:07}@@{:03.0}@{:03.0}@@{:.1}@@@.jpg",
                ORIGIN.0 + at.x,
                ORIGIN.1 + at.y,
                shot.place.map_or(9_000_000 + index, |place| place),
                heading,
                pitch,
                at.z,
            )
        }
    };
    Path::new(side.folder(layout)).join(name)
}

/// The depth image that belongs to an image.
pub(crate) fn depth_path(layout: Layout, side: Side, image: &Path) -> PathBuf {
    let name = image.file_name().unwrap_or_default().to_string_lossy().into_owned();
    if layout == Layout::SevenScenes {
        return image.with_file_name(name.replace(".color.", ".depth."));
    }
    let folder = match side {
        Side::References => "depth/ref",
        Side::Queries => "depth/query",
        Side::Grid => "depth/grid",
    };
    Path::new(folder).join(name).with_extension("png")
}

/// Metres per unit of a depth image: 7-Scenes counts millimetres, which end at 65 m.
pub(crate) fn depth_unit(layout: Layout) -> f64 {
    if layout == Layout::SevenScenes { 0.001 } else { 0.01 }
}

/// Puts the shots in the order in which the layout's reader will list their images.
pub(crate) fn in_reading_order(layout: Layout, plan: &mut Plan) {
    if layout == Layout::Utm {
        for shots in [&mut plan.references, &mut plan.queries] {
            // New places have numbers of their own, so the index does not matter for the order
            // of equal positions.
            shots.sort_by_cached_key(|shot| image_path(layout, Side::Queries, 0, shot));
        }
    }
}

/// What lies beside the images: ground truth, split files, pose tables. Paths and contents.
pub(crate) fn side_files(
    recipe: &Recipe,
    plan: &Plan,
    truth: &GroundTruth,
) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for side in [Side::References, Side::Queries, Side::Grid] {
        let shots = side.shots(plan);
        if shots.is_empty() {
            continue;
        }
        files.push((PathBuf::from(side.pose_table()), pose_table(recipe.layout, side, plan)));
        if recipe.layout == Layout::SevenScenes {
            match side {
                Side::References => {
                    files.push((PathBuf::from("TrainSplit.txt"), b"sequence1\n".to_vec()));
                }
                Side::Queries => {
                    files.push((PathBuf::from("TestSplit.txt"), b"sequence2\n".to_vec()));
                }
                Side::Grid => {}
            }
            for (index, shot) in shots.iter().enumerate() {
                let image = image_path(recipe.layout, side, index, shot);
                let name = image
                    .file_name()
                    .unwrap_or_default()
                    .to_string_lossy()
                    .replace(".color.png", ".pose.txt");
                files.push((
                    image.with_file_name(name),
                    matrix(&(plan.world_from_scene * shot.pose)),
                ));
            }
        }
    }
    if recipe.layout == Layout::VprBench {
        files.push((PathBuf::from("ground_truth_new.npy"), ground_truth_npy(truth)));
    }
    files
}

fn pose_table(layout: Layout, side: Side, plan: &Plan) -> Vec<u8> {
    let mut text = String::from("name,x,y,z,qw,qx,qy,qz\n");
    for (index, shot) in side.shots(plan).iter().enumerate() {
        let name = image_path(layout, side, index, shot);
        let name = name.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let pose = plan.world_from_scene * shot.pose;
        let (t, q) = (pose.translation.vector, pose.rotation);
        let values = [t.x, t.y, t.z, q.w, q.i, q.j, q.k].map(|value| format!("{value:.9}"));
        text.extend([name.as_str(), ",", &values.join(","), "\n"]);
    }
    text.into_bytes()
}

/// A 4 × 4 camera-to-world matrix as 7-Scenes writes it.
fn matrix(pose: &vpr_core::Pose) -> Vec<u8> {
    let matrix = pose.to_homogeneous();
    let rows = matrix.row_iter().map(|row| {
        let cells: Vec<String> = row.iter().map(|cell| format!("{cell:.9e}")).collect();
        cells.join("\t") + "\n"
    });
    rows.collect::<String>().into_bytes()
}

/// Reads a world back through the readers that real data uses.
pub(crate) fn open(recipe: &Recipe, folder: &Path) -> vpr_core::Result<Dataset> {
    let table = |side: Side| PoseTable::read(&folder.join(side.pose_table()));
    let (references, queries) = (table(Side::References)?, table(Side::Queries)?);
    if recipe.layout == Layout::SevenScenes {
        return Ok(seven_scenes(recipe, folder, &references, &queries));
    }
    let entry = DatasetEntry {
        id: format!("world/{}", recipe.name),
        name: format!("{} (generated)", recipe.name),
        layout: match recipe.layout {
            Layout::Utm => vpr_data::Layout::UtmNames,
            Layout::VprBench | Layout::SevenScenes => vpr_data::Layout::VprBench,
        },
        path: PathBuf::from(if recipe.layout == Layout::Utm { "images/test" } else { "." }),
        matches: None,
        queries: Some(queries.names.len()),
        references: Some(references.names.len()),
        tolerance: match recipe.tolerance {
            Tolerance::Frames(frames) => vpr_data::Tolerance::Frames(frames),
            Tolerance::RadiusM(radius) => vpr_data::Tolerance::Metres(radius),
        },
        spacing_m: None,
        frames: None,
        every: None,
        origin: format!("generated; counterpart: {}", recipe.counterpart),
        licence: "that of this toolkit".to_owned(),
        note: None,
        provenance: Provenance::Generated,
    };
    let mut dataset = Dataset::open(&entry, &DataRoots::new([folder.to_owned()]))?;
    for (images, table) in [(&dataset.references, &references), (&dataset.queries, &queries)] {
        let same = images.len() == table.names.len()
            && images.iter().zip(&table.names).all(|(image, name)| image.ends_with(name));
        if !same {
            return Err(Error::format(
                folder,
                "pose tables",
                "do not list the images that are there",
            ));
        }
    }
    if dataset.poses.is_none() {
        dataset.poses = Some((queries.poses, references.poses));
    }
    Ok(dataset)
}

fn seven_scenes(
    recipe: &Recipe,
    folder: &Path,
    references: &PoseTable,
    queries: &PoseTable,
) -> Dataset {
    let paths = |side: Side, table: &PoseTable| -> Vec<PathBuf> {
        let within = folder.join(side.folder(recipe.layout));
        table.names.iter().map(|name| within.join(name)).collect()
    };
    let truth = match recipe.tolerance {
        Tolerance::RadiusM(radius) => {
            GroundTruth::within_radius(&queries.poses, &references.poses, radius)
                .expect("the radius is checked and both sides have full poses")
        }
        Tolerance::Frames(frames) => {
            GroundTruth::within_frames(queries.names.len(), references.names.len(), frames)
        }
    };
    Dataset {
        id: format!("world/{}", recipe.name),
        name: format!("{} (generated)", recipe.name),
        queries: paths(Side::Queries, queries),
        references: paths(Side::References, references),
        truth,
        n_clamped: 0,
        poses: Some((queries.poses.clone(), references.poses.clone())),
        provenance: Provenance::Generated,
    }
}

/// The images of the further views.
pub(crate) fn grid_images(recipe: &Recipe, folder: &Path) -> vpr_core::Result<Vec<PathBuf>> {
    let table = folder.join(Side::Grid.pose_table());
    if !table.exists() {
        return Ok(Vec::new());
    }
    let within = folder.join(Side::Grid.folder(recipe.layout));
    Ok(PoseTable::read(&table)?.names.iter().map(|name| within.join(name)).collect())
}

/// The poses of one side, full ones, also where the layout's reader gives positions only.
pub(crate) fn poses(folder: &Path, side: Side) -> vpr_core::Result<Poses> {
    Ok(PoseTable::read(&folder.join(side.pose_table()))?.poses)
}
