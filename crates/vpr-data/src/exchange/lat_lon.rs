//! Latitude and longitude as CSV, to metres in one UTM zone and back.

use std::{collections::BTreeMap, path::Path};

use super::{
    parts::Parts,
    report::{Read, Report, number},
};
use vpr_core::{
    Error, Poses, Result,
    map::{About, Coordinates, LatLon, Names},
};
use vpr_files::replace;

const NAME: [&str; 5] = ["name", "image", "key", "file", "filename"];
const LAT: [&str; 2] = ["lat", "latitude"];
const LON: [&str; 4] = ["lon", "lng", "long", "longitude"];

/// Columns are found by their titles; all points must lie in one zone.
pub(super) fn read(path: &Path) -> Read<Parts> {
    let wrong = |err: &csv::Error| {
        let line = err.position().map_or(1, csv::Position::line);
        vec![Error::format(path, format!("line {line}"), err.to_string())]
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(|err| wrong(&err))?;
    let header = reader.headers().map_err(|err| wrong(&err))?.clone();
    let column = |titles: &[&str]| {
        header.iter().position(|title| titles.contains(&title.to_lowercase().as_str()))
    };
    let mut report = Report::new(path);
    let (Some(lat), Some(lon)) = (column(&LAT), column(&LON)) else {
        report.line(1, "the titles of the columns need `lat` and `lon` (and `name`)");
        return report.finish(Parts::default());
    };
    let name = column(&NAME);
    let (mut names, mut points) = (Names::default(), Vec::new());
    let mut lines_of_zones = BTreeMap::new();
    for record in reader.records() {
        let record = match record {
            Ok(record) => record,
            Err(err) => {
                report.errors(wrong(&err));
                continue;
            }
        };
        let line = record.position().map_or(0, csv::Position::line);
        let line = usize::try_from(line).unwrap_or_default();
        let field = |column: usize| record.get(column).unwrap_or_default();
        let point = number(field(lat)).and_then(|lat| Ok(LatLon { lat, lon: number(field(lon))? }));
        let zone = point.and_then(|point| Ok((point, point.zone()?)));
        if let Some((point, zone)) = report.keep(line, zone) {
            lines_of_zones.entry(zone).or_insert(line);
            points.push(point);
            if let Some(column) = name {
                names.push(field(column));
            }
        }
    }
    if lines_of_zones.len() > 1 {
        let zones = lines_of_zones.iter().map(|(zone, line)| format!("{zone} (line {line})"));
        let zones: Vec<String> = zones.collect();
        report.file(format!(
            "crosses UTM zones: {}; metres of two zones cannot be compared, split the file",
            zones.join(", ")
        ));
    }
    let zone = lines_of_zones.into_keys().next();
    let poses =
        zone.map(|zone| Poses::Planar(points.iter().map(|point| point.to_utm(zone)).collect()));
    let about = About { coordinates: zone.map(Coordinates::Utm), ..About::default() };
    let names = name.map(|_| names);
    let poses = poses.or(Some(Poses::Planar(Vec::new())));
    report.finish(Parts { names, poses, about, ..Parts::default() })
}

/// Degrees with ten digits after the point: a hundredth of a millimetre.
pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    let Some(Coordinates::Utm(zone)) = parts.about.coordinates else {
        return Err(Error::Parameter {
            name: "coordinates",
            value: parts.about.coordinates.map_or("unknown".to_owned(), |it| it.to_string()),
            reason: "latitude and longitude follow only from UTM with its zone",
        });
    };
    let mut out = csv::Writer::from_writer(Vec::new());
    let in_memory = |_: csv::Error| Error::Empty("room in memory");
    out.write_record(["name", "lat", "lon"]).map_err(in_memory)?;
    for (row, &position) in parts.poses()?.planar()?.iter().enumerate() {
        let LatLon { lat, lon } = LatLon::from_utm(position, zone);
        let fields = [parts.name(row), format!("{lat:.10}"), format!("{lon:.10}")];
        out.write_record(fields).map_err(in_memory)?;
    }
    Ok(replace(path, &out.into_inner().unwrap_or_default())?)
}
