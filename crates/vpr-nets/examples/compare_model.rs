//! Compares a published network with the output of its official code.
//!
//! `compare_model NAME CHECKPOINT IO`: `IO` is a safetensors file with `input.image` (batch × 3 ×
//! height × width, preprocessed) and `output.descriptor`. Prints ‖ours − theirs‖ / ‖theirs‖.
#![allow(clippy::print_stdout, reason = "this is a program")]

use std::error::Error;
use std::path::Path;

use burn::tensor::{Device, Tensor, TensorData};
use vpr_nets::model;
use vpr_nets::weights::Weights;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, checkpoint, io] = &arguments[..] else {
        return Err(format!(
            "needs a name ({}), a checkpoint, a file of input and output",
            model::NAMES.join(", ")
        )
        .into());
    };
    let device = Device::flex();
    let network = model::open(name, Weights::open(Path::new(checkpoint))?, &device)
        .ok_or_else(|| format!("there is no network {name}"))??;
    let io = Weights::open(Path::new(io))?;
    let read = |key: &str| {
        let tensor = io.get(key).ok_or_else(|| format!("no {key}"))?;
        Ok::<_, String>(TensorData::new(tensor.data.clone(), tensor.shape.clone()))
    };
    let images = Tensor::<4>::from_data(read("input.image")?, &device);
    let theirs = Tensor::<2>::from_data(read("output.descriptor")?, &device);
    let ours = network.describe(images);
    let norm = |x: Tensor<2>| x.square().sum().sqrt().into_scalar::<f32>();
    let relative = norm(ours - theirs.clone()) / norm(theirs);
    println!("{name}: {relative:.1e} ({})", network.report());
    Ok(())
}
