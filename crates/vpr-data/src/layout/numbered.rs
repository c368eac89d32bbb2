//! Folders of images without a layout: in the order of their numbers, or else of their paths.

use std::path::{Path, PathBuf};

use super::{utm_names::images_below, vpr_bench::image_number};
use vpr_core::{Error, Result};

/// The images below a folder, as deep as they lie: in the order of the integers that they are named
/// by, if all lie in the folder itself and each has its own; else in the order of their paths. Other
/// files are ignored.
///
/// # Errors
///
/// [`Error::Io`] if a folder cannot be read; [`Error::Format`] if there is no image.
pub fn images_in_order(folder: &Path) -> Result<Vec<PathBuf>> {
    let images = images_below(folder)?;
    if images.is_empty() {
        return Err(Error::format(folder, "folder", "has no image"));
    }
    let number = |path: &PathBuf| {
        let is_direct = path.parent() == Some(folder);
        image_number(path).ok().filter(|_| is_direct).map(|number| (number, path.clone()))
    };
    let Some(mut numbered) = images.iter().map(number).collect::<Option<Vec<_>>>() else {
        return Ok(images);
    };
    numbered.sort();
    if numbered.windows(2).any(|pair| pair[0].0 == pair[1].0) {
        return Ok(images);
    }
    Ok(numbered.into_iter().map(|(_, path)| path).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_count_where_all_have_one_of_their_own() {
        let order = |names: &[&str]| {
            let folder = tempfile::tempdir().unwrap();
            for name in names {
                let path = folder.path().join(name);
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                std::fs::write(path, b"").unwrap();
            }
            let name = |path: PathBuf| {
                path.strip_prefix(folder.path()).unwrap().to_string_lossy().into_owned()
            };
            images_in_order(folder.path()).map(|it| it.into_iter().map(name).collect::<Vec<_>>())
        };
        assert_eq!(order(&["10.jpg", "9.png", "notes.txt"]).unwrap(), ["9.png", "10.jpg"]);
        assert_eq!(order(&["10.jpg", "9.jpg", "a.jpg"]).unwrap(), ["10.jpg", "9.jpg", "a.jpg"]);
        assert_eq!(order(&["10.jpg", "9.jpg", "09.png"]).unwrap(), ["09.png", "10.jpg", "9.jpg"]);
        assert_eq!(order(&["b/10.jpg", "b/9.jpg"]).unwrap(), ["b/10.jpg", "b/9.jpg"]);
        assert!(order(&["notes.txt"]).unwrap_err().to_string().contains("no image"));
    }
}
