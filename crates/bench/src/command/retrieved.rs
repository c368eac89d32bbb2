//! What was retrieved for two sets of images or rows.

use vpr_core::{Descriptors, GroundTruth, Ranking};

use super::named::Named;

/// The two sets with what was retrieved.
pub(super) struct Retrieved {
    pub(super) queries: Named,
    pub(super) references: Named,
    pub(super) ranking: Ranking,
    /// The ranking by descriptors of single images, for networks whose descriptors depend on the batch.
    pub(super) alone: Option<Ranking>,
    /// How sure the best match of each query is; higher is surer.
    pub(super) confidence: Vec<f64>,
    /// Query and reference vectors, for techniques that have one per image.
    pub(super) descriptors: Option<(Descriptors, Descriptors)>,
    /// The truth that came with the images.
    pub(super) truth: Option<GroundTruth>,
}

impl Retrieved {
    /// What one description of queries and references gave.
    pub(super) fn new(
        [queries, references]: [Named; 2],
        ranking: Ranking,
        confidence: Vec<f64>,
        descriptors: Option<(Descriptors, Descriptors)>,
    ) -> Self {
        let (alone, truth) = (None, None);
        Self { queries, references, ranking, alone, confidence, descriptors, truth }
    }
}
