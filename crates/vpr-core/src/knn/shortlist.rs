//! The references that can still be among the k nearest of one query.

use crate::Result;

/// A reference and bounds of its key; equal bounds once the key itself is known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) index: usize,
}

/// Candidates of one query, and the key that a reference must not exceed to become one.
///
/// Whatever the order in which references are offered, none of the k nearest is ever dropped: a
/// candidate goes only if k others have upper bounds below its lower bound.
#[derive(Clone, Debug)]
pub(super) struct Shortlist {
    k: usize,
    kept: Vec<Candidate>,
    threshold: f64,
    next_prune: usize,
}

impl Shortlist {
    pub(super) fn new(k: usize) -> Self {
        Self { k, kept: Vec::new(), threshold: f64::INFINITY, next_prune: k }
    }

    /// The k-th smallest upper bound so far: references whose key is above are not needed.
    pub(super) fn threshold(&self) -> f64 {
        self.threshold
    }

    pub(super) fn offer(&mut self, candidate: Candidate) {
        self.kept.push(candidate);
    }

    /// Adds the candidates that another worker found.
    pub(super) fn merge(&mut self, other: Self) {
        self.kept.extend(other.kept);
        self.threshold = self.threshold.min(other.threshold);
    }

    /// Drops what is no longer needed, if enough came in to be worth it.
    ///
    /// If the bounds are too close to tell candidates apart (ties, cancellation), asks `key` for
    /// their keys, so that the list never grows beyond a few k.
    pub(super) fn prune(&mut self, key: impl FnMut(usize) -> Result<f64>) -> Result<()> {
        if self.kept.len() < self.next_prune {
            return Ok(());
        }
        self.drop_hopeless();
        if self.kept.len() > self.k * 4 + 256 {
            self.rescore(key)?;
        }
        self.next_prune = self.kept.len() + 1 + self.k / 16;
        Ok(())
    }

    /// The k nearest, as key and index, nearest first, ties by lower index.
    pub(super) fn finish(
        mut self,
        key: impl FnMut(usize) -> Result<f64>,
    ) -> Result<Vec<(f64, usize)>> {
        self.drop_hopeless();
        self.rescore(key)?;
        Ok(self.kept.iter().map(|candidate| (candidate.lower, candidate.index)).collect())
    }

    fn drop_hopeless(&mut self) {
        if self.kept.len() <= self.k {
            return;
        }
        let (_, kth, _) =
            self.kept.select_nth_unstable_by(self.k - 1, |a, b| a.upper.total_cmp(&b.upper));
        self.threshold = self.threshold.min(kth.upper);
        let threshold = self.threshold;
        self.kept.retain(|candidate| candidate.lower <= threshold);
    }

    /// Replaces bounds by keys and keeps the k nearest, in order.
    fn rescore(&mut self, mut key: impl FnMut(usize) -> Result<f64>) -> Result<()> {
        for candidate in &mut self.kept {
            if candidate.lower.total_cmp(&candidate.upper).is_ne() {
                candidate.lower = key(candidate.index)?;
                candidate.upper = candidate.lower;
            }
        }
        let by_key_then_index =
            |a: &Candidate, b: &Candidate| a.lower.total_cmp(&b.lower).then(a.index.cmp(&b.index));
        self.kept.sort_unstable_by(by_key_then_index);
        self.kept.truncate(self.k);
        if self.kept.len() == self.k {
            self.threshold = self.threshold.min(self.kept[self.k - 1].upper);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn between(lower: f64, upper: f64, index: usize) -> Candidate {
        Candidate { lower, upper, index }
    }

    #[test]
    fn overlapping_bounds_are_settled_by_the_key() {
        let mut list = Shortlist::new(1);
        list.offer(between(1.0, 3.0, 0));
        list.offer(between(2.0, 4.0, 1));
        let keys = [2.9, 2.1];
        assert_eq!(list.finish(|index| Ok(keys[index])).unwrap(), [(2.1, 1)]);
    }

    #[test]
    fn what_cannot_be_near_is_never_rescored() {
        let mut list = Shortlist::new(1);
        list.offer(between(1.0, 2.0, 0));
        list.offer(between(5.0, 6.0, 1));
        let key = |index| if index == 0 { Ok(1.5) } else { panic!("asked for {index}") };
        assert_eq!(list.finish(key).unwrap(), [(1.5, 0)]);
    }

    #[test]
    fn a_flood_of_ties_stays_short_and_breaks_by_index() {
        let mut list = Shortlist::new(3);
        for index in (0..10_000).rev() {
            list.offer(between(0.0, 2.0, index));
            list.prune(|_| Ok(1.0)).unwrap();
            assert!(list.kept.len() <= 3 * 4 + 256 + 1);
        }
        assert_eq!(list.finish(|_| Ok(1.0)).unwrap(), [(1.0, 0), (1.0, 1), (1.0, 2)]);
    }
}
