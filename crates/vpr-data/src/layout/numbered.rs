//! Folders of images without a layout: in the order of their numbers, or else of their paths.

use std::path::{Path, PathBuf};

use super::{
    folder::{Listing, images_of},
    vpr_bench::image_number,
};
use vpr_core::Result;

/// The images of a folder, see [`images_of`]: in the order of the integers that they are named by,
/// if all lie in the folder itself and each has its own; else in the order of their paths.
///
/// # Errors
///
/// Those of [`images_of`].
pub fn images_in_order(folder: &Path) -> Result<Listing> {
    let Listing { images, notes } = images_of(folder)?;
    Ok(Listing { images: in_order(folder, images), notes })
}

fn in_order(folder: &Path, images: Vec<PathBuf>) -> Vec<PathBuf> {
    let number = |path: &PathBuf| {
        let is_direct = path.parent() == Some(folder);
        image_number(path).ok().filter(|_| is_direct).map(|number| (number, path.clone()))
    };
    let Some(mut numbered) = images.iter().map(number).collect::<Option<Vec<_>>>() else {
        return images;
    };
    numbered.sort();
    if numbered.windows(2).any(|pair| pair[0].0 == pair[1].0) {
        return images;
    }
    numbered.into_iter().map(|(_, path)| path).collect()
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
            let listing = images_in_order(folder.path());
            listing.map(|it| it.images.into_iter().map(name).collect::<Vec<_>>())
        };
        assert_eq!(order(&["10.jpg", "9.png", "notes.txt"]).unwrap(), ["9.png", "10.jpg"]);
        assert_eq!(order(&["10.jpg", "9.jpg", "a.jpg"]).unwrap(), ["10.jpg", "9.jpg", "a.jpg"]);
        assert_eq!(order(&["10.jpg", "9.jpg", "09.png"]).unwrap(), ["09.png", "10.jpg", "9.jpg"]);
        assert_eq!(order(&["b/10.jpg", "b/9.jpg"]).unwrap(), ["b/10.jpg", "b/9.jpg"]);
        assert!(order(&["notes.txt"]).unwrap_err().to_string().contains("no image"));
    }
}
