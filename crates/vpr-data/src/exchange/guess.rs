//! Which format a path has, by its name and, where names do not say, by its first bytes.

use std::{fs::File, path::Path};

use super::{Format, colmap, table};
use vpr_core::{Error, Result, map::Header};

impl Format {
    /// The format of what lies at `path`, where that is beyond doubt.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if nothing lies there, [`Error::Format`] if several formats look like this.
    pub fn guess(path: &Path) -> Result<Self> {
        let metadata = path.metadata().map_err(Error::io(path))?;
        let guess = if metadata.is_dir() { of_folder(path)? } else { of_file(path)? };
        guess.ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            let reason = format!("{UNSAID}; known are {known}");
            Error::format(path, "name", reason)
        })
    }

    /// The format of what lies at `path`, for a program whose flag `flag` names one if that is in
    /// doubt: one of those that fit.
    ///
    /// # Errors
    ///
    /// As [`Self::guess`].
    pub fn guess_or(path: &Path, flag: &str, fits: impl Fn(Self) -> bool) -> Result<Self> {
        Self::guess(path).map_err(|err| match err {
            Error::Format { path, place, reason } if reason.starts_with(UNSAID) => {
                let known = Self::ALL.into_iter().filter(|it| fits(*it)).map(Self::name);
                let known = known.collect::<Vec<_>>().join(", ");
                let reason = format!("{UNSAID}; give `{flag}` one of {known}");
                Error::Format { path, place, reason }
            }
            err => err,
        })
    }
}

/// What is said of a path that tells nothing.
const UNSAID: &str = "does not say of which format it is";

fn of_file(path: &Path) -> Result<Option<Format>> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let stem = path.file_stem().unwrap_or_default();
    Ok(match extension.as_str() {
        "npy" => Some(Format::Npy),
        "npz" => Some(Format::Npz),
        "h5" | "hdf5" => Some(Format::HlocH5),
        "tum" => Some(Format::Tum),
        "kitti" => Some(Format::Kitti),
        "csv" | "tsv" => Some(of_table(path)?),
        "txt" | "bin" if stem == "images" => Some(Format::Colmap),
        // Other texts have no header, or are read by it.
        "txt" if table::is_table(path)? => Some(of_table(path)?),
        "safetensors" => {
            let file = File::open(path).map_err(Error::io(path))?;
            let (header, _) = Header::read(path, &file)?;
            let is_map = header.metadata.contains_key("format")
                && header.tensors.contains_key("block_digests");
            Some(if is_map { Format::Map } else { Format::Safetensors })
        }
        _ => None,
    })
}

/// Tables with positions in degrees only are those of latitudes.
fn of_table(path: &Path) -> Result<Format> {
    Ok(if table::is_in_degrees(path)? { Format::LatLon } else { Format::PoseCsv })
}

fn of_folder(path: &Path) -> Result<Option<Format>> {
    let has = |name: &str| path.join(name).exists();
    if has("manifest.json") {
        return Ok(Some(Format::Map));
    }
    if has("sensors/trajectories.txt") {
        return Ok(Some(Format::Kapture));
    }
    if colmap::is_in(path) {
        return Ok(Some(Format::Colmap));
    }
    if has("database_descriptors.npy") || has("preds") {
        return Ok(Some(Format::VprEval));
    }
    for entry in path.read_dir().map_err(Error::io(path))? {
        let name = entry.map_err(Error::io(path))?.file_name();
        let name = name.to_string_lossy();
        if name.ends_with(".pose.txt") {
            return Ok(Some(Format::SevenScenes));
        }
        if name.starts_with('@') {
            return Ok(Some(Format::UtmNames));
        }
    }
    Ok(None)
}
