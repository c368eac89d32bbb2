//! The map and the queries that commands look at.

use std::path::{Path, PathBuf};

use anyhow::Context;
use sue::{DistanceKind, EstimatorChoice, EstimatorSettings, Share, Sue, SueParams};
use vpr_core::{
    Descriptors, Error, Poses, Retrieval,
    knn::{self, Metric, SearchParams},
    map::{About, Names},
};
use vpr_data::exchange::{self, Beside, Parts};
use vpr_report::cli;
use vpr_study::reading::ReadingArgs;

use super::{
    normalization::{Measured, NormalizationArgs, Scale, unit_distance},
    scores::{Scores, ScoresArgs},
    side::{Rows, Side, check, joined},
    threshold,
};

/// Map and queries, and what the estimators are told.
#[derive(clap::Args)]
pub(crate) struct InputArgs {
    /// Descriptors of the references: a map (file or growing folder), or any format of
    /// docs/formats.md
    #[arg(
        long,
        value_name = "PATH",
        required_unless_present_any = ["distances", "similarities"]
    )]
    map: Option<PathBuf>,
    /// Poses of the references, instead of those that the map has
    #[arg(long, aliases = ["poses", "map_poses"], value_name = "PATH")]
    map_poses: Option<PathBuf>,
    /// Descriptors of the queries
    #[arg(
        long,
        value_name = "PATH",
        required_unless_present_any = ["distances", "similarities"]
    )]
    queries: Option<PathBuf>,
    #[command(flatten)]
    normalization: NormalizationArgs,
    #[command(flatten)]
    scores: ScoresArgs,
    #[command(flatten)]
    reading: ReadingArgs,
    /// Number of best references that spatial estimators look at
    #[arg(short, long, default_value_t = 10, value_name = "K", value_parser = cli::at_least_one)]
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
    #[arg(long, default_value_t = 1024, value_name = "N", value_parser = cli::at_least_one)]
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
    /// Scores of all pairs, which stand in for the rows.
    scores: Option<Scores>,
    /// Poses of the references.
    pub(crate) poses: Option<Poses>,
    /// Names of the references.
    pub(crate) names: Option<Names>,
    /// Names of the queries.
    pub(crate) query_names: Option<Names>,
    /// Poses of the queries, if they came with them.
    query_poses: Option<Poses>,
    /// What the map says about itself.
    pub(crate) about: About,
    query_about: About,
    /// Where the poses of queries and references are from.
    places: [PathBuf; 2],
    reading: ReadingArgs,
    /// What the estimators are told.
    pub(crate) settings: EstimatorSettings,
    /// How descriptors are compared.
    pub(crate) scale: Scale,
    ranks: usize,
    batch_size: usize,
}

impl InputArgs {
    /// Opens both sides, for these estimators.
    pub(crate) fn open(&self, estimators: &[EstimatorChoice]) -> anyhow::Result<Input> {
        let scores = self.scores.open()?;
        let (references, queries, scale) = match &scores {
            Some(scores) => self.of_scores(scores)?,
            None => self.sides(estimators)?,
        };
        let [map, query_file] = [&self.map, &self.queries].map(|it| it.clone().unwrap_or_default());
        let distance = match self.distance {
            Decay::Euclidean => DistanceKind::Euclidean,
            Decay::Squared => DistanceKind::Squared,
        };
        let base = *Sue::corrected().params();
        let sue = SueParams { k: self.k, lambda: self.lambda, distance, clip_m: self.clip, ..base };
        Sue::new(sue)?;
        Ok(Input {
            references: references.rows,
            queries: queries.rows,
            scores,
            poses: references.poses,
            names: references.names,
            query_names: queries.names,
            query_poses: queries.poses,
            about: references.about,
            query_about: queries.about,
            places: [query_file, self.map_poses.clone().unwrap_or(map)],
            reading: self.reading,
            settings: EstimatorSettings { sue, nth: self.nth },
            scale,
            ranks: self.ranks.max(self.k).max(2),
            batch_size: self.batch_size,
        })
    }
}

