//! The map and the queries that commands look at.

use std::path::{Path, PathBuf};

use anyhow::Context;
use sue::{DistanceKind, EstimatorSettings, Sue, SueParams};
use vpr_core::{
    Descriptors, Error, Poses, Retrieval,
    knn::{self, Metric, RowLengths, RowSource, SearchParams, Selected},
    map::{About, Access, Names, OpenMap, Opening, Origins},
};
use vpr_data::exchange::{self, Format, Parts};

use super::normalization::{Measured, NormalizationArgs, Scale, unit_distance};

/// Map and queries, and what the estimators are told.
#[derive(clap::Args)]
pub(crate) struct InputArgs {
    /// Descriptors of the references: a map (file or growing folder), or any file `bench map` reads
    #[arg(long, value_name = "PATH")]
    map: PathBuf,
    /// Poses of the references, if the map has none
    #[arg(long, value_name = "PATH")]
    map_poses: Option<PathBuf>,
    /// Descriptors of the queries
    #[arg(long, value_name = "PATH")]
    queries: PathBuf,
    #[command(flatten)]
    normalization: NormalizationArgs,
    /// Number of best references that spatial estimators look at
    #[arg(short, long, default_value_t = 10, value_name = "K")]
    k: usize,
    /// Decay of the weights with distance
    #[arg(long, default_value_t = 350.0, value_name = "L", allow_hyphen_values = true)]
    lambda: f64,
    /// Which distance decays
    #[arg(long, value_enum, default_value_t = Decay::Squared)]
    distance: Decay,
    /// Differences of coordinates count at most this much, in metres
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    clip: Option<f64>,
    /// Which neighbour in space measures the density of the map
    #[arg(long, default_value_t = 1, value_name = "N")]
    nth: usize,
    /// How many references are ranked, for estimators that look at similarities
    #[arg(long, default_value_t = 50, value_name = "N")]
    ranks: usize,
    /// Leave out references that were regressed (`copr densify`): only images are trusted
    #[arg(long)]
    measured: bool,
    /// Queries at a time
    #[arg(long, default_value_t = 1024, value_name = "N")]
    batch_size: usize,
}

/// Which distance decays.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Decay {
    /// Plain Euclidean distance, as thesis eq. 5.3
    Euclidean,
    /// Squared distance, as the released data
    Squared,
}

/// Opened and checked against each other.
pub(crate) struct Input {
    references: Rows,
    queries: Rows,
    /// Poses of the references.
    pub(crate) poses: Option<Poses>,
    /// Names of the references.
    pub(crate) names: Option<Names>,
    /// Names of the queries.
    pub(crate) query_names: Option<Names>,
    /// Poses of the queries, if they came with them.
    pub(crate) query_poses: Option<Poses>,
    /// What the map says about itself.
    pub(crate) about: About,
    /// What the estimators are told.
    pub(crate) settings: EstimatorSettings,
    /// How descriptors are compared.
    pub(crate) scale: Scale,
    ranks: usize,
    batch_size: usize,
}

/// Descriptors that stay on the disk, or are in memory.
enum Rows {
    Open(OpenMap),
    /// Those of a map in which images were taken.
    Measured(OpenMap, Vec<usize>),
    Memory(Descriptors),
}

impl Rows {
    /// All rows that are looked at, as one source.
    fn with<T>(
        &self,
        look: impl FnOnce(&dyn RowSource) -> vpr_core::Result<T>,
    ) -> vpr_core::Result<T> {
        match self {
            Self::Open(map) => look(map),
            Self::Measured(map, rows) => look(&Selected::new(map, rows.clone())?),
            Self::Memory(rows) => look(rows),
        }
    }

    fn len(&self) -> usize {
        match self {
            Self::Open(map) => map.len(),
            Self::Measured(_, rows) => rows.len(),
            Self::Memory(rows) => rows.len(),
        }
    }

    /// As the map says, or measured.
    fn lengths(&self) -> vpr_core::Result<Option<RowLengths>> {
        if let Self::Open(map) = self
            && let Some(said) = map.row_lengths()?
        {
            return Ok(Some(said));
        }
        self.with(|source| RowLengths::of(source))
    }
}

/// One side as its file has it.
struct Side {
    rows: Rows,
    names: Option<Names>,
    poses: Option<Poses>,
    about: About,
}

impl Side {
    /// `measured` leaves regressed rows out.
    fn open(path: &Path, measured: bool) -> anyhow::Result<Self> {
        let format = Format::guess(path)?;
        if format == Format::Map {
            let map = OpenMap::open(path, Opening { access: Access::Read, trust: false })?;
            let (names, poses, about) = (map.names()?, map.poses()?, map.about().clone());
            let origins = map.origins()?.filter(|_| measured);
            if let Some(rows) = origins.as_ref().map(Origins::measured_rows) {
                let names =
                    names.map(|names| rows.iter().filter_map(|&row| names.get(row)).collect());
                let poses = poses.map(|poses| poses.select(&rows));
                return Ok(Self { rows: Rows::Measured(map, rows), names, poses, about });
            }
            return Ok(Self { rows: Rows::Open(map), names, poses, about });
        }
        let Parts { names, descriptors, poses, about, .. } = exchange::read(format, path)?;
        let none = || Error::Empty("descriptors").in_file(path);
        let rows = Rows::Memory(descriptors.ok_or_else(none)?);
        Ok(Self { rows, names, poses, about })
    }
}

