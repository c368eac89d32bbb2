//! Tables of poses, whoever wrote them: columns by their titles, in any order.
//!
//! CSV with commas, semicolons, tabs or blanks; `#` starts a comment, and the last comment before
//! the rows may be the header, as in `EuRoC`'s and TUM's files.

mod columns;
mod text;

use std::{fs::File, io::Read as _, path::Path};

use vpr_core::{
    Error, PlanarPosition, Pose, Poses, Position, Result,
    map::{About, Coordinates, LatLon, Names, UtmZone},
};

use super::{
    Reading,
    convention::{Direction, PoseConvention},
    parts::Parts,
    report::{BYTE_ORDER_MARK, Read, Report, number, read_text},
};
use crate::zone::{Placed, advised};
pub(super) use columns::Prefer;
use columns::{Columns, Kind};
pub use text::csv_field;
use text::{Header, NoHeader, Row};

/// Titles stand in the first so many bytes.
const LONGEST_START: u64 = 1 << 16;

/// Reads a table; of metres and degrees, if it has both, those that are preferred.
pub(super) fn read(path: &Path, prefer: Prefer, reading: Reading) -> Read<Parts> {
    let text = read_text(path)?;
    let mut report = Report::new(path);
    let header = match text::header(&text, prefer) {
        Ok(header) => header,
        Err(NoHeader { line, reason, .. }) => {
            report.line(line, reason);
            return report.finish(Parts::default());
        }
    };
    let mut table = Table::new(&header.columns, reading.direction);
    if let Some(reason) = table.refusal() {
        report.line(header.line, reason);
        return report.finish(Parts::default());
    }
    for row in text::rows(&text, &header) {
        match row {
            Ok(row) => table.push(&row, &header, &mut report),
            Err((line, reason)) => report.line(line, reason),
        }
    }
    table.finish(path, &header, reading, report)
}

/// Whether a file begins like a table of poses; nothing but its header is understood.
pub(super) fn is_table(path: &Path) -> Result<bool> {
    Ok(header_of(path)?.map_or_else(|err| err.is_table, |_| true))
}

/// Whether a table has positions, and has them in degrees only.
pub(super) fn is_in_degrees(path: &Path) -> Result<bool> {
    let header = header_of(path)?;
    Ok(header.is_ok_and(|header| matches!(header.columns.kind, Kind::Degrees { .. })))
}

fn header_of(path: &Path) -> Result<Result<Header, NoHeader>> {
    let file = File::open(path).map_err(Error::io(path))?;
    let mut bytes = Vec::new();
    file.take(LONGEST_START).read_to_end(&mut bytes).map_err(Error::io(path))?;
    // A table whose names are not UTF-8 is one too: reading it says what is wrong.
    let text = String::from_utf8_lossy(&bytes);
    Ok(text::header(text.trim_start_matches(BYTE_ORDER_MARK), Prefer::Metres))
}

/// The rows so far.
struct Table<'a> {
    columns: &'a Columns,
    direction: Option<Direction>,
    names: Names,
    lines: Vec<usize>,
    planar: Vec<PlanarPosition>,
    spatial: Vec<Position>,
    poses: Vec<Pose>,
    placed: Vec<Placed>,
    zones: Vec<(String, usize)>,
}

impl<'a> Table<'a> {
    fn new(columns: &'a Columns, direction: Option<Direction>) -> Self {
        Self {
            columns,
            direction,
            names: Names::default(),
            lines: Vec::new(),
            planar: Vec::new(),
            spatial: Vec::new(),
            poses: Vec::new(),
            placed: Vec::new(),
            zones: Vec::new(),
        }
    }

    /// Why these columns do not go with what was asked for.
    fn refusal(&self) -> Option<String> {
        let direction = self.direction.filter(|it| *it != Direction::WorldFromCamera)?;
        let has_orientations = matches!(self.columns.kind, Kind::SixDof { .. });
        (!has_orientations)
            .then(|| format!("{direction} needs orientations, and there is no quaternion"))
    }

