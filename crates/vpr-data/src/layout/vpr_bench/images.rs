//! The image folders `query/` and `ref/`: files named by integers, in the order of these.

use std::path::{Path, PathBuf};

use crate::layout::folder::is_hidden;
use vpr_core::{Error, Result};

/// Extensions of images, lower case.
pub(crate) const EXTENSIONS: [&str; 3] = ["jpg", "jpeg", "png"];

/// The images of a folder, sorted by the integer that is their stem.
///
/// Hidden files and what is no image (`Thumbs.db`) are ignored.
///
/// # Errors
///
/// [`Error::Io`] if the folder cannot be read; [`Error::Format`] if it has no image, an image that
/// is not named by an integer, or two of the same integer.
pub fn image_folder(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut images = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        let Some(name) = path.file_name().map(|name| name.to_string_lossy().into_owned()) else {
            continue;
        };
        if is_hidden(&path) || !is_image(&path) {
            continue;
        }
        match image_number(&path) {
            Ok(number) => images.push((number, path)),
            Err(reason) => return Err(Error::format(folder, format!("`{name}`"), reason)),
        }
    }
    images.sort();
    if let Some(pair) = images.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        let place = format!("`{}`", pair[1].1.file_name().unwrap_or_default().display());
        let reason = format!("`{}` has the same number", pair[0].1.display());
        return Err(Error::format(folder, place, reason));
    }
    if images.is_empty() {
        return Err(Error::format(folder, "folder", "has no image"));
    }
    Ok(images.into_iter().map(|(_, path)| path).collect())
}

/// Whether the extension is one of an image.
pub(crate) fn is_image(path: &Path) -> bool {
    let extension = path.extension().map(|it| it.to_string_lossy().to_ascii_lowercase());
    extension.is_some_and(|extension| EXTENSIONS.contains(&extension.as_str()))
}

/// The integer that an image is named by, or why it is none.
pub(crate) fn image_number(path: &Path) -> Result<u64, &'static str> {
    if !is_image(path) {
        return Err("is not a .jpg, .jpeg or .png image");
    }
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    match stem.parse() {
        Ok(number) if stem.bytes().all(|byte| byte.is_ascii_digit()) => Ok(number),
        _ => Err("is not named by an integer"),
    }
}
