//! Times SIFT, matching and RANSAC; the other side of `experiments/peers/local_features.py`.
//!
//! Usage: `local_features_time IMAGE_A IMAGE_B ROWS_A.npy ROWS_B.npy REPETITIONS`

#![expect(clippy::print_stdout, reason = "an example that prints")]

use std::{hint::black_box, path::Path, time::Instant};

use vpr_core::{Descriptors, Result};
use vpr_files::npy;
use vpr_vision::{
    features::{LocalDescriptors, LocalFeatures},
    image::{decode, gray},
    matching::{MatchParams, match_features},
    orb,
    ransac::{RansacParams, correspondences, homography},
    sift::{SiftParams, detect},
};

/// Prints every time in milliseconds.
fn time<T>(name: &str, repetitions: usize, mut run: impl FnMut() -> Result<T>) -> Result<T> {
    let mut last = run()?;
    for _ in 0..repetitions {
        let start = Instant::now();
        last = black_box(run()?);
        println!("{name}\t{}", start.elapsed().as_secs_f64() * 1e3);
    }
    Ok(last)
}

fn rows(path: &str) -> Result<LocalFeatures> {
    let rows = Descriptors::new(npy::read_f32(path.as_ref())?)?;
    let n = rows.len();
    LocalFeatures::new(vec![[0.0; 2]; n], vec![0.0; n], LocalDescriptors::Float(rows))
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [a, b, rows_a, rows_b, repetitions] = &arguments[..] else {
        println!("usage: local_features_time IMAGE_A IMAGE_B ROWS_A.npy ROWS_B.npy REPETITIONS");
        return Ok(());
    };
    let n = repetitions.parse().unwrap_or(1);
    let [a, b] = [a, b].map(|it| decode(Path::new(it)).map(|image| gray(&image)));
    let (a, b) = (a?, b?);
    let published = SiftParams::default();
    let native = SiftParams { doubled: false, ..published };
    let few = SiftParams { features: 1000, ..published };
    let features = time("sift", n, || detect(&a, &published))?;
    let of_native = time("sift, not doubled", n, || detect(&a, &native))?;
    time("sift, 1000 strongest", n, || detect(&a, &few))?;
    time("orb", n, || orb::detect(&a, &orb::OrbParams::default()))?;
    println!("# keypoints: {} doubled, {} not", features.len(), of_native.len());

    let (rows_a, rows_b) = (rows(rows_a)?, rows(rows_b)?);
    let of_rows =
        time("match, ratio", n, || match_features(&rows_a, &rows_b, &MatchParams::RATIO))?;
    time("match, mutual", n, || match_features(&rows_a, &rows_b, &MatchParams::MUTUAL))?;
    println!("# {} x {} rows: {} matches", rows_a.len(), rows_b.len(), of_rows.len());

    let other = detect(&b, &published)?;
    let matches = match_features(&features, &other, &MatchParams::RATIO)?;
    let points = correspondences(&features, &other, &matches);
    let fixed = RansacParams::HOMOGRAPHY;
    let early = RansacParams { confidence: Some(0.995), ..fixed };
    let found = time("ransac, 1000", n, || homography(&points, &fixed))?;
    time("ransac, 0.995", n, || homography(&points, &early))?;
    println!("# {} matches, {} inliers", points.len(), found.count());
    Ok(())
}
