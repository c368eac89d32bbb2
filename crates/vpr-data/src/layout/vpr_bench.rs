//! VPR-Bench's own files: ground truths, stored matches, invariance curves, image folders.

mod images;
mod invariance;
mod matches;

pub use crate::truth::GroundTruthFile;
pub use images::image_folder;
pub(crate) use images::{image_number, is_image};
pub use invariance::{read_areas, read_curves};
pub use matches::PublishedMatches;
