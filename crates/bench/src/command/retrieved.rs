//! What was retrieved for two sets of images or rows.

use vpr_core::{Descriptors, Ranking, Similarities, retrieve};

use super::named::Named;

/// The two sets with what was retrieved.
pub(super) struct Retrieved {
    pub(super) queries: Named,
    pub(super) references: Named,
    pub(super) ranking: Ranking,
    /// Distances of the ranked references; negative similarities for techniques without distances.
    pub(super) distances: Vec<Vec<f64>>,
    /// All similarities, for techniques that compute them.
    pub(super) similarities: Option<Similarities>,
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
        Self {
            queries,
            references,
            ranking,
            distances: Vec::new(),
            similarities: None,
            alone: None,
            confidence,
            descriptors,
        }
    }

    /// The most similar references of a matrix; their distances are negative similarities.
    pub(super) fn of_scores(
        sides: [Named; 2],
        similarities: Similarities,
        k: usize,
    ) -> anyhow::Result<Self> {
        let ranking = similarities.ranked(k)?;
        let scores = similarities.view();
        let of = |query: usize| {
            ranking.indices(query).iter().map(|&reference| -scores[[query, reference]]).collect()
        };
        let distances = (0..ranking.len()).map(of).collect();
        let confidence = similarities.best().confidence;
        let retrieved = Self::new(sides, ranking, confidence, None);
        Ok(Self { distances, similarities: Some(similarities), ..retrieved })
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
    let of = |query: usize| retrieval.distances(query).iter().map(|&it| f64::from(it)).collect();
    let distances: Vec<Vec<f64>> = (0..retrieval.len()).map(of).collect();
    let confidence = distances.iter().map(|it| -it[0]).collect();
    let ranking = AsRef::<Ranking>::as_ref(&retrieval).clone();
    let descriptors = Some((query_rows, reference_rows));
    let retrieved = Retrieved::new([queries, references], ranking, confidence, descriptors);
    Ok(Retrieved { distances, ..retrieved })
}
