//! Changes of colour, on values in 0 to 1.

use super::Planar;

/// A pixel's red, green and blue.
type Rgb = [f64; 3];

/// Kornia's `rgb_to_grayscale`.
const LUMA: Rgb = [0.299, 0.587, 0.114];
/// Levels of a byte.
const LEVELS: usize = 256;

pub(super) fn brightness(image: &mut Planar, factor: f64) {
    image.each(|value| value + factor - 1.0);
}

pub(super) fn contrast(image: &mut Planar, factor: f64) {
    image.each(|value| value * factor);
}

pub(super) fn saturation(image: &mut Planar, factor: f64) {
    image.pixels(|rgb| {
        let [h, s, v] = hsv(rgb);
        of_hsv([h, (s * factor).clamp(0.0, 1.0), v])
    });
}

/// Turns hues; `turns` is a share of the circle.
pub(super) fn hue(image: &mut Planar, turns: f64) {
    image.pixels(|rgb| {
        let [h, s, v] = hsv(rgb);
        of_hsv([(h + turns).rem_euclid(1.0), s, v])
    });
}

pub(super) fn grayscale(image: &mut Planar) {
    image.pixels(|rgb| [rgb.iter().zip(LUMA).map(|(value, share)| value * share).sum(); 3]);
}

pub(super) fn gamma(image: &mut Planar, gamma: f64, gain: f64) {
    image.each(|value| gain * value.powf(gamma));
}

/// Keeps the highest bits of every byte.
pub(super) fn posterize(image: &mut Planar, bits: u32) {
    let mask = !u8::MAX.checked_shr(bits).unwrap_or(0);
    image.each(|value| f64::from(super::byte(255.0 * value) & mask) / 255.0);
}

/// Kornia's `equalize`, that of Pillow: every channel by its own histogram, with the table's
/// integer divisions.
pub(super) fn equalize(image: &mut Planar) {
    for plane in image.planes_mut() {
        let mut counts = [0_usize; LEVELS];
        for value in plane.iter() {
            counts[usize::from(super::byte(255.0 * value))] += 1;
        }
        let last = counts.iter().rev().find(|count| **count > 0).copied().unwrap_or(0);
        let step = (plane.len() - last) / (LEVELS - 1);
        if step == 0 {
            continue;
        }
        // The table begins with 0: a level gets what is below it.
        let mut below = 0;
        let table = counts.map(|count| {
            let level = (below + step / 2) / step;
            below += count;
            level.min(LEVELS - 1) as f64 / 255.0
        });
        for value in plane.iter_mut() {
            *value = table[usize::from(super::byte(255.0 * *value))];
        }
    }
}

/// Kornia's `RandomSnow`: what is darker than `coefficient` becomes `brightness` times as light.
pub(super) fn snow(image: &mut Planar, coefficient: f64, brightness: f64) {
    image.pixels(|rgb| {
        let [h, l, s] = hls(rgb);
        if l < coefficient { of_hls([h, (l * brightness).clamp(0.0, 1.0), s]) } else { rgb }
    });
}

/// Hue in 0 to 1, saturation, value.
fn hsv(rgb: Rgb) -> [f64; 3] {
    let (most, least) = extremes(rgb);
    [turn(rgb, most, most - least), if most > 0.0 { (most - least) / most } else { 0.0 }, most]
}

fn of_hsv([h, s, v]: [f64; 3]) -> Rgb {
    // How far each colour's hue is from this one, in sixths.
    [5.0, 3.0, 1.0].map(|n| {
        let k = (n + 6.0 * h).rem_euclid(6.0);
        v - v * s * k.min(4.0 - k).clamp(0.0, 1.0)
    })
}

/// Hue in 0 to 1, lightness, saturation.
fn hls(rgb: Rgb) -> [f64; 3] {
    let (most, least) = extremes(rgb);
    let (range, lightness) = (most - least, f64::midpoint(most, least));
    let room = 1.0 - (2.0 * lightness - 1.0).abs();
    [turn(rgb, most, range), lightness, if room > 0.0 { range / room } else { 0.0 }]
}

fn of_hls([h, l, s]: [f64; 3]) -> Rgb {
    let reach = s * l.min(1.0 - l);
    [0.0, 8.0, 4.0].map(|n| {
        let k = (n + 12.0 * h).rem_euclid(12.0);
        l - reach * (k - 3.0).min(9.0 - k).clamp(-1.0, 1.0)
    })
}

fn extremes(rgb: Rgb) -> (f64, f64) {
    let most = rgb.into_iter().fold(f64::NEG_INFINITY, f64::max);
    (most, rgb.into_iter().fold(f64::INFINITY, f64::min))
}

/// The hue, in 0 to 1; 0 for grey.
fn turn([r, g, b]: Rgb, most: f64, range: f64) -> f64 {
    if range <= 0.0 {
        return 0.0;
    }
    let sixths = if most == r {
        (g - b) / range
    } else if most == g {
        (b - r) / range + 2.0
    } else {
        (r - g) / range + 4.0
    };
    (sixths / 6.0).rem_euclid(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_survive_the_way_there_and_back() {
        for r in 0..6 {
            for g in 0..6 {
                for b in 0..6 {
                    let rgb = [r, g, b].map(|it| f64::from(it) / 5.0);
                    for back in [of_hsv(hsv(rgb)), of_hls(hls(rgb))] {
                        let gap = rgb.iter().zip(back).map(|(a, b)| (a - b).abs());
                        assert!(gap.fold(0.0, f64::max) < 1e-12, "{rgb:?} {back:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn known_colours_have_known_hues() {
        let close = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(close(hsv([0.0, 1.0, 0.0]), [1.0 / 3.0, 1.0, 1.0]));
        assert!(close(hsv([0.2, 0.2, 0.4]), [2.0 / 3.0, 0.5, 0.4]));
        assert!(close(hls([1.0, 0.5, 0.5]), [0.0, 0.75, 1.0]));
        assert!(close(hls([0.3, 0.3, 0.3]), [0.0, 0.3, 0.0]));
    }
}
