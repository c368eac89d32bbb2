//! Networks as encoders, by the names of the registry.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use burn::{
    store::ModuleSnapshot,
    tensor::{Device, Tensor, module::adaptive_avg_pool2d},
};
use vpr_core::{Definition, Error};

use super::{
    Encoder, Preprocessing, Size, caffe,
    netvlad_mobile::NetVladMobile,
    registry::{Architecture, Matching, Method},
};
use crate::{
    Result,
    backbone::{EfficientNetLite0Config, efficientnet_lite},
    device::{DeviceChoice, computed},
    model::{
        self, Model, Tunable,
        default::{DefaultEncoder, DefaultEncoderConfig},
        headed::{BoqDefault, SaladDefault},
    },
    weights::{self, Fitted, Weights},
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
    /// Where to compute.
    pub device: DeviceChoice,
}

/// Length of NetVLAD's descriptors behind its whitening.
const WHITENED: usize = 4096;

pub(super) type Forward = Box<dyn Fn(Tensor<4>) -> Tensor<2> + Send + Sync>;
pub(super) type Accepts = Box<dyn Fn(usize, usize) -> Result<(), String> + Send + Sync>;

/// A network with its preprocessing and the digest of its weights.
pub struct Network {
    name: String,
    dimension: usize,
    preprocessing: Preprocessing,
    batch_dependent: bool,
    matching: Matching,
    digest: Option<String>,
    prefix: Option<String>,
    device: Device,
    forward: Forward,
    accepts: Accepts,
}

/// A network with its weights, before it has a name.
pub(super) struct Ready {
    /// What its weights say of its dimension; `None` if they fit one only.
    pub(super) dimension: Option<usize>,
    pub(super) digest: String,
    /// Whether it subtracts a mean of its own, so that images keep theirs.
    pub(super) has_mean: bool,
    pub(super) forward: Forward,
    pub(super) accepts: Accepts,
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

    fn accepts(&self, height: usize, width: usize) -> Result<(), String> {
        (self.accepts)(height, width)
    }

    fn batch_dependent(&self) -> bool {
        self.batch_dependent
    }

    fn matching(&self) -> Matching {
        self.matching
    }

    fn weights_digest(&self) -> Option<&str> {
        self.digest.as_deref()
    }

    fn weights_prefix(&self) -> Option<&str> {
        self.prefix.as_deref()
    }

    fn device(&self) -> Device {
        self.device.clone()
    }
}

/// The encoder of this name with its weights, from `weights` or from a folder of `roots`.
///
/// # Errors
///
/// [`Error::Unknown`] if there is none of this name; where its weights are from, if they
/// are not at hand; those of [`Weights::open`], [`weights::fit`] and [`DeviceChoice::open`].
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
/// As [`by_name`]; [`Error::Parameter`] if the weights give descriptors of another length than was
/// asked for.
pub fn by_request(request: &Request) -> Result<Box<dyn Encoder>> {
    let method = Method::find(&request.name, request.backbone.as_deref())?;
    let dimension = method.dimension(request.dimension)?;
    let device = request.device.open()?;
    let mut preprocessing = method.preprocessing();
    preprocessing.size = request.size.unwrap_or(preprocessing.size);
    let open = || method.weights(request.weights.as_deref(), dimension, &request.roots);
    let n_channels = preprocessing.n_channels();
    let build = |weights: Weights| ready(&method, dimension, n_channels, weights, &device);
    let Fitted { value: network, prefix } = computed(&device, || weights::fit(open, build))??;
    let actual = network.dimension.unwrap_or(dimension);
    if request.dimension.is_some_and(|asked| asked != actual) {
        let name = "descriptors-dimension";
        let reason = "the weights give descriptors of another length";
        return Err(Error::Parameter { name, value: dimension.to_string(), reason }.into());
    }
    if network.has_mean {
        preprocessing.mean = [0.0; 3];
    }
    Ok(Box::new(Network {
        name: method.name.clone(),
        matching: method.matching,
        dimension: actual,
        preprocessing,
        batch_dependent: method.architecture == Architecture::CricaVpr,
        digest: Some(format!("sha256:{}", network.digest)),
        prefix,
        device,
        forward: network.forward,
        accepts: network.accepts,
    }))
}

