//! Both networks on images small enough for a test.

use std::{cell::RefCell, fs, path::Path};

use burn::{
    module::Module,
    tensor::{Device, Distribution, Tensor},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vpr_core::Error;
use vpr_nets::{
    model::default::{DefaultEncoder, DefaultEncoderConfig},
    train::{Batch, Run, Trainable, device, seeded},
    weights::{Precision, save},
};
use vpr_vision::image::{ImageSize, RgbImage};

use super::{Btl, Learned, LearnedEncoder, Lesson, SelfTaught, Stun, Training, default_network};

fn small() -> DefaultEncoderConfig {
    DefaultEncoderConfig::new().with_widths([8, 8, 16, 16]).with_reduced(8).with_dimension(16)
}

fn training(steps: usize, rate: f64) -> Training {
    Training { config: small(), steps, rate, seed: 5 }
}

/// Four places of three images: one pattern each, under noise and another light.
#[expect(clippy::unnecessary_wraps, reason = "what training takes")]
fn tiny(step: usize) -> vpr_core::Result<Batch> {
    let (size, mut random) = ((64, 48), ChaCha8Rng::seed_from_u64(step as u64));
    let places: Vec<usize> = (0..12).map(|image| image / 3).collect();
    let mut images = Vec::new();
    for place in &places {
        let gain = random.random_range(0.4..1.0_f32);
        for at in 0..3 * size.0 * size.1 {
            let (column, row) = (at % size.0, at / size.0 % size.1);
            let lit = (column / (4 + place) + row / (9 - place)) % 2 == 0;
            let noise = random.random_range(-0.2..0.2_f32);
            images.push((gain * (if lit { 0.8 } else { 0.3 } + noise)).clamp(0.0, 1.0));
        }
    }
    Ok(Batch { images, size, places })
}

/// A run in a folder, with its log.
fn run_in(folder: &Path) -> Run {
    Run::open(folder, &[], Training::log(&folder.join("log.csv"))).unwrap()
}

fn encoder(seed: u64) -> DefaultEncoder {
    seeded(small().init(&device()), seed).centred(tiny(1_000).unwrap().tensor(&device()))
}

fn random_images(n: usize) -> Tensor<4> {
    let device = Device::flex();
    device.seed(3);
    Tensor::random([n, 3, 64, 64], Distribution::Default, &device)
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().iter::<f32>().collect()
}

fn lengths(rows: Tensor<2>) -> Vec<f32> {
    values(rows.square().sum_dim(1).sqrt())
}

/// What decides every output, bit by bit.
fn outputs((mean, variance): (Tensor<2>, Tensor<2>)) -> Vec<f32> {
    [values(mean), values(variance)].concat()
}

#[test]
fn descriptors_have_length_one_and_variances_are_positive() {
    let images = random_images(3);
    let (means, variances) = Btl::init(&small(), &Device::flex()).forward(images.clone());
    assert_eq!((means.dims(), variances.dims()), ([3, 16], [3, 1]));
    assert!(lengths(means).iter().all(|it| (it - 1.0).abs() < 1e-4));
    assert!(values(variances).iter().all(|it| it.is_finite() && *it > 0.0));

    let (means, variances) = Stun::init(&small(), &Device::flex()).describe(images);
    assert_eq!((means.dims(), variances.dims()), ([3, 16], [3, 16]));
    assert!(lengths(means).iter().all(|it| (it - 1.0).abs() < 1e-4));
    assert!(values(variances).iter().all(|it| (1.0..=std::f32::consts::E).contains(it)));
}

#[test]
fn on_resnet_50_they_have_the_published_sizes() {
    let images = random_images(1);
    let (means, variances) = Btl::resnet50(&Device::flex()).forward(images.clone());
    assert_eq!((means.dims(), variances.dims()), ([1, 2048], [1, 1]));
    assert!(values(variances)[0] > 0.0);
    let (means, variances) = Stun::resnet50(&Device::flex()).describe(images);
    assert_eq!((means.dims(), variances.dims()), ([1, 2048], [1, 2048]));
    assert!((lengths(means)[0] - 1.0).abs() < 1e-3);
}

#[test]
fn an_official_student_that_is_none_is_refused_by_key() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("student.safetensors");
    save(&encoder(1), &path, &[], Precision::Half).unwrap();
    let err = Stun::resnet50(&Device::flex()).load_official(&path).unwrap_err().to_string();
    for part in ["student.safetensors", "encoder.backbone.conv1.weight", "unexpected: head.bias"] {
        assert!(err.contains(part), "`{part}` is not in: {err}");
    }
}

