//! Which format a path has, by its name and, where names do not say, by its first bytes.

use std::{fs::File, path::Path};

use super::Format;
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
            let reason = format!("does not say of which format it is; name one of {known}");
            Error::format(path, "name", reason)
        })
    }
}

fn of_file(path: &Path) -> Result<Option<Format>> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    Ok(match extension.as_str() {
        "npy" => Some(Format::Npy),
        "npz" => Some(Format::Npz),
        "h5" | "hdf5" => Some(Format::HlocH5),
        "tum" => Some(Format::Tum),
        "kitti" => Some(Format::Kitti),
        "csv" => Some(of_csv(path)?),
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

/// Pose tables have `easting` or `x`, tables of latitudes have `lat`.
fn of_csv(path: &Path) -> Result<Format> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(|err| Error::format(path, "line 1", err.to_string()))?;
    let header = reader.headers().map_err(|err| Error::format(path, "line 1", err.to_string()))?;
    let is_latitude = |title: &str| matches!(title.to_lowercase().as_str(), "lat" | "latitude");
    Ok(if header.iter().any(is_latitude) { Format::LatLon } else { Format::PoseCsv })
}

fn of_folder(path: &Path) -> Result<Option<Format>> {
    let has = |name: &str| path.join(name).exists();
    if has("manifest.json") {
        return Ok(Some(Format::Map));
    }
    if has("sensors/trajectories.txt") {
        return Ok(Some(Format::Kapture));
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
