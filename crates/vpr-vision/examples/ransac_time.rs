//! Times RANSAC; the other side of `experiments/peers/ransac.py`.
//!
//! Usage: `ransac_time ROUNDS POINTS.txt …`, a file per pair of images, a line per correspondence: x and y in the query
//! image, x and y in the reference image. Prints, per file and estimator, tab-separated: file, estimator, median
//! milliseconds, iterations, inliers.

#![expect(clippy::print_stdout, reason = "what it prints is its result")]

use std::{error::Error, fs, hint::black_box, time::Instant};

use vpr_vision::ransac::{
    Correspondence, Inliers, Intrinsics, RansacParams, essential, fundamental, homography,
};

/// Where `OpenCV` stops in the same script.
const CONFIDENCE: Option<f64> = Some(0.999_999);

/// 7-Scenes' camera: only to have one.
const CAMERA: Intrinsics = Intrinsics { focal: [585.0, 585.0], center: [320.0, 240.0] };

fn read(path: &str) -> Result<Vec<Correspondence>, Box<dyn Error>> {
    let text = fs::read_to_string(path)?;
    let of = |line: &str| {
        let fields: Vec<f64> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        let [a, b, c, d] = fields[..] else {
            return Err(format!("{path}: four numbers expected, found {line:?}").into());
        };
        Ok(Correspondence { query: [a, b], reference: [c, d] })
    };
    text.lines().map(of).collect()
}

fn time(
    rounds: usize,
    estimate: impl Fn() -> vpr_core::Result<Inliers>,
) -> vpr_core::Result<(f64, Inliers)> {
    let mut found = estimate()?;
    let mut times = Vec::new();
    for _ in 0..rounds {
        let start = Instant::now();
        found = black_box(estimate()?);
        times.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times.sort_by(f64::total_cmp);
    Ok((times.get(times.len() / 2).copied().unwrap_or(f64::NAN), found))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let rounds = arguments.next().ok_or("usage: ransac_time ROUNDS POINTS.txt …")?.parse()?;
    for path in arguments {
        let points = read(&path)?;
        for confidence in [None, CONFIDENCE] {
            let plane = RansacParams { confidence, ..RansacParams::HOMOGRAPHY };
            let epipolar = RansacParams { confidence, ..RansacParams::EPIPOLAR };
            let results = [
                ("homography", time(rounds, || homography(&points, &plane))?),
                ("fundamental", time(rounds, || fundamental(&points, &epipolar))?),
                ("essential", time(rounds, || essential(&points, [CAMERA; 2], &epipolar))?),
            ];
            let until = if confidence.is_some() { "early" } else { "exact" };
            for (name, (median, found)) in results {
                let (iterations, inliers) = (found.iterations, found.count());
                println!("{path}\t{name}-{until}\t{median:.4}\t{iterations}\t{inliers}");
            }
        }
    }
    Ok(())
}
