//! Triplets of a batch.

use ndarray::ArrayView2;

/// Which images of other places a pair is held against.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Negatives {
    /// The nearest that is farther than the positive; if there is none, the farthest (Schroff,
    /// Kalenichenko and Philbin, CVPR 2015, section 3.2).
    #[default]
    SemiHard,
    /// The nearest.
    Hard,
}

/// Row numbers, one entry per triplet.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Triplets {
    /// What is compared.
    pub anchors: Vec<usize>,
    /// Another image of the same place.
    pub positives: Vec<usize>,
    /// An image of another place.
    pub negatives: Vec<usize>,
}

/// One triplet for every ordered pair of images of one place, in the order of rows: `descriptors`
/// is `n × dimension`, `places` says what each row shows. Ties go to the lower row; rows beyond
/// `places` are ignored.
#[must_use]
pub fn mine(descriptors: ArrayView2<'_, f32>, places: &[usize], rule: Negatives) -> Triplets {
    let n = places.len().min(descriptors.nrows());
    let mut triplets = Triplets::default();
    for anchor in 0..n {
        let distances: Vec<f32> = (0..n)
            .map(|other| {
                let difference = &descriptors.row(anchor) - &descriptors.row(other);
                difference.dot(&difference)
            })
            .collect();
        let mut others: Vec<usize> = (0..n).filter(|&it| places[it] != places[anchor]).collect();
        // Stable, so equal distances stay in the order of rows.
        others.sort_by(|&a, &b| distances[a].total_cmp(&distances[b]));
        let (Some(&nearest), Some(&farthest)) = (others.first(), others.last()) else { continue };
        for positive in (0..n).filter(|&it| it != anchor && places[it] == places[anchor]) {
            let beyond = || others.partition_point(|&it| distances[it] <= distances[positive]);
            let negative = match rule {
                Negatives::SemiHard => others.get(beyond()).copied().unwrap_or(farthest),
                Negatives::Hard => nearest,
            };
            triplets.anchors.push(anchor);
            triplets.positives.push(positive);
            triplets.negatives.push(negative);
        }
    }
    triplets
}

#[cfg(test)]
mod tests {
    use ndarray::array;

    use super::*;

    #[test]
    fn all_pairs_meet_the_negative_of_the_rule() {
        // Place 0 at 0 and 2; place 1 at 1 and 5; place 2 alone at 9.
        let rows = array![[0.0], [2.0], [1.0], [5.0], [9.0_f32]];
        let places = [0, 0, 1, 1, 2];
        let semi_hard = mine(rows.view(), &places, Negatives::SemiHard);
        assert_eq!(semi_hard.anchors, [0, 1, 2, 3]);
        assert_eq!(semi_hard.positives, [1, 0, 3, 2]);
        // From 0 the positive is 2 away, the next beyond it is at 5. From 5 it is 4 away: nothing
        // but 0 is beyond, as 9 is as far.
        assert_eq!(semi_hard.negatives, [3, 3, 4, 0]);
        let hard = mine(rows.view(), &places, Negatives::Hard);
        assert_eq!(hard.negatives, [2, 2, 0, 1]);
    }

    #[test]
    fn without_a_farther_negative_the_farthest_is_taken() {
        let rows = array![[0.0], [9.0], [1.0], [2.0_f32]];
        let triplets = mine(rows.view(), &[7, 7, 8, 9], Negatives::SemiHard);
        assert_eq!(triplets.negatives[0], 3);
    }

    #[test]
    fn a_batch_without_pairs_has_no_triplets() {
        let rows = array![[0.0], [1.0_f32]];
        assert_eq!(mine(rows.view(), &[0, 1], Negatives::Hard), Triplets::default());
        assert_eq!(mine(rows.view(), &[0, 0], Negatives::Hard), Triplets::default());
    }
}
