//! The numbers that one looks for first, with their intervals.

use std::io::{self, Write};

use vpr_core::{
    Definition,
    metrics::bootstrap::{Interval, Z_95, wilson_interval},
};

use super::{Judged, Report, Run, chart::sample, escape, outcome::label, short};
use crate::figure::{Mark, Style, styles};

/// Ranks of recall@N.
const RANKS: [usize; 4] = [1, 5, 10, 20];

pub(super) fn write(out: &mut dyn Write, report: &Report<'_>, judged: &[Judged]) -> io::Result<()> {
    writeln!(
        out,
        "<section id=\"summary\">\n<h2>Numbers</h2>\n<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"numbers of every run\">\n<table>\n<thead><tr><th scope=\"col\">run</th>"
    )?;
    let deepest = report.runs.iter().map(depth).max().unwrap_or(0);
    let ranks: Vec<usize> = RANKS.into_iter().filter(|it| *it <= deepest.max(1)).collect();
    for rank in &ranks {
        write!(out, "<th scope=\"col\">recall@{rank}</th>")?;
    }
    writeln!(
        out,
        "<th scope=\"col\">AUC-PR</th><th scope=\"col\">AUC-PR, corrected</th>\
         <th scope=\"col\">accepted</th><th scope=\"col\">of them right</th></tr></thead>\n<tbody>"
    )?;
    for (index, (run, judged)) in report.runs.iter().zip(judged).enumerate() {
        let (class, mark) = (style(report, index).colour, sample(style(report, index)));
        write!(
            out,
            "<tr><th scope=\"row\" class=\"run\"><span class=\"c{class}\">{mark}</span> {}</th>",
            escape(&title(report, run))
        )?;
        for rank in &ranks {
            let cell = recall(report, run, *rank).map_or("–".to_owned(), |it| interval(&it));
            write!(out, "<td>{cell}</td>")?;
        }
        for cell in areas(report, run, judged) {
            write!(out, "<td>{cell}</td>")?;
        }
        let n = judged.uncertainty.len();
        let accepted: Vec<usize> = (0..n).filter(|&query| judged.accepts(query)).collect();
        let share = wilson_interval(accepted.len(), n, Z_95).ok();
        write!(out, "<td>{}</td>", share.map_or("–".to_owned(), |it| interval(&it)))?;
        let right = judged
            .correct
            .as_ref()
            .map(|correct| accepted.iter().filter(|&&it| correct[it]).count());
        let share = right.and_then(|right| wilson_interval(right, accepted.len(), Z_95).ok());
        writeln!(out, "<td>{}</td></tr>", share.map_or("–".to_owned(), |it| interval(&it)))?;
    }
    writeln!(out, "</tbody>\n</table>\n</div>\n<ul class=\"notes\">")?;
    for (run, judged) in report.runs.iter().zip(judged) {
        let (by, threshold) = (label(run, judged), short(judged.threshold));
        let which = if judged.is_given { "" } else { ", the median, since no threshold was given" };
        let unknown = match judged.n_unknown {
            0 => String::new(),
            n => format!("; {n} queries have none that is a number and are rejected"),
        };
        writeln!(
            out,
            "<li>{}: accepted if {} is at most {threshold}{which}{unknown}.</li>",
            escape(&title(report, run)),
            escape(&by)
        )?;
    }
    writeln!(
        out,
        "<li>95 % intervals: Wilson's, for AUC-PR over the number of queries that it is worth. \
         The corrected AUC-PR counts queries whose match is wrong although a correct reference exists.</li>\n</ul>\n</section>"
    )
}

/// Dataset and method.
pub(super) fn title(report: &Report<'_>, run: &Run) -> String {
    if report.datasets.len() == 1 {
        return run.name.clone();
    }
    format!("{}, {}", report.datasets[run.dataset].name, run.name)
}

/// The longest list of matches.
pub(super) fn depth(run: &Run) -> usize {
    run.matches.iter().map(Vec::len).max().unwrap_or(0)
}

/// Share of the queries with a correct reference among the first `rank`, with Wilson's interval.
pub(super) fn recall(report: &Report<'_>, run: &Run, rank: usize) -> Option<Interval> {
    let truth = report.datasets[run.dataset].truth?;
    let is_found = |query: &usize| {
        run.matches[*query].iter().take(rank).any(|it| truth.is_correct(*query, it.reference))
    };
    let n_found = (0..run.matches.len()).filter(is_found).count();
    wilson_interval(n_found, run.matches.len(), Z_95).ok()
}

fn areas(report: &Report<'_>, run: &Run, judged: &Judged) -> [String; 2] {
    let of = judged.judged(report.datasets[run.dataset].truth);
    let evaluation = of.as_ref().and_then(|of| judged.evaluation(of));
    [Definition::Published, Definition::Corrected].map(|definition| {
        let Some(evaluation) = &evaluation else { return "–".to_owned() };
        let Ok(value) = evaluation.auc_pr(definition) else { return "–".to_owned() };
        match evaluation.auc_pr_interval(definition) {
            Ok(it) => interval(&it),
            Err(_) => format!("{value:.3}"),
        }
    })
}

fn interval(interval: &Interval) -> String {
    let Interval { estimate, low, high, .. } = interval;
    format!("{estimate:.3} <small>({low:.2}–{high:.2})</small>")
}

/// The look of a run: that of its method in all figures, or a free one.
pub(super) fn style(report: &Report<'_>, run: usize) -> Style {
    let names: Vec<String> = report.runs.iter().map(|run| title(report, run)).collect();
    // Datasets share methods: then the whole title decides, so that no two runs look alike.
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let name = names[run];
    let styles = styles(&[names]);
    let of = styles.iter().find(|it| it.0 == name);
    of.map_or(Style { colour: 7, mark: Mark::Circle }, |it| it.1)
}
