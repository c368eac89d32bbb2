//! What was retrieved for two sets of images or rows.

use vpr_core::{Descriptors, Ranking, retrieve};

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
}

impl Retrieved {
    /// What one description of queries and references gave.
    pub(super) fn new(
        [queries, references]: [Named; 2],
        ranking: Ranking,
        confidence: Vec<f64>,
        descriptors: Option<(Descriptors, Descriptors)>,
    ) -> Self {
        Self { queries, references, ranking, alone: None, confidence, descriptors }
    }
}

/// The nearest references by Euclidean distance.
pub(super) fn nearest(
    queries: Named,
    references: Named,
    query_rows: Descriptors,
    reference_rows: Descriptors,
    k: usize,
) -> anyhow::Result<Retrieved> {
    let retrieval = retrieve(&query_rows, &reference_rows, k)?;
    let confidence =
        (0..retrieval.len()).map(|query| -f64::from(retrieval.distances(query)[0])).collect();
    let ranking = AsRef::<Ranking>::as_ref(&retrieval).clone();
    let descriptors = Some((query_rows, reference_rows));
    Ok(Retrieved::new([queries, references], ranking, confidence, descriptors))
}
