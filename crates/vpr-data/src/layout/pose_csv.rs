//! Poses as a table: `name,easting,northing`, `name,x,y,z` or `name,x,y,z,qw,qx,qy,qz`.

use std::{collections::HashSet, path::Path};

use csv::StringRecord;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};

use vpr_core::{Error, PlanarPosition, Pose, Poses, Position, Result};

/// The names and poses of a CSV file, in its order.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseTable {
    /// Names of the images, each once.
    pub names: Vec<String>,
    /// Their poses, metres; orientations are `world_from_camera`.
    pub poses: Poses,
}

/// The header of each kind; it says what the columns are, so it is required.
const PLANAR: [&str; 3] = ["name", "easting", "northing"];
const SPATIAL: [&str; 4] = ["name", "x", "y", "z"];
const SIX_DOF: [&str; 8] = ["name", "x", "y", "z", "qw", "qx", "qy", "qz"];

/// How far the norm of a stored quaternion may be from one.
const NORM_TOLERANCE: f64 = 1e-3;

impl PoseTable {
    /// Reads the file. Quaternions are w first, must be of unit length within 0.001 (rounded
    /// decimals are not exact) and are normalised.
    ///
    /// # Errors
    ///
    /// [`Error::Io`]; [`Error::Format`] with line and column of what is not as it should be.
    pub fn read(path: &Path) -> Result<Self> {
        let file = std::fs::File::open(path).map_err(Error::io(path))?;
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).flexible(true).from_reader(file);
        let header = reader.headers().map_err(|cause| csv_error(path, &cause))?.clone();
        let columns: Vec<&str> = header.iter().collect();
        let mut poses = match columns.as_slice() {
            it if it == PLANAR => Poses::Planar(Vec::new()),
            it if it == SPATIAL => Poses::Spatial(Vec::new()),
            it if it == SIX_DOF => Poses::SixDof(Vec::new()),
            _ => {
                let reason = format!(
                    "the header is `{}`; expected `{}`, `{}` or `{}`",
                    columns.join(","),
                    PLANAR.join(","),
                    SPATIAL.join(","),
                    SIX_DOF.join(",")
                );
                return Err(Error::format(path, "line 1", reason));
            }
        };
        let (mut names, mut seen) = (Vec::new(), HashSet::new());
        for record in reader.records() {
            let record = record.map_err(|cause| csv_error(path, &cause))?;
            let row = Row { path, columns: &columns, record: &record };
            let name = row.name()?;
            if !seen.insert(name.clone()) {
                return Err(row.err("name", format!("`{name}` appears twice")));
            }
            names.push(name);
            match &mut poses {
                Poses::Planar(positions) => positions.push(row.planar()?),
                Poses::Spatial(positions) => positions.push(row.spatial()?),
                Poses::SixDof(poses) => poses.push(row.six_dof()?),
            }
        }
        if names.is_empty() {
            return Err(Error::format(path, "line 2", "there is no pose"));
        }
        Ok(Self { names, poses })
    }
}

/// One line of the table.
struct Row<'a> {
    path: &'a Path,
    columns: &'a [&'a str],
    record: &'a StringRecord,
}

