//! CoHOG against the released code, on one generated image (`data/golden/cohog/README.md`).

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::{fs, path::PathBuf};

use vpr_vision::cohog::{CoHog, CoHogParams, local_entropy};
use vpr_vision::image::{GrayImage, ImageSize, decode};

fn golden(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "../../data/golden/cohog", name].iter().collect()
}

/// What follows the header of a version 1 `.npy` file.
fn values(name: &str) -> Vec<u8> {
    let bytes = fs::read(golden(name)).unwrap();
    let header = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[header..].to_vec()
}

fn floats(name: &str) -> Vec<f32> {
    values(name).as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
}

/// An angle of 300° is known to 3e-5° in f32, 7e-7 of a bin; a region sums a few such shares of its length.
const ROUNDING: f32 = 1e-5;

#[test]
fn regions_equal_those_of_the_released_code() {
    let image = decode(&golden("image.png")).unwrap();
    let descriptor = CoHog::new(CoHogParams::default()).unwrap().describe(&image).unwrap();
    let expected = floats("regions.npy");
    assert_eq!(expected.len(), 961 * 32);
    for (value, (actual, expected)) in descriptor.regions().iter().zip(&expected).enumerate() {
        let (region, value) = (value / 32, value % 32);
        assert!(
            (actual - expected).abs() < ROUNDING,
            "region {region}, value {value}: {actual} and not {expected}"
        );
    }
    let of_interest: Vec<u8> = descriptor.of_interest().iter().map(|&it| it.into()).collect();
    assert_eq!(of_interest, values("of_interest.npy"));
    assert!(of_interest.contains(&0) && of_interest.contains(&1));
}

#[test]
fn local_entropy_equals_that_of_scikit_image() {
    let size = ImageSize { width: 100, height: 100 };
    let entropy = local_entropy(&GrayImage::new(size, values("gray_100.npy")).unwrap(), 5);
    let expected = floats("entropy_100.npy");
    assert_eq!(entropy.len(), expected.len());
    for (actual, expected) in entropy.iter().zip(expected) {
        assert!((actual - f64::from(expected)).abs() < 1e-6, "{actual} and not {expected}");
    }
}
