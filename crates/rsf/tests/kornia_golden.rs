//! Our augmentations against Kornia 0.8.1 on given parameters (`data/golden/kornia/make.py`).

use std::path::{Path, PathBuf};

use ndarray::{Array3, Array4};
use rsf::Operation;
use vpr_files::npy;
use vpr_vision::image::{ImageSize, from_pixels};

const SIZE: ImageSize = ImageSize { width: 48, height: 36 };
const FRAME: [[f64; 2]; 4] = [[0.0, 0.0], [47.0, 0.0], [47.0, 35.0], [0.0, 35.0]];
/// Ours are rounded to bytes after each operation, Kornia's once.
const LEVELS: i16 = 2;

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/golden/kornia").join(name)
}

fn affine(translation: [f64; 2], scale: f64, degrees: f64, shear: [f64; 2]) -> Operation {
    Operation::Affine { translation, scale: [scale; 2], degrees, shear }
}

fn jiggle([brightness, contrast, saturation, hue]: [f64; 4], order: [usize; 4]) -> Operation {
    Operation::ColorJiggle { brightness, contrast, saturation, hue, order }
}

/// In the order of the script.
fn cases() -> Vec<Operation> {
    let perspective = |end| Operation::Perspective { start: FRAME, end };
    vec![
        perspective([[3.0, 2.0], [43.0, 4.0], [45.0, 31.0], [1.0, 34.0]]),
        perspective([[8.0, 0.0], [47.0, 5.0], [40.0, 35.0], [0.0, 30.0]]),
        affine([2.5, -1.25], 1.1, 4.0, [3.0, 0.0]),
        affine([-3.0, 2.0], 0.93, -5.0, [-4.0, 2.0]),
        Operation::Rotation { degrees: 17.0 },
        Operation::Rotation { degrees: -8.5 },
        Operation::ResizedCrop { left: 5, top: 3, width: 38, height: 29 },
        Operation::ResizedCrop { left: 0, top: 8, width: 41, height: 27 },
        Operation::HorizontalFlip,
        jiggle([1.2, 0.8, 1.3, 0.04], [0, 1, 2, 3]),
        jiggle([0.8, 1.3, 0.5, -0.05], [2, 0, 3, 1]),
        Operation::Grayscale,
        Operation::Gamma { gamma: 1.6, gain: 0.95 },
        Operation::Gamma { gamma: 0.7, gain: 1.08 },
        Operation::Posterize { bits: 3 },
        Operation::Equalize,
        Operation::GaussianBlur { kernel: 5, sigma: 0.4 },
        Operation::GaussianBlur { kernel: 5, sigma: 1.3 },
        Operation::MotionBlur { kernel: 5, degrees: 20.0, direction: 0.3 },
        Operation::MotionBlur { kernel: 7, degrees: -30.0, direction: -0.5 },
        Operation::Erasing { left: 7, top: 5, width: 12, height: 9, value: 0.4 },
        Operation::Snow { coefficient: 0.5, brightness: 2.0 },
        Operation::Snow { coefficient: 0.65, brightness: 1.4 },
    ]
}

#[test]
fn every_operation_is_kornias_within_two_grey_levels() {
    let input: Array3<u8> = npy::read(&golden("input.npy")).unwrap();
    let outputs: Array4<u8> = npy::read(&golden("outputs.npy")).unwrap();
    let image = from_pixels(SIZE, input.iter().copied().collect());
    let cases = cases();
    assert_eq!(outputs.len_of(ndarray::Axis(0)), cases.len());
    let mut off = Vec::new();
    for (operation, expected) in cases.iter().zip(outputs.outer_iter()) {
        let found = operation.apply(&image);
        assert_ne!(found.as_slice(), image.as_slice(), "{operation:?} changes something");
        let apart = found.as_slice().iter().zip(expected.iter());
        let apart = apart.map(|(a, b)| (i16::from(*a) - i16::from(*b)).abs());
        let (n, most) = (apart.clone().filter(|it| *it > LEVELS).count(), apart.max().unwrap());
        if n > 0 {
            off.push(format!("{operation:?}: {n} values up to {most} levels apart"));
        }
    }
    assert!(off.is_empty(), "{}", off.join("\n"));
}
