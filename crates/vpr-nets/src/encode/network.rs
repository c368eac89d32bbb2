//! Networks as encoders, by the names of the registry.

use std::path::{Path, PathBuf};

use burn::{
    store::ModuleSnapshot,
    tensor::{Device, Tensor, module::adaptive_avg_pool2d},
};

use super::{
    Encoder, Preprocessing, Size,
    registry::{Architecture, Method},
};
use crate::{
    Result,
    backbone::{EfficientNetLite0Config, efficientnet_lite},
    model::default::{DefaultEncoder, DefaultEncoderConfig},
    weights::{Report, Weights},
};

/// Which encoder is wanted; everything but the name may be left to the registry.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// Name of the method.
    pub name: String,
    /// Chooses among the methods of a family.
    pub backbone: Option<String>,
    /// Length of the descriptor, where there are files for several.
    pub dimension: Option<usize>,
    /// File of the weights, instead of the one in the data folders.
    pub weights: Option<PathBuf>,
    /// Size of the images, instead of the method's own.
    pub size: Option<Size>,
    /// Data folders; weights are in `weights/` or `models/` of one of them.
    pub roots: Vec<PathBuf>,
}

type Forward = Box<dyn Fn(Tensor<4>) -> Tensor<2> + Send + Sync>;

/// A network with its preprocessing and the digest of its weights.
pub struct Network {
    name: String,
    dimension: usize,
    preprocessing: Preprocessing,
    batch_dependent: bool,
    digest: Option<String>,
    device: Device,
    forward: Forward,
}

impl Encoder for Network {
    fn name(&self) -> &str {
        &self.name
    }

    fn dimension(&self) -> usize {
        self.dimension
    }

    fn preprocessing(&self) -> &Preprocessing {
        &self.preprocessing
    }

    fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        (self.forward)(images)
    }

    fn batch_dependent(&self) -> bool {
        self.batch_dependent
    }

    fn weights_digest(&self) -> Option<&str> {
        self.digest.as_deref()
    }

    fn device(&self) -> Device {
        self.device.clone()
    }
}

/// The encoder of this name with its weights, from `weights` or from a folder of `roots`.
///
/// # Errors
///
/// [`vpr_core::Error::Unknown`] if there is none of this name; where its weights are from, if they
/// are not at hand; those of [`Weights::open`] and [`Weights::apply`].
pub fn by_name(name: &str, weights: Option<&Path>, roots: &[PathBuf]) -> Result<Box<dyn Encoder>> {
    by_request(&Request {
        name: name.to_owned(),
        weights: weights.map(Path::to_owned),
        roots: roots.to_vec(),
        ..Request::default()
    })
}

/// [`by_name`] with everything that can be chosen.
///
/// # Errors
///
/// As [`by_name`].
pub fn by_request(request: &Request) -> Result<Box<dyn Encoder>> {
    let method = Method::find(&request.name, request.backbone.as_deref())?;
    let dimension = method.dimension(request.dimension)?;
    let path = method.weights(request.weights.as_deref(), dimension, &request.roots)?;
    let weights = Weights::open(&path)?;
    let device = Device::flex();
    let (forward, report) = match method.architecture {
        Architecture::Default => {
            let network = DefaultEncoderConfig::new().init(&device);
            assembled(network, weights, &[], DefaultEncoder::forward)?
        }
        Architecture::EfficientNetLite0 => efficientnet_lite0(weights, &device)?,
        _ => return Err(crate::Error::format(path, "architecture", "is not built yet")),
    };
    let mut preprocessing = method.preprocessing();
    preprocessing.size = request.size.unwrap_or(preprocessing.size);
    Ok(Box::new(Network {
        name: method.name.clone(),
        dimension,
        preprocessing,
        batch_dependent: method.architecture == Architecture::CricaVpr,
        digest: Some(format!("sha256:{}", report.digest)),
        device,
        forward,
    }))
}

/// A module with these weights, and its forward pass as an encoder's.
fn assembled<M>(
    mut module: M,
    weights: Weights,
    renames: &[(&str, &str)],
    forward: impl Fn(&M, Tensor<4>) -> Tensor<2> + Send + Sync + 'static,
) -> Result<(Forward, Report)>
where
    M: ModuleSnapshot + Send + Sync + 'static,
{
    let report = weights.renamed(renames)?.apply(&mut module)?;
    Ok((Box::new(move |images| forward(&module, images)), report))
}

fn efficientnet_lite0(weights: Weights, device: &Device) -> Result<(Forward, Report)> {
    let network = EfficientNetLite0Config::new().init(device);
    let renames = [&[(r"^_fc\..*", "")][..], &efficientnet_lite::RENAMES].concat();
    assembled(network, weights, &renames, |network, images| {
        adaptive_avg_pool2d(network.forward(images), [1, 1]).flatten(1, 3)
    })
}
