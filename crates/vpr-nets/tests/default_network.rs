//! The default network: the weights that are part of the program, and training from nothing.

#![expect(clippy::unwrap_used, reason = "a test may")]

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sha2::{Digest, Sha256};
use vpr_core::Descriptors;
use vpr_nets::{
    encode::{Options, by_name, encode_images, registry::Method},
    model::default::{DefaultEncoder, DefaultEncoderConfig},
    train::{Batch, Checkpoint, Descent, Optimizer, Schedule, device, learned_whitening, seeded},
};
use vpr_vision::image::{ImageSize, RgbImage};

fn images(n: u64) -> Vec<RgbImage> {
    let size = ImageSize { width: 160, height: 120 };
    let image = |seed| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (across, down) = (random.random_range(3..20), random.random_range(3..20));
        let value = |at: usize| (at / 3 % 160 / across * 37) ^ (at / 480 / down * 91);
        let bytes = (0..160 * 120 * 3).map(|at| u8::try_from(value(at) % 256).unwrap());
        RgbImage::new(size, bytes.collect()).unwrap()
    };
    (0..n).map(image).collect()
}

#[test]
fn it_describes_without_a_data_folder_and_is_what_the_registry_says() {
    let method = Method::find("default", None).unwrap();
    assert!(method.size_bytes.unwrap() <= 4_000_000);
    let network = by_name("default", None, &[]).unwrap();
    assert_eq!(network.weights_digest(), method.digest.as_deref());
    assert_eq!(network.dimension(), 256);
    assert!(!network.batch_dependent());
}

#[test]
fn descriptors_have_length_one_for_any_number_of_threads_and_images_at_a_time() {
    let network = by_name("default", None, &[]).unwrap();
    let images = images(7);
    let of = |threads, batch_size| -> Descriptors {
        let options = Options { threads: Some(threads), batch_size, skip_bad: false };
        encode_images(network.as_ref(), &images, &options).unwrap()
    };
    let alone = of(1, 1);
    for row in alone.view().outer_iter() {
        let length = row.iter().map(|value| value * value).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 1e-5, "{length}");
    }
    assert_eq!(of(2, 1), alone);
    assert_eq!(of(3, 4), of(1, 4));
    for (a, b) in of(1, 4).as_slice().iter().zip(alone.as_slice()) {
        assert!((a - b).abs() < 1e-5, "{a} {b}");
    }
}

/// What tables are made of must not move from one machine to the next, nor unnoticed from one
/// version to the next.
#[test]
fn its_bits_are_those_of_this_version_on_every_processor_with_fused_products() {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        let network = by_name("default", None, &[]).unwrap();
        let options = Options { threads: None, batch_size: 3, skip_bad: false };
        let rows = encode_images(network.as_ref(), &images(7), &options).unwrap();
        let bytes: Vec<u8> = rows.as_slice().iter().flat_map(|x| x.to_le_bytes()).collect();
        let digest = Sha256::digest(&bytes);
        let start = u64::from_be_bytes(*digest.first_chunk().unwrap());
        let known = (4, 0xbd79_b1b9_3193_3fbe);
        assert_eq!((vpr_nets::NUMERICS, start), known, "other bits are another version");
    }
}

/// Four places of three images: one pattern each, under noise and another light.
fn tiny(step: usize) -> Batch {
    let (size, mut random) = ((64, 48), ChaCha8Rng::seed_from_u64(step as u64));
    let places: Vec<usize> = (0..12).map(|image| image / 3).collect();
    let mut values = Vec::new();
    for place in &places {
        let gain = random.random_range(0.4..1.0_f32);
        for at in 0..3 * size.0 * size.1 {
            let (column, row) = (at % size.0, at / size.0 % size.1);
            let lit = (column / (4 + place) + row / (9 - place)) % 2 == 0;
            let noise = random.random_range(-0.2..0.2_f32);
            values.push((gain * (if lit { 0.8 } else { 0.3 } + noise)).clamp(0.0, 1.0));
        }
    }
    Batch { images: values, size, places }
}

fn trained(steps: usize) -> (Vec<f64>, DefaultEncoder) {
    let folder = tempfile::tempdir().unwrap();
    let config = DefaultEncoderConfig::new().with_widths([8, 8, 16, 16]).with_dimension(16);
    let network = seeded(config.init(&device()), 7).centred(tiny(1_000).tensor(&device()));
    let descent = Descent {
        steps,
        schedule: Schedule::Cosine { rate: 3e-3, last: 0.0, warmup: 5, steps },
        optimizer: Optimizer::AdamW { decay: 0.01 },
        save_every: steps,
    };
    let mut losses = Vec::new();
    let checkpoint = Checkpoint::new(folder.path());
    let network = descent
        .run(
            network,
            &checkpoint,
            |step| Ok(tiny(step)),
            |report, _| {
                losses.push(report.loss);
                Ok(())
            },
        )
        .unwrap();
    (losses, network)
}

#[test]
fn a_tiny_set_is_overfitted_from_random_weights() {
    let (losses, _) = trained(40);
    let last = losses[35..].iter().sum::<f64>() / 5.0;
    // Two of eleven are right and alike: the loss cannot fall below ln 2.
    assert!(losses[0] > 1.2 && last < 0.75, "{} to {last}", losses[0]);
}

#[test]
fn a_seed_gives_one_network() {
    let images = tiny(5);
    let of = |network: &DefaultEncoder| network.describe(&images.images, images.size, 4).unwrap();
    assert_eq!(of(&trained(3).1), of(&trained(3).1));
}

#[test]
fn a_fitted_projection_brings_images_of_a_place_together() {
    let config = DefaultEncoderConfig::new().with_widths([8, 8, 16, 16]).with_dimension(3);
    let network = seeded(config.init(&device()), 7);
    let fit: Vec<Batch> = (0..10).map(tiny).collect();
    let values: Vec<f32> = fit.iter().flat_map(|batch| batch.images.clone()).collect();
    let places: Vec<usize> = fit.iter().flat_map(|batch| batch.places.clone()).collect();
    let pooled = network.pooled(&values, fit[0].size, 8).unwrap();
    let projection = learned_whitening(pooled.view(), &places, 3).unwrap();
    let network = network.with_projection(&projection).unwrap();
    let unseen = tiny(99);
    let rows = network.describe(&unseen.images, unseen.size, 8).unwrap();
    let rows = rows.view();
    let same = rows.row(0).dot(&rows.row(1));
    let other = rows.row(0).dot(&rows.row(4));
    assert!(same > 0.8 && other < 0.3, "{same} {other}");
}
