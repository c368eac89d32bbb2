//! Learned local features against the official code (`experiments/peers/local_features_golden.py`), with weights made
//! by a formula, and with the published weights where they are at hand.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::print_stdout, reason = "says what it skips and how far off it is")]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use burn::tensor::{Device, Tensor, TensorData, s};
use safetensors::{Dtype, SafeTensors, tensor::TensorView};
use vpr_nets::local::{
    Detector, Disk, DiskNet, DiskParams, SuperPoint, SuperPointNet, SuperPointParams, XFeat,
    XFeatNet, XFeatParams, by_name,
};
use vpr_vision::{
    features::LocalFeatures,
    image::{ImageSize, RgbImage},
};

type Array = (Vec<usize>, Vec<f32>);

/// Tensors of a golden file by name.
struct Golden(BTreeMap<String, Array>);

impl Golden {
    fn open(path: &Path) -> Self {
        let bytes = fs::read(path).unwrap();
        let file = SafeTensors::deserialize(&bytes).unwrap();
        let read = |(name, view): (String, TensorView)| {
            let (shape, data) = (view.shape().to_vec(), view.data());
            let values = match view.dtype() {
                Dtype::F32 => data.as_chunks().0.iter().map(|&it| f32::from_le_bytes(it)).collect(),
                Dtype::U8 => data.iter().map(|&it| f32::from(it)).collect(),
                other => panic!("{name}: {other:?}"),
            };
            (name, (shape, values))
        };
        Self(file.tensors().into_iter().map(read).collect())
    }

    fn values(&self, name: &str) -> &[f32] {
        &self.0[name].1
    }

    fn tensor<const D: usize>(&self, name: &str) -> Tensor<D> {
        let (shape, values) = self.0[name].clone();
        Tensor::from_data(TensorData::new(values, shape), &Device::flex())
    }

    /// Keypoints that both have within half a pixel, and how far their descriptors are from each other; panics below
    /// 98 % or beyond 1e-3.
    fn compare(&self, name: &str, ours: &LocalFeatures) {
        let (theirs, _) = self.values(&format!("{name}.keypoints")).as_chunks::<2>();
        let [scores, rows] =
            ["scores", "descriptors"].map(|what| self.values(&format!("{name}.{what}")));
        let descriptors = ours.descriptors().as_float().unwrap();
        let dim = descriptors.dim();
        let (mut common, mut farthest, mut score_off) = (0, 0.0_f32, 0.0_f32);
        for (index, &[x, y]) in theirs.iter().enumerate() {
            let near = |[a, b]: &[f32; 2]| (a - x).hypot(b - y) <= 0.5;
            let Some(found) = ours.keypoints().iter().position(near) else { continue };
            common += 1;
            let row = &rows[index * dim..(index + 1) * dim];
            let off = row.iter().zip(descriptors.row(found)).map(|(a, b)| (a - b).powi(2));
            farthest = farthest.max(off.sum::<f32>().sqrt());
            score_off = score_off.max((scores[index] / ours.scores()[found] - 1.0).abs());
        }
        println!(
            "{name}: {common} of {} keypoints, descriptors within {farthest:.1e}, scores within {score_off:.1e}",
            theirs.len()
        );
        assert!(
            !theirs.is_empty() && ours.len() == theirs.len(),
            "{} {}",
            ours.len(),
            theirs.len()
        );
        assert!(f64::from(common) >= 0.98 * theirs.len() as f64, "{name}: {common}");
        assert!(farthest <= 1e-3, "{name}: {farthest}");
        assert!(score_off <= 1e-3, "{name}: {score_off}");
    }

    /// ‖ours − theirs‖ / ‖theirs‖; panics beyond 1e-4.
    fn compare_dense(&self, name: &str, ours: Tensor<4>) {
        let ours = ours.into_data().try_to_vec::<f32>().unwrap();
        let theirs = self.values(name);
        assert_eq!(ours.len(), theirs.len());
        let square =
            |it: &mut dyn Iterator<Item = f32>| it.map(|v| f64::from(v).powi(2)).sum::<f64>();
        let off = square(&mut ours.iter().zip(theirs).map(|(a, b)| a - b));
        let relative = (off / square(&mut theirs.iter().copied())).sqrt();
        println!("{name}: {relative:.1e}");
        assert!(relative <= 1e-4, "{name}: {relative}");
    }
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/golden/local_features")
}

/// Golden files and weights outside of the repository.
fn shared() -> Option<PathBuf> {
    let data = std::env::var_os("VPR_DATA").map(PathBuf::from);
    if data.is_none() {
        println!("skipped: VPR_DATA is not set");
    }
    data
}

/// The folder `golden` beside the data folder, also where that is a link.
fn beside(data: &Path) -> PathBuf {
    std::path::absolute(data).unwrap().with_file_name("golden")
}

