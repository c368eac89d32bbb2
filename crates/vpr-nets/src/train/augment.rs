//! What may happen to an image in training: a random crop, turn and light; erased parts.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Pixels;

/// Draws one variant of `image` at the size of `output`, three planes of values in 0 to 1.
pub fn augment(image: Pixels<'_>, size: (usize, usize), seed: u64, output: &mut [f32]) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    crop(image, size, &mut random, output);
    light(output, &mut random);
    if random.random_bool(0.3) {
        blur(output, size);
    }
    let noise = if random.random_bool(0.5) { random.random_range(0.0..0.04) } else { 0.0 };
    for value in output.iter_mut() {
        let draw: f32 = random.random::<f32>() + random.random::<f32>() - 1.0;
        *value = (*value + noise * draw).clamp(0.0, 1.0);
    }
    if random.random_bool(0.2) {
        erase(output, size, &mut random);
    }
}

/// A part of the image, slightly turned, by bilinear interpolation.
fn crop(
    image: Pixels<'_>,
    (width, height): (usize, usize),
    random: &mut ChaCha8Rng,
    output: &mut [f32],
) {
    let scale = random.random_range(0.82..1.0_f32);
    let stretch = random.random_range(0.92..1.08_f32);
    let (from_width, from_height) = (image.width as f32, image.height as f32);
    let across = (scale * stretch).min(1.0) * from_width / width as f32;
    let down = (scale / stretch).min(1.0) * from_height / height as f32;
    let spare = (from_width - across * width as f32, from_height - down * height as f32);
    let left = random.random::<f32>() * spare.0;
    let top = random.random::<f32>() * spare.1;
    let (sin, cos) = random.random_range(-0.06..0.06_f32).sin_cos();
    let (half_width, half_height) = (0.5 * width as f32, 0.5 * height as f32);
    let plane = width * height;
    for row in 0..height {
        for column in 0..width {
            let (x, y) = (column as f32 + 0.5 - half_width, row as f32 + 0.5 - half_height);
            let (turned_x, turned_y) = (cos * x - sin * y, sin * x + cos * y);
            let from_x = left + (turned_x + half_width) * across - 0.5;
            let from_y = top + (turned_y + half_height) * down - 0.5;
            let colour = image.bilinear(from_x, from_y);
            for channel in 0..3 {
                output[channel * plane + row * width + column] = colour[channel];
            }
        }
    }
}

/// Gain, colour of the light, saturation and gamma.
fn light(output: &mut [f32], random: &mut ChaCha8Rng) {
    let plane = output.len() / 3;
    let gain = random.random_range(-0.35..0.35_f32).exp();
    let tint = [0; 3].map(|_| gain * random.random_range(-0.2..0.2_f32).exp());
    let grey = random.random_bool(0.15);
    let saturation = if grey { 0.0 } else { random.random_range(0.4..1.4_f32) };
    let gamma = random.random_range(-0.45..0.45_f32).exp();
    for pixel in 0..plane {
        let colour = [0, 1, 2].map(|channel| output[channel * plane + pixel]);
        let luma = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2];
        for channel in 0..3 {
            let value = luma + saturation * (colour[channel] - luma);
            output[channel * plane + pixel] = (value * tint[channel]).clamp(0.0, 1.0).powf(gamma);
        }
    }
}

/// A 3 × 3 binomial filter.
fn blur(output: &mut [f32], (width, height): (usize, usize)) {
    for plane in output.chunks_mut(width * height) {
        for row in plane.chunks_mut(width) {
            smooth(row.to_vec(), |column, value| row[column] = value);
        }
        for column in 0..width {
            let line = (0..height).map(|row| plane[row * width + column]).collect();
            smooth(line, |row, value| plane[row * width + column] = value);
        }
    }
}

fn smooth(line: Vec<f32>, mut put: impl FnMut(usize, f32)) {
    let last = line.len() - 1;
    for at in 0..=last {
        let sides = line[at.saturating_sub(1)] + line[(at + 1).min(last)];
        put(at, 0.5 * line[at] + 0.25 * sides);
    }
}

/// A rectangle of one colour over up to a fifth of the image.
fn erase(output: &mut [f32], (width, height): (usize, usize), random: &mut ChaCha8Rng) {
    let (w, h) =
        (random.random_range(width / 8..width / 2), random.random_range(height / 8..height / 2));
    let (left, top) = (random.random_range(0..width - w), random.random_range(0..height - h));
    for plane in output.chunks_mut(width * height) {
        let colour = random.random::<f32>();
        for row in top..top + h {
            plane[row * width + left..row * width + left + w].fill(colour);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_gives_one_variant_in_range_and_others_differ() {
        let bytes: Vec<u8> = (0..=u8::MAX).cycle().step_by(7).take(40 * 30 * 3).collect();
        let image = Pixels { bytes: &bytes, width: 40, height: 30 };
        let variant = |seed: u64| {
            let mut output = vec![f32::NAN; 3 * 32 * 24];
            augment(image, (32, 24), seed, &mut output);
            output
        };
        for seed in 0..50 {
            assert!(variant(seed).iter().all(|value| (0.0..=1.0).contains(value)));
        }
        assert_eq!(variant(3), variant(3));
        assert_ne!(variant(3), variant(4));
    }
}
