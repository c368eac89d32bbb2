//! Gradients of an image, row by row, as orientation and magnitude.

use pulp::{Simd, cast};

/// Rows are padded to a multiple of this, the widest register of any instruction set.
pub(super) const LANES: usize = 16;

/// Walks down an image of `C` interleaved channels and holds the gradients of one row at a time.
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
    /// Orientation of each pixel of the row, where bin `b` is centred at `b`: from −½ to bins − ½.
    pub(super) position: Vec<f32>,
    /// Length of each gradient of the row.
    pub(super) magnitude: Vec<f32>,
}

impl<'a, const C: usize> Gradients<'a, C> {
    pub(super) fn new(pixels: &'a [[u8; C]], width: usize, bins: usize) -> Self {
        let padded = width.next_multiple_of(LANES);
        let rows = std::array::from_fn(|_| std::array::from_fn(|_| vec![0.0; padded + 2]));
        let [position, magnitude] = [vec![0.0; padded], vec![0.0; padded]];
        let mut this = Self { pixels, width, bins: bins as f32, rows, position, magnitude };
        this.load(0);
        this
    }

    /// Computes the gradients of row `y`; rows must be asked for from the top, one after the other.
    #[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
    #[inline(always)]
    pub(super) fn compute_row<S: Simd>(&mut self, simd: S, y: usize) {
        let height = self.pixels.len() / self.width;
        if y + 1 < height {
            self.load(y + 1);
        }
        let above = if y == 0 { 1 } else { y - 1 };
        let below = if y + 1 == height { y - 1 } else { y + 1 };
        let [above, here, below] = [above, y, below].map(|y| &self.rows[y % 3]);
        let channels: [[&[S::f32s]; 4]; C] = std::array::from_fn(|channel| {
            let row = here[channel].as_slice();
            [row, &row[2..], &above[channel][1..], &below[channel][1..]].map(|row| S::as_simd_f32s(row).0)
        });
        let (position, _) = S::as_mut_simd_f32s(&mut self.position);
        let (magnitude, _) = S::as_mut_simd_f32s(&mut self.magnitude);
        for (at, (position, magnitude)) in position.iter_mut().zip(magnitude).enumerate() {
            let [mut dx, mut dy, mut squared] = [simd.splat_f32s(-1.0); 3];
            for [left, right, above, below] in channels.iter().rev() {
                let x = simd.sub_f32s(right[at], left[at]);
                let y = simd.sub_f32s(below[at], above[at]);
                let length = simd.add_f32s(simd.mul_f32s(x, x), simd.mul_f32s(y, y));
                let longer = simd.greater_than_f32s(length, squared);
                dx = select(simd, longer, x, dx);
                dy = select(simd, longer, y, dy);
                squared = select(simd, longer, length, squared);
            }
            *position = simd.sub_f32s(orientation(simd, dx, dy, self.bins), simd.splat_f32s(0.5));
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

/// Angle of a gradient modulo π, in bins, by the odd polynomial that OpenCV's `fastAtan2` publishes (within 0.3°).
#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
fn orientation<S: Simd>(simd: S, dx: S::f32s, dy: S::f32s, bins: f32) -> S::f32s {
    const ODD: [f32; 4] = [0.999_787_84, -0.325_808_4, 0.155_578_65, -0.044_326_555];
    let (x, y) = (abs(simd, dx), abs(simd, dy));
    let long = simd.add_f32s(simd.max_f32s(x, y), simd.splat_f32s(f64::EPSILON as f32));
    let tangent = simd.div_f32s(simd.min_f32s(x, y), long);
    let square = simd.mul_f32s(tangent, tangent);
    let scaled = ODD.map(|it| simd.splat_f32s(it * bins / std::f32::consts::PI));
    let horner = |sum, coefficient| simd.add_f32s(simd.mul_f32s(sum, square), coefficient);
    let sum = horner(horner(horner(scaled[3], scaled[2]), scaled[1]), scaled[0]);
    let octant = simd.mul_f32s(sum, tangent);
    let steep = simd.sub_f32s(simd.splat_f32s(bins / 2.0), octant);
    let quadrant = select(simd, simd.less_than_f32s(x, y), steep, octant);
    let falling = simd.less_than_f32s(simd.mul_f32s(dx, dy), simd.splat_f32s(0.0));
    select(simd, falling, simd.sub_f32s(simd.splat_f32s(bins), quadrant), quadrant)
}

/// One of two values for each lane.
///
/// This and [`abs`] stand for pulp's own, which are not inlined into code for a wider instruction set.
#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
fn select<S: Simd>(simd: S, mask: S::m32s, yes: S::f32s, no: S::f32s) -> S::f32s {
    cast(simd.select_u32s(mask, cast(yes), cast(no)))
}

#[expect(clippy::inline_always, reason = "takes the instruction set of the caller")]
#[inline(always)]
pub(super) fn abs<S: Simd>(simd: S, value: S::f32s) -> S::f32s {
    simd.max_f32s(value, simd.sub_f32s(simd.splat_f32s(0.0), value))
}
