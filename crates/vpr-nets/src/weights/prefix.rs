//! Checkpoints whose keys all begin with a part that the network's do not have.

use super::Weights;
use crate::{Error, Result};

/// What was built, and how.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fitted<T> {
    /// What was built of the weights.
    pub value: T,
    /// What all keys began with and was left out, such as `model.`; `None` if they fitted as they
    /// are.
    pub prefix: Option<String>,
}

/// Builds something of the weights that `open` reads; where their keys do not fit, without the one
/// prefix of all keys that makes them fit, such as `model.`, `encoder.backbone.`, `state_dict.`.
///
/// # Errors
///
/// Those of `open` and `build`; if no prefix helps, the [`Error::Weights`] with the fewest keys in
/// it, and if two do, [`vpr_core::Error::Format`] with both.
pub fn fit<T>(
    open: impl Fn() -> Result<Weights>,
    mut build: impl FnMut(Weights) -> Result<T>,
) -> Result<Fitted<T>> {
    let mut problem = match build(open()?) {
        Ok(value) => return Ok(Fitted { value, prefix: None }),
        Err(err @ Error::Weights { .. }) => err,
        Err(err) => return Err(err),
    };
    let mut found: Option<Fitted<T>> = None;
    for prefix in shared_prefixes(&open()?) {
        let weights = open()?;
        let path = weights.path().to_owned();
        let shorter = weights
            .mapped(|key, tensor| key.strip_prefix(&prefix).map(|rest| (rest.to_owned(), tensor)));
        match (build(shorter), &found) {
            (Ok(_), Some(Fitted { prefix: Some(other), .. })) => {
                let reason = format!("fit without `{other}` and without `{prefix}`");
                return Err(Error::format(path, "keys", reason));
            }
            (Ok(value), _) => found = Some(Fitted { value, prefix: Some(prefix) }),
            (Err(err @ Error::Weights { .. }), _) if n_keys(&err) < n_keys(&problem) => {
                problem = err;
            }
            (Err(Error::Weights { .. }), _) => {}
            (Err(err), _) => return Err(err),
        }
    }
    found.ok_or(problem)
}

/// Parts that all keys begin with, up to a dot, the shortest first.
fn shared_prefixes(weights: &Weights) -> Vec<String> {
    let mut keys = weights.iter().map(|(key, _)| key);
    let Some(first) = keys.next() else { return Vec::new() };
    let shared = keys.fold(first, |shared, key| {
        let same = shared.bytes().zip(key.bytes()).take_while(|(a, b)| a == b).count();
        // Keys are the same up to here, so this is a boundary of a letter in both or in neither.
        shared.get(..same).unwrap_or_default()
    });
    shared.match_indices('.').map(|(at, _)| shared[..=at].to_owned()).collect()
}

/// How many keys an error lists.
fn n_keys(err: &Error) -> usize {
    match err {
        Error::Weights { mismatch, .. } => {
            mismatch.missing.len() + mismatch.unexpected.len() + mismatch.shapes.len()
        }
        _ => usize::MAX,
    }
}