impl InputArgs {
    /// Descriptors of both sides, checked against each other.
    fn sides(&self, estimators: &[EstimatorChoice]) -> anyhow::Result<(Side, Side, Scale)> {
        let (Some(map), Some(queries)) = (&self.map, &self.queries) else {
            anyhow::bail!("give --map and --queries, --distances or --similarities");
        };
        let (poses, reading) = (self.map_poses.as_deref(), self.reading);
        let references = Side::open(map, poses, reading, Beside::Used, self.measured)?;
        // Poses of the queries may come from elsewhere, or not be needed.
        let opened = Side::open(queries, None, reading, Beside::IfSound, false)?;
        check(&references.about, &opened.about)?;
        if opened.rows.len() == 0 {
            return Err(Error::Empty("queries").in_file(queries).into());
        }
        let (expected, actual) = (references.rows.dim()?, opened.rows.dim()?);
        if expected != actual {
            let what = "dimension of the query descriptors";
            return Err(Error::Mismatch { what, expected, actual }.in_file(queries).into());
        }
        let metric = references.about.metric.unwrap_or_default();
        let measured = [
            Measured { path: map, lengths: references.rows.lengths()? },
            Measured { path: queries, lengths: opened.rows.lengths()? },
        ];
        let needs_length_1 = estimators.iter().any(|it| it.depends_on_length());
        let scale = self.normalization.decide(metric, &measured, needs_length_1)?;
        Ok((references, opened, scale))
    }

    /// Both sides of a matrix: rows that are only counted, and what a file of poses knows of the
    /// references.
    fn of_scores(&self, scores: &Scores) -> anyhow::Result<(Side, Side, Scale)> {
        let side = |n: usize, parts: Parts| {
            let rows = Rows::Memory(Descriptors::new(ndarray::Array2::zeros((n, 1)))?);
            anyhow::Ok(Side { rows, names: parts.names, poses: parts.poses, about: parts.about })
        };
        let n = scores.n_references();
        let known = match &self.map_poses {
            Some(file) => joined(Parts::default(), file, n, self.reading)?,
            None => Parts::default(),
        };
        let (references, queries) = (side(n, known)?, side(scores.n_queries(), Parts::default())?);
        Ok((references, queries, scores.length()))
    }
}

impl Input {
    /// Refuses estimators that look at positions where the references have none.
    pub(crate) fn check_poses(&self, estimators: &[EstimatorChoice]) -> anyhow::Result<()> {
        let is_spatial = |it: &&EstimatorChoice| it.needs().poses != Share::None;
        match estimators.iter().find(is_spatial) {
            Some(&estimator) if self.poses.is_none() => anyhow::bail!(
                "`{}` needs positions of the references: give --map-poses, or an --estimator without \
                 positions, such as l2",
                threshold::name(estimator)
            ),
            _ => Ok(()),
        }
    }

    /// Poses of the queries: those of a file, or else those that came with their descriptors;
    /// checked against those of the references, so that distances mean something.
    pub(crate) fn query_poses(&self, file: Option<&Path>) -> anyhow::Result<Option<Poses>> {
        let given = file.map(|file| {
            let parts = Parts { names: self.query_names.clone(), ..Parts::default() };
            joined(parts, file, self.n_queries(), self.reading)
        });
        let (poses, coordinates) = match given.transpose()? {
            Some(joined) => (joined.poses, joined.about.coordinates),
            None => (self.query_poses.clone(), self.query_about.coordinates),
        };
        if let (Some(queries), Some(references)) = (&poses, &self.poses) {
            let place = file.unwrap_or(&self.places[0]);
            let queries = exchange::Side { place, poses: queries, coordinates };
            let (place, coordinates) = (self.places[1].as_path(), self.about.coordinates);
            let references = exchange::Side { place, poses: references, coordinates };
            if let Some(note) = exchange::comparable(queries, references)? {
                cli::note(&format!("note: {note}"));
            }
        }
        Ok(poses)
    }

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
        if let Some(scores) = &self.scores {
            for start in (0..scores.n_queries()).step_by(self.batch_size) {
                let end = (start + self.batch_size).min(scores.n_queries());
                then(start, &scores.retrieve(start, end, self.ranks)?)?;
            }
            return Ok(());
        }
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
