//! Images in coloured frames: figures 5.3, 5.4, 5.6 and 5.13.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use vpr_report::{
    page::Sheet,
    table::{Cell, Table},
};
use vpr_study::{ContactSheet, Tile};

use super::{
    Context, first_method,
    subject::{Labelled, Scored, Subject, open_one},
};
use crate::{EstimatorChoice, Result};

/// Which images a gallery shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scene {
    /// The two least and the two most uncertain queries of every method: figure 5.3.
    Extremes,
    /// A wrong and a correct match that SUE orders better than the distance does: figure 5.4.
    Disagreements,
    /// Correct matches that verification doubts and SUE does not: figure 5.6.
    Complements,
    /// The same queries in the order of every method: figure 5.13.
    Ranked,
}

/// Methods of a gallery that need no images.
const METHODS: [EstimatorChoice; 3] =
    [EstimatorChoice::L2, EstimatorChoice::Pa, EstimatorChoice::Sue];
/// Queries of figure 5.13.
const RANKED: usize = 10;
/// Neighbours of figure 5.4.
const NEIGHBORS: usize = 4;
/// Pairs of figure 5.6.
const COMPLEMENTS: usize = 6;
const LEGEND: &str = "Grey: query, with its uncertainty u or the share of queries that are less \
    uncertain; blue and ✓: correct reference; vermilion and ✗: wrong reference, with the distance d \
    of descriptors.";

pub(super) fn run(
    table: &mut Table,
    subject: &Subject,
    scene: Scene,
    context: Context<'_>,
) -> Result<Option<Sheet>> {
    let Some(opened) = open_one(table, subject, "uncertainty", context)? else { return Ok(None) };
    let mut scored = opened.score(&METHODS)?;
    if let Some(method) = first_method(subject) {
        scored.push(opened.verify(method, context)?);
    }
    let scored: Vec<(&'static str, Vec<f64>)> = scored
        .into_iter()
        .filter_map(|Scored { name, uncertainty, .. }| Some((name, uncertainty.ok()?)))
        .collect();
    let mut sheet = ContactSheet::default();
    match scene {
        Scene::Extremes => extremes(table, &opened, &scored, &mut sheet),
        Scene::Disagreements => disagreements(table, &opened, &scored, &mut sheet),
        Scene::Complements => complements(table, &opened, &scored, &mut sheet),
        Scene::Ranked => ranked(table, &opened, &scored, &mut sheet, context.seed),
    }
    // Pictures of real places are not ours to pass on.
    if opened.corpus.images.is_none() || opened.is_real() {
        return Ok(None);
    }
    Ok(Some(sheet.draw(LEGEND)?))
}

/// Queries from the least to the most uncertain, ties by lower index.
fn order(uncertainty: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..uncertainty.len()).collect();
    order.sort_by(|&a, &b| uncertainty[a].total_cmp(&uncertainty[b]).then(a.cmp(&b)));
    order
}

/// Share of the queries that are less uncertain.
fn ranks(uncertainty: &[f64]) -> Vec<f64> {
    let mut ranks = vec![0.0; uncertainty.len()];
    for (rank, query) in order(uncertainty).into_iter().enumerate() {
        ranks[query] = rank as f64 / uncertainty.len() as f64;
    }
    ranks
}

/// The query with a remark over its `n` best references with their distances; nothing without
/// images.
fn column(opened: &Labelled, query: usize, n: usize, remark: String) -> Vec<Tile> {
    let Some((queries, references)) = &opened.corpus.images else { return Vec::new() };
    let retrieval = &opened.corpus.retrieval;
    let correct = |reference: usize| opened.corpus.truth.is_correct(query, reference);
    let ranked = retrieval.indices(query).into_iter().zip(retrieval.distances(query)).take(n);
    let framed = ranked.map(|(&it, &distance)| {
        let remark = format!("d {}", short(f64::from(distance)));
        Tile::reference(references, it, correct(it), remark)
    });
    std::iter::once(Tile::query(queries, query, remark)).chain(framed).collect()
}

/// A number in few letters.
fn short(value: f64) -> String {
    match value.abs() {
        // Counts, and no sign before zero.
        size if size >= 100.0 || size.fract() == 0.0 => format!("{:.0}", value + 0.0),
        size if size >= 1.0 => format!("{value:.2}"),
        size if size >= 1e-3 => format!("{value:.3}"),
        _ => format!("{value:.1e}"),
    }
}

/// A share below one, in three letters.
fn share(value: f64) -> String {
    format!("{value:.2}").trim_start_matches('0').to_owned()
}

/// One tile in numbers: which query, how uncertain, whether its match is correct.
fn push(
    table: &mut Table,
    opened: &Labelled,
    row: &str,
    column: &str,
    (query, value): (usize, f64),
) {
    let correct = if opened.corpus.judged.correct()[query] { "correct" } else { "wrong" };
    let note = format!("query {query}, {correct}");
    let cell = opened.cell(row, column, value).noted(note);
    table.push(Cell { quiet: true, ..cell });
}

