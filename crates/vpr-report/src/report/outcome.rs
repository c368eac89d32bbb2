//! What became of every query of a run: right or wrong, accepted or rejected.

use vpr_core::{Evaluation, GroundTruth};

use super::{Report, Run};

/// A run with its verdicts.
pub(super) struct Judged {
    /// Whether the best match is correct; `None` without a truth.
    pub(super) correct: Option<Vec<bool>>,
    /// How uncertain the best match is; NaN where nobody knows.
    pub(super) uncertainty: Vec<f64>,
    /// Whether it is the distance of the best match.
    pub(super) is_distance: bool,
    /// Matches of at most this uncertainty are accepted.
    pub(super) threshold: f64,
    /// Whether the threshold was given.
    pub(super) is_given: bool,
    /// Queries whose uncertainty is not finite.
    pub(super) n_unknown: usize,
}

impl Judged {
    pub(super) fn new(report: &Report<'_>, run: &Run) -> Self {
        let truth = report.datasets[run.dataset].truth;
        let best = |matches: &Vec<super::Match>| matches.first().map_or(f64::NAN, |it| it.distance);
        let is_distance = run.uncertainty.is_none();
        let uncertainty = match &run.uncertainty {
            Some(uncertainty) => uncertainty.clone(),
            None => run.matches.iter().map(best).collect(),
        };
        let correct = truth.map(|truth| judge(run, truth));
        let mut finite: Vec<f64> =
            uncertainty.iter().copied().filter(|it| it.is_finite()).collect();
        finite.sort_unstable_by(f64::total_cmp);
        let median = finite.get(finite.len().saturating_sub(1) / 2).copied().unwrap_or(0.0);
        let n_unknown = uncertainty.len() - finite.len();
        let threshold = run.threshold.filter(|it| it.is_finite());
        Self {
            correct,
            uncertainty,
            is_distance,
            is_given: threshold.is_some(),
            threshold: threshold.unwrap_or(median),
            n_unknown,
        }
    }

    /// Whether the best match of a query is accepted; never if its uncertainty is unknown.
    pub(super) fn accepts(&self, query: usize) -> bool {
        self.uncertainty[query] <= self.threshold
    }

    pub(super) fn is_correct(&self, query: usize) -> Option<bool> {
        self.correct.as_ref().map(|correct| correct[query])
    }

    /// Confidences that metrics can order: queries without a finite uncertainty are the least
    /// certain.
    pub(super) fn confidence(&self) -> Vec<f64> {
        let finite = self.uncertainty.iter().copied().filter(|it| it.is_finite());
        let highest = finite.fold(0.0, f64::max);
        let last = highest + 1.0 + highest.abs();
        self.uncertainty.iter().map(|it| if it.is_finite() { -it } else { -last }).collect()
    }

    /// The metrics' view, if there is a truth and a query.
    pub(super) fn evaluation<'a>(&self, judged: &'a vpr_core::Judged) -> Option<Evaluation<'a>> {
        Evaluation::of_confidence(&self.confidence(), judged).ok()
    }

    /// The judgements as the metrics take them.
    pub(super) fn judged(&self, truth: Option<&GroundTruth>) -> Option<vpr_core::Judged> {
        let (correct, truth) = (self.correct.clone()?, truth?);
        let known = (0..truth.len()).map(|query| !truth.is_new_place(query)).collect();
        vpr_core::Judged::from_flags(correct, known).ok()
    }
}

fn judge(run: &Run, truth: &GroundTruth) -> Vec<bool> {
    let is_correct = |(query, matches): (usize, &Vec<super::Match>)| {
        matches.first().is_some_and(|it| truth.is_correct(query, it.reference))
    };
    run.matches.iter().enumerate().map(is_correct).collect()
}

/// What a run's uncertainty is called.
pub(super) fn label(run: &Run, judged: &Judged) -> String {
    match (&run.estimator, judged.is_distance) {
        (Some(name), _) => name.clone(),
        (None, true) => "distance of the best match".to_owned(),
        (None, false) => "uncertainty".to_owned(),
    }
}
