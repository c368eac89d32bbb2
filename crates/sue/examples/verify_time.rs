//! Times geometric verification by stage, for `experiments/peers/sift_ransac.py`.
//!
//! Arguments: query, reference, query, reference, …. Prints a line per pair: milliseconds for
//! features of both images, matching, RANSAC, all three; then the number of inliers.

#![expect(clippy::print_stdout, reason = "what it prints is its result")]

use std::{path::Path, time::Instant};

use vpr_vision::{
    image,
    matching::{MatchParams, match_features},
    ransac::{RansacParams, correspondences, homography},
    sift::{self, SiftParams},
};

fn main() -> vpr_core::Result<()> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    for pair in paths.chunks_exact(2) {
        let read = |path: &String| -> vpr_core::Result<_> {
            Ok(image::gray(&image::decode(Path::new(path))?))
        };
        let (query, reference) = (read(&pair[0])?, read(&pair[1])?);
        let start = Instant::now();
        let query = sift::detect(&query, &SiftParams::default())?;
        let reference = sift::detect(&reference, &SiftParams::default())?;
        let detect = start.elapsed();
        let start = Instant::now();
        let matches = match_features(&query, &reference, &MatchParams::RATIO)?;
        let compare = start.elapsed();
        let start = Instant::now();
        let points = correspondences(&query, &reference, &matches);
        let inliers = homography(&points, &RansacParams::HOMOGRAPHY)?.count();
        let verify = start.elapsed();
        let stages = [detect, compare, verify, detect + compare + verify];
        let [a, b, c, d] = stages.map(|it| 1e3 * it.as_secs_f64());
        println!("{a:.3} {b:.3} {c:.3} {d:.3} {inliers}");
    }
    Ok(())
}
