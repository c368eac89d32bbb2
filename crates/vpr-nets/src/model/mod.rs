//! Networks of our own.

pub mod default;
