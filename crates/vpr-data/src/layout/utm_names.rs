//! Folders of images whose names carry their position: `@utm_east@utm_north@zone@…@.jpg`.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use super::vpr_bench::is_image;
use vpr_core::{Error, PlanarPosition, Poses, Result};

/// The images of one folder with what their names say, sorted by path.
#[derive(Clone, Debug, PartialEq)]
pub struct UtmFolder {
    /// The images, as paths that start with the folder.
    pub images: Vec<PathBuf>,
    /// Easting and northing of each, in metres.
    pub positions: Vec<PlanarPosition>,
    /// UTM zone of each, number and letter as in `10S`; empty where the name has none.
    pub zones: Vec<String>,
}

impl UtmFolder {
    /// Lists the images below `folder`, as deep as they lie, or those that
    /// `<folder>_images_paths.txt` beside it lists, one path a line, if that exists.
    ///
    /// Only the file's own name is parsed: an `@` in a directory does no harm. Paths in the list
    /// are taken as they are, or else relative to the folder, or to what the folder is in.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if a folder cannot be read; [`Error::Format`] if there is no image, a name
    /// has no position, the list names a missing file (with its line), or images lie in different
    /// UTM zones, whose coordinates cannot be compared.
    pub fn open(folder: &Path) -> Result<Self> {
        let list = list_path(folder);
        let images = if list.is_file() { listed(folder, &list)? } else { images_below(folder)? };
        if images.is_empty() {
            return Err(Error::format(folder, "folder", "has no image"));
        }
        let (mut positions, mut zones) = (Vec::new(), Vec::new());
        for image in &images {
            let (position, zone) =
                parse_name(image).map_err(|reason| Error::format(image, "file name", reason))?;
            positions.push(position);
            zones.push(zone);
        }
        let distinct: BTreeSet<&String> = zones.iter().filter(|zone| !zone.is_empty()).collect();
        if distinct.len() > 1 {
            let zones: Vec<_> = distinct.into_iter().map(String::as_str).collect();
            let reason = format!("positions in different UTM zones: {}", zones.join(", "));
            return Err(Error::format(folder, "file names", reason));
        }
        Ok(Self { images, positions, zones })
    }

    /// The positions as poses.
    #[must_use]
    pub fn poses(&self) -> Poses {
        Poses::Planar(self.positions.clone())
    }
}

/// Position and zone in the last component of a path.
pub(crate) fn parse_name(path: &Path) -> Result<(PlanarPosition, String), String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let fields: Vec<&str> = name.split('@').collect();
    let [_, easting, northing, rest @ ..] = fields.as_slice() else {
        return Err(format!("`{name}` does not have the form @utm_east@utm_north@…"));
    };
    let number = |what: &str, text: &str| match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(format!("{what} `{text}` of `{name}` is not a finite number")),
    };
    let position = PlanarPosition::new(number("easting", easting)?, number("northing", northing)?);
    let zone = match rest {
        // The last field is the extension, not a zone.
        [number, letter, _, ..] => format!("{number}{letter}"),
        _ => String::new(),
    };
    Ok((position, zone))
}

/// `<folder>_images_paths.txt`.
fn list_path(folder: &Path) -> PathBuf {
    let mut name = folder.file_name().unwrap_or_default().to_owned();
    name.push("_images_paths.txt");
    folder.with_file_name(name)
}

/// The images a list names, sorted.
fn listed(folder: &Path, list: &Path) -> Result<Vec<PathBuf>> {
    let text = fs::read_to_string(list).map_err(Error::io(list))?;
    let mut images = Vec::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let line = line.trim();
        let parent = folder.parent().unwrap_or(Path::new(""));
        let candidates = [PathBuf::from(line), folder.join(line), parent.join(line)];
        let image = candidates.into_iter().find(|path| path.is_file()).ok_or_else(|| {
            let reason = format!("`{line}` does not exist");
            Error::format(list, format!("line {}", index + 1), reason)
        })?;
        images.push(image);
    }
    images.sort();
    Ok(images)
}

/// All images below a folder, sorted by path. Links to directories are not followed.
///
/// # Errors
///
/// [`Error::Io`] if a folder cannot be read.
pub fn images_below(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut images = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).map_err(Error::io(&folder))? {
            let entry = entry.map_err(Error::io(&folder))?;
            let path = entry.path();
            if entry.file_type().map_err(Error::io(&path))?.is_dir() {
                folders.push(path);
            } else if is_image(&path) {
                images.push(path);
            }
        }
    }
    images.sort();
    Ok(images)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAME: &str = "@0549678.37@4180874.60@10@S@037.77386@-122.43590@bZ1@@@@@@201311@@.jpg";

    #[test]
    fn positions_keep_their_centimetres() {
        let (position, zone) = parse_name(Path::new(NAME)).unwrap();
        assert_eq!(position, PlanarPosition::new(549_678.37, 4_180_874.60));
        assert_eq!(zone, "10S");
    }

    #[test]
    fn an_at_sign_in_a_directory_does_no_harm() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("me@home@2024/queries/@1@2");
        fs::create_dir_all(&inner).unwrap();
        fs::write(inner.join(NAME), "").unwrap();
        fs::write(inner.join("notes@1@2@.txt"), "").unwrap();
        let opened = UtmFolder::open(&folder.path().join("me@home@2024/queries")).unwrap();
        assert_eq!(opened.positions, [PlanarPosition::new(549_678.37, 4_180_874.60)]);
        assert_eq!(opened.zones, ["10S"]);
    }

    #[test]
    fn names_without_a_position_are_named() {
        let reason = |name: &str| parse_name(Path::new(name)).unwrap_err();
        assert_eq!(reason("7.jpg"), "`7.jpg` does not have the form @utm_east@utm_north@…");
        assert_eq!(reason("@x@1@.jpg"), "easting `x` of `@x@1@.jpg` is not a finite number");
        assert_eq!(reason("@1@nan@.jpg"), "northing `nan` of `@1@nan@.jpg` is not a finite number");
    }

    #[test]
    fn zones_do_not_mix() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["@1@2@10@S@.jpg", "@1@2@11@S@.png"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let err = UtmFolder::open(folder.path()).unwrap_err().to_string();
        assert!(err.ends_with("file names: positions in different UTM zones: 10S, 11S"), "{err}");
    }

    #[test]
    fn the_list_beside_the_folder_is_used() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("queries");
        fs::create_dir(&folder).unwrap();
        for name in ["@3@4@.jpg", "@1@2@.jpg", "@5@6@.jpg"] {
            fs::write(folder.join(name), "").unwrap();
        }
        let list = parent.path().join("queries_images_paths.txt");
        fs::write(&list, "@5@6@.jpg\nqueries/@1@2@.jpg\n").unwrap();
        let opened = UtmFolder::open(&folder).unwrap();
        assert_eq!(
            opened.positions,
            [PlanarPosition::new(1.0, 2.0), PlanarPosition::new(5.0, 6.0)]
        );

        fs::write(&list, "@5@6@.jpg\n\n@7@8@.jpg\n").unwrap();
        let err = UtmFolder::open(&folder).unwrap_err().to_string();
        assert!(err.ends_with("line 3: `@7@8@.jpg` does not exist"), "{err}");
    }

    #[test]
    fn an_empty_or_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(UtmFolder::open(folder.path()).unwrap_err().to_string().contains("has no image"));
        let missing = UtmFolder::open(&folder.path().join("queries")).unwrap_err();
        assert!(missing.to_string().ends_with("queries"), "{missing}");
    }
}