/// The numbers that `uniform` of the script gives.
fn uniform(key: &str, n: usize) -> impl Iterator<Item = f64> {
    let shift = key.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    (0..n as u64).map(move |index| {
        let low = u64::from(u32::MAX);
        let mut x = (index * 2_654_435_761 + (shift & low)) & low;
        for (factor, turn) in [(0x7feb_352d, 16), (0x846c_a68b, 15)] {
            x = ((x ^ (x >> turn)) * factor) & low;
        }
        (x ^ (x >> 16)) as f64 / 4_294_967_296.0
    })
}

#[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
fn weight(key: &str, shape: &[usize]) -> Vec<u8> {
    let fan_in: usize = shape.iter().skip(1).product();
    let value = |u: f64| {
        if key.ends_with("running_var") {
            0.5 + u
        } else if shape.len() > 1 {
            (2.0 * u - 1.0) * (6.0 / fan_in as f64).sqrt()
        } else if key.ends_with("weight") {
            0.25 + 0.5 * u
        } else {
            0.2 * (u - 0.5)
        }
    };
    uniform(key, shape.iter().product()).flat_map(|u| (value(u) as f32).to_le_bytes()).collect()
}

/// A checkpoint of a network with the official keys.
fn checkpoint(network: &str) -> tempfile::NamedTempFile {
    let text = fs::read_to_string(folder().join("keys.json")).unwrap();
    let keys: BTreeMap<String, BTreeMap<String, Vec<usize>>> = serde_json::from_str(&text).unwrap();
    let tensors: Vec<_> =
        keys[network].iter().map(|(key, shape)| (key, shape, weight(key, shape))).collect();
    let views = tensors.iter().map(|(key, shape, bytes)| {
        (key.as_str(), TensorView::new(Dtype::F32, (*shape).clone(), bytes).unwrap())
    });
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(file.path(), safetensors::serialize(views, None).unwrap()).unwrap();
    file
}

fn image(golden: &Golden, name: &str) -> Tensor<4> {
    golden.tensor::<3>(&format!("image.{name}")).unsqueeze::<4>() / 255.0
}

fn only(features: vpr_core::Result<Vec<LocalFeatures>>) -> LocalFeatures {
    features.unwrap().pop().unwrap()
}

#[test]
fn xfeat_is_the_official_one() {
    let golden = Golden::open(&folder().join("outputs.safetensors"));
    let network = XFeatNet::load(checkpoint("xfeat").path(), &Device::flex()).unwrap();
    let maps = network.forward(image(&golden, "even"));
    golden.compare_dense("xfeat.features", maps.features);
    golden.compare_dense("xfeat.keypoint_logits", maps.keypoint_logits);
    golden.compare_dense("xfeat.reliability", maps.reliability);
    let fine = network.fine_offsets(golden.tensor("xfeat.pairs"));
    golden.compare_dense("xfeat.fine_offsets", fine.unsqueeze::<4>());
    let params = XFeatParams { features: 64, detection_threshold: 0.01 };
    let xfeat = XFeat::new(network, params, Device::flex());
    for size in ["even", "odd"] {
        golden.compare(&format!("xfeat.{size}"), &only(xfeat.detect(image(&golden, size))));
    }
}

#[test]
fn disk_is_the_official_one() {
    let golden = Golden::open(&folder().join("outputs.safetensors"));
    let network = DiskNet::load(checkpoint("disk").path(), &Device::flex()).unwrap();
    golden.compare_dense("disk.heatmap", network.forward(image(&golden, "even")).1);
    let params = DiskParams { features: Some(64), score_threshold: -10.0, ..DiskParams::default() };
    let disk = Disk::new(network, params, Device::flex()).unwrap();
    for size in ["even", "odd"] {
        golden.compare(&format!("disk.{size}"), &only(disk.detect(image(&golden, size))));
    }
}

#[test]
fn superpoint_is_the_official_one() {
    let golden = Golden::open(&folder().join("outputs.safetensors"));
    let network = SuperPointNet::load(checkpoint("superpoint").path(), &Device::flex()).unwrap();
    let params = SuperPointParams { features: Some(64), ..SuperPointParams::default() };
    let point = SuperPoint::new(network, params, Device::flex());
    for size in ["even", "odd"] {
        golden.compare(&format!("superpoint.{size}"), &only(point.detect(image(&golden, size))));
    }
}

#[test]
fn xfeat_with_published_weights() {
    let Some(data) = shared() else { return };
    let golden = Golden::open(&beside(&data).join("xfeat/io.safetensors"));
    let network = XFeatNet::load(&data.join("weights/xfeat.pt"), &Device::flex()).unwrap();
    let params = XFeatParams { features: 512, ..XFeatParams::default() };
    let xfeat = XFeat::new(network, params, Device::flex());
    let renamed = |frame: &str| {
        let of = |what: &str| golden.0[&format!("{what}.{frame}")].clone();
        let parts = ["keypoints", "scores", "descriptors"];
        Golden(parts.into_iter().map(|what| (format!("{frame}.{what}"), of(what))).collect())
    };
    for frame in ["20", "500"] {
        let input: Tensor<4> = golden.tensor(&format!("input.{frame}"));
        let maps = xfeat.network().forward(input.clone());
        golden.compare_dense(&format!("features.{frame}"), maps.features);
        golden.compare_dense(&format!("keypoint_logits.{frame}"), maps.keypoint_logits);
        golden.compare_dense(&format!("reliability.{frame}"), maps.reliability);
        renamed(frame).compare(frame, &only(xfeat.detect(input)));
    }
}

