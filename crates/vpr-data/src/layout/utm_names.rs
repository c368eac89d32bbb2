//! Folders of images whose names carry their position: `@utm_east@utm_north@zone@…@.jpg`.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use super::folder::{Listing, images_of};
use crate::zone::{Placed, ZoneChoice, advised};
use vpr_core::{
    Error, PlanarPosition, Poses, Result,
    map::{LatLon, UtmZone},
};

/// The images of one folder with what their names say, sorted by path.
#[derive(Clone, Debug, PartialEq)]
pub struct UtmFolder {
    /// The images, as paths that start with the folder.
    pub images: Vec<PathBuf>,
    /// Easting and northing of each, in metres.
    pub positions: Vec<PlanarPosition>,
    /// The UTM zone of all; `None` where no name has one, or none says its hemisphere.
    pub zone: Option<UtmZone>,
    /// What a person should know of the folder, one line each.
    pub notes: Vec<String>,
}

impl UtmFolder {
    /// The images of `folder`, see [`images_of`], with positions in one zone.
    ///
    /// Only the file's own name is parsed: an `@` in a directory does no harm.
    ///
    /// # Errors
    ///
    /// Those of [`images_of`]; [`Error::Format`] if a name has no position or no sound zone, or
    /// images lie in different UTM zones, whose coordinates cannot be compared. Bands of one
    /// hemisphere, as in `18S` and `18T`, are one zone.
    pub fn open(folder: &Path) -> Result<Self> {
        Self::read(folder, ZoneChoice::Only)
    }

    /// Like [`Self::open`], with images of other zones put into the one that is chosen.
    ///
    /// # Errors
    ///
    /// Those of [`Self::open`], as far as the choice does not settle them; [`Error::Format`] if an
    /// image lies too far from the zone that was chosen.
    pub fn open_in(folder: &Path, choice: ZoneChoice) -> Result<Self> {
        Self::read(folder, choice).map_err(advised)
    }

    fn read(folder: &Path, choice: ZoneChoice) -> Result<Self> {
        let Listing { images, mut notes } = images_of(folder)?;
        let mut named = Vec::new();
        for image in &images {
            let name = |reason| Error::format(image, "file name", reason);
            named.push(parse_name(image).map_err(name)?);
        }
        let InNames { positions, zone, notes: more } =
            in_one_zone(&named, choice, folder, |row| {
                format!("`{}`", images[row].file_name().unwrap_or_default().display())
            })?;
        notes.extend(more);
        Ok(Self { images, positions, zone, notes })
    }

    /// The positions as poses.
    #[must_use]
    pub fn poses(&self) -> Poses {
        Poses::Planar(self.positions.clone())
    }
}

/// What the name of an image says of its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct NamedPosition {
    /// Easting and northing in metres.
    pub(crate) position: PlanarPosition,
    pub(crate) zone: NamedZone,
}

/// The zone in a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NamedZone {
    /// `@18@T@`.
    Zone(UtmZone),
    /// `@18@@`: on either side of the equator.
    Number(u8),
    /// `@@@`.
    Unsaid,
}

/// Positions of names in one zone.
pub(crate) struct InNames {
    pub(crate) positions: Vec<PlanarPosition>,
    pub(crate) zone: Option<UtmZone>,
    pub(crate) notes: Vec<String>,
}

/// Puts the positions of names into one zone; `place` says which name a row is.
///
/// # Errors
///
/// [`Error::Format`] as [`UtmFolder::open_in`].
pub(crate) fn in_one_zone(
    named: &[NamedPosition],
    choice: ZoneChoice,
    path: &Path,
    place: impl Fn(usize) -> String,
) -> Result<InNames> {
    let wrong = |reason: String| Error::format(path, "file names", reason);
    let of_zone = |(row, it): (usize, &NamedPosition)| match it.zone {
        NamedZone::Zone(zone) => {
            Some(Placed { point: LatLon::from_utm(it.position, zone), zone, place: place(row) })
        }
        _ => None,
    };
    let placed: Vec<Placed> = named.iter().enumerate().filter_map(of_zone).collect();
    let all = if placed.is_empty() { None } else { choice.apply(&placed, path)? };
    let (zone, note) = all.map_or((None, None), |all| (Some(all.zone), all.note));
    let mut notes: Vec<String> = note.into_iter().collect();
    let numbers: BTreeSet<u8> = named
        .iter()
        .filter_map(|it| match it.zone {
            NamedZone::Number(number) => Some(number),
            _ => None,
        })
        .chain(zone.map(|zone| zone.number))
        .collect();
    if numbers.len() > 1 {
        let numbers: Vec<String> = numbers.iter().map(u8::to_string).collect();
        let reason = format!("names say UTM zones of different numbers: {}", numbers.join(", "));
        return Err(wrong(reason));
    }
    let in_zone = |it: &NamedPosition| match (it.zone, zone) {
        (NamedZone::Zone(own), Some(zone)) if own != zone => {
            LatLon::from_utm(it.position, own).to_utm(zone)
        }
        _ => it.position,
    };
    let positions = named.iter().map(in_zone).collect();
    let n_unsaid = named.len() - placed.len();
    match zone {
        Some(zone) if n_unsaid > 0 => notes.push(format!(
            "{}: {n_unsaid} of {} names say no zone, or not whether it is north or south: taken to be in {zone}",
            path.display(),
            named.len()
        )),
        None if numbers.is_empty() && choice != ZoneChoice::Only => notes.push(format!(
            "{}: no name says a zone: positions stay as they are, whatever zone is asked for",
            path.display()
        )),
        None if numbers.len() == 1 => notes.push(format!(
            "{}: names say a zone, but not whether it is north or south",
            path.display()
        )),
        _ => {}
    }
    Ok(InNames { positions, zone, notes })
}

