//! The networks of chapter 3: layers of those that Caffe trained against OpenCV's, and every technique on
//! five images with random weights of the official shapes.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

mod golden;

use std::{fs, path::Path};

use burn::tensor::{Device, Tensor, TensorData};
use half::f16;
use ndarray::array;
use safetensors::{
    Dtype, serialize_to_file,
    tensor::{TensorView, serialize},
};
use vpr_core::Descriptors;
use vpr_nets::{
    backbone::{
        AlexNetConfig, Calc, ResNetConfig,
        alexnet::{Layer, NormOrder},
    },
    encode::{Options, Request, Size, by_request, encode_images, l1, registry::Matching},
    weights::{Precision, Weights, save},
};
use vpr_vision::image::{ImageSize, RgbImage, from_pixels};

type Shape = &'static [usize];

const ALEXNET: [(&str, Shape); 5] = [
    ("conv1", &[96, 3, 11, 11]),
    ("conv2", &[256, 48, 5, 5]),
    ("conv3", &[384, 256, 3, 3]),
    ("conv4", &[384, 192, 3, 3]),
    ("conv5", &[256, 192, 3, 3]),
];
const CALC: [(&str, Shape); 3] =
    [("conv1", &[64, 1, 5, 5]), ("conv2", &[128, 64, 4, 4]), ("conv3", &[4, 128, 3, 3])];

/// Array `array` of `data/golden/caffe_nets/make.py`.
fn numbers(array: u64, n: usize, scale: f64) -> Vec<f32> {
    let number = |index: u64| {
        let hashed = ((index + 7919 * array) * 2_654_435_761 % (1 << 32)) >> 8;
        #[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
        let number = ((hashed as f64 / f64::from(1 << 24) - 0.5) * scale) as f32;
        number
    };
    (0..n as u64).map(number).collect()
}

fn field(number: u64, body: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    for mut value in [number << 3 | 2, body.len() as u64] {
        while value >= 0x80 {
            out.push(u8::try_from(value & 0x7f).unwrap() | 0x80);
            value >>= 7;
        }
        out.push(u8::try_from(value).unwrap());
    }
    [out, body.to_vec()].concat()
}

/// A `.caffemodel` of these layers, with the numbers of `make.py`.
fn caffemodel(layers: &[(&str, Shape)]) -> Vec<u8> {
    let blob = |shape: &[usize], values: &[f32]| {
        let mut lengths = Vec::new();
        for &len in shape {
            if len >= 0x80 {
                lengths.push(u8::try_from(len & 0x7f).unwrap() | 0x80);
                lengths.push(u8::try_from(len >> 7).unwrap());
            } else {
                lengths.push(u8::try_from(len).unwrap());
            }
        }
        let values: Vec<u8> = values.iter().flat_map(|it| it.to_le_bytes()).collect();
        [field(7, &field(1, &lengths)), field(5, &values)].concat()
    };
    let mut model = Vec::new();
    for (at, (name, shape)) in (0..).zip(layers) {
        let fan: usize = shape[1..].iter().product();
        let weight = numbers(2 * at, fan * shape[0], (24.0 / fan as f64).sqrt());
        let bias = numbers(2 * at + 1, shape[0], 0.2);
        let parts = [
            field(1, name.as_bytes()),
            field(7, &blob(shape, &weight)),
            field(7, &blob(&shape[..1], &bias)),
        ];
        model.extend(field(100, &parts.concat()));
    }
    // What has weights and is not used.
    let classifier = [field(1, b"fc8"), field(7, &blob(&[2, 3], &[0.5; 6]))];
    model.extend(field(100, &classifier.concat()));
    model
}

fn convolutions(layers: &[(&str, Shape)]) -> Weights {
    let weights = Weights::read("net.caffemodel".as_ref(), &caffemodel(layers)).unwrap();
    weights.renamed(&[(r"^fc.*$", "")]).unwrap()
}

fn image(array: u64, shape: [usize; 4], scale: f64, shift: f32) -> Tensor<4> {
    let n = shape.iter().product();
    let values: Vec<f32> = numbers(array, n, scale).iter().map(|it| it + shift).collect();
    Tensor::from_data(TensorData::new(values, shape), &Device::flex())
}

