//! What is written beside an index.

use std::{fs, path::Path};

use serde::{Deserialize, Serialize};
use usearch::{Index, IndexOptions};

use super::{
    HnswParams, MeasuredRecall,
    codes::{metric_kind, scalar_kind},
    refused,
};
use crate::{Error, Result, knn::Metric};

/// The description of an index.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sidecar {
    pub(super) metric: Metric,
    pub(super) params: HnswParams,
    pub(super) len: usize,
    pub(super) dim: usize,
    /// Length of one step of int8 codes.
    pub(super) step: f32,
    /// What the rows are of.
    pub(super) source: Option<String>,
    /// Digest of the index file (XXH3, 128 bits).
    pub(super) digest: String,
    pub(super) recall: Option<MeasuredRecall>,
}

/// A description is never longer than this.
const LONGEST: u64 = 1 << 16;

impl Sidecar {
    pub(super) fn new(
        metric: Metric,
        params: &HnswParams,
        (len, dim): (usize, usize),
        step: f32,
        source: Option<String>,
    ) -> Self {
        let (params, digest, recall) = (*params, String::new(), None);
        Self { metric, params, len, dim, step, source, digest, recall }
    }

    pub(super) fn to_json(&self) -> Vec<u8> {
        serde_json::to_vec_pretty(self).expect("text and numbers become JSON")
    }

    pub(super) fn read(path: &Path) -> Result<Self> {
        let length = fs::metadata(path).map_err(Error::io(path))?.len();
        if length > LONGEST {
            let reason = format!("has {length} bytes, more than a description can have");
            return Err(Error::format(path, "description", reason));
        }
        let json = fs::read(path).map_err(Error::io(path))?;
        let sidecar: Self = serde_json::from_slice(&json)
            .map_err(|err| Error::format(path, format!("line {}", err.line()), err.to_string()))?;
        if sidecar.step.is_finite() && sidecar.step >= 0.0 {
            Ok(sidecar)
        } else {
            Err(Error::format(path, "step", "is not a finite positive number"))
        }
    }

    /// An index of this kind without references.
    pub(super) fn empty_index(&self) -> Result<Index> {
        let options = IndexOptions {
            dimensions: self.dim,
            metric: metric_kind(self.metric)?,
            quantization: scalar_kind(self.params.codes),
            connectivity: self.params.connectivity,
            expansion_add: self.params.expansion_add,
            expansion_search: self.params.expansion_search,
            multi: false,
        };
        Index::new(&options).map_err(refused)
    }
}
