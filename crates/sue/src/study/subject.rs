//! Datasets under encoders, and the uncertainties of their matches.

use serde::Deserialize;
use std::sync::Arc;

use vpr_core::{Definition, Evaluation, Judged, Provenance, metrics::effective};
use vpr_report::table::{Cell, Table};
use vpr_study::verification::{LocalMethod, Verified};

use super::Context;
use crate::{
    Error, EstimatorChoice, EstimatorSettings, InlierCounts, Inliers, Result, UncertaintyEstimator,
    corpus::{COUNTERPARTS, Corpus},
    net::Learned,
};

/// One dataset, the encoders that see it, and how its matches are verified.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Subject {
    /// Id of the manifest, `world/…`, or the name of a counterpart.
    pub dataset: String,
    /// `hog`, `cohog`, `published`, or an encoder by name.
    pub encoders: Vec<String>,
    /// Local methods for geometric verification; what takes long is left to few.
    #[serde(default)]
    pub verify: Vec<LocalMethod>,
    /// Learned uncertainties; shown beside the first encoder.
    #[serde(default)]
    pub learned: Vec<Learned>,
}

/// A dataset under an encoder that predicts variances, or why there is none.
pub(super) type LearnedCorpus = (Learned, Result<Arc<Corpus>, String>);

/// One corpus with its row label.
pub(super) struct Labelled {
    /// Row label.
    pub(super) row: String,
    pub(super) corpus: Arc<Corpus>,
    /// The same dataset under encoders that predict variances, or why there is none.
    pub(super) learned: Vec<LearnedCorpus>,
}

/// The uncertainties of one method, or why it has none.
pub(super) struct Scored {
    /// Column label.
    pub(super) name: &'static str,
    pub(super) uncertainty: Result<Vec<f64>, String>,
    /// The matches it is about, if the method has a retrieval of its own.
    pub(super) own: Option<Judged>,
}

/// Opens all subjects; what is not at hand becomes an absent cell in `column`.
pub(super) fn open(
    table: &mut Table,
    subjects: &[Subject],
    column: &str,
    context: Context<'_>,
) -> Result<Vec<(Labelled, Vec<LocalMethod>)>> {
    let mut all = Vec::new();
    for subject in subjects {
        let opened = context.corpora.open(&subject.dataset, &subject.encoders)?;
        let is_alone = subject.encoders.len() == 1;
        let mut learned = learned_of(subject, context)?;
        for corpus in opened.corpora {
            let is_counterpart = COUNTERPARTS.iter().any(|it| it.name == subject.dataset);
            let row = if is_counterpart && is_alone { corpus.name.clone() } else { corpus.label() };
            let learned = std::mem::take(&mut learned);
            all.push((Labelled { row, corpus, learned }, subject.verify.clone()));
        }
        for why in opened.missing {
            let cell = Cell::absent(&subject.dataset, column, why);
            // A dataset may be listed once per way of verifying it.
            if !table.cells.contains(&cell) {
                table.push(cell);
            }
        }
    }
    Ok(all)
}

/// The subject's dataset under every learned encoder that it lists.
fn learned_of(subject: &Subject, context: Context<'_>) -> Result<Vec<LearnedCorpus>> {
    let open = |&learned: &Learned| {
        let name = [learned.key().to_owned()];
        let mut opened = context.corpora.open(&subject.dataset, &name)?;
        let missing = || opened.missing.join("; ");
        Ok((learned, opened.corpora.pop().ok_or_else(missing)))
    };
    subject.learned.iter().map(open).collect()
}

/// Opens one subject with one encoder.
pub(super) fn open_one(
    table: &mut Table,
    subject: &Subject,
    column: &str,
    context: Context<'_>,
) -> Result<Option<Labelled>> {
    let mut all = open(table, std::slice::from_ref(subject), column, context)?;
    all.truncate(1);
    Ok(all.pop().map(|it| it.0))
}

/// The estimators of table 5.2 that need no images, in its order, and those it has not.
pub(super) const EFFICIENT: [EstimatorChoice; 8] = [
    EstimatorChoice::L2,
    EstimatorChoice::Pa,
    EstimatorChoice::Sue,
    EstimatorChoice::SuePublished,
    EstimatorChoice::SueThesis,
    EstimatorChoice::SimilarityDistribution,
    EstimatorChoice::RatioSpread,
    EstimatorChoice::StatisticalUncertainty,
];

