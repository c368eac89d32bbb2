//! Spatial uncertainty estimation.

use serde::{Deserialize, Serialize};
use vpr_core::Error;

use super::{
    Category, UncertaintyEstimator, check_length, check_ranks,
    spread::{clipped_spread, exponentiate, released_spread, weighted_spread},
};
use crate::{Error as SueError, Places, Result};

/// Spatial uncertainty estimation: how far apart the `k` best references were taken, weighted by
/// how well they match (Zaffar et al., CVPR 2024; thesis §5.2.4).
///
/// `s = trace Σ`, the weighted covariance of the positions (thesis eqs. 5.1–5.3) with weights
/// `exp(−λ d)`, in metres². What that means exactly is in [`SueDefinition`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sue {
    params: SueParams,
}

/// Everything that can be chosen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SueParams {
    /// Number of best references; 10 in the thesis.
    pub k: usize,
    /// Decay of the weights with distance; 350 in the thesis.
    pub lambda: f64,
    /// Which distance decays.
    pub distance: DistanceKind,
    /// Differences of coordinates above this many metres count as this many; none in the thesis'
    /// text, 500 m in the released script, which clips positive differences only.
    pub clip_m: Option<f64>,
    /// Whose formula.
    pub definition: SueDefinition,
}

/// Which distance between descriptors the weights see.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DistanceKind {
    /// `‖f − g‖`, as thesis eq. 5.3 writes.
    Euclidean,
    /// `‖f − g‖²`, as the released data has it (FAISS's `IndexFlatL2`); `λ = 350` belongs to it.
    Squared,
}

/// Three readings of SUE.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SueDefinition {
    /// Exactly the released `sue.py`: x and y only, half of the trace, one-sided clip (so not
    /// invariant to mirroring the map), and [`SueError::Underflow`] where it divides 0 by 0.
    Published,
    /// Thesis eqs. 5.1–5.3 as written, evaluated as written: two or three dimensions, trace,
    /// symmetric clip if any, and [`SueError::Underflow`] where all weights vanish in f64.
    Thesis,
    /// The same value with weights relative to the nearest reference, in the log domain: a limit
    /// exists for descriptors of any scale, and adding a constant to all distances changes nothing.
    Corrected,
}

impl Default for Sue {
    /// [`Sue::corrected`].
    fn default() -> Self {
        Self::corrected()
    }
}

impl Sue {
    /// The released script with its settings: K = 10, λ = 350 on squared distances, 500 m.
    #[must_use]
    pub fn published() -> Self {
        let definition = SueDefinition::Published;
        let distance = DistanceKind::Squared;
        Self {
            params: SueParams { k: 10, lambda: 350.0, distance, clip_m: Some(500.0), definition },
        }
    }

    /// Thesis eqs. 5.1–5.3 with K = 10 and λ = 350 on plain distances, no clip.
    #[must_use]
    pub fn thesis() -> Self {
        let definition = SueDefinition::Thesis;
        let distance = DistanceKind::Euclidean;
        Self { params: SueParams { k: 10, lambda: 350.0, distance, clip_m: None, definition } }
    }

    /// The corrected definition with K = 10 and λ = 350 on squared distances, no clip.
    #[must_use]
    pub fn corrected() -> Self {
        let definition = SueDefinition::Corrected;
        let distance = DistanceKind::Squared;
        Self { params: SueParams { k: 10, lambda: 350.0, distance, clip_m: None, definition } }
    }

    /// Any other choice.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if `k` is zero, or `lambda` or the clip is not positive and finite.
    pub fn new(params: SueParams) -> Result<Self> {
        let refuse =
            |name, value: String, reason| Err(Error::Parameter { name, value, reason }.into());
        if params.k == 0 {
            return refuse("k", "0".to_owned(), "must be at least 1");
        }
        if !(params.lambda.is_finite() && params.lambda > 0.0) {
            return refuse("lambda", params.lambda.to_string(), "must be positive and finite");
        }
        if let Some(clip) = params.clip_m
            && !(clip.is_finite() && clip > 0.0)
        {
            return refuse("clip_m", clip.to_string(), "must be positive and finite");
        }
        Ok(Self { params })
    }

    /// What was chosen.
    #[must_use]
    pub fn params(&self) -> &SueParams {
        &self.params
    }

    /// The uncertainty of one query, or `None` if all its weights are 0. `weights` is scratch.
    fn of_query(&self, places: &Places<'_>, query: usize, weights: &mut [f64]) -> Option<f64> {
        let SueParams { k, lambda, distance, clip_m, definition } = self.params;
        let references = places.retrieval().indices(query).slice_move(ndarray::s![..k]);
        let distances = places.retrieval().distances(query);
        for (weight, &nearby) in weights.iter_mut().zip(distances) {
            *weight = -lambda * distance.of(nearby);
        }
        match definition {
            // The script raises a rounded e to a power.
            SueDefinition::Published => {
                for weight in weights.iter_mut() {
                    *weight = std::f64::consts::E.powf(*weight);
                }
            }
            SueDefinition::Thesis => {
                for weight in weights.iter_mut() {
                    *weight = weight.exp();
                }
            }
            SueDefinition::Corrected => {
                exponentiate(weights);
            }
        }
        if weights.iter().all(|&weight| weight == 0.0) {
            return None;
        }
        Some(match (definition, clip_m) {
            (SueDefinition::Published, clip) => {
                let clip = clip.unwrap_or(f64::INFINITY);
                released_spread(references, places.poses(), weights, clip)
            }
            (_, Some(clip)) => clipped_spread(references, places.poses(), weights, clip),
            (_, None) => weighted_spread(references, places.poses(), weights),
        })
    }
}

impl DistanceKind {
    /// The distance as the weights see it.
    #[must_use]
    pub fn of(self, distance: f32) -> f64 {
        let distance = f64::from(distance);
        match self {
            Self::Euclidean => distance,
            Self::Squared => distance * distance,
        }
    }
}

impl UncertaintyEstimator for Sue {
    type Evidence<'a> = Places<'a>;

    const CATEGORY: Category = Category::Spatial;

    fn name(&self) -> &'static str {
        match self.params.definition {
            SueDefinition::Published => "SUE, as released",
            SueDefinition::Thesis => "SUE, eqs. 5.1–5.3",
            SueDefinition::Corrected => "SUE",
        }
    }

    fn estimate_into(&self, evidence: &Places<'_>, out: &mut [f64]) -> Result<()> {
        check_length(evidence, out)?;
        check_ranks(self.name(), self.params.k, evidence.retrieval().k())?;
        let mut weights = vec![0.0; self.params.k];
        for (query, out) in out.iter_mut().enumerate() {
            *out = self.of_query(evidence, query, &mut weights).ok_or_else(|| {
                SueError::Underflow {
                    query,
                    lambda: self.params.lambda,
                    nearest: self.params.distance.of(evidence.retrieval().distances(query)[0]),
                }
            })?;
        }
        Ok(())
    }
}
