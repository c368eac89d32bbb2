//! Latitude and longitude as CSV, to metres in one UTM zone and back.

use std::{fmt::Write as _, path::Path};

use super::{Reading, csv_field, held, parts::Parts, report::Read, table};
use vpr_core::{
    Error, Result,
    map::{Coordinates, LatLon},
};
use vpr_files::replace;

/// Columns are found by their titles, see [`table`].
pub(super) fn read(path: &Path, reading: Reading) -> Read<Parts> {
    table::read(path, table::Prefer::Degrees, reading)
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
    held::Names::Quoted.check_all(path, parts)?;
    let mut text = String::from("name,lat,lon\n");
    for (row, &position) in parts.poses()?.planar()?.iter().enumerate() {
        let LatLon { lat, lon } = LatLon::from_utm(position, zone);
        let _ = writeln!(text, "{},{lat:.10},{lon:.10}", csv_field(&parts.name(row)));
    }
    Ok(replace(path, text.as_bytes())?)
}
