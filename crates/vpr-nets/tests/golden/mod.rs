//! Outputs of official code: committed ones under `data/golden`, the others beside `VPR_DATA`.
#![allow(dead_code, reason = "not every test needs all of it")]

use std::path::{Path, PathBuf};

use burn::tensor::{Device, Tensor, TensorData};
use vpr_nets::weights::Weights;

/// The largest difference, relative to the norm of the official output.
pub(crate) const TOLERANCE: f32 = 1e-4;

/// The golden folder `name`; says `skipped:` and gives `None` if it is not at hand.
pub(crate) fn folder(name: &str) -> Option<PathBuf> {
    let committed = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data/golden").join(name);
    if committed.is_dir() {
        return Some(committed);
    }
    let Some(data) = std::env::var_os("VPR_DATA") else {
        println!("skipped: VPR_DATA is not set, golden/{name} stands beside it");
        return None;
    };
    // By name, not by `..`: a linked data folder has another folder's neighbours.
    let shared = std::path::absolute(&data).unwrap().with_file_name("golden").join(name);
    if shared.is_dir() {
        return Some(shared);
    }
    println!("skipped: there is no {}", shared.display());
    None
}

/// The weights in every format that the folder has.
pub(crate) fn weights(folder: &Path) -> Vec<Weights> {
    let files = ["weights.safetensors", "weights.pth"].map(|name| folder.join(name));
    files.iter().filter(|file| file.exists()).map(|file| Weights::open(file).unwrap()).collect()
}

/// The tensor `key` of the folder's inputs and outputs.
pub(crate) fn tensor<const D: usize>(folder: &Path, key: &str) -> Tensor<D> {
    let all = Weights::open(&folder.join("io.safetensors")).unwrap();
    let tensor = all.get(key).unwrap().clone();
    Tensor::from_data(TensorData::new(tensor.data, tensor.shape), &Device::flex())
}

/// Fails if `ours` differs from the output `key` by more than the tolerance.
#[track_caller]
pub(crate) fn assert_close<const D: usize>(ours: Tensor<D>, folder: &Path, key: &str) {
    let theirs = tensor::<D>(folder, key);
    assert_eq!(ours.dims(), theirs.dims(), "shape of {key}");
    let norm = |x: Tensor<D>| x.square().sum().sqrt().into_scalar::<f32>();
    let relative = norm(ours - theirs.clone()) / norm(theirs);
    println!("{}: {key} differs by {relative:.1e}", folder.display());
    assert!(relative <= TOLERANCE, "{key} differs by {relative:e}");
}
