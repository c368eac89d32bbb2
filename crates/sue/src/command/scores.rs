//! A matrix that somebody computed, instead of descriptors: every query with every reference.

use std::path::PathBuf;

use ndarray::Array2;
use vpr_core::{Error, Retrieval, Similarities};
use vpr_data::truth::{Scale, read_scores};

/// How similar or how far every query is to every reference.
#[derive(clap::Args)]
pub(crate) struct ScoresArgs {
    /// Distances, a row per query, instead of descriptors: .npy, an .npz of one array, or text;
    /// positions are those of `--map-poses`
    #[arg(long, value_name = "FILE", conflicts_with_all = ["map", "queries", "similarities"])]
    pub(crate) distances: Option<PathBuf>,
    /// The same as cosine similarities; distances are those of unit descriptors, √(2 − 2s)
    #[arg(long, value_name = "FILE", conflicts_with_all = ["map", "queries"])]
    pub(crate) similarities: Option<PathBuf>,
    /// The rows of the scores are the references
    #[arg(long)]
    scores_transposed: bool,
}

/// How far a cosine may be outside of −1 to 1, or a distance below 0, by rounding.
const ROUNDING: f64 = 1e-5;

/// A matrix as a retrieval is made of it.
pub(crate) struct Scores {
    similarities: Similarities,
    scale: Scale,
}

impl ScoresArgs {
    /// The matrix that the flags name, if any.
    pub(crate) fn open(&self) -> vpr_core::Result<Option<Scores>> {
        let (path, scale) = match (&self.distances, &self.similarities) {
            (Some(path), _) => (path, Scale::Distances),
            (_, Some(path)) => (path, Scale::Similarities),
            (None, None) => return Ok(None),
        };
        let similarities = read_scores(path, scale)?;
        let similarities =
            if self.scores_transposed { similarities.swapped() } else { similarities };
        // Distances are kept as their negatives.
        if scale == Scale::Distances
            && let Some(((row, column), value)) =
                similarities.view().indexed_iter().find(|it| *it.1 > ROUNDING)
        {
            let reason = format!("column {column} is -{value}: a distance is not negative");
            return Err(Error::format(path, format!("row {row}"), reason));
        }
        let is_cosine = |value: &f64| value.abs() <= 1.0 + ROUNDING;
        if scale == Scale::Similarities
            && let Some(((row, column), value)) =
                similarities.view().indexed_iter().find(|it| !is_cosine(it.1))
        {
            let reason = format!(
                "column {column} is {value}, but similarities are taken for cosines, from -1 to 1; \
                 give `--distances`"
            );
            return Err(Error::format(path, format!("row {row}"), reason));
        }
        Ok(Some(Scores { similarities, scale }))
    }
}

impl Scores {
    /// How long the descriptors are that have these distances.
    pub(super) fn length(&self) -> super::normalization::Scale {
        match self.scale {
            Scale::Distances => super::normalization::Scale::Other,
            Scale::Similarities => super::normalization::Scale::Unit,
        }
    }

    /// Number of queries.
    pub(crate) fn n_queries(&self) -> usize {
        self.similarities.n_queries()
    }

    /// Number of references.
    pub(crate) fn n_references(&self) -> usize {
        self.similarities.n_references()
    }

    /// The `k` nearest references of the queries from `start` to `end`.
    pub(crate) fn retrieve(
        &self,
        start: usize,
        end: usize,
        k: usize,
    ) -> vpr_core::Result<Retrieval> {
        let rows = self.similarities.view().slice(ndarray::s![start..end, ..]).to_owned();
        let rows = Similarities::new(rows)?;
        let ranking = rows.ranked(k)?;
        let shape = (ranking.len(), ranking.k());
        let indices = Array2::from_shape_fn(shape, |(query, rank)| ranking.indices(query)[rank]);
        let distances = Array2::from_shape_fn(shape, |(query, rank)| {
            self.distance(rows.view()[(query, indices[(query, rank)])])
        });
        Retrieval::new(indices, distances)
    }

    #[expect(clippy::cast_possible_truncation, reason = "distances are kept in f32")]
    fn distance(&self, similarity: f64) -> f32 {
        match self.scale {
            Scale::Distances => (0.0 - similarity).max(0.0) as f32,
            Scale::Similarities => (2.0 - 2.0 * similarity).max(0.0).sqrt() as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn cosines_are_the_distances_of_unit_descriptors() {
        let of = |scale, values| Scores { similarities: Similarities::new(values).unwrap(), scale };
        let cosines = of(Scale::Similarities, array![[0.5, 1.0, -1.0], [0.0, 0.0, 1.0]]);
        let found = cosines.retrieve(0, 2, 2).unwrap();
        assert_eq!(found.indices(0).to_vec(), [1, 0]);
        assert_eq!(found.distances(0).to_vec(), [0.0, 1.0]);
        assert_eq!(found.distances(1).to_vec(), [0.0, 2.0_f32.sqrt()]);
        let distances = of(Scale::Distances, array![[-3.0, -0.0]]);
        let found = distances.retrieve(0, 1, 9).unwrap();
        assert_eq!(found.indices(0).to_vec(), [1, 0]);
        assert_eq!(found.distances(0).to_vec(), [0.0, 3.0]);
    }
}
