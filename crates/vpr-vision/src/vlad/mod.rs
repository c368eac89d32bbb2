//! Descriptors of an image by what its local features add to a vocabulary: DenseVLAD and a VLAD of
//! HOG cells, which need no network.
//!
//! ```
//! use vpr_vision::{image::{ImageSize, RgbImage}, vlad::VladEncoder};
//!
//! let dense_vlad = VladEncoder::dense_vlad();
//! let pixels = (0..160 * 120 * 3).map(|at| ((at * 37) ^ (at / 480 * 91)) as u8).collect();
//! let street = RgbImage::new(ImageSize { width: 160, height: 120 }, pixels).unwrap();
//! let descriptor = dense_vlad.describe(&street)?;
//! assert_eq!(descriptor.len(), dense_vlad.dim());
//! # Ok::<(), vpr_core::Error>(())
//! ```

mod encoder;
mod projection;
mod stored;
mod vocabulary;

pub use self::{
    encoder::{Local, VladEncoder},
    projection::Projection,
    vocabulary::{Vocabulary, VocabularyParams},
};
