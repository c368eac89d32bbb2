//! What can be wrong with the input of this crate.

/// The result of every fallible function here.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Wrong input. An uncertainty that is returned is never NaN: where a definition has no value for a
/// query, one of these says which query and why.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Wrong descriptors, poses, files or parameters.
    #[error(transparent)]
    Core(#[from] vpr_core::Error),
    /// Weights or networks.
    #[cfg(feature = "study")]
    #[error(transparent)]
    Nets(#[from] vpr_nets::Error),
    /// An estimator needs more neighbours than were retrieved or than there are.
    #[error(
        "{estimator} needs {needed} neighbours per query, but only {available} are ranked: give \
         fewer by `-k`, or a larger map"
    )]
    TooFewNeighbors {
        /// The estimator.
        estimator: &'static str,
        /// How many it needs.
        needed: usize,
        /// How many there are.
        available: usize,
    },
    /// All weights of a query are too small for an f64, so the released formula divides 0 by 0.
    #[error(
        "query {query}: every weight exp(-{lambda:?} d) is 0, since the nearest distance is {nearest:?}: \
         the released formula divides 0 by 0; the corrected definition has a value"
    )]
    Underflow {
        /// The query.
        query: usize,
        /// Decay of the weights.
        lambda: f64,
        /// Its nearest distance, as the weights see it.
        nearest: f64,
    },
    /// All neighbours of a query have no weight, since each shares its position with others.
    #[error(
        "query {query}: each of its {k} neighbours shares its position with at least {nth} other references, \
         so that all weights are 0; count distinct positions instead"
    )]
    NoDensity {
        /// The query.
        query: usize,
        /// Number of neighbours.
        k: usize,
        /// Which neighbour in space measures the density.
        nth: usize,
    },
    /// The poses of the whole map are the same.
    #[error("all {n} references have the same position: their spread says nothing about a match")]
    OnePosition {
        /// Number of references.
        n: usize,
    },
    /// Queries and map were described by different encoders.
    #[error(
        "the map was described by `{map}`, the queries by `{queries}`: their distances mean nothing"
    )]
    OtherEncoder {
        /// Encoder of the map.
        map: String,
        /// Encoder of the queries.
        queries: String,
    },
    /// Coordinates of different grids.
    #[error(
        "positions in {first} and in {second} cannot be compared; `--zone` puts positions in degrees \
         into one zone"
    )]
    OtherCoordinates {
        /// Coordinates of the map.
        first: String,
        /// Coordinates of the queries.
        second: String,
    },
}
