//! Reproducible randomness: every object, texture cell and pixel hashes its own name.

/// A point in a tree of random numbers; children are independent of the order they are asked in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seed(u64);

impl Seed {
    pub(crate) const fn new(value: u64) -> Self {
        Self(mix64(value ^ 0x9e37_79b9_7f4a_7c15))
    }

    /// The child with this number.
    pub(crate) const fn at(self, key: i64) -> Self {
        Self(mix64(self.0 ^ (key as u64).wrapping_mul(0xd6e8_feb8_6659_fd93).wrapping_add(1)))
    }

    /// The child with this name.
    pub(crate) fn named(self, name: &str) -> Self {
        name.bytes().fold(self, |seed, byte| seed.at(i64::from(byte)))
    }

    pub(crate) const fn bits(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// Uniform in `0 .. 1`.
    pub(crate) fn unit(self) -> f32 {
        unit(self.bits())
    }

    /// Uniform in `low .. high`.
    pub(crate) fn range(self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// One of `0 .. n`.
    pub(crate) fn index(self, n: usize) -> usize {
        ((u64::from(self.bits()) * n as u64) >> 32) as usize
    }

    pub(crate) fn chance(self, probability: f32) -> bool {
        self.unit() < probability
    }

    pub(crate) fn pick<T: Copy>(self, options: &[T]) -> T {
        options[self.index(options.len())]
    }
}

/// Uniform in `0 .. 1` from 32 random bits.
pub(crate) fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Scrambles 32 bits (the finaliser of "lowbias32").
pub(crate) const fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// A hash of an integer cell.
pub(crate) const fn cell(seed: u32, x: i32, y: i32) -> u32 {
    mix(seed ^ mix((x as u32).wrapping_mul(0x85eb_ca6b) ^ mix((y as u32).wrapping_mul(0xc2b2_ae35))))
}

/// Roughly normal with standard deviation 1, from four uniform bytes pairs; in `-3.5 .. 3.5`.
pub(crate) fn normal(bits: u32) -> f32 {
    let other = mix(bits ^ 0x5bd1_e995);
    let sum = (bits & 0xffff) + (bits >> 16) + (other & 0xffff) + (other >> 16);
    (sum as f32 * (1.0 / 65_536.0) - 2.0) * 1.732
}

const fn mix64(mut x: u64) -> u64 {
    x ^= x >> 30;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 27;
    x = x.wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn children_do_not_depend_on_the_order_they_are_asked_in() {
        let seed = Seed::new(7);
        let forward: Vec<u32> = (0..9).map(|key| seed.at(key).bits()).collect();
        let mut backward: Vec<u32> = (0..9).rev().map(|key| seed.at(key).bits()).collect();
        backward.reverse();
        assert_eq!(forward, backward);
        assert_ne!(seed.named("a").bits(), seed.named("b").bits());
    }

    #[test]
    fn draws_are_uniform_and_normal_enough() {
        let seed = Seed::new(1);
        let n = 20_000;
        let mean = (0..n).map(|key| seed.at(key).unit()).sum::<f32>() / n as f32;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        let variance =
            (0..n).map(|key| normal(seed.at(key).bits()).powi(2)).sum::<f32>() / n as f32;
        assert!((variance - 1.0).abs() < 0.05, "{variance}");
    }
}
