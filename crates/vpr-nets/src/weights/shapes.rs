//! Sizes of a network, read off the shapes of its weights.

use crate::weights::Weights;
use crate::{Error, Mismatch, Result};

/// The weights below a prefix, asked for their shapes.
pub(crate) struct Shapes<'a> {
    weights: &'a Weights,
    prefix: &'a str,
}

impl<'a> Shapes<'a> {
    pub(crate) fn new(weights: &'a Weights, prefix: &'a str) -> Self {
        Self { weights, prefix }
    }

    pub(crate) fn has(&self, key: &str) -> bool {
        self.weights.get(&self.key(key)).is_some()
    }

    /// Length of an axis of the tensor `key`.
    pub(crate) fn axis(&self, key: &str, axis: usize) -> Result<usize> {
        let key = self.key(key);
        let Some(tensor) = self.weights.get(&key) else {
            let mismatch = Mismatch { missing: vec![key], ..Default::default() };
            let path = self.weights.path().to_owned();
            return Err(Error::Weights { path, mismatch: Box::new(mismatch) });
        };
        tensor.shape.get(axis).copied().ok_or_else(|| {
            let reason = format!("has {} axes, expected at least {}", tensor.shape.len(), axis + 1);
            self.refuse(&key, reason)
        })
    }

    /// How many of `key(0)`, `key(1)`, … there are without a gap.
    pub(crate) fn count(&self, key: impl Fn(usize) -> String) -> usize {
        let mut count = 0;
        while self.has(&key(count)) {
            count += 1;
        }
        count
    }

    /// The side of a square of `count` cells.
    pub(crate) fn side(&self, key: &str, count: usize) -> Result<usize> {
        let side = count.isqrt();
        if side * side == count {
            return Ok(side);
        }
        Err(self.refuse(&self.key(key), format!("{count} positions are no square grid")))
    }

    fn refuse(&self, key: &str, reason: String) -> Error {
        Error::format(self.weights.path(), key, reason)
    }

    fn key(&self, key: &str) -> String {
        format!("{}{key}", self.prefix)
    }
}
