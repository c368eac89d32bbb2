//! The formats by name: which there are, reading and writing them.

use std::{fmt, path::Path, str::FromStr};

use super::{
    Reading, colmap, hdf5, hloc_pairs, hloc_poses, kapture, kitti, lat_lon, methods_evaluation,
    npy, npz,
    parts::{Pairs, Parts},
    pose_csv, report, safetensors, seven_scenes, tum, utm_names,
};
use vpr_core::{
    Error, Result,
    map::{OpenMap, Opening, RowType, verify},
};

/// A file format, by the name that is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// `map`: our own file, or folder of segments.
    Map,
    /// `npy`: descriptors, with poses as `.csv` beside it.
    Npy,
    /// `npz`: descriptors, positions, orientations, names in one archive.
    Npz,
    /// `safetensors`: any such file with descriptors.
    Safetensors,
    /// `hloc-h5`: HDF5 with a group per image.
    HlocH5,
    /// `hloc-pairs`: `query reference` per line.
    HlocPairs,
    /// `hloc-poses`: `name qw qx qy qz tx ty tz` per line, camera from world.
    HlocPoses,
    /// `colmap`: `images.txt` or `images.bin` of a reconstruction, camera from world.
    Colmap,
    /// `vpr-eval`: the database's descriptors, or the predictions, of VPR-methods-evaluation.
    VprEval,
    /// `vpr-eval-queries`: the queries' descriptors of VPR-methods-evaluation.
    VprEvalQueries,
    /// `kapture`: trajectories of kapture 1.1.
    Kapture,
    /// `tum`: trajectories of the TUM RGB-D benchmark.
    Tum,
    /// `kitti`: poses of KITTI odometry.
    Kitti,
    /// `7scenes`: pose files of one sequence.
    SevenScenes,
    /// `latlon`: a table of latitude and longitude.
    LatLon,
    /// `csv`: a table of poses, columns by their titles.
    PoseCsv,
    /// `utm-names`: image names `@utm_east@utm_north@…`, a folder of them or a list.
    UtmNames,
}

/// What a format holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Descriptors, perhaps with names and poses.
    Descriptors,
    /// Poses and names.
    Poses,
    /// References per query.
    Pairs,
    /// Descriptors in one place, references per query in another.
    DescriptorsAndPairs,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 17] = [
        Self::Map,
        Self::Npy,
        Self::Npz,
        Self::Safetensors,
        Self::HlocH5,
        Self::HlocPairs,
        Self::HlocPoses,
        Self::Colmap,
        Self::VprEval,
        Self::VprEvalQueries,
        Self::Kapture,
        Self::Tum,
        Self::Kitti,
        Self::SevenScenes,
        Self::LatLon,
        Self::PoseCsv,
        Self::UtmNames,
    ];

    /// The name that is typed.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Map => "map",
            Self::Npy => "npy",
            Self::Npz => "npz",
            Self::Safetensors => "safetensors",
            Self::HlocH5 => "hloc-h5",
            Self::HlocPairs => "hloc-pairs",
            Self::HlocPoses => "hloc-poses",
            Self::Colmap => "colmap",
            Self::VprEval => "vpr-eval",
            Self::VprEvalQueries => "vpr-eval-queries",
            Self::Kapture => "kapture",
            Self::Tum => "tum",
            Self::Kitti => "kitti",
            Self::SevenScenes => "7scenes",
            Self::LatLon => "latlon",
            Self::PoseCsv => "csv",
            Self::UtmNames => "utm-names",
        }
    }

    /// What it holds.
    #[must_use]
    pub fn kind(self) -> Kind {
        match self {
            Self::Map
            | Self::Npy
            | Self::Npz
            | Self::Safetensors
            | Self::HlocH5
            | Self::VprEvalQueries => Kind::Descriptors,
            Self::VprEval => Kind::DescriptorsAndPairs,
            Self::HlocPairs => Kind::Pairs,
            Self::HlocPoses
            | Self::Colmap
            | Self::Kapture
            | Self::Tum
            | Self::Kitti
            | Self::SevenScenes
            | Self::LatLon
            | Self::PoseCsv
            | Self::UtmNames => Kind::Poses,
        }
    }
}