#[track_caller]
fn assert_close(key: &str, ours: Vec<f32>, every: usize) {
    let golden = golden::folder("caffe_nets").unwrap();
    let theirs = Weights::open(&golden.join("io.safetensors")).unwrap();
    let theirs = &theirs.get(key).unwrap().data;
    let ours: Vec<f32> = ours.into_iter().step_by(every).collect();
    assert_eq!(ours.len(), theirs.len(), "{key}");
    let largest = theirs.iter().fold(0.0, |largest: f32, it| largest.max(it.abs()));
    let off = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / largest;
    println!("{key}: largest difference {off:.1e} of the largest value");
    assert!(off < golden::TOLERANCE, "{key}: {off}");
}

#[test]
fn layers_are_those_of_opencv() {
    let device = Device::flex();
    let pixels = || image(100, [1, 3, 227, 227], 255.0, 0.0);
    let run = |order, end| {
        let mut network =
            AlexNetConfig::new().with_order(order).with_end(Layer::Conv5).init(&device);
        convolutions(&ALEXNET).apply(&mut network).unwrap();
        let mut cut = AlexNetConfig::new().with_order(order).with_end(Layer::Conv3).init(&device);
        let weights = convolutions(&ALEXNET).renamed(&[(r"^conv[45].*$", "")]).unwrap();
        weights.apply(&mut cut).unwrap();
        let map =
            if end == Layer::Conv3 { cut.forward(pixels()) } else { network.forward(pixels()) };
        map.into_data().try_into_vec::<f32>().unwrap()
    };
    assert_close("alexnet.conv3", run(NormOrder::BeforePooling, Layer::Conv3), 97);
    assert_close("alexnet.conv5", run(NormOrder::BeforePooling, Layer::Conv5), 61);
    assert_close("caffenet.conv5", run(NormOrder::AfterPooling, Layer::Conv5), 61);

    let mut calc = Calc::new(&device);
    convolutions(&CALC).apply(&mut calc).unwrap();
    let gray = image(101, [1, 1, 120, 160], 1.0, 0.5);
    assert_close("calc", calc.forward(gray).into_data().try_into_vec::<f32>().unwrap(), 1);
}

fn five_images() -> Vec<RgbImage> {
    let size = ImageSize { width: 64, height: 48 };
    let pixel = |image: usize, at: usize| u8::try_from((at * (3 + image) + at / 97) % 256).unwrap();
    (0..5)
        .map(|image| from_pixels(size, (0..64 * 48 * 3).map(|at| pixel(image, at)).collect()))
        .collect()
}

/// Descriptors of five images by a technique with these weights.
fn described(name: &str, weights: &Path, dimension: usize) -> Vec<Vec<f32>> {
    let weights = Some(weights.to_owned());
    let request = Request { name: name.to_owned(), weights, ..Request::default() };
    let encoder = by_request(&request).unwrap();
    assert_eq!(encoder.dimension(), dimension, "{name}");
    let rows = encode_images(&*encoder, &five_images(), &Options::default()).unwrap();
    assert_eq!((rows.len(), rows.dim()), (5, dimension), "{name}");
    let rows: Vec<_> = rows.view().outer_iter().map(|row| row.to_vec()).collect();
    for other in &rows[1..] {
        assert_ne!(other, &rows[0], "{name}: two images have one descriptor");
    }
    rows
}

#[test]
fn every_technique_describes_five_images() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let alexnet = path("alexnet.caffemodel");
    fs::write(&alexnet, caffemodel(&ALEXNET)).unwrap();
    let calc = path("calc.caffemodel");
    fs::write(&calc, caffemodel(&CALC)).unwrap();
    for name in ["alexnet", "alexnet-corrected"] {
        for row in described(name, &alexnet, 1064) {
            let length: f32 = row.iter().map(|it| it * it).sum();
            assert!((length - 1.0).abs() < 1e-4, "{name}: {length}");
        }
    }
    described("calc", &calc, 1064);
    let published = described("amosnet", &alexnet, 7680);
    let corrected = described("amosnet-corrected", &alexnet, 7680);
    // The first cell of every channel is the whole map; others lack rows (VB-13).
    assert_eq!(published[0][0], corrected[0][0]);
    assert_ne!(published, corrected);
    assert_eq!(described("hybridnet", &alexnet, 7680), published);
    let regions = path("regionvlad.safetensors");
    fs::write(&regions, region_vlad()).unwrap();
    let published = described("regionvlad", &regions, 98_304);
    assert_ne!(published, described("regionvlad-corrected", &regions, 98_304));
}

