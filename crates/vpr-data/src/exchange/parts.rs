//! What a file of another program knows of images.

use std::path::Path;

use vpr_core::{
    Descriptors, Error, Map, Pose, Poses, Result,
    map::{About, MapWriter, Names, OpenMap, Origins, RowType},
};

/// Names, descriptors and poses of the same images in the same order, as far as a file has them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parts {
    /// Names of the images.
    pub names: Option<Names>,
    /// Their descriptors.
    pub descriptors: Option<Descriptors>,
    /// Their poses.
    pub poses: Option<Poses>,
    /// Which of them are regressed from others; only maps can say so.
    pub origins: Option<Origins>,
    /// What else is known.
    pub about: About,
    /// What a person should know of the reading, one line each with the file it is about: what was
    /// rounded, put into another zone, or not used.
    pub notes: Vec<String>,
}

/// References in order of nearness for every query, by name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pairs {
    /// One entry per query, in the order of the queries.
    pub lists: Vec<PairList>,
}

/// The references of one query.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PairList {
    /// Name of the query.
    pub query: String,
    /// Names of the references, nearest first.
    pub references: Vec<String>,
}

impl Parts {
    /// The content of an open map, in memory.
    ///
    /// # Errors
    ///
    /// Those of [`OpenMap::descriptors`], [`OpenMap::poses`] and [`OpenMap::names`].
    pub fn of_map(map: &OpenMap) -> Result<Self> {
        Ok(Self {
            names: map.names()?,
            descriptors: Some(map.descriptors()?),
            poses: map.poses()?,
            origins: map.origins()?,
            about: map.about().clone(),
            notes: Vec::new(),
        })
    }

    /// Checks that all parts are of equally many images.
    ///
    /// # Errors
    ///
    /// [`Error::Mismatch`] if not.
    pub fn check(&self) -> Result<()> {
        let lengths = [
            ("image names", self.names.as_ref().map(Names::len)),
            ("descriptors", self.descriptors.as_ref().map(Descriptors::len)),
            ("poses", self.poses.as_ref().map(Poses::len)),
            ("origins of rows", self.origins.as_ref().map(Origins::len)),
        ];
        let known: Vec<_> =
            lengths.into_iter().filter_map(|(what, len)| Some((what, len?))).collect();
        match known.iter().find(|(_, len)| *len != known[0].1) {
            None => Ok(()),
            Some(&(what, actual)) => Err(Error::Mismatch { what, expected: known[0].1, actual }),
        }
    }

    /// The map of these parts.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] if descriptors or poses are missing, and those of [`Map::new`].
    pub fn into_map(self) -> Result<Map> {
        let descriptors = self.descriptors.ok_or(Error::Empty("descriptors in the file"))?;
        Map::new(descriptors, self.poses.ok_or(Error::Empty("poses in the file"))?)
    }

    /// Writes one map file.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] if there are no descriptors, and those of [`MapWriter`].
    pub fn write_map(&self, path: &Path, row_type: RowType) -> Result<()> {
        self.check()?;
        let descriptors = self.descriptors()?;
        let mut writer = MapWriter::create(path, descriptors.dim(), row_type, self.about.clone())?;
        let (rows, poses, names) = (descriptors.view(), self.poses.as_ref(), self.names.as_ref());
        match &self.origins {
            Some(origins) => writer.append_regressed(rows, poses, names, origins)?,
            None => writer.append(rows, poses, names)?,
        }
        writer.finish().map(drop)
    }

    pub(super) fn descriptors(&self) -> Result<&Descriptors> {
        self.descriptors.as_ref().ok_or(Error::Empty("descriptors in the file"))
    }

    pub(super) fn poses(&self) -> Result<&Poses> {
        self.poses.as_ref().ok_or(Error::Empty("poses in the file"))
    }

    pub(super) fn six_dof(&self) -> Result<&[Pose]> {
        self.poses()?.six_dof()
    }

    /// The name of an image, or its number in six digits.
    pub(super) fn name(&self, row: usize) -> String {
        let name = self.names.as_ref().and_then(|names| names.get(row));
        name.map_or_else(|| format!("{row:06}"), str::to_owned)
    }
}
