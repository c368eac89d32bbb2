//! Doors: other programs' files in and out of the map, one file per format.
//!
//! Every format reads into [`Parts`] (what a file knows of images: names, descriptors, poses) or
//! [`Pairs`] (references in order, per query) and is written from them; converting is reading with
//! one and writing with the other. Readers collect every problem of a file, see [`problems`].

mod colmap;
mod convention;
mod format;
mod guess;
#[cfg_attr(not(feature = "hdf5"), path = "no_hdf5.rs")]
mod hdf5;
mod held;
mod hloc_pairs;
mod hloc_poses;
mod join;
mod kapture;
mod kitti;
mod lat_lon;
mod methods_evaluation;
mod npy;
mod npz;
mod page;
mod parts;
mod pose_csv;
mod reading;
mod report;
mod rounded;
mod safetensors;
mod seven_scenes;
mod table;
mod tum;
mod utm_names;

pub use convention::{Direction, PoseConvention, QuaternionOrder};
pub use format::{
    Format, Kind, left_out, problems, read, read_pairs, read_with, write, write_pairs,
};
pub use join::{Side, comparable};
pub use page::{Entry, Example, entries, page};
pub use parts::{PairList, Pairs, Parts};
pub use reading::{Beside, Reading};
pub use table::csv_field;
