//! Descriptors from one file, poses from another.

use std::{collections::HashMap, path::Path};

use super::parts::Parts;
use crate::layout::vpr_bench::is_image;
use vpr_core::{Descriptors, Error, Poses, Result, map::Names};

impl Parts {
    /// Takes names and poses from another file of the same images: by name if both have names,
    /// by order otherwise. Poses that came with the descriptors give way.
    ///
    /// If no name of one is a name of the other, they are compared without folders and without the
    /// extension of an image, as far as they are then still different.
    ///
    /// # Errors
    ///
    /// [`Error::Repeated`] if a name stands in two rows of what is joined; [`Error::Mismatch`] if
    /// the numbers of images differ and there are no names to go by; [`Error::Unknown`] if an image
    /// has no pose.
    pub fn join(mut self, other: Self) -> Result<Self> {
        refuse_repeated("pose of image", other.names.as_ref())?;
        self.notes.extend(other.notes);
        if other.poses.is_some() {
            self.about.coordinates = other.about.coordinates.or(self.about.coordinates);
        }
        let Some(poses) = other.poses else {
            self.names = self.names.or(other.names);
            self.check()?;
            return Ok(self);
        };
        let poses = match (&self.names, &other.names) {
            (Some(names), Some(others)) => {
                refuse_repeated("descriptor of image", Some(names))?;
                let (rows, notes) = rows_by_name(names, others)?;
                self.notes.extend(notes);
                poses.select(&rows)
            }
            (names, _) => {
                let n = names.as_ref().map(Names::len);
                let n = n.or(self.descriptors.as_ref().map(Descriptors::len));
                if let Some(expected) = n.filter(|&n| n != poses.len()) {
                    let (what, actual) = ("poses, one per image", poses.len());
                    return Err(Error::Mismatch { what, expected, actual });
                }
                if names.is_some() {
                    let note = "poses have no names: they are taken in the order of the images";
                    self.notes.push(note.to_owned());
                }
                poses
            }
        };
        self.names = self.names.or(other.names);
        self.poses = Some(poses);
        Ok(self)
    }
}

fn refuse_repeated(kind: &'static str, names: Option<&Names>) -> Result<()> {
    match names.and_then(Names::repeated) {
        None => Ok(()),
        Some((name, rows)) => Err(Error::Repeated { kind, name: vpr_files::shorten(name), rows }),
    }
}

/// The row of every name among the others, and what is to be said about it.
fn rows_by_name(names: &Names, others: &Names) -> Result<(Vec<usize>, Vec<String>)> {
    let row_of: HashMap<&str, usize> = others.iter().zip(0..).collect();
    let mut rows: Vec<Option<usize>> = names.iter().map(|name| row_of.get(name).copied()).collect();
    let mut notes = Vec::new();
    if rows.iter().all(Option::is_none)
        && let Some(by_stem) = rows_by_stem(names, others)
    {
        rows = by_stem;
        notes.push(format!(
            "names are compared without folders and extensions: `{}` is `{}`",
            names.get(0).unwrap_or_default(),
            rows.first().copied().flatten().and_then(|row| others.get(row)).unwrap_or_default()
        ));
    }
    let missing = rows.iter().filter(|row| row.is_none()).count();
    if let Some(row) = rows.iter().position(Option::is_none) {
        let name = vpr_files::shorten(names.get(row).unwrap_or_default());
        let such_as = others
            .get(0)
            .map_or(String::new(), |it| format!(", such as `{}`", vpr_files::shorten(it)));
        let more = match missing {
            1 => String::new(),
            n => format!("; {n} of {} images have none", names.len()),
        };
        let known = format!("{} images{such_as}{more}", others.len());
        return Err(Error::Unknown { kind: "pose of image", name, known });
    }
    let rows: Vec<usize> = rows.into_iter().flatten().collect();
    if rows.len() < others.len() {
        let n = others.len() - rows.len();
        notes.push(format!("{n} of {} poses are of other images and not used", others.len()));
    }
    Ok((rows, notes))
}

/// The same by what is left of names without folders and extensions; `None` if that is not the same
/// for no two images of either side, or helps no image.
fn rows_by_stem(names: &Names, others: &Names) -> Option<Vec<Option<usize>>> {
    let stems = |names: &Names| -> Option<HashMap<String, usize>> {
        let stems: HashMap<String, usize> = names.iter().map(stem).zip(0..).collect();
        (stems.len() == names.len()).then_some(stems)
    };
    stems(names)?;
    let row_of = stems(others)?;
    let rows: Vec<Option<usize>> =
        names.iter().map(|name| row_of.get(&stem(name)).copied()).collect();
    rows.iter().any(Option::is_some).then_some(rows)
}

fn stem(name: &str) -> String {
    let path = Path::new(name);
    let stem = if is_image(path) { path.file_stem() } else { path.file_name() };
    stem.unwrap_or_default().to_string_lossy().into_owned()
}

/// One of two sets of positions whose distances are asked for.
#[derive(Clone, Copy, Debug)]
pub struct Side<'a> {
    /// The file or folder they are from.
    pub place: &'a Path,
    /// The positions.
    pub poses: &'a Poses,
    /// What their numbers mean.
    pub coordinates: Option<vpr_core::map::Coordinates>,
}

