//! One file per on-disk layout, read as the originals are.

pub mod folder;
pub mod npz_images;
pub mod numbered;
pub mod pose_csv;
pub mod seven_scenes;
pub mod utm_names;
pub mod vpr_bench;