fn extremes(
    table: &mut Table,
    opened: &Labelled,
    scored: &[(&'static str, Vec<f64>)],
    sheet: &mut ContactSheet,
) {
    for (name, uncertainty) in scored {
        let order = order(uncertainty);
        let n = order.len();
        let (least, most) = (&order[..2.min(n)], &order[n.saturating_sub(2)..]);
        let mut columns = Vec::new();
        for (label, queries) in [("least uncertain", least), ("most uncertain", most)] {
            for (i, &query) in queries.iter().enumerate() {
                push(
                    table,
                    opened,
                    name,
                    &format!("{label} {}", i + 1),
                    (query, uncertainty[query]),
                );
                let remark = format!("u {}", short(uncertainty[query]));
                columns.push(column(opened, query, 1, remark));
            }
        }
        sheet.add_columns(format!("{name}: least and most uncertain"), columns);
    }
}

fn disagreements(
    table: &mut Table,
    opened: &Labelled,
    scored: &[(&'static str, Vec<f64>)],
    sheet: &mut ContactSheet,
) {
    let rank_of = |name: &str| scored.iter().find(|it| it.0 == name).map(|it| ranks(&it.1));
    let (Some(sue), Some(distance)) = (rank_of("SUE"), rank_of("L2-distance")) else { return };
    let correct = opened.corpus.judged.correct();
    for (label, wanted, sign) in [
        ("correct match, SUE more certain", true, 1.0),
        ("wrong match, SUE less certain", false, -1.0),
    ] {
        let gain = |query: &usize| sign * (distance[*query] - sue[*query]);
        let candidates = (0..correct.len()).filter(|&query| correct[query] == wanted);
        let Some(query) = candidates.max_by(|a, b| gain(a).total_cmp(&gain(b)).then(b.cmp(a)))
        else {
            continue;
        };
        for (name, uncertainty) in scored {
            let rank = ranks(uncertainty)[query];
            push(table, opened, label, &format!("share of queries below, {name}"), (query, rank));
        }
        let remark = format!("SUE {} L2 {}", share(sue[query]), share(distance[query]));
        sheet.add_row(label, column(opened, query, NEIGHBORS, remark));
    }
}

fn complements(
    table: &mut Table,
    opened: &Labelled,
    scored: &[(&'static str, Vec<f64>)],
    sheet: &mut ContactSheet,
) {
    let sue = scored.iter().find(|it| it.0 == "SUE").map(|it| ranks(&it.1));
    let verified = scored.iter().find(|it| it.0.contains("RANSAC")).map(|it| ranks(&it.1));
    let (Some(sue), Some(verified)) = (sue, verified) else { return };
    let correct = opened.corpus.judged.correct();
    let mut queries: Vec<usize> = (0..correct.len()).filter(|&query| correct[query]).collect();
    let gain = |query: usize| verified[query] - sue[query];
    queries.sort_by(|&a, &b| gain(b).total_cmp(&gain(a)).then(a.cmp(&b)));
    let mut columns = Vec::new();
    for (i, &query) in queries.iter().take(COMPLEMENTS).enumerate() {
        let row = format!("pair {}", i + 1);
        push(table, opened, &row, "share of queries below, SUE", (query, sue[query]));
        push(table, opened, &row, "share of queries below, verification", (query, verified[query]));
        let remark = format!("SUE {} GV {}", share(sue[query]), share(verified[query]));
        columns.push(column(opened, query, 1, remark));
    }
    sheet.add_columns("correct, doubted by verification (GV) and not by SUE", columns);
}

fn ranked(
    table: &mut Table,
    opened: &Labelled,
    scored: &[(&'static str, Vec<f64>)],
    sheet: &mut ContactSheet,
    seed: u64,
) {
    let n = opened.corpus.judged.len();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < RANKED.min(n) {
        #[expect(clippy::cast_possible_truncation, reason = "an index")]
        let query = rng.random_range(0..n as u64) as usize;
        if !chosen.contains(&query) {
            chosen.push(query);
        }
    }
    for (name, uncertainty) in scored {
        chosen.sort_by(|&a, &b| uncertainty[a].total_cmp(&uncertainty[b]).then(a.cmp(&b)));
        for (i, &query) in chosen.iter().enumerate() {
            push(table, opened, name, &format!("rank {}", i + 1), (query, uncertainty[query]));
        }
        let remark = |query: usize| format!("u {}", short(uncertainty[query]));
        let columns = chosen.iter().map(|&query| column(opened, query, 1, remark(query))).collect();
        sheet.add_columns(format!("{name}: from least to most uncertain"), columns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remarks_fit_below_a_tile() {
        let numbers = [-0.0, -26.0, 0.918, 1.03, 1526.4, 3.0e-70, 0.068].map(short);
        assert_eq!(numbers, ["0", "-26", "0.918", "1.03", "1526", "3.0e-70", "0.068"]);
        assert_eq!([0.21, 0.0, 0.999].map(share), [".21", ".00", "1.00"]);
    }
}