/// Checks that distances between two sides mean something; what is to be said if only one of them
/// says where its coordinates are.
///
/// # Errors
///
/// [`Error::Format`] with both files if one side is planar and the other is not, or both say what
/// their coordinates are, and it is not the same.
pub fn comparable(queries: Side<'_>, references: Side<'_>) -> Result<Option<String>> {
    let other = references.place.display();
    let wrong = |reason: String| Err(Error::format(queries.place, "positions", reason));
    if queries.poses.planar().is_ok() != references.poses.planar().is_ok() {
        let [own, theirs] = [queries, references].map(|side| match side.poses {
            Poses::Planar(_) => "easting and northing",
            _ => "three coordinates",
        });
        return wrong(format!("have {own}, those of {other} {theirs}: give both the same"));
    }
    match (queries.coordinates, references.coordinates) {
        (Some(own), Some(theirs)) if own != theirs => wrong(format!(
            "are in {own}, those of {other} in {theirs}: they cannot be compared; `--zone` puts \
             positions in degrees, or with their zone in their names, into one"
        )),
        (Some(own), None) => Ok(Some(format!(
            "{}: positions are in {own}; {other} does not say where its are: taken to be there, too",
            queries.place.display()
        ))),
        (None, Some(theirs)) => Ok(Some(format!(
            "{other}: positions are in {theirs}; {} does not say where its are: taken to be there, too",
            queries.place.display()
        ))),
        _ => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use vpr_core::{PlanarPosition, Position, map::Coordinates};

    use super::*;

    fn named(names: &[&str]) -> Parts {
        Parts { names: Some(names.iter().collect()), ..Parts::default() }
    }

    /// Poses along x by name.
    fn poses(names: &[&str]) -> Parts {
        let poses = (0..names.len()).map(|x| Position::new(x as f64, 0.0, 0.0)).collect();
        Parts { poses: Some(Poses::Spatial(poses)), ..named(names) }
    }

    fn xs(parts: &Parts) -> Vec<f64> {
        let poses = parts.poses.as_ref().unwrap();
        (0..poses.len()).map(|row| poses.position(row).x).collect()
    }

    #[test]
    fn poses_go_by_name_and_the_rest_is_said() {
        let joined = named(&["c", "a"]).join(poses(&["a", "b", "c"])).unwrap();
        assert_eq!(xs(&joined), [2.0, 0.0]);
        assert_eq!(joined.notes, ["1 of 3 poses are of other images and not used"]);
        let err = named(&["c", "d", "e"]).join(poses(&["a", "b", "c"])).unwrap_err().to_string();
        assert_eq!(
            err,
            "unknown pose of image `d`; known: 3 images, such as `a`; 2 of 3 images have none"
        );
    }

    #[test]
    fn a_name_in_two_rows_is_refused_wherever_it_stands() {
        let err = named(&["a"]).join(poses(&["a", "b", "a"])).unwrap_err().to_string();
        assert_eq!(err, "pose of image `a` stands in rows 0 and 2");
        // Also where there is no name to join by.
        assert!(Parts::default().join(poses(&["1.0", "1.0"])).is_err());
        let err = named(&["b", "b"]).join(poses(&["a", "b"])).unwrap_err().to_string();
        assert_eq!(err, "descriptor of image `b` stands in rows 0 and 1");
    }

    #[test]
    fn names_without_folders_and_extensions_are_the_last_resort() {
        let joined = named(&["images/b.jpg", "images/a.png"]).join(poses(&["a", "b"])).unwrap();
        assert_eq!(xs(&joined), [1.0, 0.0]);
        assert!(joined.notes[0].ends_with("`images/b.jpg` is `b`"), "{:?}", joined.notes);
        // A dot in a time stamp is no extension.
        let joined = named(&["2.5"]).join(poses(&["2.4", "2.5"])).unwrap();
        assert_eq!(xs(&joined), [1.0]);
        let two = named(&["left/a.jpg", "right/a.jpg"]).join(poses(&["a", "b"]));
        assert!(matches!(two, Err(Error::Unknown { .. })));
    }

    #[test]
    fn poses_without_names_are_taken_in_order_if_they_are_as_many() {
        let nameless = || Parts { names: None, ..poses(&["", " "]) };
        let joined = named(&["b", "a"]).join(nameless()).unwrap();
        assert_eq!((xs(&joined), joined.notes.len()), (vec![0.0, 1.0], 1));
        let err = named(&["b"]).join(nameless()).unwrap_err();
        assert!(matches!(err, Error::Mismatch { expected: 1, actual: 2, .. }), "{err}");
    }

    #[test]
    fn zones_and_kinds_must_be_the_same_and_silence_is_said() {
        let planar = Poses::Planar(vec![PlanarPosition::origin()]);
        let spatial = Poses::Spatial(vec![Position::origin()]);
        let side = |place: &'static str, poses, zone: Option<&str>| {
            let coordinates = zone.map(|zone| Coordinates::Utm(zone.parse().unwrap()));
            Side { place: Path::new(place), poses, coordinates }
        };
        let [queries, references] = [side("q.csv", &planar, None), side("r.csv", &planar, None)];
        assert_eq!(comparable(queries, references).unwrap(), None);
        let err = comparable(queries, side("r.csv", &spatial, None)).unwrap_err().to_string();
        assert!(err.starts_with("q.csv: ") && err.contains("r.csv three coordinates"), "{err}");
        let north = side("r.csv", &planar, Some("18N"));
        let note = comparable(queries, north).unwrap().unwrap();
        assert!(note.starts_with("r.csv: positions are in utm 18N; q.csv does not"), "{note}");
        assert!(comparable(north, queries).unwrap().unwrap().starts_with("r.csv: "));
        let err = comparable(side("q.csv", &planar, Some("18S")), north).unwrap_err().to_string();
        assert!(err.contains("in utm 18S, those of r.csv in utm 18N"), "{err}");
    }
}
