//! Times DenseVLAD for `experiments/peers/dense_vlad.py`: for each line on stdin, one time in ns on stdout.
//!
//! `dense_vlad_time IMAGE.rgb WORDS.f32`: 640 × 480 × 3 bytes, red first; 128 × 128 numbers. The last line on
//! stdin, `print`, prints the descriptor instead.

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

use ndarray::Array2;
use vpr_core::Descriptors;
use vpr_vision::{
    image::{ImageSize, RgbImage},
    vlad::{Local, VladEncoder, Vocabulary},
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let usage = "usage: dense_vlad_time IMAGE.rgb WORDS.f32";
    let image = fs::read(env::args().nth(1).ok_or(usage)?)?;
    let image = RgbImage::new(ImageSize { width: 640, height: 480 }, image)?;
    let words = fs::read(env::args().nth(2).ok_or(usage)?)?;
    let words: Vec<f32> = words.as_chunks().0.iter().copied().map(f32::from_le_bytes).collect();
    let words = Descriptors::new(Array2::from_shape_vec((128, 128), words)?)?;
    let vocabulary = Vocabulary::from_centres(words);
    let encoder = VladEncoder::new(Local::dense_vlad(), vocabulary, None)?;
    let mut stdout = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        if line? == "print" {
            let values = encoder.describe(&image)?;
            let texts: Vec<String> = values.iter().map(ToString::to_string).collect();
            writeln!(stdout, "{}", texts.join(" "))?;
            break;
        }
        let start = Instant::now();
        black_box(encoder.describe(black_box(&image))?);
        writeln!(stdout, "{}", start.elapsed().as_nanos())?;
        stdout.flush()?;
    }
    Ok(())
}
