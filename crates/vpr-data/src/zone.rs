//! One UTM zone for a set of positions, and what it costs to put others into it.

use std::{collections::BTreeMap, fmt, path::Path, str::FromStr};

use vpr_core::{
    Error, PlanarPosition, Result,
    map::{LatLon, UtmZone},
};

/// Beyond so many degrees from its central meridian a zone's grid is no longer one of metres.
const FARTHEST_DEG: f64 = 30.0;

/// The way out of several zones, in programs that have these flags.
const ADVICE: &str = "; `--zone 30N` puts all into one, `--zone auto` into that of most";

/// What the errors of positions in several zones begin with.
const SEVERAL: &str = "positions in different UTM zones: ";

/// Adds to an error of positions in several zones what a person can do about it.
pub(crate) fn advised(err: Error) -> Error {
    match err {
        Error::Format { path, place, reason } if reason.starts_with(SEVERAL) => {
            Error::Format { path, place, reason: reason + ADVICE }
        }
        err => err,
    }
}

/// Into which UTM zone positions are put whose zones differ: metres of two zones cannot be compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ZoneChoice {
    /// The one that all lie in; positions in several are refused.
    #[default]
    Only,
    /// `auto`: the one that most lie in, of equally many the lowest.
    Most,
    /// `30N`: this one.
    Given(UtmZone),
}

impl fmt::Display for ZoneChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Only => f.write_str("only"),
            Self::Most => f.write_str("auto"),
            Self::Given(zone) => write!(f, "{zone}"),
        }
    }
}

impl FromStr for ZoneChoice {
    type Err = String;

    /// Reads `auto`, or a zone such as `30N`: number and hemisphere.
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Most),
            text => text
                .parse()
                .map(Self::Given)
                .map_err(|reason: String| format!("{reason}; or `auto`, the zone of most images")),
        }
    }
}

/// A position on the ground, the zone it belongs to, and where it is said.
#[derive(Clone, Debug)]
pub(crate) struct Placed {
    pub(crate) point: LatLon,
    pub(crate) zone: UtmZone,
    /// Such as `line 3`.
    pub(crate) place: String,
}

/// Easting and northing of all positions in one zone.
#[derive(Clone, Debug)]
pub(crate) struct InOneZone {
    pub(crate) zone: UtmZone,
    pub(crate) positions: Vec<PlanarPosition>,
    /// What is to be said of positions from elsewhere.
    pub(crate) note: Option<String>,
}

impl ZoneChoice {
    /// The zone for these positions; why there is none, if there are several.
    pub(crate) fn zone(self, placed: &[Placed]) -> Result<Option<UtmZone>, String> {
        let mut zones: BTreeMap<UtmZone, (usize, &str)> = BTreeMap::new();
        for Placed { zone, place, .. } in placed {
            zones.entry(*zone).or_insert((0, place)).0 += 1;
        }
        match self {
            Self::Given(zone) => Ok(Some(zone)),
            // Of equally many the last is taken, so the lowest zone comes last.
            Self::Most => {
                Ok(zones.iter().rev().max_by_key(|(_, (n, _))| *n).map(|(zone, _)| *zone))
            }
            Self::Only if zones.len() > 1 => {
                let each = zones.iter().map(|(zone, (n, place))| {
                    let first = if *n > 1 { ", first " } else { ", " };
                    format!("{zone} ({n}{first}{place})")
                });
                let zones = each.collect::<Vec<_>>().join(", ");
                Err(format!("{SEVERAL}{zones}"))
            }
            Self::Only => Ok(zones.into_keys().next()),
        }
    }

