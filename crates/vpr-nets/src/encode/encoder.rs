//! What every encoder says about itself.

use burn::tensor::{Device, Tensor};

use super::{Preprocessing, registry::Matching};

/// A network that gives one global descriptor per image.
pub trait Encoder: Send + Sync {
    /// The name that `--method` takes.
    fn name(&self) -> &str;

    /// Length of a descriptor.
    fn dimension(&self) -> usize;

    /// How images become its input.
    fn preprocessing(&self) -> &Preprocessing;

    /// Descriptors, `n × dimension`, of images, `n × channels × height × width`, preprocessed.
    fn forward(&self, images: Tensor<4>) -> Tensor<2>;

    /// Whether images of this size can be encoded.
    ///
    /// # Errors
    ///
    /// What the network needs, in words.
    fn accepts(&self, _height: usize, _width: usize) -> Result<(), String> {
        Ok(())
    }

    /// Whether a descriptor depends on the other images of its batch, as `CricaVPR`'s does.
    fn batch_dependent(&self) -> bool {
        false
    }

    /// How its descriptors are compared.
    fn matching(&self) -> Matching {
        Matching::Euclidean
    }

    /// Digest of its weights' file, `sha256:…`; `None` if there was none.
    fn weights_digest(&self) -> Option<&str> {
        None
    }

    /// What the keys of its weights began with more than those of the network; `None` if nothing.
    fn weights_prefix(&self) -> Option<&str> {
        None
    }

    /// Where it computes.
    fn device(&self) -> Device {
        Device::flex()
    }
}
