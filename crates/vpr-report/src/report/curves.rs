//! Recall@N, precision–recall, ROC and risk–coverage curves.

use std::io::{self, Write};

use vpr_core::{
    Definition,
    metrics::{Positives, precision_recall_curve, risk_coverage_curve, roc_curve},
};

use super::{
    Judged, Report,
    chart::{Chart, Line},
    summary::{depth, recall, style, title},
};

pub(super) fn write(out: &mut dyn Write, report: &Report<'_>, judged: &[Judged]) -> io::Result<()> {
    if judged.iter().all(|it| it.correct.is_none()) {
        return Ok(());
    }
    let names: Vec<String> = report.runs.iter().map(|run| title(report, run)).collect();
    writeln!(
        out,
        "<section id=\"curves\">\n<h2>Curves</h2>\n<p class=\"notes script\">The dashed line is the run chosen above on what the filters leave. Values under the pointer stand below each plot.</p>\n<div class=\"charts\">"
    )?;
    let [recalls, precision, roc, risk] = lines(report, judged, &names);
    let deepest = report.runs.iter().map(depth).max().unwrap_or(1).max(2) as f64;
    let (unit, x) = ((0.0, 1.0), (1.0, deepest));
    let chart = |id, title, x_label, y_label, x, lines| Chart {
        id,
        title,
        x_label,
        y_label,
        x,
        y: unit,
        lines,
        cut: None,
    };
    for chart in [
        chart("recall-at-n", "Recall@N", "N", "share of queries", x, recalls),
        chart("precision-recall", "Precision and recall", "recall", "precision", unit, precision),
        chart(
            "roc",
            "ROC: right against wrong best matches",
            "false-positive rate",
            "true-positive rate",
            unit,
            roc,
        ),
        chart(
            "risk-coverage",
            "Risk and coverage",
            "share accepted",
            "share of them wrong",
            unit,
            risk,
        ),
    ] {
        chart.write(out)?;
    }
    writeln!(out, "</div>\n</section>")
}

/// The lines of recall@N, precision over recall, ROC and risk over coverage.
fn lines(report: &Report<'_>, judged: &[Judged], names: &[String]) -> [Vec<Line>; 4] {
    let line = |run: usize, points: Vec<(f64, f64)>| Line {
        name: names[run].clone(),
        style: style(report, run),
        points,
        band: Vec::new(),
    };
    let (mut recalls, mut precision, mut roc, mut risk) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (index, (run, judged)) in report.runs.iter().zip(judged).enumerate() {
        let truth = report.datasets[run.dataset].truth;
        let ranks = 1..=depth(run);
        let found: Vec<_> =
            ranks.filter_map(|rank| Some((rank, recall(report, run, rank)?))).collect();
        let points = found.iter().map(|(rank, it)| (*rank as f64, it.estimate)).collect();
        let band = found.iter().map(|(_, it)| (it.low, it.high)).collect();
        recalls.push(Line { band, ..line(index, points) });
        let (Some(of), confidence) = (judged.judged(truth), judged.confidence()) else { continue };
        let correct = of.correct();
        let positives: Positives = of.positives(Definition::Published);
        if let Ok(curve) = precision_recall_curve(&confidence, correct, positives) {
            precision
                .push(line(index, curve.recall.into_iter().zip(curve.precision).rev().collect()));
        }
        if let Ok(curve) = roc_curve(&confidence, correct) {
            roc.push(line(index, curve.fpr.into_iter().zip(curve.tpr).collect()));
        }
        if let Ok(curve) = risk_coverage_curve(&confidence, correct) {
            risk.push(line(index, curve.coverage.into_iter().zip(curve.risk).collect()));
        }
    }
    [recalls, precision, roc, risk]
}
