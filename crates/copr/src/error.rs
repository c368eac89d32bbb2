//! What can be wrong with the input of this crate.

/// The result of every fallible function here.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// Wrong input. A regressed descriptor is never NaN: where a method has no value for a target, one
/// of these says which target and why. Targets are counted from 0, in the order they are given.
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
    /// A method needs more anchors than a target can have.
    #[error("target {target}: {method} needs {needed} anchors, {found} can be had")]
    TooFewAnchors {
        /// The target.
        target: usize,
        /// The method.
        method: &'static str,
        /// How many it needs.
        needed: usize,
        /// How many there are.
        found: usize,
    },
    /// The released plane fit has no inverse.
    #[error(
        "target {target}: the anchors lie in one plane, so that XᵀX has no inverse; the released \
         code stops here, the corrected definition has a value"
    )]
    Singular {
        /// The target.
        target: usize,
    },
    /// A plane through anchors says nothing about where the target is.
    #[error(
        "target {target}: its anchors span {rank} of 3 directions and it lies {outside_m} m outside \
         of them; `flat` takes the nearest point that they span"
    )]
    Undetermined {
        /// The target.
        target: usize,
        /// Directions in which the anchors differ.
        rank: usize,
        /// Distance of the target from what they span, in metres.
        outside_m: f64,
    },
    /// A regressed value is too large for f32 or no number.
    #[error("target {target}: value {column} of its descriptor is {value}")]
    NotFinite {
        /// The target.
        target: usize,
        /// Which value of the descriptor.
        column: usize,
        /// The value.
        value: f64,
    },
    /// More targets than anybody means.
    #[error("{n} targets: more than {most}; a coarser grid, a smaller span or fewer anchors help")]
    TooMany {
        /// How many there would be.
        n: u128,
        /// How many are allowed.
        most: usize,
    },
}
