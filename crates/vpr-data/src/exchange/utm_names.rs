//! Images whose names carry their position, `@utm_east@utm_north@zone@…@.jpg`.

use std::{fmt::Write as _, path::Path};

use super::{
    parts::Parts,
    report::{Read, Report, content_lines, read_text},
};
use crate::layout::utm_names::{UtmFolder, parse_name};
use vpr_core::{
    Poses, Result,
    map::{About, Coordinates, UtmZone},
};
use vpr_files::replace;

/// Reads a folder of images, or a text file with one such name per line.
pub(super) fn read(path: &Path) -> Read<Parts> {
    if path.is_dir() {
        let folder = UtmFolder::open(path).map_err(|err| vec![err])?;
        let names = folder.images.iter();
        let names = names.map(|image| image.strip_prefix(path).unwrap_or(image).to_string_lossy());
        let about = about(folder.zones.iter().map(String::as_str));
        let names = Some(names.collect());
        return Ok(Parts { names, poses: Some(folder.poses()), about, ..Parts::default() });
    }
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let (mut names, mut positions, mut zones) = (Vec::new(), Vec::new(), Vec::new());
    for (line, name) in content_lines(&text) {
        if let Some((position, zone)) = report.keep(line, parse_name(Path::new(name))) {
            if let Some(first) = zones.iter().find(|first: &&String| **first != zone) {
                report.line(line, format!("zone `{zone}`, but `{first}` before: not comparable"));
            }
            names.push(name);
            positions.push(position);
            zones.push(zone);
        }
    }
    let about = about(zones.iter().map(String::as_str));
    let poses = Some(Poses::Planar(positions));
    report.finish(Parts {
        names: Some(names.into_iter().collect()),
        poses,
        about,
        ..Parts::default()
    })
}

/// The zone of names such as `10S`, where the letter is a latitude band: N and above lie north.
fn about<'z>(mut zones: impl Iterator<Item = &'z str>) -> About {
    let zone = zones.next().and_then(|zone| {
        let letter = zone.chars().last().filter(char::is_ascii_uppercase)?;
        let number = zone.strip_suffix(letter)?.parse().ok()?;
        (1..=60).contains(&number).then_some(UtmZone { number, south: letter < 'N' })
    });
    About { coordinates: zone.map(Coordinates::Utm), ..About::default() }
}

/// Writes one name per line: `@east@north@zone@band@@@name@…@.jpg`, the old name as the panorama's.
///
/// The band is `N` or `M`, the first on either side of the equator: maps keep no latitude band.
pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    let (number, band) = match parts.about.coordinates {
        Some(Coordinates::Utm(zone)) => {
            (format!("{:02}", zone.number), if zone.south { "M" } else { "N" })
        }
        _ => (String::new(), ""),
    };
    let mut text = String::new();
    for (row, position) in parts.poses()?.planar()?.iter().enumerate() {
        let name = parts.name(row);
        let (x, y) = (position.x, position.y);
        if name.contains('@') {
            let _ = writeln!(text, "{name}");
        } else {
            let stem = name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem);
            let stem = stem.replace(['/', '\\'], "_");
            let _ = writeln!(text, "@{x:010.2}@{y:010.2}@{number}@{band}@@@{stem}@@@@@@@@.jpg");
        }
    }
    Ok(replace(path, text.as_bytes())?)
}
