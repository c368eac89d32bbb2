//! Names of cached files: digests of everything that their content depends on.

use std::{fs, path::PathBuf, time::UNIX_EPOCH};

use vpr_core::{Error, Result, map::image_list_digest};

/// Digest of a method and the images it was applied to: their paths, lengths and times of change;
/// and of the versions of what computes it.
pub(super) fn key(method: &str, images: &[&PathBuf]) -> Result<String> {
    let versions = format!("nets {} vision {}", vpr_nets::NUMERICS, vpr_vision::NUMERICS);
    let mut lines = vec![method.to_owned(), versions];
    for path in images {
        let metadata = fs::metadata(path).map_err(Error::io(path.as_path()))?;
        let changed = metadata.modified().map_err(Error::io(path.as_path()))?;
        let nanos = changed.duration_since(UNIX_EPOCH).map_or(0, |it| it.as_nanos());
        lines.push(format!("{} {} {nanos}", path.display(), metadata.len()));
    }
    let digest = image_list_digest(&lines);
    let hex = digest.strip_prefix("sha256:").unwrap_or(&digest);
    Ok(hex.chars().take(32).collect())
}