#[test]
fn variances_begin_near_the_prior_and_the_loss_falls() {
    let folder = tempfile::tempdir().unwrap();
    let images = || tiny(1_000).unwrap().tensor(&device());
    let fresh = Btl::init(&small(), &device()).start(encoder(7), 5, images());
    let mean = values(fresh.forward(images()).1).iter().sum::<f32>() / 12.0;
    assert!((0.3..3.0).contains(&(mean * 16.0)), "{mean}");

    let losses = RefCell::new(Vec::new());
    let mut run = run_in(folder.path());
    let observe = |report: &vpr_nets::train::Report| {
        losses.borrow_mut().push(report.loss);
        Ok(())
    };
    let network = training(40, 3e-3).btl(encoder(7), &mut run, tiny, observe).unwrap();
    let losses = losses.into_inner();
    let last = losses[35..].iter().sum::<f64>() / 5.0;
    assert!(last < 0.3 * losses[0], "{} to {last}", losses[0]);
    let (_, variances) = network.forward(images());
    assert!(values(variances).iter().all(|it| it.is_finite() && *it > 0.0));
}

#[test]
fn a_student_approaches_its_teacher() {
    let folder = tempfile::tempdir().unwrap();
    let teacher = encoder(7);
    let losses = RefCell::new(Vec::new());
    let observe = |report: &vpr_nets::train::Report| {
        losses.borrow_mut().push(report.loss);
        Ok(())
    };
    let cosine = |student: &Stun<DefaultEncoder>| {
        let images = tiny(2_000).unwrap().tensor(&Device::flex());
        let (mean, _) = student.valid().describe(images.clone());
        let product = mean * teacher.valid().forward(images);
        values(product.sum_dim(1)).iter().sum::<f32>() / 12.0
    };
    let images = tiny(60).unwrap().tensor(&device());
    let before = cosine(&Stun::init(&small(), &device()).start(5, images));
    let mut run = run_in(folder.path());
    let training = training(60, 5e-3);
    let pair = training.stun(&teacher, Lesson::default(), &mut run, tiny, observe).unwrap();
    let after = cosine(pair.student());
    assert!(before < 0.2 && after > 0.6, "{before} to {after}");
    let losses = losses.into_inner();
    assert!(losses[59] < 0.7 * losses[0], "{} to {}", losses[0], losses[59]);
}

#[test]
fn the_teacher_is_neither_trained_nor_kept() {
    let folder = tempfile::tempdir().unwrap();
    let teacher = encoder(7);
    let images = || tiny(2_000).unwrap().tensor(&device());
    let before = values(teacher.forward(images()));
    let mut run = run_in(folder.path());
    let pair =
        training(2, 1e-2).stun(&teacher, Lesson::default(), &mut run, tiny, |_| Ok(())).unwrap();
    assert_eq!(pair.num_params(), pair.student().num_params());
    assert_eq!(values(teacher.forward(images())), before);
    assert_eq!(values(pair.teacher(images())).len(), before.len());
}

