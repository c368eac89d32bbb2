//! Gradients of an image, row by row, as orientation and magnitude.

use std::ops::Range;

use pulp::{Simd, bytemuck};

/// Pixels that are computed together, the widest register of any instruction set; rows are padded to it.
pub(super) const LANES: usize = 16;

/// Rows that are visited together, so that sums over rows are loaded and stored less often.
pub(super) const BAND: usize = 4;

/// Length of a row of `width` pixels that can be read in whole groups from any pixel on.
pub(super) const fn padded(width: usize) -> usize {
    width.next_multiple_of(LANES) + LANES
}

/// Walks down an image of `C` interleaved channels and holds the gradients of a few rows at a time.
///
/// The gradient is the central difference, mirrored at the border without repeating the edge (`BORDER_REFLECT_101`).
/// Of several channels the strongest gradient counts; on a tie the last channel wins, then the one before it. Ties
/// are frequent among 8-bit values, so the order of the channels changes the descriptor.
pub(super) struct Gradients<'a, const C: usize> {
    pixels: &'a [[u8; C]],
    width: usize,
    /// Orientations, 0 to π, in units of one bin.
    bins: f32,
    /// Rows y − 1, y and y + 1 (row y at index y mod 3), with a mirrored pixel before the first and after the last.
    rows: [[Vec<f32>; C]; 3],
    /// Orientation of each pixel of the band, row by row, where bin `b` is centred at `b`: from −½ to bins − ½.
    pub(super) position: Vec<f32>,
    /// Length of each gradient of the band.
    pub(super) magnitude: Vec<f32>,
}

impl<'a, const C: usize> Gradients<'a, C> {
    pub(super) fn new(pixels: &'a [[u8; C]], width: usize, bins: usize) -> Self {
        let padded = padded(width);
        let rows = std::array::from_fn(|_| std::array::from_fn(|_| vec![0.0; padded + 2]));
        let [position, magnitude] = [vec![0.0; BAND * padded], vec![0.0; BAND * padded]];
        let mut this = Self { pixels, width, bins: bins as f32, rows, position, magnitude };
        this.load(0);
        this
    }

    /// Computes the gradients of at most [`BAND`] rows; rows must be asked for from the top, each once.
    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    pub(super) fn compute_rows<S: Simd>(&mut self, simd: S, rows: Range<usize>) {
        let top = rows.start;
        for y in rows {
            self.compute_row(simd, y, y - top);
        }
    }

    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    fn compute_row<S: Simd>(&mut self, simd: S, y: usize, place: usize) {
        let height = self.pixels.len() / self.width;
        if y + 1 < height {
            self.load(y + 1);
        }
        let above = if y == 0 { 1 } else { y - 1 };
        let below = if y + 1 == height { y - 1 } else { y + 1 };
        let [above, here, below] = [above, y, below].map(|y| &self.rows[y % 3]);
        let width = padded(self.width);
        let neighbours: [[&[S::f32s]; 4]; C] = std::array::from_fn(|channel| {
            let row = here[channel].as_slice();
            let (above, below) = (&above[channel][1..], &below[channel][1..]);
            [&row[..width], &row[2..], above, below].map(|row| S::as_simd_f32s(&row[..width]).0)
        });
        let half_turn = HalfTurn::new(simd, self.bins);
        let (position, _) = S::as_mut_simd_f32s(&mut self.position[place * width..][..width]);
        let (magnitude, _) = S::as_mut_simd_f32s(&mut self.magnitude[place * width..][..width]);
        for (at, (position, magnitude)) in position.iter_mut().zip(magnitude).enumerate() {
            let [mut dx, mut dy, mut squared] = [simd.splat_f32s(-1.0); 3];
            for [left, right, above, below] in neighbours.iter().rev() {
                let x = simd.sub_f32s(right[at], left[at]);
                let y = simd.sub_f32s(below[at], above[at]);
                let length = simd.add_f32s(simd.mul_f32s(x, x), simd.mul_f32s(y, y));
                let longer = simd.greater_than_f32s(length, squared);
                dx = select(simd, longer, x, dx);
                dy = select(simd, longer, y, dy);
                squared = simd.max_f32s(length, squared);
            }
            *position = half_turn.position(simd, dx, dy);
            *magnitude = simd.sqrt_f32s(squared);
        }
    }

    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    fn load(&mut self, y: usize) {
        let pixels = &self.pixels[y * self.width..][..self.width];
        for (channel, row) in self.rows[y % 3].iter_mut().enumerate() {
            for (value, pixel) in row[1..].iter_mut().zip(pixels) {
                *value = f32::from(pixel[channel]);
            }
            row[0] = row[2];
            row[self.width + 1] = row[self.width - 1];
        }
    }
}

/// From gradients to orientations: constants for the register that `S` has.
struct HalfTurn<S: Simd> {
    /// Coefficients of an odd polynomial for the arc tangent on [0, 1], in bins: those that OpenCV publishes for
    /// `fastAtan2`, within 0.3°.
    arc_tangent: [S::f32s; 4],
    quarter: S::f32s,
    half: S::f32s,
}

impl<S: Simd> HalfTurn<S> {
    #[inline(always)]
    fn new(simd: S, bins: f32) -> Self {
        const ODD: [f32; 4] = [0.999_787_84, -0.325_808_4, 0.155_578_65, -0.044_326_555];
        Self {
            arc_tangent: ODD.map(|it| simd.splat_f32s(it * bins / std::f32::consts::PI)),
            quarter: simd.splat_f32s(bins / 2.0),
            half: simd.splat_f32s(bins),
        }
    }

    /// Orientation modulo half a turn, where bin `b` is centred at `b`.
    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    fn position(&self, simd: S, dx: S::f32s, dy: S::f32s) -> S::f32s {
        let zero = simd.splat_f32s(0.0);
        let x = simd.max_f32s(dx, simd.sub_f32s(zero, dx));
        let y = simd.max_f32s(dy, simd.sub_f32s(zero, dy));
        let tiny = simd.splat_f32s(2.220_446e-16); // no division by zero; the size is OpenCV's
        let tangent = simd.div_f32s(simd.min_f32s(x, y), simd.add_f32s(simd.max_f32s(x, y), tiny));
        let square = simd.mul_f32s(tangent, tangent);
        let [first, third, fifth, seventh] = self.arc_tangent;
        let sum = simd.add_f32s(simd.mul_f32s(seventh, square), fifth);
        let sum = simd.add_f32s(simd.mul_f32s(sum, square), third);
        let sum = simd.add_f32s(simd.mul_f32s(sum, square), first);
        let octant = simd.mul_f32s(sum, tangent);
        let steep = simd.sub_f32s(self.quarter, octant);
        let quadrant = select(simd, simd.less_than_f32s(x, y), steep, octant);
        let falling = simd.less_than_f32s(simd.mul_f32s(dx, dy), zero);
        let angle = select(simd, falling, simd.sub_f32s(self.half, quadrant), quadrant);
        simd.sub_f32s(angle, simd.splat_f32s(0.5))
    }
}

/// One of two values for each lane.
///
/// Stands for pulp's own, which is not inlined into code for a wider instruction set.
#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
fn select<S: Simd>(simd: S, mask: S::m32s, yes: S::f32s, no: S::f32s) -> S::f32s {
    bytemuck::cast(simd.select_u32s(mask, bytemuck::cast(yes), bytemuck::cast(no)))
}
