//! Images whose names carry their position, `@utm_east@utm_north@zone@…@.jpg`.

use std::{fmt::Write as _, path::Path};

use super::{
    Reading, held,
    parts::Parts,
    report::{Read, Report, content_lines, read_text},
};
use crate::{
    layout::utm_names::{InNames, UtmFolder, in_one_zone, parse_name},
    zone::advised,
};
use vpr_core::{
    Error, Poses, Result,
    map::{About, Coordinates, Names, UtmZone},
};
use vpr_files::replace;

/// Names round positions to the centimetre.
const ROUNDING_M: f64 = 0.02;

/// Reads a folder of images, or a text file with one such name per line.
pub(super) fn read(path: &Path, reading: Reading) -> Read<Parts> {
    if path.is_dir() {
        let folder = UtmFolder::open_in(path, reading.zone).map_err(|err| vec![err])?;
        let names = folder.images.iter();
        let names = names.map(|image| image.strip_prefix(path).unwrap_or(image).to_string_lossy());
        let (names, poses) = (Some(names.collect()), Some(folder.poses()));
        let notes = folder.notes;
        return Ok(Parts { names, poses, about: about(folder.zone), notes, ..Parts::default() });
    }
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let (mut names, mut lines, mut said) = (Names::default(), Vec::new(), Vec::new());
    for (line, name) in content_lines(&text) {
        if let Some(position) = report.keep(line, parse_name(Path::new(name))) {
            names.push(name);
            lines.push(line);
            said.push(position);
        }
    }
    let place = |row: usize| format!("line {}", lines[row]);
    match in_one_zone(&said, reading.zone, path, place).map_err(advised) {
        Ok(InNames { positions, zone, notes }) => {
            let (names, poses) = (Some(names), Some(Poses::Planar(positions)));
            report.finish(Parts { names, poses, about: about(zone), notes, ..Parts::default() })
        }
        Err(err) => {
            report.errors(vec![err]);
            report.finish(Parts::default())
        }
    }
}

fn about(zone: Option<UtmZone>) -> About {
    About { coordinates: zone.map(Coordinates::Utm), ..About::default() }
}

/// Writes one name per line: `@east@north@zone@band@@@name@…@.jpg`, the old name as the panorama's.
///
/// A name that says this position already stays as it is. The band is `N` or `M`, the first on either
/// side of the equator: maps keep no latitude band.
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
        held::Names::Line.check(path, &name)?;
        let own = parse_name(Path::new(&name)).ok();
        if own.is_some_and(|own| (own.position - position).norm() < ROUNDING_M) {
            let _ = writeln!(text, "{name}");
        } else if name.contains('@') {
            let place = format!("name `{}`", vpr_files::shorten(&name));
            let reason = "has an `@`, which ends a field in this format, and not this position";
            return Err(Error::format(path, place, reason));
        } else {
            let stem = name.rsplit_once('.').map_or(name.as_str(), |(stem, _)| stem);
            let stem = stem.replace(['/', '\\'], "_");
            let _ = writeln!(text, "@{x:010.2}@{y:010.2}@{number}@{band}@@@{stem}@@@@@@@@.jpg");
        }
    }
    Ok(replace(path, text.as_bytes())?)
}
