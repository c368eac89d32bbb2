//! What is being read, for whom, and what comes out of it.

use std::path::Path;

use vpr_core::{Error, Result};

use super::{Reading, content::Said, side::Sides};

/// A list per query as files have them: `[-1]` for a new place.
pub(super) type Lists = Vec<Vec<i64>>;

/// What is being read, for whom.
#[derive(Clone, Copy)]
pub(super) struct Task<'a> {
    pub(super) path: &'a Path,
    pub(super) reading: &'a Reading,
    pub(super) sides: &'a Sides,
}

impl Task<'_> {
    pub(super) fn err(&self, place: impl Into<String>, reason: impl Into<String>) -> Error {
        Error::format(self.path, place, reason)
    }

    pub(super) fn n_queries(&self) -> usize {
        self.sides.queries.len
    }

    pub(super) fn n_references(&self) -> usize {
        self.sides.references.len
    }

    /// Too few or too many rows, one per query being expected.
    pub(super) fn check_rows(&self, said: &Said, n_rows: usize) -> Result<()> {
        let n_queries = self.n_queries();
        if n_rows == n_queries {
            return Ok(());
        }
        let place = said.array.as_ref().map(|array| format!("array `{array}`, "));
        let place = place.unwrap_or_default() + "number of rows";
        Err(self.err(place, format!("{n_rows}, but there are {n_queries} queries")))
    }
}

/// Says how many queries no row is about.
pub(super) fn note_unnamed<T>(task: Task<'_>, lists: &[Option<T>], notes: &mut Vec<String>) {
    let n_unnamed = lists.iter().filter(|list| list.is_none()).count();
    if n_unnamed > 0 {
        let n = task.n_queries();
        notes.push(format!("{n_unnamed} of {n} queries are in no pair: taken for new places"));
    }
}
