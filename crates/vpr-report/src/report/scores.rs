//! How the uncertainties of right and of wrong matches are distributed.

use std::io::{self, Write};

use super::{
    Judged, Report,
    chart::{Chart, Line},
    outcome::label,
    summary::title,
};
use crate::figure::{Mark, Style};

const BARS: usize = 40;
const RIGHT: Style = Style { colour: 0, mark: Mark::Circle };
const WRONG: Style = Style { colour: 1, mark: Mark::Cross };

pub(super) fn write(out: &mut dyn Write, report: &Report<'_>, judged: &[Judged]) -> io::Result<()> {
    if judged.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "<section id=\"scores\">\n<h2>Scores</h2>\n<p class=\"notes\">Of right (●) and of wrong (×) best matches, each side \
         as shares of itself. The dashed line is the threshold: what lies left of it is accepted.</p>\n<div class=\"charts\">"
    )?;
    for (index, (run, judged)) in report.runs.iter().zip(judged).enumerate() {
        let finite = || judged.uncertainty.iter().copied().filter(|it| it.is_finite());
        let low = finite().fold(f64::INFINITY, f64::min);
        let high = finite().fold(f64::NEG_INFINITY, f64::max);
        if low > high {
            continue;
        }
        let high = if high > low { high } else { low + 1.0 };
        let side = |wanted: bool| -> Vec<f64> {
            let of = judged.uncertainty.iter().enumerate();
            let of = of.filter(|(query, _)| judged.is_correct(*query).unwrap_or(true) == wanted);
            outline(of.map(|it| *it.1).filter(|it| it.is_finite()), low, high)
        };
        let sides = if judged.correct.is_some() {
            vec![("right", RIGHT, side(true)), ("wrong", WRONG, side(false))]
        } else {
            vec![("all", RIGHT, side(true))]
        };
        let top = sides.iter().flat_map(|it| &it.2).copied().fold(0.01, f64::max);
        let width = (high - low) / BARS as f64;
        let line = |(name, style, shares): (&str, Style, Vec<f64>)| {
            let steps = shares.iter().enumerate().flat_map(|(bar, share)| {
                [0, 1].map(|side| (low + (bar + side) as f64 * width, *share))
            });
            Line { name: name.to_owned(), style, points: steps.collect(), band: Vec::new() }
        };
        let (title, x_label) = (title(report, run), label(run, judged));
        let chart = Chart {
            id: &format!("scores-{index}"),
            title: &title,
            x_label: &x_label,
            y_label: "share of its side",
            x: (low, high),
            y: (0.0, top),
            lines: sides.into_iter().map(line).collect(),
            cut: Some((index, judged.threshold)),
        };
        chart.write(out)?;
    }
    writeln!(out, "</div>\n</section>")
}

/// Share of the values in each of the bars.
fn outline(values: impl Iterator<Item = f64>, low: f64, high: f64) -> Vec<f64> {
    let mut counts = vec![0.0; BARS];
    let mut n = 0.0;
    for value in values {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to BARS")]
        let bar = ((value - low) / (high - low) * BARS as f64) as usize;
        counts[bar.min(BARS - 1)] += 1.0;
        n += 1.0;
    }
    counts.iter().map(|count| if n > 0.0 { count / n } else { 0.0 }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_and_the_highest_value_is_in_the_last_bar() {
        let shares = outline([0.0, 0.1, 1.0, 1.0].into_iter(), 0.0, 1.0);
        assert_eq!((shares[0], shares[4], shares[BARS - 1]), (0.25, 0.25, 0.5));
        assert_eq!(outline([].into_iter(), 0.0, 1.0), vec![0.0; BARS]);
    }
}