/// Position and zone in the last component of a path.
pub(crate) fn parse_name(path: &Path) -> Result<NamedPosition, String> {
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
        [number, band, _, ..] => parse_zone(number, band).ok_or_else(|| {
            format!("zone `{number}{band}` of `{name}` is not one from 1C to 60X")
        })?,
        _ => NamedZone::Unsaid,
    };
    Ok(NamedPosition { position, zone })
}

fn parse_zone(number: &str, band: &str) -> Option<NamedZone> {
    let mut letters = band.chars();
    match (number, letters.next(), letters.next()) {
        ("", None, None) => Some(NamedZone::Unsaid),
        (number, band, None) => {
            let number = number.parse().ok().filter(|number| (1..=60).contains(number))?;
            match band {
                None => Some(NamedZone::Number(number)),
                Some(band) => UtmZone::of_band(number, band).map(NamedZone::Zone),
            }
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const NAME: &str = "@0549678.37@4180874.60@10@S@037.77386@-122.43590@bZ1@@@@@@201311@@.jpg";

    #[test]
    fn positions_keep_their_centimetres() {
        let NamedPosition { position, zone } = parse_name(Path::new(NAME)).unwrap();
        assert_eq!(position, PlanarPosition::new(549_678.37, 4_180_874.60));
        // S is the latitude band of San Francisco, not the southern hemisphere.
        assert_eq!(zone, NamedZone::Zone(UtmZone { number: 10, south: false }));
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
        assert_eq!(opened.zone.unwrap().to_string(), "10N");
    }

    #[test]
    fn names_without_a_position_are_named() {
        let reason = |name: &str| parse_name(Path::new(name)).unwrap_err();
        assert_eq!(reason("7.jpg"), "`7.jpg` does not have the form @utm_east@utm_north@…");
        assert_eq!(reason("@x@1@.jpg"), "easting `x` of `@x@1@.jpg` is not a finite number");
        assert_eq!(reason("@1@nan@.jpg"), "northing `nan` of `@1@nan@.jpg` is not a finite number");
        for zone in ["61@N", "x@N", "10@I", "10@NN", "@N"] {
            let err = reason(&format!("@1@2@{zone}@.jpg"));
            assert!(err.contains("is not one from 1C to 60X"), "{err}");
        }
    }

    /// The folder of images with these names.
    fn folder_of(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            fs::write(folder.path().join(name), "").unwrap();
        }
        folder
    }

    #[test]
    fn bands_of_one_hemisphere_are_one_zone() {
        let folder = folder_of(&["@1@2@18@S@.jpg", "@1@3@18@T@.jpg"]);
        let opened = UtmFolder::open(folder.path()).unwrap();
        assert_eq!((opened.zone.unwrap().to_string(), opened.notes.len()), ("18N".to_owned(), 0));
        let south = folder_of(&["@1@2@18@M@.jpg", "@1@3@18@N@.jpg"]);
        let err = UtmFolder::open(south.path()).unwrap_err().to_string();
        assert!(err.contains("different UTM zones: 18N (1, `@1@3@18@N@.jpg`), 18S (1"), "{err}");
    }

    #[test]
    fn names_that_say_less_are_taken_to_lie_with_the_others() {
        let folder = folder_of(&["@1@2@18@S@.jpg", "@1@3@18@@.jpg", "@1@4@@@.jpg"]);
        let opened = UtmFolder::open(folder.path()).unwrap();
        assert_eq!(opened.zone.unwrap().to_string(), "18N");
        assert!(opened.notes[0].contains("2 of 3 names say no zone"), "{:?}", opened.notes);
        let numbers = folder_of(&["@1@2@18@@.jpg", "@1@3@19@@.jpg"]);
        let err = UtmFolder::open(numbers.path()).unwrap_err().to_string();
        assert!(err.ends_with("UTM zones of different numbers: 18, 19"), "{err}");
        let number = UtmFolder::open(folder_of(&["@1@2@18@@.jpg"]).path()).unwrap();
        assert_eq!((number.zone, number.notes.len()), (None, 1));
    }

    #[test]
    fn images_across_a_border_are_put_into_the_zone_that_is_chosen() {
        // The Greenwich meridian in Greenwich, a metre to either side, in zones 30 and 31.
        let at = |lon: f64, zone: &str| {
            let position = LatLon { lat: 51.4779, lon }.to_utm(zone.parse().unwrap());
            format!("@{:.3}@{:.3}@{}@U@.jpg", position.x, position.y, &zone[..2])
        };
        let (west, east) = (at(-0.000_014, "30N"), at(0.000_014, "31N"));
        let folder = folder_of(&[&west, &east]);
        assert!(UtmFolder::open(folder.path()).is_err());
        for choice in ["30N", "31N", "auto"] {
            let opened = UtmFolder::open_in(folder.path(), choice.parse().unwrap()).unwrap();
            let apart = (opened.positions[0] - opened.positions[1]).norm();
            assert!((apart - 1.946).abs() < 0.01, "{choice}: {apart}");
            assert!(opened.notes[0].contains("1 of 2 positions lie outside"), "{:?}", opened.notes);
        }
    }

    #[test]
    fn zones_do_not_mix() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["@1@2@10@S@.jpg", "@1@2@11@S@.png"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        let err = UtmFolder::open(folder.path()).unwrap_err().to_string();
        assert!(err.contains("zones: positions in different UTM zones: 10N (1"), "{err}");
    }

    #[test]
    fn an_empty_or_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        assert!(UtmFolder::open(folder.path()).unwrap_err().to_string().contains("has no image"));
        let missing = UtmFolder::open(&folder.path().join("queries")).unwrap_err();
        assert!(missing.to_string().ends_with("queries"), "{missing}");
    }
}
