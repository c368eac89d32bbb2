//! One side, queries or references: rows on the disk or in memory, with what is known of them.

use std::path::Path;

use vpr_core::{
    Descriptors, Error, Poses,
    knn::{RowLengths, RowSource, Selected},
    map::{About, Access, Names, OpenMap, Opening, Origins},
};
use vpr_data::exchange::{Beside, Format, Parts};
use vpr_study::reading::ReadingArgs;

/// Descriptors that stay on the disk, or are in memory.
pub(super) enum Rows {
    Open(OpenMap),
    /// Those of a map in which images were taken.
    Measured(OpenMap, Vec<usize>),
    Memory(Descriptors),
}

impl Rows {
    /// All rows that are looked at, as one source.
    pub(super) fn with<T>(
        &self,
        look: impl FnOnce(&dyn RowSource) -> vpr_core::Result<T>,
    ) -> vpr_core::Result<T> {
        match self {
            Self::Open(map) => look(map),
            Self::Measured(map, rows) => look(&Selected::new(map, rows.clone())?),
            Self::Memory(rows) => look(rows),
        }
    }

    pub(super) fn len(&self) -> usize {
        match self {
            Self::Open(map) => map.len(),
            Self::Measured(_, rows) => rows.len(),
            Self::Memory(rows) => rows.len(),
        }
    }

    pub(super) fn dim(&self) -> vpr_core::Result<usize> {
        self.with(|source| Ok(source.dim()))
    }

    /// As the map says, or measured.
    pub(super) fn lengths(&self) -> vpr_core::Result<Option<RowLengths>> {
        if let Self::Open(map) = self
            && let Some(said) = map.row_lengths()?
        {
            return Ok(Some(said));
        }
        self.with(|source| RowLengths::of(source))
    }
}

/// One side as its file has it.
pub(super) struct Side {
    pub(super) rows: Rows,
    pub(super) names: Option<Names>,
    pub(super) poses: Option<Poses>,
    pub(super) about: About,
}

impl Side {
    /// Opens a map, or reads a file of another format, with the poses of another file if there is
    /// one. `measured` leaves regressed rows of a map out.
    pub(super) fn open(
        path: &Path,
        poses: Option<&Path>,
        reading: ReadingArgs,
        beside: Beside,
        measured: bool,
    ) -> anyhow::Result<Self> {
        // A map shows what it is, whatever format the other side has.
        if matches!(Format::guess(path), Ok(Format::Map)) {
            let map = OpenMap::open(path, Opening { access: Access::Read, trust: false })?;
            let (names, poses, about) = match poses {
                None => (map.names()?, map.poses()?, map.about().clone()),
                Some(file) => {
                    let (names, about) = (map.names()?, map.about().clone());
                    let parts = Parts { names, about, ..Parts::default() };
                    let joined = joined(parts, file, map.len(), reading)?;
                    (joined.names, joined.poses, joined.about)
                }
            };
            let origins = map.origins()?.filter(|_| measured);
            let Some(rows) = origins.as_ref().map(Origins::measured_rows) else {
                return Ok(Self { rows: Rows::Open(map), names, poses, about });
            };
            let names = names.map(|names| rows.iter().filter_map(|&row| names.get(row)).collect());
            let poses = poses.map(|poses| poses.select(&rows));
            return Ok(Self { rows: Rows::Measured(map, rows), names, poses, about });
        }
        let parts = reading.read_both(path, poses, beside)?;
        let none = || Error::Empty("descriptors").in_file(path);
        let rows = Rows::Memory(parts.descriptors.ok_or_else(none)?);
        Ok(Self { rows, names: parts.names, poses: parts.poses, about: parts.about })
    }
}

/// Poses of a file, as many as there are descriptors.
pub(super) fn joined(
    parts: Parts,
    file: &Path,
    n: usize,
    reading: ReadingArgs,
) -> anyhow::Result<Parts> {
    let joined = reading.poses.join(parts, file)?;
    match joined.poses.as_ref().map(Poses::len) {
        Some(n_poses) if n_poses != n => {
            let what = "poses, one per descriptor";
            let err = Error::Mismatch { what, expected: n, actual: n_poses };
            Err(err.in_file(file).into())
        }
        _ => Ok(joined),
    }
}

/// Refuses descriptors of different encoders and coordinates of different grids.
pub(super) fn check(map: &About, queries: &About) -> sue::Result<()> {
    let differ =
        |a: &Option<String>, b: &Option<String>| matches!((a, b), (Some(a), Some(b)) if a != b);
    if differ(&map.encoder, &queries.encoder)
        || differ(&map.weights_digest, &queries.weights_digest)
    {
        let name = |about: &About| {
            let digest = about.weights_digest.as_ref().map(|it| format!(" with weights {it}"));
            about.encoder.clone().unwrap_or_default() + &digest.unwrap_or_default()
        };
        return Err(sue::Error::OtherEncoder { map: name(map), queries: name(queries) });
    }
    match (&map.coordinates, &queries.coordinates) {
        (Some(a), Some(b)) if a != b => {
            Err(sue::Error::OtherCoordinates { first: a.to_string(), second: b.to_string() })
        }
        _ => Ok(()),
    }
}
