//! Matches that VPR-Bench's authors stored: score matrices of ten techniques.

use std::sync::Arc;

use vpr_core::{BestMatches, GroundTruth, Provenance, Result, metrics::Timing};
use vpr_data::layout::vpr_bench::PublishedMatches;

use crate::{Scores, Sources, Technique};

/// Matches that the authors stored, with the ground truth they are judged by.
#[derive(Debug)]
pub struct Stored {
    /// Similarity of every query with every reference, and the best references as stored.
    pub scores: Arc<Scores>,
    /// Encoding and matching time as stored, in seconds.
    pub timing: Timing,
    /// Which references are correct.
    pub truth: Arc<GroundTruth>,
    /// Entries of the ground truth that point past the references (VB-15).
    pub n_clamped: usize,
    /// `published`, or `generated` for matches that were made up.
    pub provenance: Provenance,
}

impl Stored {
    /// What to say of a ground truth that points past the references (VB-15).
    #[must_use]
    pub fn note(&self) -> Option<String> {
        clamped(self.n_clamped)
    }
}

/// What to say of a ground truth that points past the references (VB-15).
pub(crate) fn clamped(n: usize) -> Option<String> {
    (n > 0).then(|| {
        format!("{n} entries of the ground truth point past the references and are dropped")
    })
}

impl Sources<'_> {
    /// The matches stored for a technique; `None` if they or their ground truth are not at hand.
    ///
    /// # Errors
    ///
    /// If a file is there but cannot be read, or the matches and the truth do not fit.
    pub fn stored(&self, id: &str, technique: Technique) -> Result<Option<Arc<Stored>>> {
        self.stored.get_or((id.to_owned(), technique), || self.read_stored(id, technique))
    }

    fn read_stored(&self, id: &str, technique: Technique) -> Result<Option<Arc<Stored>>> {
        let entry = self.entry(id)?;
        let Some(folder) = &entry.matches else { return Ok(None) };
        let file = folder.join(technique.stored_name()).join("precomputed_data_corrected.npy");
        let (Some(path), Some(truth)) = (self.locate(&file)?, self.ground_truth(id)?) else {
            return Ok(None);
        };
        let matches = PublishedMatches::read(&path)?;
        let truth = truth.about(matches.similarities.n_queries())?;
        let (truth, n_clamped) = truth.truth(matches.similarities.n_references())?;
        let timing = Timing { encoding: matches.encode_s, matching: matches.match_s };
        let best = BestMatches { reference: matches.reference, confidence: matches.score };
        let provenance = match entry.provenance {
            Provenance::Generated => Provenance::Generated,
            _ => Provenance::Published,
        };
        let scores = Arc::new(Scores::new(matches.similarities, None).with_best(best));
        let truth = Arc::new(truth);
        Ok(Some(Arc::new(Stored { scores, timing, truth, n_clamped, provenance })))
    }
}