/// With a mean image beside the weights, that is what is subtracted; descriptors are compared by L1.
#[test]
fn a_mean_image_beside_the_weights_is_subtracted() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let model = path("amosnet.caffemodel");
    fs::write(&model, caffemodel(&ALEXNET)).unwrap();
    let without = described("amosnet", &model, 7680);
    // `BlobProto`: field 7 the shape, field 5 the values. The mean of ImageNet, as an image.
    let blob = |mean: [f32; 3]| {
        let values = mean.iter().flat_map(|it| [it.to_le_bytes(); 4].concat()).collect::<Vec<u8>>();
        [field(7, &field(1, &[1, 3, 2, 2])), field(5, &values)].concat()
    };
    fs::write(path("amosnet_mean.binaryproto"), blob([104.0, 117.0, 123.0])).unwrap();
    let image_net = described("amosnet", &model, 7680);
    for (a, b) in image_net.iter().flatten().zip(without.iter().flatten()) {
        assert!((a - b).abs() < 1e-3 * b.abs().max(1.0), "{a} {b}");
    }
    fs::write(path("amosnet_mean.binaryproto"), blob([90.0, 140.0, 123.0])).unwrap();
    assert_ne!(described("amosnet", &model, 7680), image_net);
    fs::write(path("amosnet_mean.binaryproto"), blob([f32::NAN, 0.0, 0.0])).unwrap();
    let request = |name: &str| Request {
        name: name.to_owned(),
        weights: Some(model.clone()),
        ..Request::default()
    };
    let err = by_request(&request("amosnet")).map(|_| ()).unwrap_err().to_string();
    assert!(err.contains("amosnet_mean.binaryproto"), "{err}");
    // Another technique does not read it.
    let encoder = by_request(&request("alexnet")).unwrap();
    assert_eq!(encoder.matching(), Matching::Euclidean);
    fs::remove_file(path("amosnet_mean.binaryproto")).unwrap();
    assert_eq!(by_request(&request("hybridnet")).unwrap().matching(), Matching::L1);
}

#[test]
fn the_match_is_the_published_one_and_not_that_of_euclid() {
    let references = Descriptors::new(array![[3.0, 3.0], [0.0, 5.0]]).unwrap();
    let queries = Descriptors::new(array![[0.0, 0.0]]).unwrap();
    let found = l1::similarities(&queries, &references).unwrap();
    assert_eq!(found.view(), array![[1.0 - 6.0 / 65_536.0, 1.0 - 5.0 / 65_536.0]]);
    // Euclid: √18 < 5.
    assert_eq!(found.best().reference, [1]);
    let narrow = Descriptors::new(array![[0.0]]).unwrap();
    assert!(l1::similarities(&narrow, &references).is_err());
}

/// NetVLAD on VGG-16 at the official shapes, whitened from 32 768 to 4096 values. Weights are stored in
/// half precision, so that the file of this test has a third of a gigabyte.
#[test]
fn netvlad_describes_five_images() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("netvlad.safetensors");
    let mut parts: Vec<(String, Vec<usize>, Vec<u8>)> = Vec::new();
    let mut add = |key: &str, shape: &[usize], scale: f64| {
        let values = numbers(400 + parts.len() as u64, shape.iter().product(), scale);
        let bytes = values.iter().flat_map(|&it| f16::from_f32(it).to_le_bytes()).collect();
        parts.push((key.to_owned(), shape.to_vec(), bytes));
    };
    let widths = [3, 64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512, 512];
    let places = [0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28];
    for (place, width) in places.iter().zip(widths.windows(2)) {
        let fan = 9.0 * f64::from(width[0]);
        let [from, to] = [width[0], width[1]].map(|it| usize::try_from(it).unwrap());
        add(&format!("backbone.{place}.weight"), &[to, from, 3, 3], (24.0 / fan).sqrt());
        add(&format!("backbone.{place}.bias"), &[to], 0.2);
    }
    add("netvlad.score_proj.weight", &[64, 512, 1], 1.0);
    add("netvlad.centers", &[512, 64], 0.2);
    add("whiten.weight", &[4096, 32_768], 0.02);
    add("whiten.bias", &[4096], 0.02);
    let views = parts.iter().map(|(key, shape, bytes)| {
        (key.as_str(), TensorView::new(Dtype::F16, shape.clone(), bytes).unwrap())
    });
    serialize_to_file(views, None, &path).unwrap();
    drop(parts);
    let request = Request {
        name: "netvlad".to_owned(),
        weights: Some(path),
        size: Some(Size::Fixed { height: 64, width: 96 }),
        ..Request::default()
    };
    let encoder = by_request(&request).unwrap();
    assert_eq!(encoder.dimension(), 4096);
    let rows = encode_images(&*encoder, &five_images(), &Options::default()).unwrap();
    assert_eq!((rows.len(), rows.dim()), (5, 4096));
    let rows: Vec<Vec<f32>> = rows.view().outer_iter().map(|row| row.to_vec()).collect();
    for row in &rows {
        let length: f32 = row.iter().map(|it| it * it).sum();
        assert!((length - 1.0).abs() < 1e-4, "{length}");
    }
    assert!(rows[1..].iter().all(|row| *row != rows[0]), "two images have one descriptor");
}

