//! Region-VLAD: what the strongest regions of a feature map add to a vocabulary.

use vpr_core::{Definition, Descriptors};

/// Khaliq et al., *A Holistic Visual Place Recognition Approach Using Lightweight CNNs for Significant
/// Viewpoint and Appearance Changes* (2020), with 400 regions and 256 words, as VPR-Bench runs it.
///
/// Regions are 8-connected positions of one channel, ordered by their mean activation; each is
/// described by the sum of all channels over its bounding box. Differences to the words are summed,
/// square-rooted with their signs, and scaled to unit length as a whole.
///
/// With `Published`, connected positions are those whose activations have the same whole part, not
/// zero: what scikit-image's `label` makes of a map of fractions. Of several regions with the same
/// energy the first one's box is taken each time, and where there are fewer than 400 regions, zeros
/// stand for the others. With `Corrected`, connected positions are those that are not zero, each
/// region has its own box, and there are no zeros.
#[derive(Clone, Debug)]
pub struct Regions {
    words: Descriptors,
    definition: Definition,
}

/// The rows and columns of a box, and the mean activation of the positions of its region.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Region {
    top: usize,
    bottom: usize,
    left: usize,
    right: usize,
    energy: f32,
}

impl Regions {
    /// Regions of an image.
    pub const COUNT: usize = 400;
    /// Words of the vocabulary.
    pub const WORDS: usize = 256;
    /// Channels of `conv3`.
    pub const CHANNELS: usize = 384;

    /// Regions under a vocabulary, `words × channels`.
    #[must_use]
    pub fn new(words: Descriptors, definition: Definition) -> Self {
        Self { words, definition }
    }

    /// The descriptor of a map, `channels × rows × columns`: `words · channels`, of unit length.
    ///
    /// # Panics
    ///
    /// If the map has other channels than the words.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "descriptors are f32")]
    pub fn describe(&self, map: &[f32], [rows, columns]: [usize; 2]) -> Vec<f32> {
        let (area, dim) = (rows * columns, self.words.dim());
        assert_eq!(map.len(), area * dim, "a map of the vocabulary's channels");
        let planes: Vec<&[f32]> = map.chunks_exact(area).collect();
        let mut regions: Vec<Region> = planes
            .iter()
            .flat_map(|plane| found(plane, [rows, columns], self.definition))
            .collect();
        // The sort is stable: of equals, the first channel and position stays first.
        regions.sort_by(|a, b| b.energy.total_cmp(&a.energy));
        regions.truncate(Self::COUNT);
        if self.definition == Definition::Published {
            for at in 1..regions.len() {
                if regions[at].energy == regions[at - 1].energy {
                    regions[at] = regions[at - 1];
                }
            }
        }
        let mut residuals = vec![0.0_f64; self.words.len() * dim];
        let mut add = |features: &[f64]| {
            let word = self.nearest(features);
            let sums = residuals[word * dim..].iter_mut().zip(features).zip(self.words.row(word));
            sums.for_each(|((sum, x), c)| *sum += x - f64::from(*c));
        };
        let mut features = vec![0.0; dim];
        for region in &regions {
            for (sum, plane) in features.iter_mut().zip(&planes) {
                let row =
                    |y: usize| plane[y * columns + region.left..y * columns + region.right].iter();
                *sum = (region.top..region.bottom).flat_map(row).map(|&it| f64::from(it)).sum();
            }
            add(&features);
        }
        if self.definition == Definition::Published {
            features.fill(0.0);
            (regions.len()..Self::COUNT).for_each(|_| add(&features));
        }
        for value in &mut residuals {
            *value = value.signum() * value.abs().sqrt();
        }
        let norm = residuals.iter().map(|it| it * it).sum::<f64>().sqrt();
        let norm = if norm > 0.0 { norm } else { 1.0 };
        residuals.iter().map(|it| (it / norm) as f32).collect()
    }

    /// The nearest word; of equals the first.
    fn nearest(&self, features: &[f64]) -> usize {
        let squared = |word: usize| -> f64 {
            let pairs = features.iter().zip(self.words.row(word));
            pairs.map(|(x, c)| (x - f64::from(*c)).powi(2)).sum()
        };
        let mut best = (0, f64::INFINITY);
        for word in 0..self.words.len() {
            let distance = squared(word);
            if distance < best.1 {
                best = (word, distance);
            }
        }
        best.0
    }
}

/// The regions of one channel, by their first positions.
fn found(plane: &[f32], [rows, columns]: [usize; 2], definition: Definition) -> Vec<Region> {
    // What is 0 belongs to no region.
    let label = |value: f32| match definition {
        Definition::Published => value.trunc(),
        Definition::Corrected => f32::from(u8::from(value != 0.0)),
    };
    let mut seen = vec![false; plane.len()];
    let mut regions = Vec::new();
    for start in 0..plane.len() {
        let own = label(plane[start]);
        if seen[start] || own == 0.0 {
            continue;
        }
        seen[start] = true;
        let (mut open, mut members) = (vec![start], Vec::new());
        while let Some(at) = open.pop() {
            members.push(at);
            let (y, x) = (at / columns, at % columns);
            for near_y in y.saturating_sub(1)..(y + 2).min(rows) {
                for near_x in x.saturating_sub(1)..(x + 2).min(columns) {
                    let near = near_y * columns + near_x;
                    if !seen[near] && label(plane[near]) == own {
                        seen[near] = true;
                        open.push(near);
                    }
                }
            }
        }
        members.sort_unstable();
        let sum: f64 = members.iter().map(|&at| f64::from(plane[at])).sum();
        let side = |of: fn(usize, usize) -> usize| {
            let places = members.iter().map(move |&at| of(at, columns));
            places.fold((usize::MAX, 0), |(low, high), it| (low.min(it), high.max(it + 1)))
        };
        let ((top, bottom), (left, right)) =
            (side(|at, columns| at / columns), side(|at, columns| at % columns));
        #[expect(clippy::cast_possible_truncation, reason = "activations are f32")]
        let energy = (sum / members.len() as f64) as f32;
        regions.push(Region { top, bottom, left, right, energy });
    }
    regions
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two regions by their whole parts touch: one region of what is not zero. A fraction below one
    /// is nothing to the released code.
    #[test]
    fn regions_are_those_of_either_definition() {
        #[rustfmt::skip]
        let plane = [
            1.5, 1.2, 0.0, 0.4,
            0.0, 2.5, 0.0, 0.0,
            0.0, 0.0, 0.0, 3.0,
        ];
        let region = |top, bottom, left, right, energy| Region { top, bottom, left, right, energy };
        assert_eq!(
            found(&plane, [3, 4], Definition::Published),
            [region(0, 1, 0, 2, 1.35), region(1, 2, 1, 2, 2.5), region(2, 3, 3, 4, 3.0)]
        );
        #[expect(clippy::cast_possible_truncation, reason = "activations are f32")]
        let energy = ((1.5_f64 + f64::from(1.2_f32) + 2.5) / 3.0) as f32;
        assert_eq!(
            found(&plane, [3, 4], Definition::Corrected),
            [region(0, 2, 0, 2, energy), region(0, 1, 3, 4, 0.4), region(2, 3, 3, 4, 3.0)]
        );
    }
}
