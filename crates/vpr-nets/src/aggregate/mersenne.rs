//! NumPy's legacy generator of normal numbers, for matrices that published code draws from a seed.

/// Words of the state.
const N: usize = 624;
const M: usize = 397;

/// MT19937 (Matsumoto and Nishimura 1998) with Marsaglia's polar method, as `numpy.random.randn`.
pub(super) struct Normal {
    state: [u32; N],
    next: usize,
    spare: Option<f64>,
}

impl Normal {
    /// `numpy.random.seed(seed)`.
    pub(super) fn new(seed: u32) -> Self {
        let mut state = [seed; N];
        for at in 1..N {
            let before = state[at - 1];
            let at_word = u32::try_from(at).unwrap_or(u32::MAX);
            state[at] =
                1_812_433_253_u32.wrapping_mul(before ^ (before >> 30)).wrapping_add(at_word);
        }
        Self { state, next: N, spare: None }
    }

    fn word(&mut self) -> u32 {
        if self.next == N {
            for at in 0..N {
                let joined =
                    (self.state[at] & 0x8000_0000) | (self.state[(at + 1) % N] & 0x7fff_ffff);
                let odd = if joined & 1 == 1 { 0x9908_b0df } else { 0 };
                self.state[at] = self.state[(at + M) % N] ^ (joined >> 1) ^ odd;
            }
            self.next = 0;
        }
        let mut word = self.state[self.next];
        self.next += 1;
        word ^= word >> 11;
        word ^= (word << 7) & 0x9d2c_5680;
        word ^= (word << 15) & 0xefc6_0000;
        word ^ (word >> 18)
    }

    /// From 0 to below 1, with 53 binary digits.
    fn uniform(&mut self) -> f64 {
        let (high, low) = (self.word() >> 5, self.word() >> 6);
        (f64::from(high) * 67_108_864.0 + f64::from(low)) / 9_007_199_254_740_992.0
    }

    /// One number from N(0, 1).
    pub(super) fn draw(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        loop {
            let (x, y) = (2.0 * self.uniform() - 1.0, 2.0 * self.uniform() - 1.0);
            let squared = x * x + y * y;
            if squared < 1.0 && squared != 0.0 {
                let scale = (-2.0 * squared.ln() / squared).sqrt();
                self.spare = Some(scale * x);
                return scale * y;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `numpy.random.seed(0); numpy.random.randn(2000)[[0, 1, 2, 3, 1999]]`, NumPy 2.
    #[test]
    fn numbers_are_those_of_numpy() {
        let mut normal = Normal::new(0);
        let drawn: Vec<f64> = (0..2000).map(|_| normal.draw()).collect();
        let expected = GOLDEN;
        for (at, value) in expected {
            assert!((drawn[at] - value).abs() < 1e-12, "{at}: {} {value}", drawn[at]);
        }
    }

    const GOLDEN: [(usize, f64); 5] = [
        (0, 1.764_052_345_967_664),
        (1, 0.400_157_208_367_223_3),
        (2, 0.978_737_984_105_739_2),
        (3, 2.240_893_199_201_458),
        (1999, -1.310_970_370_441_212_3),
    ];
}