    fn push(&mut self, row: &Row, header: &Header, report: &mut Report<'_>) {
        let n = header.titles.len();
        let wrong = |report: &mut Report<'_>, column: usize, reason: String| {
            let title = header.titles.get(column).map_or("after the last", String::as_str);
            report.at(format!("line {}, column {title}", row.line), reason);
        };
        // A separator at the end of a line makes no column.
        if row.fields.len() < n || row.fields.iter().skip(n).any(|field| !field.is_empty()) {
            let reason = format!("{} values for {n} columns", row.fields.len());
            return wrong(report, row.fields.len().min(n), reason);
        }
        let mut sound = true;
        let mut value = |column: usize| {
            number(&row.fields[column]).unwrap_or_else(|reason| {
                wrong(report, column, reason);
                sound = false;
                0.0
            })
        };
        match self.columns.kind {
            Kind::Planar { x, y } => self.planar.push(PlanarPosition::new(value(x), value(y))),
            Kind::Spatial { x, y, z } => {
                self.spatial.push(Position::new(value(x), value(y), value(z)));
            }
            Kind::SixDof { xyz, wxyz } => {
                let (xyz, quaternion) = (xyz.map(&mut value), wxyz.map(&mut value));
                let convention = PoseConvention::TABLE.directed(self.direction);
                match convention.pose(xyz, quaternion) {
                    Ok(pose) => self.poses.push(pose),
                    Err(reason) if sound => wrong(report, wxyz[0], reason),
                    Err(_) => {}
                }
            }
            Kind::Degrees { lat, lon } => {
                let point = LatLon { lat: value(lat), lon: value(lon) };
                match point.zone() {
                    Ok(zone) => {
                        let place = format!("line {}", row.line);
                        self.placed.push(Placed { point, zone, place });
                    }
                    Err(reason) if sound => wrong(report, lat, reason),
                    Err(_) => {}
                }
            }
        }
        self.lines.push(row.line);
        if let Some(column) = self.columns.name {
            let name = &row.fields[column];
            if name.is_empty() {
                wrong(report, column, "is empty".to_owned());
            }
            self.names.push(name);
        }
        let zone = self.columns.zone.iter().map(|&column| row.fields[column].trim());
        let zone: String = zone.collect();
        if self.zones.last().is_none_or(|(last, _)| *last != zone) {
            self.zones.push((zone, row.line));
        }
    }

    fn finish(
        self,
        path: &Path,
        header: &Header,
        reading: Reading,
        mut report: Report<'_>,
    ) -> Read<Parts> {
        let column = |title: Option<usize>| {
            title.and_then(|column| header.titles.get(column)).map_or("", String::as_str)
        };
        if let Some((name, [first, second])) = self.names.repeated() {
            let place =
                format!("line {}, column {}", self.lines[second], column(self.columns.name));
            let name = vpr_files::shorten(name);
            report
                .at(place, format!("`{name}` appears twice, first on line {}", self.lines[first]));
        }
        if self.lines.is_empty() && !report.has_problems() {
            report.line(header.line + 1, "there is no pose");
        }
        let mut notes = notes(path, header, reading);
        let mut about = About::default();
        let is_in_metres = !matches!(self.columns.kind, Kind::Degrees { .. });
        if is_in_metres && !self.columns.zone.is_empty() {
            match one_zone(&self.zones) {
                Ok(zone) => {
                    about.coordinates = zone.map(Coordinates::Utm);
                    if zone.is_none() && self.zones.iter().any(|(zone, _)| !zone.is_empty()) {
                        notes.push(format!(
                            "{}: its zone says not whether it is north or south of the equator",
                            path.display()
                        ));
                    }
                }
                Err(reason) => report.file(reason),
            }
        }
        let poses = match self.columns.kind {
            Kind::Planar { .. } => Poses::Planar(self.planar),
            Kind::Spatial { .. } => Poses::Spatial(self.spatial),
            Kind::SixDof { .. } => Poses::SixDof(self.poses),
            Kind::Degrees { .. } => {
                let mut positions = Vec::new();
                match reading.zone.apply(&self.placed, path).map_err(advised) {
                    Ok(Some(all)) => {
                        about.coordinates = Some(Coordinates::Utm(all.zone));
                        notes.extend(all.note);
                        positions = all.positions;
                    }
                    Ok(None) => {}
                    Err(err) => report.errors(vec![err]),
                }
                Poses::Planar(positions)
            }
        };
        let names = self.columns.name.map(|_| self.names);
        report.finish(Parts { names, poses: Some(poses), about, notes, ..Parts::default() })
    }
}

/// What a person should know of a table that was read.
fn notes(path: &Path, header: &Header, reading: Reading) -> Vec<String> {
    let path = path.display();
    let mut notes = Vec::new();
    if !header.columns.unused.is_empty() {
        notes.push(format!(
            "{path}: columns that are not used: {}",
            header.columns.unused.join(", ")
        ));
    }
    if header.columns.name.is_none() {
        notes.push(format!("{path}: no column has names: its rows are taken in their order"));
    }
    if header.n_commented_rows > 0 {
        let n = header.n_commented_rows;
        notes.push(format!("{path}: rows that start with `#` are comments, {n} look like poses"));
    }
    if reading.zone != crate::ZoneChoice::Only
        && !matches!(header.columns.kind, Kind::Degrees { .. })
    {
        notes.push(format!(
            "{path}: positions are in metres, and stay as they are whatever the zone"
        ));
    }
    notes
}

/// The one zone of a column; `None` if it is empty or leaves the hemisphere open.
fn one_zone(zones: &[(String, usize)]) -> Result<Option<UtmZone>, String> {
    let Some((first, line)) = zones.first() else { return Ok(None) };
    if let Some((other, other_line)) = zones.iter().find(|(zone, _)| zone != first) {
        return Err(format!(
            "positions in different UTM zones: `{first}` (line {line}), `{other}` (line \
             {other_line}): metres of two zones cannot be compared"
        ));
    }
    let digits = first.trim_end_matches(|it: char| it.is_ascii_alphabetic());
    let letters = &first[digits.len()..];
    match (digits.parse(), letters.len()) {
        _ if first.is_empty() => Ok(None),
        // S is a band in the north, or the southern hemisphere.
        (Ok(1..=60), 1) if letters.eq_ignore_ascii_case("s") => Ok(None),
        (Ok(1..=60), 0) => Ok(None),
        (Ok(number), 1) => match UtmZone::of_band(number, letters.chars().next().unwrap_or('-')) {
            Some(zone) => Ok(Some(zone)),
            None => Err(format!("zone `{first}` (line {line}) is not one from 1C to 60X")),
        },
        _ => Err(format!("zone `{first}` (line {line}) is not one from 1C to 60X")),
    }
}

#[cfg(test)]
mod tests;
