//! From descriptors to what the graph holds and compares.

use usearch::{Index, MetricKind, ScalarKind, ffi::Matches};

use super::{HnswCodes, refused};
use crate::{Error, Result, knn::Metric};

/// Turns rows and queries into codes.
pub(super) struct Coder {
    codes: HnswCodes,
    /// Whether vectors are scaled to length one, so that their squared distances order by cosine.
    normalize: bool,
    /// Largest magnitude, sum of squares and number of the values seen.
    seen: (f32, f64, usize),
    /// Length of one step of int8 codes; zero for others, or if all values are zero.
    step: f32,
}

impl Coder {
    pub(super) fn new(metric: Metric, codes: HnswCodes) -> Result<Self> {
        metric_kind(metric)?;
        Ok(Self { codes, normalize: metric == Metric::Cosine, seen: (0.0, 0.0, 0), step: 0.0 })
    }

    pub(super) fn with_step(metric: Metric, codes: HnswCodes, step: f32) -> Result<Self> {
        Ok(Self { step, ..Self::new(metric, codes)? })
    }

    /// Takes notice of the range of some rows of unit length or any.
    pub(super) fn look_at(&mut self, values: &[f32]) {
        if self.normalize || self.codes != HnswCodes::Int8 {
            return;
        }
        let (largest, squares, n) = &mut self.seen;
        for &value in values {
            *largest = largest.max(value.abs());
            *squares += f64::from(value) * f64::from(value);
        }
        *n += values.len();
        let spread = 8.0 * (*squares / *n as f64).sqrt();
        self.step = narrow(f64::from(*largest).min(spread) / 127.0);
    }

    pub(super) fn step(&self) -> f32 {
        self.step
    }

    pub(super) fn add(&self, index: &Index, key: u64, row: &[f32]) -> Result<()> {
        match self.codes {
            HnswCodes::Int8 => index.add(key, &self.int8(row)),
            _ if self.normalize => index.add(key, &normalized(row)),
            _ => index.add(key, row),
        }
        .map_err(refused)
    }

    pub(super) fn search(&self, index: &Index, query: &[f32], count: usize) -> Result<Matches> {
        match self.codes {
            HnswCodes::Int8 => index.search(&self.int8(query), count),
            _ if self.normalize => index.search(&normalized(query), count),
            _ => index.search(query, count),
        }
        .map_err(refused)
    }

    fn int8(&self, values: &[f32]) -> Vec<i8> {
        // A normalized row has a root mean square of 1/√dim.
        let step = if self.normalize {
            let norm = norm(values);
            narrow(norm * (8.0 / (values.len() as f64).sqrt()).min(1.0) / 127.0)
        } else {
            self.step
        };
        let per_step = if step > 0.0 { step.recip() } else { 0.0 };
        values.iter().map(|&value| code(value * per_step)).collect()
    }
}

/// `USearch`'s name for what is compared; of normalized vectors the squared distance.
pub(super) fn metric_kind(metric: Metric) -> Result<MetricKind> {
    match metric {
        Metric::Euclidean | Metric::Cosine => Ok(MetricKind::L2sq),
        Metric::InnerProduct => Ok(MetricKind::IP),
        Metric::Manhattan => {
            let value = "manhattan".to_owned();
            let reason = "is not one of USearch's metrics";
            Err(Error::Parameter { name: "metric", value, reason })
        }
    }
}

/// `USearch`'s name for the codes.
pub(super) fn scalar_kind(codes: HnswCodes) -> ScalarKind {
    match codes {
        HnswCodes::F32 => ScalarKind::F32,
        HnswCodes::F16 => ScalarKind::F16,
        HnswCodes::Int8 => ScalarKind::I8,
    }
}

fn norm(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value) * f64::from(value)).sum::<f64>().sqrt()
}

fn normalized(values: &[f32]) -> Vec<f32> {
    let norm = norm(values);
    let scale = if norm > 0.0 { norm.recip() } else { 0.0 };
    values.iter().map(|&value| narrow(f64::from(value) * scale)).collect()
}

#[expect(clippy::cast_possible_truncation, reason = "codes are coarser than f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}

#[expect(clippy::cast_possible_truncation, reason = "clamped to the range of the codes")]
fn code(steps: f32) -> i8 {
    steps.round_ties_even().clamp(-127.0, 127.0) as i8
}
