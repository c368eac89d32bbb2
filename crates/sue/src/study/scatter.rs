//! Two uncertainties of every query and the boundary of an SVM: figures 5.5, 5.11 and 5.12.

use vpr_report::{
    figure::{Curve, Figure, Panel, Shape},
    table::{Cell, Table},
};

use super::{
    Context, first_method,
    subject::{Labelled, Subject, open, open_one},
};
use crate::{
    Error, EstimatorChoice, Result,
    fusion::{LinearSvm, SvmParams},
};

/// What is drawn against what.
#[derive(Clone, Copy)]
pub(super) struct Axes<'a> {
    /// Vertical axes, one panel each.
    pub(super) estimators: &'a [EstimatorChoice],
    /// Horizontal axis; verification if there is none.
    pub(super) against: Option<EstimatorChoice>,
}

/// Points of a drawn line.
const LINE: usize = 120;
/// Added before taking logarithms of scaled uncertainties.
const FLOOR: f64 = 1e-6;

/// Pairs of uncertainties of one corpus.
struct Pairs {
    labels: (String, String),
    values: Vec<Vec<f64>>,
}

pub(super) fn run(
    table: &mut Table,
    train: &Subject,
    subjects: &[Subject],
    axes: Axes<'_>,
    context: Context<'_>,
) -> Result<Figure> {
    let mut figure = Figure::default();
    let Some(training) = open_one(table, train, "accuracy", context)? else { return Ok(figure) };
    for &estimator in axes.estimators {
        let Some(learnt) = pairs(&training, train, estimator, axes.against, context)? else {
            continue;
        };
        let params = SvmParams { tolerance: None, seed: context.seed, ..SvmParams::default() };
        let correct = training.corpus.judged.correct();
        let svm = match LinearSvm::train(&learnt.values, correct, &params) {
            Ok(svm) => Some(svm),
            Err(Error::Core(vpr_core::Error::Undefined { .. })) => None,
            Err(err) => return Err(err),
        };
        for subject in subjects {
            for (opened, _) in open(table, std::slice::from_ref(subject), "accuracy", context)? {
                let Some(pairs) = pairs(&opened, subject, estimator, axes.against, context)? else {
                    continue;
                };
                push(table, &opened, &pairs, svm.as_ref())?;
                figure.panels.push(panel(&opened, &pairs, &learnt, svm.as_ref()));
            }
        }
    }
    Ok(figure)
}

/// First feature: horizontal; second: the estimator's.
fn pairs(
    opened: &Labelled,
    subject: &Subject,
    estimator: EstimatorChoice,
    against: Option<EstimatorChoice>,
    context: Context<'_>,
) -> Result<Option<Pairs>> {
    let first = match (against, first_method(subject)) {
        (Some(choice), _) => opened.score(&[choice])?.pop(),
        (None, Some(method)) => Some(opened.verify(method, context)?),
        (None, None) => None,
    };
    let (Some(first), Some(second)) = (first, opened.score(&[estimator])?.pop()) else {
        return Ok(None);
    };
    let (Ok(x), Ok(y)) = (first.uncertainty, second.uncertainty) else { return Ok(None) };
    let labels = (first.name.to_owned(), second.name.to_owned());
    Ok(Some(Pairs { labels, values: x.into_iter().zip(y).map(|(x, y)| vec![x, y]).collect() }))
}

/// How many matches lie where, in numbers.
fn push(
    table: &mut Table,
    opened: &Labelled,
    pairs: &Pairs,
    svm: Option<&LinearSvm>,
) -> Result<()> {
    let row = format!("{}: {} and {}", opened.row, pairs.labels.0, pairs.labels.1);
    let judged = &opened.corpus.judged;
    let cell = opened.cell(&row, "accuracy of the boundary", 0.0);
    let Some(svm) = svm else {
        let why = "the training matches are all correct or all wrong";
        table.push(Cell { value: None, ..cell.noted(why) });
        return Ok(());
    };
    let accuracy = svm.accuracy(&pairs.values, judged.correct())?;
    table.push(Cell { value: Some(accuracy.into()), ..cell });
    for (column, wanted) in [("correct and accepted", true), ("wrong and accepted", false)] {
        let mut accepted = 0_usize;
        for (pair, &correct) in pairs.values.iter().zip(judged.correct()) {
            accepted += usize::from(correct == wanted && svm.decision(pair)? > 0.0);
        }
        table.push(opened.cell(&row, column, accepted as f64));
    }
    Ok(())
}

/// Smallest value and range of one feature.
fn scale(values: &[Vec<f64>], feature: usize) -> (f64, f64) {
    let all = || values.iter().map(|it| it[feature]);
    let (low, high) =
        (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max));
    (low, if high > low { high - low } else { 1.0 })
}

fn panel(opened: &Labelled, pairs: &Pairs, learnt: &Pairs, svm: Option<&LinearSvm>) -> Panel {
    let (x_scale, y_scale) = (scale(&learnt.values, 0), scale(&learnt.values, 1));
    let x = |value: f64| (value - x_scale.0) / x_scale.1;
    let y = |value: f64| ((value - y_scale.0) / y_scale.1).max(0.0).mul_add(1.0, FLOOR).log10();
    let mut curves: Vec<Curve> = [("correct", true), ("wrong", false)]
        .map(|(name, wanted)| {
            let judged = pairs.values.iter().zip(opened.corpus.judged.correct());
            let points = judged.filter(|it| *it.1 == wanted);
            let points = points.map(|(it, _)| (x(it[0]), y(it[1]))).collect();
            Curve::new(name, points).shaped(Shape::Points)
        })
        .into();
    for (name, level) in
        [("SVM boundary", 0.0), ("margin, accepted", 1.0), ("margin, rejected", -1.0)]
    {
        let (low, range) = scale(&pairs.values, 0);
        let points = (0..=LINE).filter_map(|i| {
            let first = low + range * i as f64 / LINE as f64;
            let second = svm?.boundary(first, level)?;
            let scaled = (second - y_scale.0) / y_scale.1;
            (-0.2..=1.5).contains(&scaled).then(|| (x(first), y(second)))
        });
        curves.push(Curve::new(name, points.collect()));
    }
    Panel {
        title: opened.row.clone(),
        x_label: format!("{}, scaled", pairs.labels.0),
        y_label: format!("log₁₀ of {}, scaled", pairs.labels.1),
        curves,
        ..Panel::default()
    }
}
