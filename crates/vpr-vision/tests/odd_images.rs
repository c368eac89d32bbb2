//! Images as they come: CMYK, palettes, 16 bits, turned by EXIF, tiny and huge.
//!
//! `golden/images/make.py` writes the files with Pillow, and beside them what Pillow sees in them.

#![expect(clippy::unwrap_used, reason = "a test may")]

use std::{io::Cursor, path::Path};

use image::{ExtendedColorType, ImageEncoder as _, codecs::png::PngEncoder};
use vpr_vision::image::{ImageSize, RgbImage, decode, decode_bytes, probe};

fn golden(name: &str) -> RgbImage {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/images").join(name);
    let image = decode(&path).unwrap();
    assert_eq!(probe(&path).unwrap(), image.size(), "{name}");
    image
}

/// Largest and mean difference of a level.
fn difference(a: &RgbImage, b: &RgbImage) -> (u8, f64) {
    assert_eq!(a.size(), b.size());
    let levels = a.as_slice().iter().zip(b.as_slice()).map(|(a, b)| a.abs_diff(*b));
    let sum: u64 = levels.clone().map(u64::from).sum();
    (levels.max().unwrap(), sum as f64 / a.as_slice().len() as f64)
}

#[test]
fn palettes_and_sixteen_bits_are_exact() {
    for name in ["palette", "gray16"] {
        let [image, expected] = ["png", "expected.png"].map(|it| golden(&format!("{name}.{it}")));
        assert_eq!(difference(&image, &expected), (0, 0.0), "{name}");
    }
}

#[test]
fn a_jpeg_of_four_inks_is_what_pillow_sees() {
    let (largest, mean) = difference(&golden("cmyk.jpg"), &golden("cmyk.expected.png"));
    assert!(largest <= 4 && mean < 1.0, "{largest}, {mean}");
}

#[test]
fn a_progressive_jpeg_is_what_pillow_sees() {
    let (largest, mean) =
        difference(&golden("progressive.jpg"), &golden("progressive.expected.png"));
    assert!(largest <= 4 && mean < 1.0, "{largest}, {mean}");
}

/// Where the pixel at column `x`, row `y` of the upright image lies in the stored one, 32 × 24.
fn stored(orientation: usize, x: usize, y: usize) -> (usize, usize) {
    match orientation {
        1 => (x, y),
        2 => (31 - x, y),
        3 => (31 - x, 23 - y),
        4 => (x, 23 - y),
        5 => (y, x),
        6 => (y, 23 - x),
        7 => (31 - y, 23 - x),
        _ => (31 - y, x),
    }
}

#[test]
fn every_orientation_of_exif_is_applied() {
    let upright = golden("orientation-1.jpg");
    for orientation in 1..=8 {
        let image = golden(&format!("orientation-{orientation}.jpg"));
        let (width, height) = if orientation < 5 { (32, 24) } else { (24, 32) };
        assert_eq!(image.size(), ImageSize { width, height }, "{orientation}");
        for y in 0..height {
            for x in 0..width {
                let (from_x, from_y) = stored(orientation, x, y);
                let pixel = |image: &RgbImage, at: usize| image.as_slice()[3 * at..][..3].to_vec();
                let expected = pixel(&upright, from_y * 32 + from_x);
                assert_eq!(pixel(&image, y * width + x), expected, "{orientation}: {x}, {y}");
            }
        }
    }
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let pixels = vec![7; (width * height) as usize];
    PngEncoder::new(&mut file).write_image(&pixels, width, height, ExtendedColorType::L8).unwrap();
    file.into_inner()
}

#[test]
fn a_single_pixel_is_an_image() {
    let image = decode_bytes(&png(1, 1), Path::new("dot.png")).unwrap();
    assert_eq!(image.as_slice(), [7, 7, 7]);
}

#[test]
fn twenty_thousand_by_twenty_thousand_is_refused_by_its_header() {
    let mut bytes = png(1, 1);
    let side = 20_000_u32.to_be_bytes();
    bytes[16..20].copy_from_slice(&side);
    bytes[20..24].copy_from_slice(&side);
    // The checksum of the header has to fit, or it is refused for that.
    let sum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&sum.to_be_bytes());
    bytes.resize(1 << 20, 0);
    let error = decode_bytes(&bytes, Path::new("huge.png")).err().unwrap().to_string();
    assert!(error.starts_with("huge.png: header: 20000x20000 pixels"), "{error}");
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| {
            (sum >> 1) ^ (0xedb8_8320 & (sum & 1).wrapping_neg())
        })
    })
}
