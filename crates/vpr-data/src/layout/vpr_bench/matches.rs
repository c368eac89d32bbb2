//! `precomputed_data_corrected.npy`: what a technique retrieved on a dataset, with all scores.

use std::path::Path;

use ndarray::Array2;

use vpr_core::{Error, Result, Similarities};
use vpr_files::{
    npy,
    pickle::{Elements, Value},
};

/// The stored matches of one technique on one dataset.
#[derive(Clone, Debug, PartialEq)]
pub struct PublishedMatches {
    /// Indices of the queries, as many as there are rows of scores.
    pub query: Vec<usize>,
    /// The reference that the technique retrieved for each.
    pub reference: Vec<usize>,
    /// The score of that reference; higher is more certain.
    pub score: Vec<f64>,
    /// All scores, `n_queries × n_references`.
    pub similarities: Similarities,
    /// Time to encode one image, in seconds, as the authors measured it.
    pub encode_s: f64,
    /// Time to compare one query with one reference, in seconds, as the authors measured it.
    pub match_s: f64,
}

impl PublishedMatches {
    /// Reads the file and checks its parts against each other.
    ///
    /// # Errors
    ///
    /// [`Error::Io`], or [`Error::Format`] that names the part, if counts differ, an index points
    /// past what it refers to, or a score is not finite.
    pub fn read(path: &Path) -> Result<Self> {
        let (shape, values) = npy::read_objects(path)?;
        let [query, reference, score, scores, encode_s, match_s] = values.as_slice() else {
            let reason = format!("expected six parts, got shape {shape:?}");
            return Err(Error::format(path, "shape", reason));
        };
        let query = indices(path, "query indices (part 0)", query)?;
        let reference = indices(path, "retrieved references (part 1)", reference)?;
        let score = numbers(path, "best scores (part 2)", score)?;
        let similarities = matrix(path, scores)?;
        let published = Self {
            query,
            reference,
            score,
            similarities,
            encode_s: seconds(path, "encoding time (part 4)", encode_s)?,
            match_s: seconds(path, "matching time (part 5)", match_s)?,
        };
        published.check(path)?;
        Ok(published)
    }

    /// Counts, ranges and finite values.
    fn check(&self, path: &Path) -> Result<()> {
        let n_queries = self.query.len();
        let counts = [
            ("retrieved references (part 1)", self.reference.len()),
            ("best scores (part 2)", self.score.len()),
            ("rows of scores (part 3)", self.similarities.n_queries()),
        ];
        for (part, count) in counts {
            if count != n_queries {
                let reason = format!("{count}, but there are {n_queries} query indices (part 0)");
                return Err(Error::format(path, part, reason));
            }
        }
        let n_references = self.similarities.n_references();
        if let Some(query) = self.reference.iter().position(|&index| index >= n_references) {
            let reason = format!(
                "query {query} retrieves reference {}, but scores have {n_references} columns",
                self.reference[query]
            );
            return Err(Error::format(path, "retrieved references (part 1)", reason));
        }
        if let Some(query) = self.score.iter().position(|score| !score.is_finite()) {
            let reason = format!("query {query} has {}", self.score[query]);
            return Err(Error::format(path, "best scores (part 2)", reason));
        }
        Ok(())
    }
}

/// A list of indices; some authors stored them as floats.
fn indices(path: &Path, part: &str, value: &Value) -> Result<Vec<usize>> {
    let integers = value.to_i64s().ok_or_else(|| {
        let reason = format!("expected a vector of integers, got {}", value.kind());
        Error::format(path, part, reason)
    })?;
    let index = |(row, &index): (usize, &i64)| {
        usize::try_from(index)
            .map_err(|_| Error::format(path, part, format!("row {row} is {index}, not an index")))
    };
    integers.iter().enumerate().map(index).collect()
}

fn numbers(path: &Path, part: &str, value: &Value) -> Result<Vec<f64>> {
    value.to_f64s().ok_or_else(|| {
        Error::format(path, part, format!("expected a vector of numbers, got {}", value.kind()))
    })
}

fn seconds(path: &Path, part: &str, value: &Value) -> Result<f64> {
    match value.as_f64() {
        Some(seconds) if seconds.is_finite() && seconds >= 0.0 => Ok(seconds),
        Some(seconds) => Err(Error::format(path, part, format!("{seconds} is not a duration"))),
        None => Err(Error::format(path, part, format!("expected seconds, got {}", value.kind()))),
    }
}

/// The score matrix: a two-dimensional array, or one vector per query.
fn matrix(path: &Path, value: &Value) -> Result<Similarities> {
    const PART: &str = "scores (part 3)";
    let err = |reason: String| Error::format(path, PART, reason);
    let (shape, values) = match value {
        Value::Array { shape, elements } if shape.len() == 2 => {
            let values = elements.to_f64s().ok_or_else(|| err("not numbers".into()))?;
            ((shape[0], shape[1]), values)
        }
        Value::List(rows) | Value::Array { elements: Elements::Object(rows), .. } => {
            let rows =
                rows.iter().map(|row| numbers(path, PART, row)).collect::<Result<Vec<_>>>()?;
            let n_columns = rows.first().map_or(0, Vec::len);
            if let Some(row) = rows.iter().position(|row| row.len() != n_columns) {
                let reason =
                    format!("row {row} has {} scores, row 0 has {n_columns}", rows[row].len());
                return Err(err(reason));
            }
            ((rows.len(), n_columns), rows.concat())
        }
        other => return Err(err(format!("expected a matrix, got {}", other.kind()))),
    };
    let values = Array2::from_shape_vec(shape, values).map_err(|cause| err(cause.to_string()))?;
    Similarities::new(values).map_err(|cause| err(cause.to_string()))
}
