//! A network of your own as an encoder: what takes a `&dyn Encoder` here takes yours.
//!
//! ```text
//! cargo run -p vpr-nets --example own_encoder
//! ```
//!
//! This one has two convolutions with random weights, drawn from a seed. It has learned nothing: see
//! what an untrained network already finds, and beat it. Weights of your own come from
//! [`vpr_nets::weights::Weights`]; [`vpr_nets::train`] trains.
#![expect(clippy::print_stdout, reason = "an example prints what it found")]

use std::path::Path;

use anyhow::Result;
use burn::{
    module::Module,
    tensor::{Device, Tensor, activation::relu, module::adaptive_avg_pool2d},
};
use vpr_core::{metrics::recall_at, retrieve};
use vpr_nets::{
    encode::{Channels, Encoder, Options, Preprocessing, encode_files},
    layer::{Conv2d, Conv2dConfig, l2_normalize_rows},
    train::seeded,
};
use vpr_worlds::{World, named_recipe};

/// Twenty places of a city, rendered once into `data/worlds`.
const WORLD: &str = "world/street?places=20&camera.width=160&camera.height=120&camera.focal=115.0";

/// What has weights, a module of burn.
#[derive(Module, Debug)]
struct Layers {
    edges: Conv2d,
    parts: Conv2d,
}

/// The network with what an encoder must say of itself.
struct Tiny(Layers, Preprocessing);

impl Tiny {
    fn new(seed: u64, device: &Device) -> Self {
        let layers = Layers {
            edges: Conv2dConfig::new([1, 8], [5, 5]).with_stride([2, 2]).init(device),
            parts: Conv2dConfig::new([8, 16], [5, 5]).with_stride([2, 2]).init(device),
        };
        // Images become 80 × 60 grey values around 0.
        let mut preprocessing = Preprocessing::image_net(60, 80);
        preprocessing.channels = Channels::Gray;
        (preprocessing.mean, preprocessing.std) = ([0.5; 3], [0.25; 3]);
        Self(seeded(layers, seed), preprocessing)
    }
}

impl Encoder for Tiny {
    fn name(&self) -> &'static str {
        "tiny"
    }

    fn dimension(&self) -> usize {
        16 * 3 * 4 // channels of the last layer, averaged over 3 × 4 fields
    }

    fn preprocessing(&self) -> &Preprocessing {
        &self.1
    }

    fn forward(&self, images: Tensor<4>) -> Tensor<2> {
        let edges = relu(self.0.edges.forward(images));
        let parts = relu(self.0.parts.forward(edges));
        l2_normalize_rows(adaptive_avg_pool2d(parts, [3, 4]).flatten(1, 3))
    }
}

fn main() -> Result<()> {
    let city = World::open(&named_recipe(WORLD)?, Path::new("data/worlds"), &|| ())?.dataset;
    let network = Tiny::new(1, &vpr_nets::device());

    // Decoding, resizing, batches and threads are not the encoder's business.
    let options = Options { batch_size: 4, ..Options::default() };
    let references = encode_files(&network, &city.references, &options, &mut |_| ())?;
    let queries = encode_files(&network, &city.queries, &options, &mut |_| ())?;

    let found = retrieve(&queries, &references, 5)?;
    println!("`{}`: {} values per image", network.name(), references.dim());
    for n in [1, 5] {
        println!("R@{n} {:.3}", recall_at(n, &found, &city.truth)?);
    }
    Ok(())
}
