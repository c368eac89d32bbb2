//! A ground truth as lists: what its file says, before it is known how many references there are.

use std::path::{Path, PathBuf};

use vpr_core::{Error, GroundTruth, Result};
use vpr_files::npy;

use super::{
    Reading,
    content::Item,
    side::{Side, Sides},
    value,
};

/// The correct references of every query, as a file has them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GroundTruthFile {
    /// Where it was read from.
    pub path: PathBuf,
    /// The correct references of every query; `[-1]` for a query at a new place. References that do
    /// not exist are kept as they are.
    pub lists: Vec<Vec<i64>>,
}

impl GroundTruthFile {
    /// Reads VPR-Bench's `ground_truth_new.npy`, an object array of `[query, list of references]`;
    /// rows may be in any order, and every query has exactly one. Other forms need to know how many
    /// images there are: [`super::read_lists`].
    ///
    /// # Errors
    ///
    /// [`Error::Io`], or [`Error::Format`] with the row (or byte) and what is wrong there.
    pub fn read(path: &Path) -> Result<Self> {
        let (shape, values) = npy::read_objects(path)?;
        if shape.len() != 2 || shape[1] != 2 {
            let reason = format!("expected rows of query and references, got shape {shape:?}");
            return Err(Error::format(path, "shape", reason));
        }
        let mut lists: Vec<Option<Vec<i64>>> = vec![None; shape[0]];
        for (row, pair) in values.chunks_exact(2).enumerate() {
            let err = |reason: String| Error::format(path, format!("row {row}"), reason);
            let (query, references) = value::row_of_vpr_bench(pair).map_err(err)?;
            let slot = lists
                .get_mut(query)
                .ok_or_else(|| err(format!("query {query}: there are only {} rows", shape[0])))?;
            let indices = references.into_iter().map(|item| match item {
                Item::Index(index) => Ok(index),
                Item::Name(_) => Err(err("the references are names, not indices".to_owned())),
            });
            if slot.replace(indices.collect::<Result<_>>()?).is_some() {
                return Err(err(format!("query {query} has a row already")));
            }
        }
        // As many rows as queries and none twice: every query has one.
        Ok(Self { path: path.to_owned(), lists: lists.into_iter().flatten().collect() })
    }

    /// Reads the truth that lies in the folder of a dataset: VPR-Bench's form, whatever number of
    /// queries it is about, or any other that [`super::read_lists`] takes for these numbers; and what
    /// a person should know of how it was read.
    ///
    /// # Errors
    ///
    /// Those of [`Self::read`] and of [`super::read_lists`].
    pub fn read_for(
        path: &Path,
        n_queries: usize,
        n_references: usize,
    ) -> Result<(Self, Vec<String>)> {
        if let Ok(file) = Self::read(path) {
            return Ok((file, Vec::new()));
        }
        let [queries, references] = [n_queries, n_references].map(Side::numbered);
        super::read_lists(path, &Reading::default(), &Sides { queries, references })
    }

    /// The same, if it is about so many queries.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] with both numbers.
    pub fn about(self, n_queries: usize) -> Result<Self> {
        if self.len() == n_queries {
            return Ok(self);
        }
        let reason = format!("{}, but there are {n_queries} queries", self.len());
        Err(Error::format(self.path, "number of rows", reason))
    }

    /// Number of queries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lists.len()
    }

    /// Whether there is no query.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lists.is_empty()
    }

    /// The truth for a map of `n_references`, and how many list entries pointed past it.
    ///
    /// Those are dropped, as [`GroundTruth::clamped`] says; a list of nothing but `-1` is a new
    /// place.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] with the query if a negative index is not the only one of its list.
    pub fn truth(&self, n_references: usize) -> Result<(GroundTruth, usize)> {
        let list = |(query, list): (usize, &Vec<i64>)| {
            if list.as_slice() == [-1] {
                return Ok(Vec::new());
            }
            let index = |&index: &i64| {
                usize::try_from(index).map_err(|_| {
                    let reason = format!("{index} is not a reference; a new place is [-1]");
                    Error::format(&self.path, format!("query {query}"), reason)
                })
            };
            list.iter().map(index).collect()
        };
        let lists = self.lists.iter().enumerate().map(list).collect::<Result<_>>()?;
        Ok(GroundTruth::clamped(lists, n_references))
    }
}
