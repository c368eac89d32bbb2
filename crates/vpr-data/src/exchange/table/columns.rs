//! Which column is what, by its title.

/// Which positions are meant where a table has them in metres and in degrees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum Prefer {
    /// Degrees only if there are no metres.
    Metres,
    /// Degrees, and nothing else.
    Degrees,
}

/// The columns that are used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Columns {
    pub(super) name: Option<usize>,
    pub(super) kind: Kind,
    /// The zone of metres: one column, or its number and its letter; none if it is not said.
    pub(super) zone: Vec<usize>,
    /// Titles of the others.
    pub(super) unused: Vec<String>,
}

/// What positions there are, and in which columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Planar { x: usize, y: usize },
    Spatial { x: usize, y: usize, z: usize },
    SixDof { xyz: [usize; 3], wxyz: [usize; 4] },
    Degrees { lat: usize, lon: usize },
}

/// Why titles are not those of a table of poses.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum NotFound {
    /// Nothing in them is a position.
    NoTable(String),
    /// They are, but not all that is needed, or more than is clear.
    Broken(String),
}

/// Titles of names; the first that there is counts.
const NAMES: [&str; 22] = [
    "name",
    "image_name",
    "image",
    "images",
    "img",
    "img_name",
    "filename",
    "file_name",
    "file",
    "image_path",
    "img_path",
    "image_file",
    "path",
    "key",
    "panoid",
    "pano_id",
    "timestamp",
    "time_stamp",
    "timestamps",
    "time",
    "stamp",
    "ts",
];

/// Titles of easting and northing, in pairs, and of what is up.
const EASTINGS: [(&str, &str); 5] = [
    ("easting", "northing"),
    ("utm_easting", "utm_northing"),
    ("utm_east", "utm_north"),
    ("east", "north"),
    ("utm_e", "utm_n"),
];
const UP: [&str; 1] = ["up"];

const LATITUDES: [&str; 5] = ["lat", "latitude", "gps_lat", "gps_latitude", "lat_deg"];
const LONGITUDES: [&str; 8] =
    ["lon", "lng", "long", "longitude", "gps_lon", "gps_lng", "gps_longitude", "lon_deg"];

/// What stands before `x`, `y`, `z` in the titles of a position.
const POSITION_STEMS: [&str; 14] = [
    "",
    "t",
    "p",
    "t_",
    "p_",
    "pos",
    "pos_",
    "pose_",
    "position_",
    "translation_",
    "camera_",
    "cam_",
    "utm_",
    "p_rs_r_",
];
const POSITION_ENDS: [&str; 2] = ["_position_", "_translation_"];

/// What stands before `w`, `x`, `y`, `z` in the titles of a quaternion.
const QUATERNION_STEMS: [&str; 10] =
    ["q", "q_", "quat", "quat_", "quaternion_", "orientation_", "rotation_", "rot_", "q_rs_", "r_"];
const QUATERNION_ENDS: [&str; 3] = ["_orientation_", "_rotation_", "_quaternion_"];

const ZONES: [&str; 2] = ["zone", "utm_zone"];
const ZONE_NUMBERS: [&str; 2] = ["zone_number", "utm_zone_number"];
const ZONE_LETTERS: [&str; 3] = ["zone_letter", "utm_zone_letter", "zone_band"];

impl Columns {
    /// Finds the columns by their titles, in any order and case, units in brackets apart.
    pub(super) fn find(titles: &[String], prefer: Prefer) -> Result<Self, NotFound> {
        let plain: Vec<String> = titles.iter().map(|title| normalised(title)).collect();
        let titles = Titles { written: titles, plain };
        titles.check_whose()?;
        let metres = titles.metres()?;
        let degrees = titles.pair(&LATITUDES, &LONGITUDES)?;
        let kind = match (metres, degrees, prefer) {
            (Some(metres), _, Prefer::Metres) => metres,
            (_, Some([lat, lon]), _) => Kind::Degrees { lat, lon },
            _ => return Err(NotFound::NoTable(titles.refusal(prefer))),
        };
        let name = NAMES.iter().find_map(|name| titles.one(&[name]).transpose()).transpose()?;
        let zone = match kind {
            Kind::Degrees { .. } => Vec::new(),
            _ => titles.zone()?,
        };
        let mut used: Vec<usize> = kind.columns();
        used.extend(name.iter().chain(&zone));
        let unused = (0..titles.written.len()).filter(|column| !used.contains(column));
        let unused = unused.map(|column| titles.written[column].clone());
        let unused = unused.filter(|title| !title.is_empty()).collect();
        Ok(Self { name, kind, zone, unused })
    }
}

impl Kind {
    fn columns(self) -> Vec<usize> {
        match self {
            Self::Planar { x, y } => vec![x, y],
            Self::Spatial { x, y, z } => vec![x, y, z],
            Self::SixDof { xyz, wxyz } => xyz.into_iter().chain(wxyz).collect(),
            Self::Degrees { lat, lon } => vec![lat, lon],
        }
    }
}

/// ` P_RS_R_x [m]` becomes `p_rs_r_x`.
fn normalised(title: &str) -> String {
    let title = title.split(['[', '(']).next().unwrap_or_default().trim().to_lowercase();
    let parts = title.split([' ', '-', '.', ':', '/', '_']).filter(|part| !part.is_empty());
    parts.collect::<Vec<_>>().join("_")
}

struct Titles<'a> {
    written: &'a [String],
    plain: Vec<String>,
}

