//! SIFT, the ratio test and homographies against OpenCV 4.14: three pairs of VPR-Bench's Corridor (5 000 features,
//! ratio 0.6, 5 px, 1 000 iterations). Images and outputs are outside of the repository.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::print_stdout, reason = "says what it skips and how far off it is")]

use std::path::PathBuf;

use safetensors::SafeTensors;
use vpr_core::Descriptors;
use vpr_vision::{
    features::{LocalDescriptors, LocalFeatures},
    image::{GrayImage, ImageSize},
    matching::{MatchParams, match_features},
    ransac::{RansacParams, correspondences, homography},
    sift::{SiftParams, detect},
};

/// OpenCV's keypoints (x, y, size, angle, response, octave) and descriptors of one image.
struct Theirs {
    image: GrayImage,
    points: Vec<[f32; 6]>,
    rows: Vec<f32>,
}

fn read(file: &SafeTensors, side: &str, pair: &str) -> Theirs {
    let tensor = |what: &str| file.tensor(&format!("{side}.{pair}.{what}")).unwrap();
    let (image, points) = (tensor("image"), tensor("keypoints"));
    let shape = ImageSize { width: image.shape()[1], height: image.shape()[0] };
    let numbers: Vec<f32> =
        points.data().as_chunks().0.iter().map(|&it| f32::from_le_bytes(it)).collect();
    Theirs {
        image: GrayImage::new(shape, image.data().to_vec()).unwrap(),
        points: numbers.as_chunks().0.to_vec(),
        rows: tensor("descriptors").data().iter().map(|&it| f32::from(it)).collect(),
    }
}

fn golden() -> Option<Vec<u8>> {
    let Some(data) = std::env::var_os("VPR_DATA").map(PathBuf::from) else {
        println!("skipped: VPR_DATA is not set");
        return None;
    };
    // By name, not by `..`: a linked data folder has another folder's neighbours.
    let golden = std::path::absolute(data).unwrap().with_file_name("golden");
    Some(std::fs::read(golden.join("sift_opencv/sift.safetensors")).unwrap())
}

#[test]
fn keypoints_and_descriptors_are_those_of_opencv() {
    let Some(bytes) = golden() else { return };
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let (mut n_theirs, mut n_common, mut n_alike) = (0, 0, 0);
    for pair in ["0", "40", "90"] {
        for side in ["query", "ref"] {
            let theirs = read(&file, side, pair);
            let ours = detect(&theirs.image, &SiftParams::default()).unwrap();
            let rows = ours.descriptors().as_float().unwrap();
            let mut common = 0;
            for (point, row) in theirs.points.iter().zip(theirs.rows.chunks_exact(128)) {
                let near = |[x, y]: &[f32; 2]| (x - point[0]).hypot(y - point[1]) <= 0.5;
                let at: Vec<usize> =
                    (0..ours.len()).filter(|&i| near(&ours.keypoints()[i])).collect();
                common += usize::from(!at.is_empty());
                let off = |&i: &usize| {
                    row.iter().zip(rows.row(i)).map(|(a, b)| (a - b).powi(2)).sum::<f32>().sqrt()
                };
                // descriptors have length 512: 5 % of it
                n_alike += usize::from(at.iter().any(|i| off(i) < 26.0));
            }
            println!("{side} {pair}: {common} of {}, ours {}", theirs.points.len(), ours.len());
            n_common += common;
            n_theirs += theirs.points.len();
            let more = ours.len().abs_diff(theirs.points.len());
            assert!(more * 20 <= theirs.points.len(), "{} keypoints", ours.len());
        }
    }
    println!("{n_common} of {n_theirs} keypoints, {n_alike} descriptors");
    assert!(n_common * 100 >= n_theirs * 98, "{n_common} of {n_theirs}");
    assert!(n_alike * 100 >= n_theirs * 95, "{n_alike} of {n_theirs}");
}

#[test]
fn matches_of_the_same_descriptors_are_those_of_opencv() {
    let Some(bytes) = golden() else { return };
    let file = SafeTensors::deserialize(&bytes).unwrap();
    for pair in ["0", "40", "90"] {
        let [query, reference] = ["query", "ref"].map(|side| {
            let theirs = read(&file, side, pair);
            let n = theirs.points.len();
            let rows = ndarray::Array2::from_shape_vec((n, 128), theirs.rows).unwrap();
            let points = theirs.points.iter().map(|it| [it[0], it[1]]).collect();
            let rows = LocalDescriptors::Float(Descriptors::new(rows).unwrap());
            LocalFeatures::new(points, vec![1.0; n], rows).unwrap()
        });
        let ours = match_features(&query, &reference, &MatchParams::RATIO).unwrap();
        let ours: Vec<[usize; 2]> = ours.iter().map(|it| [it.query, it.reference]).collect();
        let theirs = file.tensor(&format!("pair.{pair}.matches")).unwrap();
        let index = |&it: &[u8; 4]| usize::try_from(i32::from_le_bytes(it)).unwrap();
        let theirs: Vec<usize> = theirs.data().as_chunks().0.iter().map(index).collect();
        assert_eq!(ours, theirs.as_chunks::<2>().0, "pair {pair}");
    }
}

/// OpenCV finds 4 matches and 4 inliers, 0 and 0, 3 and 0.
#[test]
fn inliers_are_in_line_with_opencv() {
    let Some(bytes) = golden() else { return };
    let file = SafeTensors::deserialize(&bytes).unwrap();
    for (pair, theirs) in [("0", 4_usize), ("40", 0), ("90", 0)] {
        let [query, reference] = ["query", "ref"]
            .map(|side| detect(&read(&file, side, pair).image, &SiftParams::default()).unwrap());
        let matches = match_features(&query, &reference, &MatchParams::RATIO).unwrap();
        let points = correspondences(&query, &reference, &matches);
        let inliers = homography(&points, &RansacParams::HOMOGRAPHY).unwrap();
        println!(
            "pair {pair}: {} matches, {} inliers; OpenCV {theirs}",
            matches.len(),
            inliers.count()
        );
        assert!(inliers.count().abs_diff(theirs) <= 1, "pair {pair}: {}", inliers.count());
    }
}