#[test]
fn disk_with_published_weights() {
    let Some(data) = shared() else { return };
    let golden = Golden::open(&beside(&data).join("disk/io.safetensors"));
    let network =
        DiskNet::load(&data.join("weights/disk-depth-save.pth"), &Device::flex()).unwrap();
    let (descriptors, heatmap) = network.forward(golden.tensor("input.20"));
    golden.compare_dense("heatmap.20", heatmap);
    let every_fourth = descriptors.slice(s![.., .., 0..;4, 0..;4]);
    golden.compare_dense("dense.20", every_fourth);
    let params = DiskParams { features: Some(512), ..DiskParams::default() };
    let disk = Disk::new(network, params, Device::flex()).unwrap();
    for frame in ["20", "500"] {
        let parts = ["keypoints", "scores", "descriptors"];
        let of =
            |what: &str| (format!("{frame}.{what}"), golden.0[&format!("{what}.{frame}")].clone());
        let renamed = Golden(parts.into_iter().map(of).collect());
        renamed.compare(frame, &only(disk.detect(golden.tensor(&format!("input.{frame}")))));
    }
}

#[test]
fn superpoint_of_the_shared_golden_files() {
    let Some(data) = shared() else { return };
    let path = beside(&data).join("superpoint");
    let golden = Golden::open(&path.join("io.safetensors"));
    let network = SuperPointNet::load(&path.join("weights.safetensors"), &Device::flex()).unwrap();
    let params = SuperPointParams {
        features: Some(200),
        detection_threshold: 0.0005,
        ..SuperPointParams::default()
    };
    let point = SuperPoint::new(network, params, Device::flex());
    let of = |what: &str, key: &str| (format!("output.{what}"), golden.0[key].clone());
    let renamed = Golden(BTreeMap::from([
        of("keypoints", "output.keypoints"),
        of("scores", "output.keypoint_scores"),
        of("descriptors", "output.descriptors"),
    ]));
    renamed.compare("output", &only(point.detect(golden.tensor("input.image"))));
}

/// One network after the other with weights by the formula.
fn all() -> Vec<Box<dyn Detector>> {
    let device = Device::flex();
    let file = |name: &str| checkpoint(name);
    let xfeat = XFeatNet::load(file("xfeat").path(), &device).unwrap();
    let disk = DiskNet::load(file("disk").path(), &device).unwrap();
    let point = SuperPointNet::load(file("superpoint").path(), &device).unwrap();
    let params = SuperPointParams { features: Some(100), ..SuperPointParams::default() };
    vec![
        Box::new(XFeat::new(
            xfeat,
            XFeatParams { features: 100, detection_threshold: 0.01 },
            device.clone(),
        )),
        Box::new(Disk::new(disk, DiskParams::default(), device.clone()).unwrap()),
        Box::new(SuperPoint::new(point, params, device)),
    ]
}

#[test]
fn small_images_are_answered_or_refused() {
    for detector in all() {
        for (width, height) in [(1, 1), (7, 90), (8, 8), (17, 33), (32, 32), (65, 40)] {
            let image = RgbImage::from_size_val(ImageSize { width, height }, 128).unwrap();
            if let Err(error) = detector.extract(&image) {
                let (text, name) = (error.to_string(), detector.name());
                let start = format!("`image` = {width}x{height}: ");
                assert!(text.starts_with(&start) && width.min(height) < 32, "{name}: {text}");
            }
        }
    }
}

#[test]
fn a_batch_gives_what_its_images_give() {
    let golden = Golden::open(&folder().join("outputs.safetensors"));
    let even = image(&golden, "even");
    let turned = even.clone().flip([3]);
    for detector in all() {
        let both = detector.detect(Tensor::cat(vec![even.clone(), turned.clone()], 0)).unwrap();
        let alone = [even.clone(), turned.clone()].map(|it| only(detector.detect(it)));
        for (in_batch, alone) in both.iter().zip(&alone) {
            assert!(!alone.is_empty(), "{}", detector.name());
            assert_eq!(in_batch.keypoints(), alone.keypoints(), "{}", detector.name());
        }
    }
}

#[test]
fn another_network_is_refused_with_its_keys() {
    let error = by_name("disk", Some(checkpoint("xfeat").path()), 10).err().unwrap().to_string();
    assert!(error.contains("missing") && error.contains("path_down.0"), "{error}");
    let error = by_name("lift", None, 10).err().unwrap().to_string();
    assert!(error.contains("unknown local feature `lift`"), "{error}");
}
