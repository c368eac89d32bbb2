//! Words on signs: a five by seven dot font and names made of syllables.

use glam::Vec2;

use crate::seed::{Seed, mix};

/// Rows from the top, five bits each, A to Z.
const LETTERS: [[u8; 7]; 26] = [
    [14, 17, 17, 31, 17, 17, 17],
    [30, 17, 17, 30, 17, 17, 30],
    [14, 17, 16, 16, 16, 17, 14],
    [30, 17, 17, 17, 17, 17, 30],
    [31, 16, 16, 30, 16, 16, 31],
    [31, 16, 16, 30, 16, 16, 16],
    [14, 17, 16, 23, 17, 17, 15],
    [17, 17, 17, 31, 17, 17, 17],
    [14, 4, 4, 4, 4, 4, 14],
    [7, 2, 2, 2, 2, 18, 12],
    [17, 18, 20, 24, 20, 18, 17],
    [16, 16, 16, 16, 16, 16, 31],
    [17, 27, 21, 21, 17, 17, 17],
    [17, 25, 21, 19, 17, 17, 17],
    [14, 17, 17, 17, 17, 17, 14],
    [30, 17, 17, 30, 16, 16, 16],
    [14, 17, 17, 17, 21, 18, 13],
    [30, 17, 17, 30, 20, 18, 17],
    [15, 16, 16, 14, 1, 1, 30],
    [31, 4, 4, 4, 4, 4, 4],
    [17, 17, 17, 17, 17, 17, 14],
    [17, 17, 17, 17, 17, 10, 4],
    [17, 17, 17, 21, 21, 27, 17],
    [17, 17, 10, 4, 10, 17, 17],
    [17, 17, 10, 4, 4, 4, 4],
    [31, 1, 2, 4, 8, 16, 31],
];

const SYLLABLES: [&[u8]; 24] = [
    b"BAR", b"CAFE", b"KO", b"MA", b"RI", b"SU", b"TEN", b"LO", b"VE", b"NOR", b"PA", b"DI",
    b"GEL", b"HUT", b"WIN", b"ZO", b"FEN", b"TA", b"JUS", b"MOR", b"EX", b"QUI", b"OLD", b"YA",
];

/// Ink, 0 or 1, of a name that fills a sign `aspect` times as wide as high; `at` is 0 to 1.
pub(crate) fn line(seed: u32, at: Vec2, aspect: f32) -> f32 {
    let mut name = [0_u8; 12];
    let length = spell(seed, &mut name);
    // One letter cell is 6 × 9 dots including its margins.
    let dots = 9.0;
    let wide = aspect * dots;
    let scale = ((6 * length + 1) as f32 / wide).max(1.0);
    let x = (at.x - 0.5) * wide * scale + 3.0 * length as f32;
    let y = (0.5 - at.y) * dots * scale + 3.5;
    if x < 0.0 || !(0.0..7.0).contains(&y) {
        return 0.0;
    }
    let (letter, column) = ((x / 6.0) as usize, (x % 6.0) as u32);
    if letter >= length || column == 5 {
        return 0.0;
    }
    let row = LETTERS[usize::from(name[letter] - b'A')][y as usize];
    f32::from((row >> (4 - column)) & 1)
}

fn spell(seed: u32, name: &mut [u8; 12]) -> usize {
    let seed = Seed::new(u64::from(mix(seed)));
    let mut length = 0;
    for syllable in 0..2 + seed.at(0).index(2) as i64 {
        for &letter in seed.at(syllable + 1).pick(&SYLLABLES) {
            name[length] = letter;
            length += 1;
        }
    }
    length
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_differ_and_have_ink() {
        let ink = |seed: u32| -> Vec<bool> {
            (0..60 * 8)
                .map(|k| {
                    line(seed, Vec2::new((k % 60) as f32 / 60.0, (k / 60) as f32 / 8.0), 6.0) > 0.5
                })
                .collect()
        };
        assert!(ink(1).iter().filter(|&&dot| dot).count() > 40);
        assert_ne!(ink(1), ink(2));
    }
}
