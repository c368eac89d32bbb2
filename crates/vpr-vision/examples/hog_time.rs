//! Times HOG for `experiments/peers/hog.py`: for each name of a configuration on stdin, one time in ns on stdout.
//!
//! `hog_time IMAGE.rgb`, where the file holds 512 × 512 × 3 bytes, red first.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example prints, and stops at the first error"
)]

use std::{
    env, fs,
    hint::black_box,
    io::{self, BufRead, Write},
    time::Instant,
};

use vpr_vision::{
    hog::{Hog, HogParams},
    image::{ImageSize, RgbImage},
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = env::args().nth(1).ok_or("usage: hog_time IMAGE.rgb")?;
    let image = RgbImage::new(ImageSize { width: 512, height: 512 }, fs::read(path)?)?;
    let (released, thesis) = (Hog::new(HogParams::RELEASED)?, Hog::new(HogParams::THESIS)?);
    let mut stdout = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        let hog = match line?.as_str() {
            "released" => &released,
            "thesis" => &thesis,
            other => return Err(format!("unknown configuration `{other}`").into()),
        };
        let start = Instant::now();
        black_box(hog.describe(black_box(&image))?);
        writeln!(stdout, "{}", start.elapsed().as_nanos())?;
        stdout.flush()?;
    }
    Ok(())
}
