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
/// Uncertainties of which the largest is more than so many times the smallest are drawn by their
/// logarithms.
const DECADES: f64 = 100.0;
/// Lowest scaled uncertainty that a logarithmic axis tells from zero.
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

/// One axis: how a feature is scaled, as it was learnt, and drawn.
struct Axis {
    low: f64,
    range: f64,
    /// What zero is drawn as, on an axis of logarithms.
    floor: Option<f64>,
}

impl Axis {
    fn new(feature: usize, learnt: &[Vec<f64>], drawn: &[Vec<f64>]) -> Self {
        let of = |values: &[Vec<f64>]| -> (f64, f64) {
            let all = values.iter().map(|it| it[feature]);
            all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), it| {
                (low.min(it), high.max(it))
            })
        };
        let (low, high) = of(learnt);
        let range = if high > low { high - low } else { 1.0 };
        let axis = Self { low, range, floor: None };
        if low < 0.0 || high <= low * DECADES {
            return axis;
        }
        // Not far below what is there.
        let scaled = [learnt, drawn].into_iter().flatten().map(|it| axis.scaled(it[feature]));
        let least = scaled.filter(|it| *it > 0.0).fold(1.0, f64::min);
        Self { floor: Some((least / 2.0).max(FLOOR)), ..axis }
    }

    /// From 0 to 1 over what was learnt from.
    fn scaled(&self, value: f64) -> f64 {
        (value - self.low) / self.range
    }

    fn place(&self, value: f64) -> f64 {
        let scaled = self.scaled(value);
        self.floor.map_or(scaled, |floor| scaled.max(floor).log10())
    }

    /// The value that is drawn at a place.
    fn value(&self, place: f64) -> f64 {
        let scaled = if self.floor.is_some() { 10_f64.powf(place) } else { place };
        self.low + scaled * self.range
    }

    fn label(&self, name: &str) -> String {
        let how = if self.floor.is_some() { "log₁₀ of " } else { "" };
        format!("{how}{name}, scaled")
    }
}

fn panel(opened: &Labelled, pairs: &Pairs, learnt: &Pairs, svm: Option<&LinearSvm>) -> Panel {
    let [x, y] = [0, 1].map(|feature| Axis::new(feature, &learnt.values, &pairs.values));
    let mut curves: Vec<Curve> = [("correct", true), ("wrong", false)]
        .map(|(name, wanted)| {
            let judged = pairs.values.iter().zip(opened.corpus.judged.correct());
            let points = judged.filter(|it| *it.1 == wanted);
            let points = points.map(|(it, _)| (x.place(it[0]), y.place(it[1]))).collect();
            Curve::new(name, points).shaped(Shape::Points)
        })
        .into();
    let across = pairs.values.iter().map(|it| x.place(it[0]));
    let (left, right) = across
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), it| (low.min(it), high.max(it)));
    for (name, level) in
        [("SVM boundary", 0.0), ("margin, accepted", 1.0), ("margin, rejected", -1.0)]
    {
        let points = (0..=LINE).filter_map(|i| {
            let place = left + (right - left) * i as f64 / LINE as f64;
            let second = svm?.boundary(x.value(place), level)?;
            (-0.2..=1.5).contains(&y.scaled(second)).then(|| (place, y.place(second)))
        });
        curves.push(Curve::new(name, points.collect()));
    }
    Panel {
        title: opened.row.clone(),
        x_label: x.label(&pairs.labels.0),
        y_label: y.label(&pairs.labels.1),
        curves,
        ..Panel::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(values: &[f64]) -> Axis {
        let values: Vec<Vec<f64>> = values.iter().map(|&it| vec![it]).collect();
        Axis::new(0, &values, &values)
    }

    #[test]
    fn what_spans_decades_is_drawn_by_logarithms_and_zero_just_below_the_rest() {
        let distances = axis(&[0.8, 1.0, 1.2]);
        assert_eq!(distances.label("L2-distance"), "L2-distance, scaled");
        assert!((distances.place(1.0) - 0.5).abs() < 1e-12);
        let wide = axis(&[1.0, 11.0, 1001.0]);
        assert_eq!(wide.label("SUE"), "log₁₀ of SUE, scaled");
        assert!((wide.place(11.0) + 2.0).abs() < 1e-12 && (wide.place(1001.0)).abs() < 1e-12);
        assert!((wide.place(1.0) - 0.005_f64.log10()).abs() < 1e-12);
        // Values so small that they do not matter, and inliers, which are negative.
        assert!((axis(&[0.0, 1e-70, 1.0]).place(0.0) + 6.0).abs() < 1e-12);
        assert_eq!(axis(&[-20.0, 0.0]).label("SIFT-RANSAC"), "SIFT-RANSAC, scaled");
        for (axis, value) in [(distances, 1.1), (wide, 300.0)] {
            assert!((axis.value(axis.place(value)) - value).abs() < 1e-9);
        }
    }
}