    /// Puts positions on the ground into one zone; `None` if there is no position.
    ///
    /// What is said of several zones ends in [`ADVICE`] where [`advised`] adds it.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] if they lie in several and none was chosen, or too far from the chosen one.
    pub(crate) fn apply(self, placed: &[Placed], path: &Path) -> Result<Option<InOneZone>> {
        let wrong = |reason: String| Error::format(path, "zones", reason);
        let Some(zone) = self.zone(placed).map_err(wrong)? else { return Ok(None) };
        let n_outside = placed.iter().filter(|it| it.zone != zone).count();
        let degrees = |it: &Placed| it.point.degrees_from(zone);
        let farthest = placed.iter().max_by(|a, b| degrees(a).total_cmp(&degrees(b)));
        let mut note = None;
        if let Some(farthest) = farthest.filter(|_| n_outside > 0) {
            let (degrees, place) = (degrees(farthest), &farthest.place);
            if degrees > FARTHEST_DEG {
                return Err(wrong(format!(
                    "{place} lies {degrees:.0}° of longitude from the middle of zone {zone}, too far \
                     for metres of its grid: at most {FARTHEST_DEG:.0}°"
                )));
            }
            let scale = farthest.point.scale(zone);
            note = Some(format!(
                "{}: {n_outside} of {} positions lie outside of UTM zone {zone} and are put into it; \
                 the scale factor is {scale:.5} at {place}, the farthest: lengths there are {:+.2} %",
                path.display(),
                placed.len(),
                100.0 * (scale - 1.0)
            ));
        }
        let positions = placed.iter().map(|it| it.point.to_utm(zone)).collect();
        Ok(Some(InOneZone { zone, positions, note }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on the equator at these longitudes, called `line 2`, `line 3`, …
    fn on_the_equator(lons: &[f64]) -> Vec<Placed> {
        let placed = |(line, &lon): (usize, &f64)| {
            let point = LatLon { lat: 0.5, lon };
            Placed { point, zone: point.zone().unwrap(), place: format!("line {}", line + 2) }
        };
        lons.iter().enumerate().map(placed).collect()
    }

    fn zone(text: &str) -> UtmZone {
        text.parse().unwrap()
    }

    #[test]
    fn several_zones_are_refused_with_the_way_out() {
        let path = Path::new("gps.csv");
        let err = ZoneChoice::Only.apply(&on_the_equator(&[-1.0, 1.0, 2.0]), path).unwrap_err();
        let err = advised(err).to_string();
        assert!(err.contains("30N (1, line 2), 31N (2, first line 3)"), "{err}");
        assert!(err.contains("`--zone 30N`") && err.contains("`--zone auto`"), "{err}");
        assert!(ZoneChoice::Only.apply(&[], path).unwrap().is_none());
        let one = ZoneChoice::Only.apply(&on_the_equator(&[1.0, 2.0]), path).unwrap().unwrap();
        assert_eq!((one.zone, one.note), (zone("31N"), None));
    }

    #[test]
    fn most_and_given_say_what_is_stretched() {
        let path = Path::new("gps.csv");
        let placed = on_the_equator(&[-1.0, 1.0, 2.0]);
        let most = ZoneChoice::Most.apply(&placed, path).unwrap().unwrap();
        assert_eq!(most.zone, zone("31N"));
        // 4° from the meridian of 3° E: 0.9996 (1 + 0.0698² / 2 + …).
        let note = most.note.unwrap();
        assert!(note.contains("1 of 3") && note.contains("1.00206 at line 2"), "{note}");
        assert!(note.ends_with("+0.21 %"), "{note}");
        let given = ZoneChoice::Given(zone("30N")).apply(&placed, path).unwrap().unwrap();
        assert_eq!(given.zone, zone("30N"));
        // The same two places, a degree apart, in either grid.
        for all in [&most.positions, &given.positions] {
            let apart = (all[1] - all[2]).norm();
            assert!((apart - 111_315.0).abs() < 500.0, "{apart}");
        }
        let tie = ZoneChoice::Most.apply(&on_the_equator(&[1.0, -1.0]), path).unwrap().unwrap();
        assert_eq!(tie.zone, zone("30N"));
        let far = ZoneChoice::Given(zone("1N")).apply(&placed, path).unwrap_err().to_string();
        assert!(far.contains("line 4 lies 179°"), "{far}");
    }

    #[test]
    fn choices_are_read_as_they_are_written() {
        for text in ["auto", "30N", "7S"] {
            assert_eq!(text.parse::<ZoneChoice>().unwrap().to_string(), text);
        }
        let err = "18T".parse::<ZoneChoice>().unwrap_err();
        assert!(err.contains("`18T` is no UTM zone") && err.ends_with("most images"), "{err}");
    }
}
