//! How far networks on another device are from those on the processor, and how long they take.
//!
//! `cargo run --features vpr-nets/wgpu --example devices -- wgpu` (or `cuda`, `cuda:1`), from
//! `experiments/devices.sh`. Weights and images are random, seeded; a difference is the largest one
//! of all values, as a share of the largest value. Exit code 1 if one is above 1e-4.
#![allow(clippy::print_stdout, reason = "this is a program")]

use std::{error::Error, process::ExitCode, time::Instant};

use burn::{
    module::Module,
    tensor::{Device, Distribution, Tensor},
};
use vpr_nets::{
    DeviceChoice,
    backbone::{DinoV2Config, ResNet, ResNetConfig},
    local::XFeatNet,
    model::default::{DefaultEncoder, DefaultEncoderConfig},
};

/// What the issue of devices allows: a share of the largest value.
const LIMIT: f32 = 1e-4;
/// Forward passes that are timed, behind one that is not.
const ROUNDS: u32 = 5;

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let name = std::env::args().nth(1).unwrap_or_else(|| "cpu".to_owned());
    let device = match name.parse::<DeviceChoice>().map(DeviceChoice::open) {
        Ok(Ok(device)) => device,
        Ok(Err(err)) => return Err(err.to_string().into()),
        Err(reason) => return Err(format!("{name}: {reason}").into()),
    };
    let cpu = Device::flex();
    cpu.seed(1984);
    println!("network           largest relative difference    cpu ms   {name} ms");
    let mut worst = 0.0_f32;
    let mut row = |what: &str, pair: [(Vec<f32>, f64); 2]| {
        let [(ours, cpu_ms), (theirs, ms)] = pair;
        let difference = difference(&ours, &theirs);
        worst = worst.max(difference);
        println!("{what:<18}{difference:>27.1e}{cpu_ms:>10.1}{ms:>10.1}");
    };
    let images =
        |height, width| Tensor::<4>::random([1, 3, height, width], Distribution::Default, &cpu);
    let network = DefaultEncoderConfig::new().init(&cpu);
    let input = images(96, 128);
    row("default network", both(&network, &input, &device, DefaultEncoder::forward));
    let network = ResNetConfig::resnet34().init(&cpu);
    let input = images(224, 224);
    row("ResNet-34", both(&network, &input, &device, ResNet::forward));
    let network = DinoV2Config::small().init(&cpu);
    row("DINOv2, ViT-S", both(&network, &input, &device, |it, x| it.forward(x).patches));
    let network = XFeatNet::new(&cpu);
    let input = images(240, 320);
    row("XFeat", both(&network, &input, &device, |it, x| it.forward(x).features));
    Ok(ExitCode::from(u8::from(worst > LIMIT)))
}

/// The values of a network's output on the processor and on the device, and milliseconds of a pass.
fn both<M: Module, const D: usize>(
    network: &M,
    images: &Tensor<4>,
    device: &Device,
    forward: impl Fn(&M, Tensor<4>) -> Tensor<D>,
) -> [(Vec<f32>, f64); 2] {
    [&Device::flex(), device].map(|device| {
        let network = network.clone().to_device(device);
        let images = images.clone().to_device(device);
        let once = || -> Vec<f32> {
            let data = forward(&network, images.clone()).into_data();
            data.try_into_vec().expect("descriptors are f32")
        };
        let values = once();
        let start = Instant::now();
        for _ in 0..ROUNDS {
            std::hint::black_box(once());
        }
        (values, start.elapsed().as_secs_f64() * 1e3 / f64::from(ROUNDS))
    })
}

fn difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len(), "values");
    let largest = a.iter().fold(0.0_f32, |largest, it| largest.max(it.abs()));
    let far = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    far.fold(0.0_f32, |far, it| if it.is_nan() { f32::INFINITY } else { far.max(it) }) / largest
}
