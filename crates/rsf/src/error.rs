//! What can be wrong with the input of this crate.

/// The result of every fallible function here.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Wrong input: a map that cannot be learned from, a file, a parameter.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Wrong descriptors, poses, files or parameters.
    #[error(transparent)]
    Core(#[from] vpr_core::Error),
    /// Weights or networks.
    #[cfg(feature = "networks")]
    #[error(transparent)]
    Nets(#[from] vpr_nets::Error),
    /// No reference is far enough from any other to be a negative.
    #[error(
        "{n} references, none of them {beyond_m} m or more from another: there is nothing to tell \
         apart; a smaller `negative_m` or a larger map helps"
    )]
    OnePlace {
        /// How many references there are.
        n: usize,
        /// The distance that a negative must have, in metres.
        beyond_m: f64,
    },
    /// Too few references to learn from.
    #[error("{n} references: at least {needed} are needed {purpose}")]
    TooFew {
        /// How many there are.
        n: usize,
        /// How many are needed.
        needed: usize,
        /// What for.
        purpose: &'static str,
    },
    /// A part of the network that is to stay as it is does not exist.
    #[error("no part of the network is called `{name}`; its parts: {known}")]
    NoSuchPart {
        /// The name.
        name: String,
        /// The names there are.
        known: String,
    },
}
