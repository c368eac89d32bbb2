//! The flags that choose an encoder, as VPR-methods-evaluation names them.

use std::path::PathBuf;

use anyhow::bail;
use vpr_nets::{
    DeviceChoice,
    encode::{Encoder, Options, Request, Size, by_request, registry::Method},
};

/// Which network, and how images are run through it.
#[derive(clap::Args, Clone)]
pub(crate) struct EncoderArgs {
    /// File of the weights; by default the method's own below the data folder
    #[arg(long, value_name = "FILE")]
    pub(super) weights: Option<PathBuf>,
    /// Backbone, where a method has several
    #[arg(long, value_name = "NAME")]
    pub(super) backbone: Option<String>,
    /// Length of the descriptors, where a method has several; by default that of
    /// VPR-methods-evaluation: cosplace and eigenplaces 2048 (512 on ResNet-18 and VGG16), mixvpr
    /// and netvlad 4096
    #[arg(long, alias = "descriptors_dimension", value_name = "N")]
    pub(super) descriptors_dimension: Option<usize>,
    /// Size of the images: height and width, or the shorter side; by default the method's own
    #[arg(long, alias = "image_size", num_args = 1..=2, value_name = "H W")]
    pub(super) image_size: Vec<usize>,
    /// Images per forward pass; images of different sizes need 1
    #[arg(long, alias = "batch_size", default_value_t = 1, value_name = "N")]
    pub(super) batch_size: usize,
    /// Where to compute: cpu, or wgpu or cuda where the program was built with that feature;
    /// cuda:1 is the second of its kind
    #[arg(long, default_value_t)]
    device: DeviceChoice,
}

impl EncoderArgs {
    /// The encoder with its weights.
    pub(super) fn open(&self, method: &str, data: &[PathBuf]) -> anyhow::Result<Box<dyn Encoder>> {
        let size = match self.image_size[..] {
            [] => None,
            [side] => Some(Size::ShorterSide(side)),
            [height, width] => Some(Size::Fixed { height, width }),
            _ => bail!("`image-size` takes one or two numbers"),
        };
        let encoder = by_request(&Request {
            name: method.to_owned(),
            backbone: self.backbone.clone(),
            dimension: self.descriptors_dimension,
            weights: self.weights.clone(),
            size,
            roots: data.to_vec(),
            device: self.device,
        })?;
        if let Some(prefix) = encoder.weights_prefix() {
            vpr_report::cli::note(&format!(
                "note: the keys of the weights begin with `{prefix}`, which is left out"
            ));
        }
        let registered = Method::find(method, self.backbone.as_deref())?;
        let (usual, actual) = (registered.dimensions[0], encoder.dimension());
        if self.descriptors_dimension.is_none() && actual != usual {
            vpr_report::cli::note(&format!(
                "note: the weights give descriptors of {actual} values, not of {usual}"
            ));
        }
        let official = registered.digest;
        if let (Some(official), Some(actual)) = (official, encoder.weights_digest())
            && official != actual
        {
            vpr_report::cli::note(&format!(
                "warning: the weights are not the published ones of `{method}`: {actual}"
            ));
        }
        Ok(encoder)
    }

    /// How images are run through it.
    pub(super) fn options(&self, threads: Option<usize>, skip_bad: bool) -> Options {
        Options { batch_size: self.batch_size, threads, skip_bad }
    }
}
