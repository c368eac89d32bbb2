//! Times convolutional networks, a case per line of stdin: `experiments/peers/convolution.py` asks,
//! and runs PyTorch in between. Answers with nanoseconds.
//!
//! Cases: `layer images in out side kernel stride`, `resnet34 images`, `train images` (one step of
//! Adam on ResNet-18 with ten classes at 96×96), `finetune triplets` (one step of Adam on the default
//! network under the triplet loss, three images of 128×96 each).
#![expect(clippy::print_stdout, reason = "prints its measurements")]

use std::{collections::HashMap, io::BufRead, time::Instant};

use burn::{
    module::Module,
    nn::{PaddingConfig2d, loss::CrossEntropyLossConfig},
    optim::GradientsParams,
    tensor::{Device, Distribution, Int, Tensor},
};
use vpr_nets::{
    backbone::{ResNetConfig, resnet::Block},
    layer::Conv2dConfig,
    loss::Triplet,
    model::default::{DefaultEncoderConfig, INPUT},
    train::Optimizer,
};

/// As in the programs.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

type Case = Box<dyn FnMut()>;

fn main() -> Result<(), String> {
    // This thread works along, as PyTorch's does: a third one that only waits makes the scheduler
    // put both workers on one core now and then.
    let pool = rayon::ThreadPoolBuilder::new().use_current_thread();
    pool.build_global().map_err(|err| err.to_string())?;
    let mut cases: HashMap<String, Case> = HashMap::new();
    for line in std::io::stdin().lock().lines() {
        let line = line.map_err(|err| err.to_string())?;
        if !cases.contains_key(&line) {
            cases.insert(line.clone(), case(&line)?);
        }
        if let Some(case) = cases.get_mut(&line) {
            let start = Instant::now();
            case();
            println!("{}", start.elapsed().as_nanos());
        }
    }
    Ok(())
}

fn case(line: &str) -> Result<Case, String> {
    let (name, numbers) = line.split_once(' ').ok_or("a case has numbers")?;
    let numbers: Result<Vec<usize>, _> = numbers.split(' ').map(str::parse).collect();
    match (name, &numbers.map_err(|err| err.to_string())?[..]) {
        ("layer", &[images, channels, out, side, kernel, stride]) => {
            Ok(layer(images, [channels, out], side, kernel, stride))
        }
        ("resnet34", &[images]) => Ok(resnet34(images)),
        ("train", &[images]) => Ok(training_step(images)),
        ("finetune", &[triplets]) => Ok(fine_tuning_step(triplets)),
        _ => Err(format!("no case `{line}`")),
    }
}

fn noise(shape: [usize; 4], device: &Device) -> Tensor<4> {
    Tensor::random(shape, Distribution::Uniform(-1.0, 1.0), device)
}

fn layer(images: usize, channels: [usize; 2], side: usize, kernel: usize, stride: usize) -> Case {
    let device = Device::flex();
    let pad = kernel / 2;
    let layer = Conv2dConfig::new(channels, [kernel, kernel])
        .with_stride([stride, stride])
        .with_padding(PaddingConfig2d::Explicit(pad, pad, pad, pad))
        .init(&device);
    let input = noise([images, channels[0], side, side], &device);
    Box::new(move || drop(layer.forward(input.clone())))
}

fn resnet34(images: usize) -> Case {
    let device = Device::flex();
    let network = ResNetConfig::resnet34().init(&device).valid();
    let input = noise([images, 3, 224, 224], &device);
    Box::new(move || drop(network.forward(input.clone())))
}

fn training_step(images: usize) -> Case {
    let device = Device::flex().autodiff();
    let config = ResNetConfig::new(Block::Basic, [2, 2, 2, 2]).with_classes(Some(10));
    let mut network = Some(config.init(&device));
    let mut adam = Optimizer::Adam.init();
    let input = noise([images, 3, 96, 96], &device);
    let classes: Vec<i64> = (0..images).map(|it| i64::try_from(it % 10).unwrap_or(0)).collect();
    let classes = Tensor::<1, Int>::from_data(&classes[..], &device);
    let loss = CrossEntropyLossConfig::new().init(&device);
    Box::new(move || {
        let Some(current) = network.take() else { return };
        let Some(scores) = current.classify(input.clone()) else { return };
        let gradients = loss.forward(scores, classes.clone()).backward();
        let gradients = GradientsParams::from_grads(gradients, &current);
        network = Some(adam.step(1e-3, current, gradients));
    })
}

fn fine_tuning_step(triplets: usize) -> Case {
    let device = Device::flex().autodiff();
    let mut network = Some(DefaultEncoderConfig::new().init(&device));
    let mut adam = Optimizer::Adam.init();
    let input = noise([3 * triplets, 3, INPUT.1, INPUT.0], &device);
    Box::new(move || {
        let Some(current) = network.take() else { return };
        let rows = current.forward(input.clone());
        let part = |number: usize| rows.clone().narrow(0, number * triplets, triplets);
        let loss = Triplet { margin: 0.3 }.forward(part(0), part(1), part(2));
        let gradients = GradientsParams::from_grads(loss.backward(), &current);
        network = Some(adam.step(3e-4, current, gradients));
    })
}
