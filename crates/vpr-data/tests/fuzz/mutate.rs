//! Ways to damage a file.

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

/// Numbers that lengths, shapes and counts are replaced by.
const NUMBERS: [&str; 10] = [
    "0",
    "-1",
    "1e999",
    "NaN",
    "4294967296",
    "18446744073709551615",
    "99999999999999999999",
    "1",
    "",
    "0.0000000000000000001",
];

fn position(len: usize, rng: &mut ChaCha8Rng) -> usize {
    if len == 0 { 0 } else { rng.random_range(0..len) }
}

/// The file up to some byte.
pub(crate) fn truncated(seed: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    seed[..position(seed.len(), rng)].to_vec()
}

/// The file with one bit the other way.
pub(crate) fn bit_flipped(seed: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    let at = position(bytes.len(), rng);
    if let Some(byte) = bytes.get_mut(at) {
        *byte ^= 1 << rng.random_range(0..8);
    }
    bytes
}

/// The file after a few rougher changes.
pub(crate) fn mangled(seed: &[u8], seeds: &[Vec<u8>], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..rng.random_range(1..5) {
        let at = position(bytes.len(), rng);
        let end = (at + rng.random_range(1..17)).min(bytes.len());
        match rng.random_range(0..8) {
            0 => bytes[at..end].fill(0),
            1 => bytes[at..end].fill(0xff),
            2 => bytes[at..end].iter_mut().for_each(|byte| *byte = rng.random()),
            3 => drop(bytes.drain(at..end)),
            4 => {
                let piece = bytes[at..end].to_vec();
                let to = position(bytes.len(), rng);
                drop(bytes.splice(to..to, piece));
            }
            5 => replace_number(&mut bytes, at, rng),
            6 => {
                let other = &seeds[position(seeds.len(), rng)];
                let from = position(other.len(), rng);
                bytes.truncate(at);
                bytes.extend(&other[from..]);
            }
            _ => {
                drop(bytes.splice(at..at, [b'[', b'(', b'{', b'@', b',', b'\n', 0x80]));
            }
        }
    }
    bytes
}

/// The next number in decimal digits becomes another one.
fn replace_number(bytes: &mut Vec<u8>, at: usize, rng: &mut ChaCha8Rng) {
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit).map(|n| at + n) else {
        return;
    };
    let digits = bytes[start..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let number = NUMBERS[rng.random_range(0..NUMBERS.len())];
    bytes.splice(start..start + digits, number.bytes());
}