impl Scored {
    /// The matches it is about.
    pub(super) fn judged<'a>(&'a self, opened: &'a Labelled) -> &'a Judged {
        self.own.as_ref().unwrap_or(&opened.corpus.judged)
    }

    /// What a reader must know of a method with its own retrieval.
    pub(super) fn remark(&self) -> Option<String> {
        let base_rate = self.own.as_ref()?.base_rate();
        Some(format!("own descriptors; base rate {base_rate:.4}"))
    }
}

impl Labelled {
    /// The uncertainties of these estimators with the thesis' settings.
    pub(super) fn score(&self, choices: &[EstimatorChoice]) -> Result<Vec<Scored>> {
        let settings = EstimatorSettings::default();
        choices.iter().map(|&choice| self.score_one(choice, &settings)).collect()
    }

    /// The uncertainties of one estimator.
    pub(super) fn score_one(
        &self,
        choice: EstimatorChoice,
        settings: &EstimatorSettings,
    ) -> Result<Scored> {
        let prepared = choice.prepare(settings, Some(&self.corpus.poses))?;
        let uncertainty = match prepared.estimate(&self.corpus.retrieval) {
            Ok(values) => Ok(values),
            Err(
                err @ (Error::Underflow { .. }
                | Error::NoDensity { .. }
                | Error::TooFewNeighbors { .. }),
            ) => Err(err.to_string()),
            Err(err) => return Err(err),
        };
        Ok(Scored { name: prepared.name(), uncertainty, own: None })
    }

    /// The negative inliers of a local method.
    pub(super) fn verify(&self, method: LocalMethod, context: Context<'_>) -> Result<Scored> {
        let name = method.name();
        let uncertainty = match self.corpus.inlier_counts(method, context.corpora.sources())? {
            Verified::Counts(counts) => {
                Ok(Inliers::named(name).estimate(&InlierCounts::new(&counts)?)?)
            }
            Verified::NotAtHand(why) => Err(why),
        };
        Ok(Scored { name, uncertainty, own: None })
    }

    /// The variances of learned encoders, each about its own matches.
    pub(super) fn score_learned(&self) -> Result<Vec<Scored>> {
        let score = |(learned, corpus): &LearnedCorpus| {
            let (uncertainty, own) = match corpus {
                Ok(corpus) => (Ok(corpus.variance(*learned)?), Some(corpus.judged.clone())),
                Err(why) => (Err(why.clone()), None),
            };
            Ok(Scored { name: learned.name(), uncertainty, own })
        };
        self.learned.iter().map(score).collect()
    }

    /// Everything about this corpus: efficient estimators, learned ones, then verification.
    pub(super) fn score_all(
        &self,
        verify: &[LocalMethod],
        context: Context<'_>,
    ) -> Result<Vec<Scored>> {
        let mut scored = self.score(&EFFICIENT)?;
        scored.extend(self.score_learned()?);
        for &method in verify {
            scored.push(self.verify(method, context)?);
        }
        Ok(scored)
    }

    /// A cell about this corpus.
    pub(super) fn cell(&self, row: &str, column: &str, value: f64) -> Cell {
        Cell::new(row, column, value, self.corpus.provenance, self.corpus.judged.len())
    }

    /// AUC-PR under both definitions with its interval; `remark` is a footnote.
    pub(super) fn push_auc(
        &self,
        table: &mut Table,
        (row, column): (&str, &str),
        scored: &Scored,
        remark: Option<&str>,
    ) -> Result<()> {
        for definition in [Definition::Published, Definition::Corrected] {
            let empty = |why: &str| {
                let cell = self.cell(row, column, 0.0).noted(why);
                Cell { value: None, ..cell }.defined(definition)
            };
            let uncertainty = match &scored.uncertainty {
                Ok(uncertainty) => uncertainty,
                Err(why) => {
                    table.push(empty(why));
                    continue;
                }
            };
            let evaluation = Evaluation::new(uncertainty, scored.judged(self))?;
            table.push(match evaluation.auc_pr_interval(definition) {
                Ok(it) => {
                    let cell = self.cell(row, column, it.estimate).defined(definition);
                    let cell = match remark {
                        Some(remark) => cell.noted(remark),
                        None => cell,
                    };
                    cell.within(it.low, it.high, effective::METHOD)
                }
                Err(err @ vpr_core::Error::Undefined { .. }) => empty(&err.to_string()),
                Err(err) => return Err(err.into()),
            });
        }
        Ok(())
    }

    /// Whether the data is real.
    pub(super) fn is_real(&self) -> bool {
        self.corpus.provenance != Provenance::Generated
    }
}
