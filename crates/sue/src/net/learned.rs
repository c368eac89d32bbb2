//! Networks with a variance, as encoders.

use std::path::{Path, PathBuf};

use burn::{
    module::Module,
    tensor::{Device, Tensor},
};
use ndarray::{Array2, Axis, Slice};
use serde::{Deserialize, Serialize};
use vpr_core::Descriptors;
use vpr_nets::{
    encode::{Encoder, Options, Preprocessing, encode_files, encode_images, registry::Method},
    model::default::{DefaultEncoder, DefaultEncoderConfig},
    weights,
};
use vpr_vision::image::RgbImage;

use super::{Btl, Stun};
use crate::{Result, Variance};

/// Which learned uncertainty, on the default network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Learned {
    /// The Bayesian triplet loss: one variance per image
    Btl,
    /// Self-teaching uncertainty estimation: a variance per dimension
    Stun,
}

/// Descriptors and how sure the network is of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Embedded {
    /// `n × dimension`, rows of length one.
    pub descriptors: Descriptors,
    /// Their variances, `n × 1` (BTL) or `n × dimension` (STUN), positive.
    pub variances: Array2<f32>,
}

/// A trained network with a variance.
#[derive(Debug)]
pub struct LearnedEncoder {
    learned: Learned,
    network: Network,
    preprocessing: Preprocessing,
    dimension: usize,
    digest: String,
}

#[derive(Debug)]
enum Network {
    Btl(Btl<DefaultEncoder>),
    Stun(Stun<DefaultEncoder>),
}

impl Learned {
    /// All.
    pub const ALL: [Self; 2] = [Self::Btl, Self::Stun];

    /// The one called `name` in experiment files, `btl` or `stun`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|it| it.key() == name)
    }

    /// Its name in experiment files and on the command line.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Btl => "btl",
            Self::Stun => "stun",
        }
    }

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Btl => "BTL",
            Self::Stun => "STUN",
        }
    }

    /// The estimator that reads its variances.
    #[must_use]
    pub fn estimator(self) -> Variance {
        match self {
            Self::Btl => Variance::BTL,
            Self::Stun => Variance::STUN,
        }
    }

    /// Where its weights lie in a data folder.
    #[must_use]
    pub fn weights(self) -> PathBuf {
        Path::new("models").join(format!("{}-default.safetensors", self.key()))
    }
}

impl LearnedEncoder {
    /// Reads weights as [`vpr_nets::weights::save`] writes them.
    ///
    /// # Errors
    ///
    /// [`vpr_nets::Error::Weights`] with the file and its keys that are missing, unexpected or of
    /// another shape.
    pub fn open(learned: Learned, path: &Path) -> Result<Self> {
        let (config, device) = (DefaultEncoderConfig::new(), Device::flex());
        let (network, report) = match learned {
            Learned::Btl => {
                let mut network = Btl::init(&config, &device);
                let report = weights::load(&mut network, path, &[])?;
                (Network::Btl(network.valid()), report)
            }
            Learned::Stun => {
                let mut network = Stun::init(&config, &device);
                let report = weights::load(&mut network, path, &[])?;
                (Network::Stun(network.valid()), report)
            }
        };
        Ok(Self {
            learned,
            network,
            preprocessing: Method::find("default", None)?.preprocessing(),
            dimension: config.dimension,
            digest: report.digest,
        })
    }

    /// Embeds image files; `done` is told how many are done.
    ///
    /// # Errors
    ///
    /// The first file that cannot be read or decoded, by its path.
    pub fn embed(&self, images: &[PathBuf], done: &mut dyn FnMut(usize)) -> Result<Embedded> {
        let rows = encode_files(self, images, &Options::default(), done)?;
        self.split(&rows)
    }

    /// Embeds images in memory.
    ///
    /// # Errors
    ///
    /// An image without pixels, by its index.
    pub fn embed_images(&self, images: &[RgbImage]) -> Result<Embedded> {
        let rows = encode_images(self, images, &Options::default())?;
        self.split(&rows)
    }

    /// Rows of this encoder as descriptors and variances.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Mismatch`] if they are of another width.
    pub fn split(&self, rows: &Descriptors) -> Result<Embedded> {
        let (expected, actual) = (Encoder::dimension(self), rows.dim());
        if expected != actual {
            let what = "values of a descriptor and its variances";
            return Err(vpr_core::Error::Mismatch { what, expected, actual }.into());
        }
        let part = |slice| rows.view().slice_axis(Axis(1), slice).to_owned();
        Ok(Embedded {
            descriptors: Descriptors::new(part(Slice::from(..self.dimension)))?,
            variances: part(Slice::from(self.dimension..)),
        })
    }

    fn both(&self, images: Tensor<4>) -> (Tensor<2>, Tensor<2>) {
        match &self.network {
            Network::Btl(network) => network.forward(images),
            Network::Stun(network) => network.describe(images),
        }
    }
}

/// Rows are a descriptor and its variances behind it; [`LearnedEncoder::split`] parts them.
impl Encoder for LearnedEncoder {
    fn name(&self) -> &str {
        self.learned.key()
    }

    fn dimension(&self) -> usize {
        self.dimension
            + match self.learned {
                Learned::Btl => 1,
                Learned::Stun => self.dimension,
            }
    }

    fn preprocessing(&self) -> &Preprocessing {
        &self.preprocessing
    }

    fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        let (descriptors, variances) = self.both(images);
        Tensor::cat(vec![descriptors, variances], 1)
    }

    fn weights_digest(&self) -> Option<&str> {
        Some(&self.digest)
    }
}
