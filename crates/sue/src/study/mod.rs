//! What an experiment file of chapter 5 can ask for, one file per study.

mod calibration;
mod comparison;
mod density;
mod fusion;
mod gallery;
mod metrics;
mod needs;
mod noise;
mod pr_curves;
mod resampled;
mod scatter;
mod spacing;
mod subject;
mod sweep;
mod timing;
mod weighing;

use serde::Deserialize;
use vpr_core::metrics::bootstrap::Resampling;
use vpr_report::{experiment::Experiment, page::Report};
use vpr_study::{Dial, verification::LocalMethod};

pub use fusion::Group;
pub use gallery::Scene;
pub use subject::Subject;

use crate::{EstimatorChoice, Result, corpus::Corpora, net::Learned};

/// What to compute; the key `kind` of `[study]` chooses.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Study {
    /// What each family needs: table 5.1.
    Needs {},
    /// AUC-PR of all estimators: table 5.2.
    Comparison {
        /// Datasets with their encoders.
        subjects: Vec<Subject>,
    },
    /// All metrics of all estimators.
    Metrics {
        /// Datasets with their encoders.
        subjects: Vec<Subject>,
    },
    /// Accuracy of a linear SVM on one or two uncertainties: table 5.3.
    Fusion {
        /// Each trained on one dataset and tested on all of it.
        groups: Vec<Group>,
    },
    /// Decaying against uniform weights: table 5.4.
    Weighing {
        /// Datasets with their encoders.
        subjects: Vec<Subject>,
    },
    /// SUE compensated for the density of the map: table 5.5.
    Density {
        /// Datasets with their encoders.
        subjects: Vec<Subject>,
        /// Which neighbours in space measure the density.
        nth: Vec<usize>,
    },
    /// The same for queries resampled to a uniform density: table 5.6.
    Resampled {
        /// The dataset with its encoder.
        subject: Subject,
        /// Which neighbours in space measure the density.
        nth: Vec<usize>,
        /// Distances between neighbouring queries that are kept, in metres.
        spacings: Vec<(f64, f64)>,
        /// Of the second half of the map every so many-th reference is kept.
        thinning: usize,
    },
    /// Precision–recall curves: figures 5.1, 5.8 and 5.10.
    PrCurves {
        /// Datasets with their encoders.
        subjects: Vec<Subject>,
        /// The estimators.
        estimators: Vec<EstimatorChoice>,
    },
    /// Images in coloured frames: figures 5.3, 5.4, 5.6 and 5.13.
    Gallery {
        /// The dataset with its encoder; generated, so that the picture can be passed on.
        subject: Subject,
        /// Which images.
        scene: Scene,
    },
    /// Two uncertainties of every query and the boundary of an SVM: figures 5.5, 5.11 and 5.12.
    Scatter {
        /// The dataset the SVM is trained on.
        train: Subject,
        /// Datasets with their encoders.
        subjects: Vec<Subject>,
        /// Vertical axis.
        estimators: Vec<EstimatorChoice>,
        /// Horizontal axis; the inliers of a local method if there is none.
        against: Option<EstimatorChoice>,
    },
    /// AUC-PR over K and λ: figure 5.7.
    Sweep {
        /// Datasets with their encoders.
        subjects: Vec<Subject>,
        /// Numbers of best references.
        k: Vec<usize>,
        /// Decays.
        lambda: Vec<f64>,
    },
    /// Distances to the nearest neighbour in space: figure 5.9.
    Spacing {
        /// Datasets with their encoders.
        subjects: Vec<Subject>,
    },
    /// Whether predicted variances rise with a nuisance of generated places.
    Noise {
        /// The nuisance, from least to most.
        dial: Dial,
        /// The learned uncertainties.
        learned: Vec<Learned>,
    },
    /// Whether calibrated thresholds keep their promise on random splits.
    Calibration {
        /// Datasets with their encoders.
        subjects: Vec<Subject>,
        /// Number of random halves.
        splits: usize,
        /// Precision that is promised.
        precision: f64,
        /// Chance that the promise is broken.
        risk: f64,
    },
}

/// What every study is given.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Datasets as encoders see them.
    pub corpora: &'a Corpora<'a>,
    /// Whether to measure what differs from run to run.
    pub timings: bool,
    /// Seed of every random draw.
    pub seed: u64,
}

impl Context<'_> {
    /// How intervals are drawn.
    fn resampling(&self) -> Resampling {
        Resampling { n_resamples: 1000, seed: self.seed, ..Resampling::default() }
    }
}

/// Computes what the experiment asks for, as far as its data is at hand.
///
/// # Errors
///
/// Wrong files name themselves; missing ones make absent cells.
pub fn run(experiment: &Experiment<Study>, context: Context<'_>) -> Result<Report> {
    let mut table = experiment.table();
    let (mut figure, mut sheet) = (None, None);
    let out = &mut table;
    match &experiment.study {
        Study::Needs {} => needs::run(out),
        Study::Comparison { subjects } => comparison::run(out, subjects, context)?,
        Study::Metrics { subjects } => metrics::run(out, subjects, context)?,
        Study::Fusion { groups } => fusion::run(out, groups, context)?,
        Study::Weighing { subjects } => weighing::run(out, subjects, context)?,
        Study::Density { subjects, nth } => density::run(out, subjects, nth, context)?,
        Study::Resampled { subject, nth, spacings, thinning } => {
            let plan = resampled::Plan { nth, spacings, thinning: *thinning };
            resampled::run(out, subject, plan, context)?;
        }
        Study::PrCurves { subjects, estimators } => {
            figure = Some(pr_curves::run(out, subjects, estimators, context)?);
        }
        Study::Gallery { subject, scene } => {
            sheet = gallery::run(out, subject, *scene, context)?;
        }
        Study::Scatter { train, subjects, estimators, against } => {
            let axes = scatter::Axes { estimators, against: *against };
            figure = Some(scatter::run(out, train, subjects, axes, context)?);
        }
        Study::Sweep { subjects, k, lambda } => {
            figure = Some(sweep::run(out, subjects, k, lambda, context)?);
        }
        Study::Spacing { subjects } => figure = Some(spacing::run(out, subjects, context)?),
        Study::Noise { dial, learned } => {
            figure = Some(noise::run(out, dial, learned, context)?);
        }
        Study::Calibration { subjects, splits, precision, risk } => {
            let plan = calibration::Plan { splits: *splits, precision: *precision, risk: *risk };
            calibration::run(out, subjects, plan, context)?;
        }
    }
    experiment.fill_thesis(&mut table);
    Ok(Report { table, figure, sheet })
}

/// The local method of every subject's first choice, for studies that use one.
fn first_method(subject: &Subject) -> Option<LocalMethod> {
    subject.verify.first().copied()
}
