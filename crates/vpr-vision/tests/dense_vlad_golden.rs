//! Dense `RootSIFT`, VLAD, k-means and PCA are those of `NumPy`, `SciPy` and scikit-learn.

#![expect(clippy::unwrap_used, clippy::print_stdout, reason = "a test may")]

use std::{fs, path::Path};

use ndarray::Array2;
use safetensors::SafeTensors;
use vpr_core::{
    Descriptors,
    knn::{Pca, PcaParams},
};
use vpr_vision::{
    dense_sift::{DenseSiftParams, describe},
    image::{GrayImage, ImageSize},
    vlad::{Projection, Vocabulary, VocabularyParams},
};

/// All values are at most one.
const TOLERANCE: f32 = 1e-5;

/// What `data/golden/dense_vlad/make.py` writes.
fn golden() -> Vec<u8> {
    let path = "../../data/golden/dense_vlad/io.safetensors";
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

fn matrix(file: &SafeTensors<'_>, key: &str) -> Descriptors {
    let tensor = file.tensor(key).unwrap();
    let values = tensor.data().as_chunks().0.iter().copied().map(f32::from_le_bytes).collect();
    let shape = (tensor.shape()[0], tensor.shape()[1]);
    Descriptors::new(Array2::from_shape_vec(shape, values).unwrap()).unwrap()
}

fn image(file: &SafeTensors<'_>) -> GrayImage {
    let tensor = file.tensor("image").unwrap();
    let size = ImageSize { width: tensor.shape()[1], height: tensor.shape()[0] };
    GrayImage::new(size, tensor.data().to_vec()).unwrap()
}

#[track_caller]
fn assert_near<'a>(
    what: &str,
    ours: impl Iterator<Item = &'a f32>,
    theirs: impl Iterator<Item = &'a f32>,
    tolerance: f32,
) {
    let worst = ours.zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    println!("{what}: largest difference {worst:.1e}");
    assert!(worst <= tolerance, "{what}: {worst}");
}

#[test]
fn dense_sift_and_its_vlad_are_those_of_numpy() {
    let bytes = golden();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let scales = describe(&image(&file), &DenseSiftParams::default(), true).unwrap();
    for (scale, (size, every)) in scales.iter().zip([(4, 4), (6, 2), (8, 1), (10, 1)]) {
        let theirs = matrix(&file, &format!("sift.{size}"));
        assert_eq!(theirs.len(), scale.len().div_ceil(every), "bins of {size}");
        let zeros =
            theirs.view().outer_iter().filter(|row| row.iter().all(|&it| it == 0.0)).count();
        println!("bins of {size}: {zeros} of {} without contrast", theirs.len());
        let ours = scale.view().into_outer_iter().step_by(every).flatten();
        assert_near(&format!("bins of {size}"), ours, theirs.as_slice().iter(), TOLERANCE);
    }
    let vocabulary = Vocabulary::from_centres(matrix(&file, "words"));
    let vlad = vocabulary.encode_all(&scales, true).unwrap();
    let theirs = file.tensor("vlad").unwrap();
    let theirs: Vec<f32> =
        theirs.data().as_chunks().0.iter().copied().map(f32::from_le_bytes).collect();
    assert_near("VLAD", vlad.iter(), theirs.iter(), TOLERANCE);
}

#[test]
fn words_are_those_of_scikit_learn() {
    let bytes = golden();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let theirs = matrix(&file, "centres");
    let params = VocabularyParams { clusters: 4, rounds: 50, seed: 0 };
    let ours = Vocabulary::fit(&matrix(&file, "blobs"), &params).unwrap();
    for centre in ours.centres().view().outer_iter() {
        let off = |row: usize| -> f32 {
            let pairs = theirs.row(row).into_iter().zip(centre);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        let nearest = (0..theirs.len()).map(off).fold(f32::INFINITY, f32::min);
        assert!(nearest < TOLERANCE, "{nearest}");
    }
}

#[test]
fn whitening_is_that_of_scikit_learn() {
    let bytes = golden();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let (rows, theirs) = (matrix(&file, "vlads"), matrix(&file, "white"));
    let pca = Pca::fit(&rows, &PcaParams { n_components: 5, whiten: true }).unwrap();
    let exact = pca.apply(&rows).unwrap().normalized();
    let projection = Projection::of(&pca);
    // The sign of a component is free.
    let sign = |column: usize| {
        let product = |row: usize| exact.row(row)[column] * theirs.row(row)[column];
        (0..rows.len()).map(product).sum::<f32>().signum()
    };
    let signs: Vec<f32> = (0..5).map(sign).collect();
    let signed = |row: &[f32]| -> Vec<f32> { row.iter().zip(&signs).map(|(a, b)| a * b).collect() };
    let ours: Vec<f32> =
        (0..rows.len()).flat_map(|row| signed(exact.row(row).as_slice().unwrap())).collect();
    assert_near("whitened", ours.iter(), theirs.as_slice().iter(), TOLERANCE);
    let bytes: Vec<f32> = (0..rows.len())
        .flat_map(|row| signed(&projection.apply(rows.row(row).as_slice().unwrap()).unwrap()))
        .collect();
    // Components of eight bits: 1/254 of their largest value.
    assert_near("in eight bits", bytes.iter(), theirs.as_slice().iter(), 0.02);
}
