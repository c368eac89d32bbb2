//! Parts of a network by name.

use burn::store::ModuleSnapshot;

use crate::{Error, Result};

/// Names of all parameters, as burn and files of weights have them but for the norms' `gamma` and
/// `beta`.
fn names<M: ModuleSnapshot>(network: &M) -> Vec<String> {
    network.collect(None, None, false).into_iter().map(|it| it.name.clone()).collect()
}

fn is_in(parameter: &str, part: &str) -> bool {
    parameter.strip_prefix(part).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
}

/// The parameters of these parts.
pub(super) fn parameters<M: ModuleSnapshot>(network: &M, parts: &[String]) -> Vec<String> {
    let mut names = names(network);
    names.retain(|name| parts.iter().any(|part| is_in(name, part)));
    names
}

/// Whether every part exists.
pub(super) fn check<M: ModuleSnapshot>(network: &M, parts: &[String]) -> Result<()> {
    let names = names(network);
    match parts.iter().find(|part| !names.iter().any(|name| is_in(name, part))) {
        None => Ok(()),
        Some(part) => Err(Error::NoSuchPart { name: part.clone(), known: names.join(", ") }),
    }
}
