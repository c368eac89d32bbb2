//! Encoders: from image files to descriptors.
//!
//! An [`Encoder`] is a network with its [`Preprocessing`]; [`encode_files`] and [`encode_images`]
//! run it over images on several threads and give [`vpr_core::Descriptors`], so that what comes
//! after needs no network library.

mod batches;
mod caffe;
mod encoder;
pub mod l1;
mod netvlad_mobile;
mod network;
mod preprocessing;
pub mod registry;
mod run;
mod stamps;
mod to_map;
mod tuning;

pub use batches::{BatchLeak, batch_leak};
pub use encoder::Encoder;
pub use network::{Network, Request, by_name, by_request};
pub use preprocessing::{Channels, Interpolation, Preprocessing, Size};
pub use run::{Encoded, Options, encode_each, encode_files, encode_images};
pub use to_map::{Images, Written, encode_to_map};
pub use tuning::{Start, Task, tune};
