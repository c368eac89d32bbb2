//! What is wrong with a truth for the images of two folders.

use std::path::Path;

use vpr_core::Error;

use super::{
    Found, Source,
    side::{Side, Sides},
};
use crate::{Problem, Severity, layout::numbered::images_in_order};

/// Everything that a reader says of it; the images that are there are told apart from their truth.
pub(crate) fn problems(source: &Source, queries: &Path, references: &Path) -> Vec<Problem> {
    let side = |folder: &Path| images_in_order(folder).map(|it| Side::images(folder, &it.images));
    let sides = match (side(queries), side(references)) {
        (Ok(queries), Ok(references)) => Sides { queries, references },
        (queries, references) => {
            return [queries, references]
                .into_iter()
                .filter_map(Result::err)
                .map(problem)
                .collect();
        }
    };
    match source.truth(&sides) {
        Err(err) => vec![problem(err)],
        Ok(Found { truth, notes }) => {
            let n_new = truth.len() - truth.n_known();
            let new = (n_new > 0).then(|| format!("{n_new} queries have no correct reference"));
            let warning = |reason| Problem {
                severity: Severity::Warning,
                path: queries.to_owned(),
                place: "truth".to_owned(),
                reason,
            };
            notes.into_iter().chain(new).map(warning).collect()
        }
    }
}

fn problem(err: Error) -> Problem {
    let (path, place, reason) = match err {
        Error::Format { path, place, reason } => (path, place, reason),
        Error::Io { path, source } => (path, String::new(), source.to_string()),
        other => (Path::new("truth").to_owned(), String::new(), other.to_string()),
    };
    Problem { severity: Severity::Error, path, place, reason }
}
