//! Networks by the names of the registry, to be trained further.

use std::path::{Path, PathBuf};

use burn::tensor::Device;
use vpr_core::Error;

use super::{
    Preprocessing, Size,
    netvlad_mobile::NetVladMobile,
    registry::{Architecture, Method},
};
use crate::{
    Result,
    model::{
        self, Tunable,
        default::DefaultEncoderConfig,
        headed::{BoqDefault, SaladDefault},
    },
};

/// Side of the images of a network that takes any size.
const SIDE: usize = 224;

/// What a network begins with.
#[derive(Clone, Debug)]
pub struct Start {
    /// How images become its input; the size is a fixed one.
    pub preprocessing: Preprocessing,
    /// Width and height of its input.
    pub size: (usize, usize),
    /// SHA-256 of its weights, in hexadecimal.
    pub digest: String,
}

/// What is done with a network, whichever it is.
pub trait Task {
    /// What comes of it.
    type Output;

    /// Does it.
    fn with<N: Tunable>(self, network: N, start: Start) -> Self::Output;
}

/// Opens the network of this name on `device`, with weights from `given` or from a folder of `roots`,
/// and hands it to `task`. One that takes any size gets 224 × 224.
///
/// # Errors
///
/// [`Error::Unknown`] with the names there are, also for a network without gradients here; where its
/// weights are from, if they are not at hand; those of the weights.
pub fn tune<T: Task>(
    name: &str,
    given: Option<&Path>,
    roots: &[PathBuf],
    device: &Device,
    task: T,
) -> Result<T::Output> {
    let method = Method::find(name, None)?;
    if !is_tunable(method.architecture) {
        let known = super::registry::methods().into_iter();
        let known: Vec<String> =
            known.filter(|it| is_tunable(it.architecture)).map(|it| it.name).collect();
        let (kind, name) = ("method with gradients", name.to_owned());
        return Err(Error::Unknown { kind, name, known: known.join(", ") }.into());
    }
    let weights = method.weights(given, method.dimension(None)?, roots)?;
    let mut preprocessing = method.preprocessing();
    if !matches!(preprocessing.size, Size::Fixed { .. }) {
        preprocessing.size = Size::Fixed { height: SIDE, width: SIDE };
    }
    let size = match preprocessing.size {
        Size::Fixed { height, width } => (width, height),
        _ => (SIDE, SIDE),
    };
    let n_channels = preprocessing.n_channels();
    let start = Start { preprocessing, size, digest: weights.digest().to_owned() };
    Ok(match method.architecture {
        Architecture::BoqDefault => {
            let mut network = BoqDefault::init(device);
            network.take(weights)?;
            task.with(network, start)
        }
        Architecture::SaladDefault => {
            let mut network = SaladDefault::init(device);
            network.take(weights)?;
            task.with(network, start)
        }
        Architecture::NetVladMobileNetV2 => {
            let mut network = NetVladMobile::new(n_channels, device);
            network.take(weights)?;
            task.with(network, start)
        }
        Architecture::BoqResnet50 => {
            task.with(model::boq_resnet50(weights, device)?.into_network(), start)
        }
        Architecture::MixVpr => task.with(model::mixvpr(weights, device)?.into_network(), start),
        Architecture::CosPlace | Architecture::EigenPlaces => {
            task.with(model::cosplace(weights, device)?.into_network(), start)
        }
        Architecture::BoqDinov2 => {
            task.with(model::boq_dinov2(weights, device)?.into_network(), start)
        }
        Architecture::Salad => task.with(model::salad(weights, device)?.into_network(), start),
        // What is not tunable was refused above.
        _ => {
            let mut network = DefaultEncoderConfig::new().init(device);
            network.take(weights)?;
            task.with(network, start)
        }
    })
}

fn is_tunable(architecture: Architecture) -> bool {
    matches!(
        architecture,
        Architecture::Default
            | Architecture::BoqDefault
            | Architecture::SaladDefault
            | Architecture::NetVladMobileNetV2
            | Architecture::BoqResnet50
            | Architecture::MixVpr
            | Architecture::CosPlace
            | Architecture::EigenPlaces
            | Architecture::BoqDinov2
            | Architecture::Salad
    )
}