impl InputArgs {
    /// Opens both sides.
    pub(crate) fn open(&self) -> anyhow::Result<Input> {
        let references = Side::open(&self.map, self.measured)?;
        let queries = Side::open(&self.queries, false)?;
        check(&references.about, &queries.about)?;
        let mut about = references.about;
        let mut poses = references.poses;
        if let Some(path) = &self.map_poses {
            let (joined, coordinates) =
                poses_of(path, references.names.as_ref(), references.rows.len())?;
            poses = Some(joined);
            about.coordinates = about.coordinates.or(coordinates);
        }
        if queries.rows.len() == 0 {
            return Err(Error::Empty("queries").in_file(&self.queries).into());
        }
        if self.batch_size == 0 {
            let (name, value) = ("batch-size", "0".to_owned());
            return Err(Error::Parameter { name, value, reason: "must be at least 1" }.into());
        }
        let distance = match self.distance {
            Decay::Euclidean => DistanceKind::Euclidean,
            Decay::Squared => DistanceKind::Squared,
        };
        let base = *Sue::corrected().params();
        let sue = SueParams { k: self.k, lambda: self.lambda, distance, clip_m: self.clip, ..base };
        Sue::new(sue)?;
        let dim = |rows: &Rows| rows.with(|source| Ok(source.dim()));
        let (expected, actual) = (dim(&references.rows)?, dim(&queries.rows)?);
        if expected != actual {
            let what = "dimension of the query descriptors";
            return Err(Error::Mismatch { what, expected, actual }.in_file(&self.queries).into());
        }
        let sides = [
            Measured { path: &self.map, lengths: references.rows.lengths()? },
            Measured { path: &self.queries, lengths: queries.rows.lengths()? },
        ];
        let scale = self.normalization.decide(about.metric.unwrap_or_default(), &sides)?;
        Ok(Input {
            references: references.rows,
            queries: queries.rows,
            poses,
            names: references.names,
            query_names: queries.names,
            query_poses: queries.poses,
            about,
            settings: EstimatorSettings { sue, nth: self.nth },
            scale,
            ranks: self.ranks.max(self.k).max(2),
            batch_size: self.batch_size,
        })
    }
}

impl Input {
    /// Number of queries.
    pub(crate) fn n_queries(&self) -> usize {
        self.queries.len()
    }

    /// Number of references.
    pub(crate) fn n_references(&self) -> usize {
        self.references.len()
    }

    /// Retrieves batch by batch and hands on the number of the first query with what was found.
    pub(crate) fn each_batch(
        &self,
        mut then: impl FnMut(usize, &Retrieval) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let is_scaled = self.scale == Scale::ToUnit;
        let metric = if is_scaled { Metric::Cosine } else { Metric::Euclidean };
        let params = SearchParams { metric, k: self.ranks, ..SearchParams::default() };
        for start in (0..self.n_queries()).step_by(self.batch_size) {
            let end = (start + self.batch_size).min(self.n_queries());
            let (dim, block) = self.queries.with(|source| {
                let mut scratch = Vec::new();
                Ok((source.dim(), source.block(start..end, &mut scratch)?.to_vec()))
            })?;
            let rows = ndarray::Array2::from_shape_vec((end - start, dim), block)?;
            let batch = Descriptors::new(rows)
                .with_context(|| format!("queries {start} to {}", end - 1))?;
            let found = self.references.with(|source| knn::search(source, &batch, &params))?;
            let found = if is_scaled { unit(&found)? } else { found };
            then(start, &found)?;
        }
        Ok(())
    }

    /// The retrieval of all queries at once.
    pub(crate) fn retrieve(&self) -> anyhow::Result<Retrieval> {
        let (mut indices, mut distances, mut k) = (Vec::new(), Vec::new(), 0);
        self.each_batch(|_, found| {
            k = found.k();
            for query in 0..found.len() {
                indices.extend(found.indices(query));
                distances.extend(found.distances(query));
            }
            Ok(())
        })?;
        let shape = (self.n_queries(), k);
        let indices = ndarray::Array2::from_shape_vec(shape, indices)?;
        Ok(Retrieval::new(indices, ndarray::Array2::from_shape_vec(shape, distances)?)?)
    }
}

/// The same references at the distances of unit descriptors.
fn unit(by_cosine: &Retrieval) -> vpr_core::Result<Retrieval> {
    let shape = (by_cosine.len(), by_cosine.k());
    let indices = ndarray::Array2::from_shape_fn(shape, |it| by_cosine.indices(it.0)[it.1]);
    let distance = |it: (usize, usize)| unit_distance(by_cosine.distances(it.0)[it.1]);
    Retrieval::new(indices, ndarray::Array2::from_shape_fn(shape, distance))
}

/// The name of an image, or its number.
pub(crate) fn name_of(names: Option<&Names>, index: usize) -> String {
    let name = names.and_then(|names| names.get(index));
    name.map_or_else(|| index.to_string(), str::to_owned)
}

/// Poses from a file: by name if both have names, by order otherwise.
pub(crate) fn poses_of(
    path: &Path,
    names: Option<&Names>,
    n: usize,
) -> anyhow::Result<(Poses, Option<vpr_core::map::Coordinates>)> {
    let read = exchange::read(Format::guess(path)?, path)?;
    let coordinates = read.about.coordinates;
    let parts = Parts { names: names.cloned(), ..Parts::default() };
    let joined = parts.join(read).map_err(|err| err.in_file(path))?;
    let poses = joined.poses.ok_or_else(|| Error::Empty("poses").in_file(path))?;
    if poses.len() != n {
        let what = "poses, one per descriptor";
        let err = Error::Mismatch { what, expected: n, actual: poses.len() };
        return Err(err.in_file(path).into());
    }
    Ok((poses, coordinates))
}

/// Refuses descriptors of different encoders and coordinates of different grids.
fn check(map: &About, queries: &About) -> sue::Result<()> {
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