impl Titles<'_> {
    /// The column with one of these titles.
    fn one(&self, titles: &[&str]) -> Result<Option<usize>, NotFound> {
        let mut columns = (0..self.plain.len()).filter(|&at| titles.contains(&&*self.plain[at]));
        match (columns.next(), columns.next()) {
            (Some(first), Some(second)) => Err(NotFound::Broken(format!(
                "columns {} and {} are both called `{}`",
                first + 1,
                second + 1,
                self.written[second]
            ))),
            (column, _) => Ok(column),
        }
    }

    /// Two columns that go together.
    fn pair(&self, first: &[&str], second: &[&str]) -> Result<Option<[usize; 2]>, NotFound> {
        match (self.one(first)?, self.one(second)?) {
            (Some(first), Some(second)) => Ok(Some([first, second])),
            (None, None) => Ok(None),
            (Some(there), None) => Err(self.half(there, second[0])),
            (None, Some(there)) => Err(self.half(there, first[0])),
        }
    }

    fn half(&self, there: usize, missing: &str) -> NotFound {
        let there = &self.written[there];
        NotFound::Broken(format!("there is a column `{there}`, but none called `{missing}`"))
    }

    /// Positions in metres, with orientations if there are any.
    fn metres(&self) -> Result<Option<Kind>, NotFound> {
        let mut found = Vec::new();
        for (east, north) in EASTINGS {
            if let Some([x, y]) = self.pair(&[east], &[north])? {
                found.push((x, y, self.one(&UP)?));
            }
        }
        for stem in self.stems("x", &POSITION_STEMS, &POSITION_ENDS) {
            let axis = |axis: &str| self.one(&[&format!("{stem}{axis}")]);
            if let (Some(x), Some(y)) = (axis("x")?, axis("y")?) {
                found.push((x, y, axis("z")?));
            }
        }
        let &[(x, y, z), ref more @ ..] = found.as_slice() else { return Ok(None) };
        if let Some(other) = more.first() {
            let title = |column: usize| &self.written[column];
            return Err(NotFound::Broken(format!(
                "there are two positions: `{}`, `{}` and `{}`, `{}`; leave one out or rename it",
                title(x),
                title(y),
                title(other.0),
                title(other.1)
            )));
        }
        Ok(Some(match (z, self.quaternion()?) {
            (None, None) => Kind::Planar { x, y },
            (Some(z), None) => Kind::Spatial { x, y, z },
            (Some(z), Some(wxyz)) => Kind::SixDof { xyz: [x, y, z], wxyz },
            (None, Some(wxyz)) => return Err(self.half(wxyz[0], "z")),
        }))
    }

    fn quaternion(&self) -> Result<Option<[usize; 4]>, NotFound> {
        let mut found = Vec::new();
        let mut stems = self.stems("w", &QUATERNION_STEMS, &QUATERNION_ENDS);
        // What is called q is a quaternion even without its w.
        let named = self.stems("x", &["q", "q_", "quat", "quat_", "quaternion_", "q_rs_"], &[]);
        stems.extend(named.into_iter().filter(|stem| !stems.contains(stem)).collect::<Vec<_>>());
        for stem in stems {
            let mut wxyz = [0; 4];
            for (column, axis) in wxyz.iter_mut().zip(["w", "x", "y", "z"]) {
                let title = format!("{stem}{axis}");
                *column = self.one(&[&title])?.ok_or_else(|| {
                    NotFound::Broken(format!("there is part of a quaternion, but no `{title}`"))
                })?;
            }
            found.push(wxyz);
        }
        match found.as_slice() {
            [] => Ok(None),
            [wxyz] => Ok(Some(*wxyz)),
            [first, second, ..] => Err(NotFound::Broken(format!(
                "there are two quaternions: `{}` and `{}`; leave one out or rename it",
                self.written[first[0]], self.written[second[0]]
            ))),
        }
    }

    /// What stands before this letter in the titles that end in it, if it is one of these.
    fn stems(&self, letter: &str, stems: &[&str], ends: &[&str]) -> Vec<String> {
        let of_title = |title: &String| {
            let stem = title.strip_suffix(letter)?;
            let is_one = stems.contains(&stem) || ends.iter().any(|end| stem.ends_with(end));
            is_one.then(|| stem.to_owned())
        };
        let mut found: Vec<String> = self.plain.iter().filter_map(of_title).collect();
        found.sort();
        found.dedup();
        found
    }

    fn zone(&self) -> Result<Vec<usize>, NotFound> {
        if let Some(zone) = self.one(&ZONES)? {
            return Ok([Some(zone), self.one(&ZONE_LETTERS)?].into_iter().flatten().collect());
        }
        let parts = [self.one(&ZONE_NUMBERS)?, self.one(&ZONE_LETTERS)?];
        Ok(parts.into_iter().flatten().collect())
    }

    /// Refuses tables that other formats of ours read otherwise.
    fn check_whose(&self) -> Result<(), NotFound> {
        let has = |title: &str| self.plain.iter().any(|it| it == title);
        let turns = has("qw") && has("tx");
        if turns && has("device_id") {
            let reason = "looks like kapture's `trajectories.txt`, whose poses go from world to \
                          device: give the folder above its `sensors/`";
            return Err(NotFound::Broken(reason.to_owned()));
        }
        if turns && has("image_id") && has("camera_id") {
            let reason = "looks like COLMAP's `images.txt`: its format is `colmap`";
            return Err(NotFound::Broken(reason.to_owned()));
        }
        Ok(())
    }

    fn refusal(&self, prefer: Prefer) -> String {
        let header = vpr_files::shorten(&self.written.join(","));
        let wanted = match prefer {
            Prefer::Metres => {
                "`name,easting,northing`, `name,x,y,z`, `name,x,y,z,qw,qx,qy,qz` or `name,lat,lon`"
            }
            Prefer::Degrees => "`name,lat,lon`",
        };
        format!("the header is `{header}`; expected titles such as {wanted}, in any order")
    }
}
