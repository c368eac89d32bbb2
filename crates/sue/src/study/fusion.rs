//! Accuracy of a linear SVM on one or two uncertainties: table 5.3.

use serde::Deserialize;
use vpr_report::table::{Cell, Table};

use super::{
    Context,
    subject::{Labelled, Subject, open, open_one},
};
use crate::{
    Error, EstimatorChoice, Result,
    fusion::{LinearSvm, SvmParams},
};

/// Datasets that share one SVM.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// The dataset it is trained on.
    pub train: Subject,
    /// Those it is tested on, the training set included if it is named.
    pub test: Vec<Subject>,
}

/// Estimators that are combined with verification.
const ALONE: [EstimatorChoice; 3] =
    [EstimatorChoice::L2, EstimatorChoice::Pa, EstimatorChoice::Sue];
/// What the best constant answer gets right.
const CONSTANT: &str = "always the commoner answer";

/// Uncertainties of one dataset by name, one or two features per match.
struct Features(Vec<(String, Vec<Vec<f64>>)>);

pub(super) fn run(table: &mut Table, groups: &[Group], context: Context<'_>) -> Result<()> {
    for group in groups {
        let Some(train) = open_one(table, &group.train, "accuracy", context)? else { continue };
        let training = features(&train, &group.train, context)?;
        let note = format!("SVM trained on {}", train.row);
        for test in &group.test {
            for (opened, _) in open(table, std::slice::from_ref(test), "accuracy", context)? {
                let testing = features(&opened, test, context)?;
                push_constant(table, &opened);
                for (name, features) in &testing.0 {
                    let known = training.0.iter().find(|it| it.0 == *name);
                    let Some((_, training)) = known else { continue };
                    let correct = train.corpus.judged.correct();
                    let judged = opened.corpus.judged.correct();
                    let accuracy = match LinearSvm::train(training, correct, &params(context)) {
                        Ok(svm) => Ok(svm.accuracy(features, judged)?),
                        Err(Error::Core(err @ vpr_core::Error::Undefined { .. })) => {
                            Err(err.to_string())
                        }
                        Err(err) => return Err(err),
                    };
                    // The thesis prints percent.
                    let cell = opened.cell(name, &opened.row, 0.0).noted(&note);
                    table.push(match accuracy {
                        Ok(accuracy) => Cell { value: Some((100.0 * accuracy).into()), ..cell },
                        Err(why) => Cell { value: None, ..cell.noted(why) },
                    });
                }
            }
        }
    }
    Ok(())
}

/// All passes, so that the result hardly depends on the order of samples.
fn params(context: Context<'_>) -> SvmParams {
    SvmParams { tolerance: None, seed: context.seed, ..SvmParams::default() }
}

fn push_constant(table: &mut Table, opened: &Labelled) {
    let base = opened.corpus.judged.base_rate();
    table.push(opened.cell(CONSTANT, &opened.row, 100.0 * base.max(1.0 - base)));
}

/// Every estimator alone, verification alone, and both.
fn features(opened: &Labelled, subject: &Subject, context: Context<'_>) -> Result<Features> {
    let mut all = Vec::new();
    let mut verified = Vec::new();
    for &method in &subject.verify {
        let scored = opened.verify(method, context)?;
        verified.extend(scored.uncertainty.ok().map(|counts| (scored.name, counts)));
    }
    for (name, counts) in &verified {
        all.push(((*name).to_owned(), counts.iter().map(|&it| vec![it]).collect()));
    }
    let scored = opened.score(&ALONE)?;
    let scored: Vec<_> =
        scored.into_iter().filter_map(|it| Some((it.name, it.uncertainty.ok()?))).collect();
    for (name, uncertainty) in &scored {
        all.push(((*name).to_owned(), uncertainty.iter().map(|&it| vec![it]).collect()));
    }
    for (method, counts) in &verified {
        for (name, uncertainty) in &scored {
            let pairs = uncertainty.iter().zip(counts).map(|(&a, &b)| vec![a, b]).collect();
            all.push((format!("{method} + {name}"), pairs));
        }
    }
    Ok(Features(all))
}
