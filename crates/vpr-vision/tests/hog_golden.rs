//! HOG equals OpenCV 4.14 within 1e-4, on the committed image and on the six of the shared golden files.

#![expect(clippy::unwrap_used, reason = "a golden file that cannot be read fails the test")]
#![expect(clippy::print_stdout, reason = "says what was compared and how near it is")]

use std::{env, fs, path::Path};

use safetensors::SafeTensors;
use vpr_vision::{
    hog::{Hog, HogParams, similarity},
    image::{GrayImage, ImageSize, RgbImage, decode, gray, resize_bilinear},
};

/// Numbers are from 0 to 1; sums in another order differ by about 2e-6.
const TOLERANCE: f32 = 1e-4;

const SIZE: ImageSize = ImageSize { width: 512, height: 512 };

fn floats(tensors: &SafeTensors, key: &str) -> Vec<f32> {
    let (numbers, _) = tensors.tensor(key).unwrap().data().as_chunks::<4>();
    numbers.iter().copied().map(f32::from_le_bytes).collect()
}

fn bytes(tensors: &SafeTensors, key: &str) -> Vec<u8> {
    tensors.tensor(key).unwrap().data().to_vec()
}

fn rgb(mut bgr: Vec<u8>) -> RgbImage {
    let (pixels, _) = bgr.as_chunks_mut::<3>();
    for pixel in pixels {
        pixel.reverse();
    }
    RgbImage::new(SIZE, bgr).unwrap()
}

fn describe<const C: usize>(params: HogParams, image: &kornia_image::Image<u8, C>) -> Vec<f32> {
    Hog::new(params).unwrap().describe(image).unwrap()
}

#[track_caller]
fn assert_near(what: &str, ours: &[f32], theirs: &[f32]) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    let worst = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    println!("{what}: largest difference {worst:e}");
    assert!(worst <= TOLERANCE, "{what}: {worst}");
}

#[test]
fn committed_image_is_described_as_by_opencv() {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/golden/hog_opencv/hog.safetensors");
    let file = fs::read(path).unwrap();
    let tensors = SafeTensors::deserialize(&file).unwrap();
    let image = RgbImage::new(SIZE, bytes(&tensors, "image")).unwrap();
    let luma: GrayImage = gray(&image);
    for (key, ours) in [
        ("released", describe(HogParams::RELEASED, &image)),
        ("thesis", describe(HogParams::THESIS, &image)),
        ("thesis_gray", describe(HogParams::THESIS, &luma)),
    ] {
        assert_near(key, &ours, &floats(&tensors, key));
    }
}

#[test]
fn shared_images_are_described_as_by_opencv() {
    let Some(data) = env::var_os("VPR_DATA") else {
        println!("skipped: VPR_DATA is not set, the shared golden files are not compared");
        return;
    };
    let data = Path::new(&data);
    // By name, not by `..`: a linked data folder has another folder's neighbours.
    let golden = std::path::absolute(data).unwrap().with_file_name("golden");
    let golden = golden.join("hog_opencv/hog.safetensors");
    let Ok(file) = fs::read(&golden) else {
        println!("skipped: {} is missing", golden.display());
        return;
    };
    let tensors = SafeTensors::deserialize(&file).unwrap();
    for (set, index) in ["query", "ref"].into_iter().flat_map(|it| [0, 40, 90].map(|i| (it, i))) {
        let key = |what: &str| format!("{set}.{index}.{what}");
        let resized = rgb(bytes(&tensors, &key("resized_bgr")));
        for (what, params) in [("released", HogParams::RELEASED), ("thesis", HogParams::THESIS)] {
            assert_near(&key(what), &describe(params, &resized), &floats(&tensors, &key(what)));
        }

        let folder = data.join("vpr-bench/datasets/corridor").join(set);
        let mut paths: Vec<_> =
            fs::read_dir(folder).unwrap().map(|it| it.unwrap().path()).collect();
        paths.sort();
        let image = decode(&paths[index]).unwrap();
        let ours = resize_bilinear(&image, SIZE).unwrap();
        let off = |(a, b): (&u8, &u8)| u32::from(a.abs_diff(*b));
        let off: Vec<u32> = ours.as_slice().iter().zip(resized.as_slice()).map(off).collect();
        let mean = f64::from(off.iter().sum::<u32>()) / off.len() as f64;
        println!("{}: pixels differ by {mean:.3}, at most {:?}", key("resized"), off.iter().max());
        assert!(mean < DECODER_TOLERANCE, "{mean}");

        // OpenCV was given the gray image resized, which the file does not hold; ours differs by the decoder, and
        // HOG of nearly constant areas amplifies single levels.
        let luma = resize_bilinear(&gray(&image), SIZE).unwrap();
        let ours = describe(HogParams::THESIS, &luma);
        let alike = similarity(&ours, &floats(&tensors, &key("thesis_gray"))).unwrap();
        println!("{}: cosine {alike}", key("thesis_gray"));
        assert!(alike > 0.999, "{alike}");
    }
}

/// Mean difference, in levels, between pixels decoded here and by libjpeg-turbo; the standard leaves rounding open.
const DECODER_TOLERANCE: f64 = 0.5;