impl Format {
    /// Whether its files do not say which way their poses go.
    fn leaves_direction_open(self) -> bool {
        matches!(self, Self::PoseCsv | Self::Tum | Self::Npy)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Format {
    type Err = Error;

    /// Reads a format's name, or that of a program or dataset whose tables of poses are read.
    fn from_str(text: &str) -> Result<Self> {
        if ["euroc", "mapillary"].contains(&text) {
            return Ok(Self::PoseCsv);
        }
        Self::ALL.into_iter().find(|format| format.name() == text).ok_or_else(|| Error::Unknown {
            kind: "format",
            name: text.to_owned(),
            known: Self::ALL.map(Self::name).join(", "),
        })
    }
}

fn read_all(format: Format, path: &Path, reading: Reading) -> report::Read<Parts> {
    if let Some(direction) = reading.direction.filter(|_| !format.leaves_direction_open()) {
        let reason = "this format says itself which way its poses go";
        let (name, value) = ("pose-direction", format!("{direction}, of {format}"));
        return Err(vec![Error::Parameter { name, value, reason }]);
    }
    let read = match format {
        Format::Map => OpenMap::open(path, Opening::default())
            .and_then(|map| Parts::of_map(&map))
            .map_err(|err| vec![err]),
        Format::Npy => npy::read(path, reading),
        Format::Npz => npz::read(path),
        Format::Safetensors => safetensors::read(path),
        Format::HlocH5 => hdf5::read(path),
        Format::HlocPoses => hloc_poses::read(path),
        Format::Colmap => colmap::read(path),
        Format::VprEval => methods_evaluation::read(path, methods_evaluation::DATABASE),
        Format::VprEvalQueries => methods_evaluation::read(path, methods_evaluation::QUERIES),
        Format::Kapture => kapture::read(path),
        Format::Tum => tum::read(path, reading),
        Format::Kitti => kitti::read(path),
        Format::SevenScenes => seven_scenes::read(path),
        Format::LatLon => lat_lon::read(path, reading),
        Format::PoseCsv => pose_csv::read(path, reading),
        Format::UtmNames => utm_names::read(path, reading),
        Format::HlocPairs => return Err(vec![other_kind(format, "images")]),
    };
    read.map_err(|problems| problems.into_iter().map(|err| err.in_file(path)).collect())
}

fn read_all_pairs(format: Format, path: &Path) -> report::Read<Pairs> {
    match format {
        Format::HlocPairs => hloc_pairs::read(path),
        Format::VprEval => methods_evaluation::read_pairs(path),
        _ => Err(vec![other_kind(format, "pairs")]),
    }
}

/// Reads what a file knows of images.
///
/// # Errors
///
/// [`Error::Io`], or the first problem of the file and how many more there are; [`problems`] lists
/// them. [`Error::Parameter`] if the format holds pairs.
pub fn read(format: Format, path: &Path) -> Result<Parts> {
    read_with(format, path, Reading::default())
}

/// Reads what a file knows of images, told what it does not say itself.
///
/// # Errors
///
/// Those of [`read`]; [`Error::Parameter`] if a direction is named for a format that has its own.
pub fn read_with(format: Format, path: &Path, reading: Reading) -> Result<Parts> {
    read_all(format, path, reading).map_err(report::first)
}

/// Reads references per query.
///
/// # Errors
///
/// As for [`read`]; [`Error::Parameter`] if the format holds no pairs.
pub fn read_pairs(format: Format, path: &Path) -> Result<Pairs> {
    read_all_pairs(format, path).map_err(report::first)
}

/// Every problem of a file; none if it can be read.
#[must_use]
pub fn problems(format: Format, path: &Path) -> Vec<Error> {
    let pairs = || read_all_pairs(format, path).err().unwrap_or_default();
    let images = || read_all(format, path, Reading::default()).err().unwrap_or_default();
    match format {
        Format::Map => verify(path),
        Format::HlocPairs => pairs(),
        Format::VprEval if path.join("preds").exists() => {
            let mut all = images();
            all.extend(pairs());
            all
        }
        _ => images(),
    }
}

/// Writes what is known of images; what the format has no place for is left out, see [`left_out`].
///
/// # Errors
///
/// [`Error::Io`]; [`Error::Empty`] or [`Error::PoseKind`] if the format needs what is not known;
/// [`Error::Format`] if it would not give a name back as it is; [`Error::Parameter`] if it holds
/// pairs.
pub fn write(format: Format, path: &Path, parts: &Parts) -> Result<()> {
    match format {
        Format::Map => parts.write_map(path, RowType::F32),
        Format::Npy => npy::write(path, parts),
        Format::Npz => npz::write(path, parts),
        Format::Safetensors => safetensors::write(path, parts),
        Format::HlocH5 => hdf5::write(path, parts),
        Format::HlocPoses => hloc_poses::write(path, parts),
        Format::Colmap => colmap::write(path, parts),
        Format::VprEval => methods_evaluation::write(path, methods_evaluation::DATABASE, parts),
        Format::VprEvalQueries => {
            methods_evaluation::write(path, methods_evaluation::QUERIES, parts)
        }
        Format::Kapture => kapture::write(path, parts),
        Format::Tum => tum::write(path, parts),
        Format::Kitti => kitti::write(path, parts),
        Format::SevenScenes => seven_scenes::write(path, parts),
        Format::LatLon => lat_lon::write(path, parts),
        Format::PoseCsv => pose_csv::write(path, parts),
        Format::UtmNames => utm_names::write(path, parts),
        Format::HlocPairs => Err(other_kind(format, "images")),
    }
}

/// What of these parts [`write()`] leaves out, since the format has no place for it.
#[must_use]
pub fn left_out(format: Format, parts: &Parts) -> Vec<&'static str> {
    use Format::{HlocH5, Kitti, Map, Npy, Npz, Safetensors, SevenScenes, Tum, VprEval};
    let has_descriptors = format.kind() != Kind::Poses;
    let has_poses = matches!(format, Map | Npy | Npz | Safetensors) || format.kind() == Kind::Poses;
    let has_names = match format {
        Kitti | VprEval | Format::VprEvalQueries => false,
        // Their names are those of poses.
        Npy => parts.poses.is_some(),
        Tum => parts.names.is_none() || tum::timestamps(parts).is_some(),
        SevenScenes => parts.names.as_ref().is_none_or(seven_scenes::are_frames),
        _ => true,
    };
    let mut left_out = Vec::new();
    let mut check = |is_there: bool, has_place: bool, what| {
        if is_there && !has_place {
            left_out.push(what);
        }
    };
    check(parts.descriptors.is_some(), has_descriptors, "descriptors");
    check(parts.poses.is_some(), has_poses && format != HlocH5, "poses");
    check(parts.names.is_some(), has_names, "names");
    left_out
}

/// Writes references per query.
///
/// # Errors
///
/// [`Error::Io`]; [`Error::Format`] if the format would not give a name back as it is;
/// [`Error::Parameter`] if it holds no pairs.
pub fn write_pairs(format: Format, path: &Path, pairs: &Pairs) -> Result<()> {
    match format {
        Format::HlocPairs => hloc_pairs::write(path, pairs),
        Format::VprEval => methods_evaluation::write_pairs(path, pairs),
        _ => Err(other_kind(format, "pairs")),
    }
}

fn other_kind(format: Format, wanted: &'static str) -> Error {
    let reason = if wanted == "pairs" {
        "holds no pairs; `hloc-pairs` and `vpr-eval` do"
    } else {
        "holds pairs, not images"
    };
    Error::Parameter { name: "format", value: format.name().to_owned(), reason }
}
