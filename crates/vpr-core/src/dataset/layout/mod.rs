//! One file per on-disk layout, read as the originals are.

pub mod vpr_bench;