#[test]
fn a_resumed_run_ends_with_the_same_weights_and_log() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| run_in(&folder.path().join(name));
    let log = |name: &str| fs::read_to_string(folder.path().join(name).join("log.csv")).unwrap();
    let train = training(30, 3e-3);
    let teacher = encoder(7);
    // Killed at step 28, after the checkpoint of step 25.
    let killed = |report: &vpr_nets::train::Report| {
        if report.step == 28 { Err(Error::Empty("patience")) } else { Ok(()) }
    };

    let whole = train.btl(encoder(7), &mut at("a"), tiny, |_| Ok(())).unwrap();
    assert!(train.btl(encoder(7), &mut at("b"), tiny, killed).is_err());
    let mut first = 0;
    let count = |report: &vpr_nets::train::Report| {
        first = if first == 0 { report.step } else { first };
        Ok(())
    };
    let resumed = train.btl(encoder(7), &mut at("b"), tiny, count).unwrap();
    assert_eq!(first, 26);
    let images = || tiny(2_000).unwrap().tensor(&device());
    assert_eq!(outputs(resumed.forward(images())), outputs(whole.forward(images())));
    assert_eq!(log("b"), log("a"));
    assert_eq!(log("a").lines().count(), 31);

    let lesson = Lesson::default();
    let whole = train.stun(&teacher, lesson, &mut at("c"), tiny, |_| Ok(())).unwrap();
    assert!(train.stun(&teacher, lesson, &mut at("d"), tiny, killed).is_err());
    let resumed = train.stun(&teacher, lesson, &mut at("d"), tiny, |_| Ok(())).unwrap();
    let of = |pair: &SelfTaught| outputs(pair.student().forward(images()));
    assert_eq!(of(&resumed), of(&whole));
    assert_eq!(log("d"), log("c"));
}

#[test]
fn a_batch_without_pairs_costs_nothing() {
    let network = Btl::init(&small(), &device());
    let images = tiny(0).unwrap().tensor(&device());
    let places: Vec<usize> = (0..12).collect();
    let loss: f32 = network.loss(images, &places).into_scalar();
    assert_eq!(loss, 0.0);
}

#[test]
fn weights_return_from_their_file_and_others_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("btl.safetensors");
    let config = DefaultEncoderConfig::new();
    let network = Btl::init(&config, &Device::flex());
    save(&network, &path, &[("seed", "3".to_owned())], Precision::Half).unwrap();
    assert!(fs::metadata(&path).unwrap().len() < 2_000_000);

    let encoder = LearnedEncoder::open(Learned::Btl, &path).unwrap();
    let size = ImageSize { width: 128, height: 96 };
    let pixels: Vec<u8> = (0..=u8::MAX).cycle().step_by(7).take(3 * 128 * 96).collect();
    let image = RgbImage::new(size, pixels.clone()).unwrap();
    let embedded = encoder.embed_images(&[image.clone(), image]).unwrap();
    assert_eq!((embedded.descriptors.dim(), embedded.variances.dim()), (256, (2, 1)));
    // Half precision costs less than a hundredth.
    let planes = (0..3).flat_map(|channel| pixels.iter().skip(channel).step_by(3));
    let planes: Vec<f32> = planes.map(|&it| f32::from(it) / 255.0).collect();
    let planes = Tensor::<1>::from_floats(planes.as_slice(), &Device::flex());
    let (mean, variance) = network.forward(planes.reshape([1, 3, 96, 128]));
    let near = |a: f32, b: f32| (a - b).abs() < 1e-2 * b.abs().max(0.1);
    let mean = values(mean);
    assert!(embedded.descriptors.row(1).iter().zip(&mean).all(|(&a, &b)| near(a, b)));
    assert!(near(embedded.variances[(1, 0)], values(variance)[0]));

    let err = LearnedEncoder::open(Learned::Stun, &path).unwrap_err().to_string();
    for part in ["btl.safetensors", "missing: var_head.bias", "unexpected: variance.hidden"] {
        assert!(err.contains(part), "`{part}` is not in: {err}");
    }
    let err = default_network(&config, &path).unwrap_err().to_string();
    assert!(err.contains("btl.safetensors") && err.contains("trunk.reduce.weight"), "{err}");
    fs::write(&path, b"nothing").unwrap();
    let err = LearnedEncoder::open(Learned::Btl, &path).unwrap_err().to_string();
    assert!(err.contains("btl.safetensors"), "{err}");
}
