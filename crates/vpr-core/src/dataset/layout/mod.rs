//! One file per on-disk layout, read as the originals are.

pub mod pose_csv;
pub mod utm_names;
pub mod vpr_bench;