/// The network of a method with weights whose keys are those that it was published with.
fn ready(
    method: &Method,
    dimension: usize,
    n_channels: usize,
    weights: Weights,
    device: &Device,
) -> Result<Ready> {
    Ok(match method.architecture {
        Architecture::Default => {
            let network = DefaultEncoderConfig::new().init(device);
            assembled(network, weights, &[], DefaultEncoder::forward)?
        }
        Architecture::BoqDefault => tunable(BoqDefault::init(device), weights)?,
        Architecture::SaladDefault => tunable(SaladDefault::init(device), weights)?,
        Architecture::NetVladMobileNetV2 => {
            tunable(NetVladMobile::new(n_channels, device), weights)?
        }
        Architecture::EfficientNetLite0 => efficientnet_lite0(weights, device)?,
        Architecture::BoqDinov2 => published(model::boq_dinov2(weights, device)?),
        Architecture::BoqResnet50 => published(model::boq_resnet50(weights, device)?),
        Architecture::Salad => published(model::salad(weights, device)?),
        Architecture::MixVpr => published(model::mixvpr(weights, device)?),
        Architecture::CosPlace | Architecture::EigenPlaces => {
            published(model::cosplace(weights, device)?)
        }
        Architecture::NetVlad if dimension > WHITENED => {
            let weights = weights.renamed(&[(r"^whiten\..*", "")])?;
            published(model::netvlad(weights, device)?)
        }
        Architecture::NetVlad => published(model::netvlad(weights, device)?),
        Architecture::CricaVpr => published(model::cricavpr(weights, device)?),
        Architecture::GemResNet50 => published(model::gem_resnet50(weights, device)?),
        Architecture::ApGem => published(model::ap_gem(weights, device)?),
        Architecture::AlexNetConv3 => caffe::alexnet_conv3(weights, device)?,
        Architecture::PyramidPublished => caffe::pyramid(weights, Definition::Published, device)?,
        Architecture::PyramidCorrected => caffe::pyramid(weights, Definition::Corrected, device)?,
        Architecture::Calc => caffe::calc(weights, device)?,
        Architecture::RegionVladPublished => {
            caffe::region_vlad(weights, Definition::Published, device)?
        }
        Architecture::RegionVladCorrected => {
            caffe::region_vlad(weights, Definition::Corrected, device)?
        }
    })
}

/// A module with these weights, and its forward pass as an encoder's.
pub(super) fn assembled<M>(
    mut module: M,
    weights: Weights,
    renames: &[(&str, &str)],
    forward: impl Fn(&M, Tensor<4>) -> Tensor<2> + Send + Sync + 'static,
) -> Result<Ready>
where
    M: ModuleSnapshot + Send + Sync + 'static,
{
    let report = weights.renamed(renames)?.apply(&mut module)?;
    Ok(Ready {
        dimension: None,
        digest: report.digest,
        has_mean: false,
        forward: Box::new(move |images| forward(&module, images)),
        accepts: Box::new(|_, _| Ok(())),
    })
}

/// A network that knows how to take its weights.
fn tunable<N: Tunable + Send + Sync + 'static>(mut network: N, weights: Weights) -> Result<Ready> {
    let report = network.take(weights)?;
    Ok(Ready {
        dimension: None,
        digest: report.digest,
        has_mean: false,
        forward: Box::new(move |images| network.describe(images)),
        accepts: Box::new(|_, _| Ok(())),
    })
}

/// A published network, whose sizes are those of its weights.
fn published(model: impl Model + 'static) -> Ready {
    let model = Arc::new(model);
    let accepting = Arc::clone(&model);
    Ready {
        dimension: Some(model.dimension()),
        digest: model.report().digest.clone(),
        has_mean: false,
        forward: Box::new(move |images| model.describe(images)),
        accepts: Box::new(move |height, width| accepting.accepts(height, width)),
    }
}

fn efficientnet_lite0(weights: Weights, device: &Device) -> Result<Ready> {
    let network = EfficientNetLite0Config::new().init(device);
    let renames = [&[(r"^_fc\..*", "")][..], &efficientnet_lite::RENAMES].concat();
    assembled(network, weights, &renames, |network, images| {
        adaptive_avg_pool2d(network.forward(images), [1, 1]).flatten(1, 3)
    })
}
