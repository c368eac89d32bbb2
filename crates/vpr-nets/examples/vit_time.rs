//! Times DINOv2 for `experiments/peers/vit.py`: reads numbers of rounds from stdin, writes milliseconds.
//!
//! `vit_time small|base|large SIDE BATCH [halves] [WEIGHTS IO]`: with `halves` two half-batches run on
//! two threads; with files, the tokens are compared with those in `IO` first.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "this is a program")]

use std::error::Error;
use std::io::{self, BufRead, Write};
use std::path::Path;
use std::time::Instant;

use burn::tensor::{Device, Distribution, Tensor, TensorData};
use vpr_nets::backbone::{DinoV2, DinoV2Config};
use vpr_nets::weights::Weights;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [variant, side, batch, rest @ ..] = &arguments[..] else {
        return Err("needs a size, a side and a batch".into());
    };
    let (side, batch): (usize, usize) = (side.parse()?, batch.parse()?);
    let device = Device::flex();
    let mut network = match variant.as_str() {
        "small" => DinoV2Config::small(),
        "base" => DinoV2Config::base(),
        "large" => DinoV2Config::large(),
        other => return Err(format!("there is no size {other}").into()),
    }
    .init(&device);
    if let Some([weights, io]) = rest.last_chunk() {
        Weights::open(Path::new(weights))?.apply(&mut network)?;
        compare(&network, Path::new(io))?;
    }
    let halves = rest.first().is_some_and(|it| it == "halves");
    let images = Tensor::<4>::random([batch, 3, side, side], Distribution::Default, &device);
    for line in io::stdin().lock().lines() {
        for _ in 0..line?.trim().parse::<usize>()? {
            let start = Instant::now();
            let values =
                if halves { in_halves(&network, &images) } else { once(&network, images.clone()) };
            println!("{}", start.elapsed().as_secs_f64() * 1e3);
            assert!(values > 0);
        }
        io::stdout().flush()?;
    }
    Ok(())
}

fn once(network: &DinoV2, images: Tensor<4>) -> usize {
    network.forward(images).patches.into_data().num_elements()
}

fn in_halves(network: &DinoV2, images: &Tensor<4>) -> usize {
    let half = images.dims()[0] / 2;
    let [first, second] = [images.clone().narrow(0, 0, half), images.clone().narrow(0, half, half)];
    let (a, b) = rayon::join(|| once(network, first), || once(network, second));
    a + b
}

fn compare(network: &DinoV2, io: &Path) -> Result<(), Box<dyn Error>> {
    let io = Weights::open(io)?;
    let read = |key: &str| io.get(key).map(|it| TensorData::new(it.data.clone(), it.shape.clone()));
    let device = Device::flex();
    let image = Tensor::<4>::from_data(read("input.image").ok_or("no input.image")?, &device);
    let theirs = Tensor::<3>::from_data(read("output.patch").ok_or("no output.patch")?, &device);
    let ours = network.forward(image).patches;
    let norm = |x: Tensor<3>| x.square().sum().sqrt().into_scalar::<f32>();
    eprintln!("relative difference {:.1e}", norm(ours - theirs.clone()) / norm(theirs));
    Ok(())
}