impl Row<'_> {
    fn err(&self, column: &str, reason: impl Into<String>) -> Error {
        let line = self.record.position().map_or(0, csv::Position::line);
        Error::format(self.path, format!("line {line}, column {column}"), reason)
    }

    fn name(&self) -> Result<String> {
        if self.record.len() != self.columns.len() {
            let reason = format!("{} values for {} columns", self.record.len(), self.columns.len());
            let first_wrong = self.columns.get(self.record.len()).unwrap_or(&"after the last");
            return Err(self.err(first_wrong, reason));
        }
        match &self.record[0] {
            "" => Err(self.err("name", "is empty")),
            name => Ok(name.to_owned()),
        }
    }

    /// The number in column `index`.
    fn number(&self, index: usize) -> Result<f64> {
        let text = &self.record[index];
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.err(self.columns[index], format!("`{text}` is not a finite number"))),
        }
    }

    fn planar(&self) -> Result<PlanarPosition> {
        Ok(PlanarPosition::new(self.number(1)?, self.number(2)?))
    }

    fn spatial(&self) -> Result<Position> {
        Ok(Position::new(self.number(1)?, self.number(2)?, self.number(3)?))
    }

    fn six_dof(&self) -> Result<Pose> {
        let position = self.spatial()?;
        let [w, i, j, k] = [self.number(4)?, self.number(5)?, self.number(6)?, self.number(7)?];
        let rotation = Quaternion::new(w, i, j, k);
        if (rotation.norm() - 1.0).abs() > NORM_TOLERANCE {
            let reason = format!("the quaternion has norm {}, not 1", rotation.norm());
            return Err(self.err("qw", reason));
        }
        let rotation = UnitQuaternion::from_quaternion(rotation);
        Ok(Pose::from_parts(Translation3::from(position), rotation))
    }
}

fn csv_error(path: &Path, cause: &csv::Error) -> Error {
    let line = cause.position().map_or(1, csv::Position::line);
    Error::format(path, format!("line {line}"), cause.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<PoseTable> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("poses.csv");
        std::fs::write(&path, text).unwrap();
        PoseTable::read(&path)
    }

    fn reason(text: &str) -> String {
        let err = read(text).unwrap_err().to_string();
        err.split_once("poses.csv: ").unwrap().1.to_owned()
    }

    #[test]
    fn each_header_gives_its_kind() {
        let planar = read("name,easting,northing\na.jpg, 549678.37 ,4180874.6\n").unwrap();
        assert_eq!(planar.poses, Poses::Planar(vec![PlanarPosition::new(549_678.37, 4_180_874.6)]));
        let spatial = read("name,x,y,z\na,1,2,3\nb,4,5,6\n").unwrap();
        assert_eq!(spatial.names, ["a", "b"]);
        assert_eq!(spatial.poses.position(1), Position::new(4.0, 5.0, 6.0));
    }

    #[test]
    fn quaternions_are_w_first() {
        // A quarter turn about z takes x to y.
        let table = read("name,x,y,z,qw,qx,qy,qz\na,1,0,0,0.70710678,0,0,0.70710678\n").unwrap();
        let moved = table.poses.six_dof().unwrap()[0] * Position::new(1.0, 0.0, 0.0);
        assert!((moved - Position::new(1.0, 1.0, 0.0)).norm() < 1e-8, "{moved}");
    }

    #[test]
    fn errors_name_line_and_column() {
        assert_eq!(
            reason("name,x,y,z\na,1,2,3\nb,1,two,3\n"),
            "line 3, column y: `two` is not a finite number"
        );
        assert_eq!(reason("name,x,y,z\na,1,2\n"), "line 2, column z: 3 values for 4 columns");
        assert_eq!(
            reason("name,x,y,z\na,1,2,inf\n"),
            "line 2, column z: `inf` is not a finite number"
        );
        assert_eq!(
            reason("name,x,y,z\na,1,2,3\na,1,2,3\n"),
            "line 3, column name: `a` appears twice"
        );
        assert_eq!(
            reason("name,x,y,z,qw,qx,qy,qz\na,0,0,0,2,0,0,0\n"),
            "line 2, column qw: the quaternion has norm 2, not 1"
        );
        assert_eq!(reason("name,x,y,z\n"), "line 2: there is no pose");
        assert!(reason("a.jpg,1,2,3\n").starts_with("line 1: the header is `a.jpg,1,2,3`"));
        assert!(reason("").starts_with("line 1: the header is ``"));
    }

    #[test]
    fn bytes_that_are_not_text_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("poses.csv");
        std::fs::write(&path, b"name,x,y,z\n\xff,1,2,3\n").unwrap();
        assert!(PoseTable::read(&path).unwrap_err().to_string().contains("line 2"));
    }
}