/// The convolutions of AlexNet and a vocabulary of the scale of their sums.
fn region_vlad() -> Vec<u8> {
    let convolutions = convolutions(&ALEXNET[..3]);
    let bytes = |values: &[f32]| values.iter().flat_map(|it| it.to_le_bytes()).collect::<Vec<u8>>();
    let mut parts: Vec<(String, Vec<usize>, Vec<u8>)> = convolutions
        .iter()
        .map(|(key, tensor)| (key.to_owned(), tensor.shape.clone(), bytes(&tensor.data)))
        .collect();
    let words = bytes(&numbers(200, 256 * 384, 40.0));
    parts.push(("vocabulary".to_owned(), vec![256, 384], words));
    let views = parts.iter().map(|(key, shape, bytes)| {
        let view = TensorView::new(Dtype::F32, shape.clone(), bytes).unwrap();
        (key.as_str(), view)
    });
    serialize(views, None).unwrap()
}

/// A ResNet-101 with weights from a seed, AP-GeM's layer and its whitening.
#[test]
fn ap_gem_describes_five_images() {
    let folder = tempfile::tempdir().unwrap();
    let (trunk, path) =
        (folder.path().join("trunk.safetensors"), folder.path().join("ap-gem.safetensors"));
    let device = Device::flex();
    device.seed(5);
    save(&ResNetConfig::resnet101().init(&device), &trunk, &[], Precision::Single).unwrap();
    let trunk = Weights::open(&trunk).unwrap();
    let bytes = |values: &[f32]| values.iter().flat_map(|it| it.to_le_bytes()).collect::<Vec<u8>>();
    let mut parts: Vec<(String, Vec<usize>, Vec<u8>)> = trunk
        .iter()
        .map(|(key, tensor)| (key.to_owned(), tensor.shape.clone(), bytes(&tensor.data)))
        .collect();
    let mut add = |key: &str, shape: &[usize], values: Vec<f32>| {
        parts.push((key.to_owned(), shape.to_vec(), bytes(&values)));
    };
    add("adpool.p", &[1], vec![3.0]);
    add("fc.weight", &[2048, 2048], numbers(300, 2048 * 2048, 0.05));
    add("fc.bias", &[2048], numbers(301, 2048, 0.1));
    add("pca.mean", &[2048], numbers(302, 2048, 0.01));
    add("pca.components", &[2048, 2048], numbers(303, 2048 * 2048, 0.05));
    add("pca.explained_variance", &[2048], (1_u16..=2048).map(|it| 1.0 / f32::from(it)).collect());
    let views = parts.iter().map(|(key, shape, bytes)| {
        (key.as_str(), TensorView::new(Dtype::F32, shape.clone(), bytes).unwrap())
    });
    fs::write(&path, serialize(views, None).unwrap()).unwrap();
    let request = Request {
        name: "ap-gem".to_owned(),
        weights: Some(path),
        size: Some(Size::Fixed { height: 64, width: 96 }),
        ..Request::default()
    };
    let encoder = by_request(&request).unwrap();
    let rows = encode_images(&*encoder, &five_images(), &Options::default()).unwrap();
    assert_eq!((rows.len(), rows.dim()), (5, 2048));
    for row in rows.view().outer_iter() {
        let length: f32 = row.iter().map(|it| it * it).sum();
        assert!((length - 1.0).abs() < 1e-4, "{length}");
    }
}
