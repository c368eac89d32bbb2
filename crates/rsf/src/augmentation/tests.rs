//! Every operation on images that are odd, and what is known of it by hand.

use vpr_vision::image::{ImageSize, from_pixels};

use super::*;

fn image(width: usize, height: usize) -> RgbImage {
    let byte = |at: usize| u8::try_from(((at * 2_654_435_761) >> 7) % 256).unwrap();
    from_pixels(ImageSize { width, height }, (0..3 * width * height).map(byte).collect())
}

/// One of each kind, as the presets have them, and those that no preset has.
fn every() -> Vec<Change> {
    let others = [Change::RandomRotation { degrees: 20.0 }, Change::RandomHorizontalFlip];
    let preset = Preset::All.augmentations().0.into_iter().map(|it| it.change);
    preset.chain(others).collect()
}

#[test]
fn images_of_any_size_keep_it_and_a_seed_decides() {
    for change in every() {
        for (width, height) in [(1, 1), (1, 9), (9, 1), (2, 3), (32, 24)] {
            let image = image(width, height);
            for seed in 0..8 {
                let mut random = ChaCha8Rng::seed_from_u64(seed);
                let operation = change.draw((width, height), &mut random);
                let changed = operation.apply(&image);
                assert_eq!(changed.size(), image.size(), "{operation:?}");
                assert_eq!(changed.as_slice(), operation.apply(&image).as_slice());
            }
        }
    }
    let all = Preset::All.augmentations();
    let image = image(32, 24);
    assert_eq!(all.apply(&image, 3).as_slice(), all.apply(&image, 3).as_slice());
    assert_ne!(all.apply(&image, 3).as_slice(), all.apply(&image, 4).as_slice());
    assert_eq!(Preset::None.augmentations().apply(&image, 3).as_slice(), image.as_slice());
}

#[test]
fn grey_images_stay_grey_but_for_noise() {
    let grey = from_pixels(
        ImageSize { width: 16, height: 12 },
        image(16, 12).as_slice().chunks(3).flat_map(|it| [it[0]; 3]).collect(),
    );
    for change in every() {
        if matches!(change, Change::RandomGaussianNoise { .. } | Change::RandomNight { .. }) {
            continue;
        }
        for seed in 0..5 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let changed = change.draw((16, 12), &mut random).apply(&grey);
            let is_grey = |it: &[u8]| it[0] == it[1] && it[1] == it[2];
            assert!(changed.as_slice().chunks(3).all(is_grey), "{change:?}");
        }
    }
}

#[test]
fn numbers_that_change_nothing_change_nothing() {
    let image = image(17, 11);
    let corners = [[0.0, 0.0], [16.0, 0.0], [16.0, 10.0], [0.0, 10.0]];
    for operation in [
        Operation::Rotation { degrees: 0.0 },
        Operation::Affine { translation: [0.0; 2], scale: [1.0; 2], degrees: 0.0, shear: [0.0; 2] },
        Operation::ResizedCrop { left: 0, top: 0, width: 17, height: 11 },
        Operation::ColorJiggle {
            brightness: 1.0,
            contrast: 1.0,
            saturation: 1.0,
            hue: 0.0,
            order: [3, 1, 0, 2],
        },
        Operation::Gamma { gamma: 1.0, gain: 1.0 },
        Operation::Posterize { bits: 8 },
        Operation::GaussianNoise { std: 0.0, seed: 1 },
        Operation::Snow { coefficient: 0.0, brightness: 3.0 },
        Operation::Fog { density: 0.0, grey: 0.5 },
        Operation::Night { darkness: 0.0, seed: 1 },
    ] {
        assert_eq!(operation.apply(&image).as_slice(), image.as_slice(), "{operation:?}");
    }
    // Perspectives of Kornia's default move every pixel by up to half of one.
    let still = Operation::Perspective { start: corners, end: corners }.apply(&image);
    assert_ne!(still.as_slice(), image.as_slice());
    let at = 3 * (5 * 17 + 8);
    assert_eq!(still.as_slice()[at..at + 3], image.as_slice()[at..at + 3], "the middle stays");
}

#[test]
fn quarter_turns_flips_and_shifts_are_exact() {
    let image = image(9, 9);
    let at = |image: &RgbImage, x: usize, y: usize| image.as_slice()[3 * (9 * y + x)];
    let turned = Operation::Rotation { degrees: 90.0 }.apply(&image);
    let flipped = Operation::HorizontalFlip.apply(&image);
    for y in 0..9 {
        for x in 0..9 {
            // Anti-clockwise: what was on the right is above.
            assert_eq!(at(&turned, x, y), at(&image, 8 - y, x));
            assert_eq!(at(&flipped, x, y), at(&image, 8 - x, y));
        }
    }
    let crop = Operation::ResizedCrop { left: 2, top: 2, width: 5, height: 5 }.apply(&image);
    assert_eq!([at(&crop, 0, 0), at(&crop, 2, 4)], [at(&image, 2, 2), at(&image, 3, 4)]);
}

#[test]
fn a_table_by_hand_equalizes() {
    // Levels 10, 20, 20, 30 in a plane of 1024: (1024 − 256) / 255 is 3, what is below is 256 and 768.
    let pixels = (0..1024).flat_map(|at| [[10, 20, 20, 30][at % 4]; 3]).collect();
    let image = from_pixels(ImageSize { width: 32, height: 32 }, pixels);
    let equalized = Operation::Equalize.apply(&image);
    assert_eq!(equalized.as_slice()[..12], [0, 0, 0, 85, 85, 85, 85, 85, 85, 255, 255, 255]);
    let posterized = Operation::Posterize { bits: 3 }.apply(&image);
    assert_eq!(
        [posterized.as_slice()[0], Operation::Posterize { bits: 0 }.apply(&image).as_slice()[0]],
        [0, 0]
    );
}
