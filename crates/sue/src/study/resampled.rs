//! Queries resampled to a uniform density, a map that is not: table 5.6.

use std::sync::Arc;

use ndarray::Array2;
use vpr_core::{GroundTruth, Judged, Poses, Retrieval};
use vpr_report::table::Table;

use super::{
    Context,
    density::push_all,
    subject::{Labelled, Subject, open_one},
};
use crate::{Result, corpus::Corpus};

/// What is kept of map and queries.
#[derive(Clone, Copy)]
pub(super) struct Plan<'a> {
    pub(super) nth: &'a [usize],
    /// Distances between neighbouring queries, in metres.
    pub(super) spacings: &'a [(f64, f64)],
    /// Of the second half of the map every so many-th reference is kept.
    pub(super) thinning: usize,
}

pub(super) fn run(
    table: &mut Table,
    subject: &Subject,
    plan: Plan<'_>,
    context: Context<'_>,
) -> Result<()> {
    let Some(opened) = open_one(table, subject, "none", context)? else { return Ok(()) };
    let Some(query_poses) = opened.corpus.query_poses.clone() else { return Ok(()) };
    let half = opened.corpus.poses.len() / 2;
    let kept = |index: usize| index < half || (index - half).is_multiple_of(plan.thinning.max(1));
    let references: Vec<usize> = (0..opened.corpus.poses.len()).filter(|&it| kept(it)).collect();
    for &(low, high) in plan.spacings {
        let queries = spread_out(&query_poses, low, high);
        let row = format!("z {low}–{high} m");
        if queries.is_empty() {
            let why = format!("no query has its nearest neighbour {low} to {high} m away");
            table.push(vpr_report::table::Cell::absent(&row, "none", why));
            continue;
        }
        let corpus = part_of(&opened.corpus, &queries, &references)?;
        let corpus = Arc::new(corpus);
        let part = Labelled { row: row.clone(), corpus, learned: Vec::new() };
        push_all(table, &part, &row, plan.nth)?;
    }
    Ok(())
}

/// Greedily, in order: queries at least `low` from all kept before, whose nearest kept one is then
/// at most `high` away.
fn spread_out(poses: &Poses, low: f64, high: f64) -> Vec<usize> {
    let between = |a: usize, b: usize| nalgebra::distance(&poses.position(a), &poses.position(b));
    let mut kept: Vec<usize> = Vec::new();
    for query in 0..poses.len() {
        if kept.iter().all(|&other| between(query, other) >= low) {
            kept.push(query);
        }
    }
    let nearest = |query: usize| {
        let others = kept.iter().filter(|&&other| other != query);
        others.map(|&other| between(query, other)).fold(f64::INFINITY, f64::min)
    };
    kept.iter().copied().filter(|&query| nearest(query) <= high).collect()
}

/// The same retrieval as if only these queries and references existed.
fn part_of(corpus: &Corpus, queries: &[usize], references: &[usize]) -> Result<Corpus> {
    let mut place = vec![None; corpus.poses.len()];
    for (new, &old) in references.iter().enumerate() {
        place[old] = Some(new);
    }
    let rows: Vec<Vec<(usize, f32)>> = queries
        .iter()
        .map(|&query| {
            let ranked = corpus.retrieval.indices(query);
            let ranked = ranked.iter().zip(corpus.retrieval.distances(query));
            ranked.filter_map(|(&old, &distance)| Some((place[old]?, distance))).collect()
        })
        .collect();
    let k = rows.iter().map(Vec::len).min().unwrap_or(0);
    let indices = Array2::from_shape_fn((rows.len(), k), |(row, rank)| rows[row][rank].0);
    let distances = Array2::from_shape_fn((rows.len(), k), |(row, rank)| rows[row][rank].1);
    let retrieval = Retrieval::new(indices, distances)?;
    let correct = |&query: &usize| {
        let correct = corpus.truth.correct(query).iter();
        correct.filter_map(|&old| place[old]).collect()
    };
    let lists = queries.iter().map(correct).collect();
    let truth = GroundTruth::from_lists(lists, references.len())?;
    Ok(Corpus {
        judged: Judged::new(&retrieval.best(), &truth)?,
        retrieval,
        truth,
        poses: pick(&corpus.poses, references),
        query_poses: corpus.query_poses.as_ref().map(|poses| pick(poses, queries)),
        images: None,
        variances: None,
        ..corpus.clone()
    })
}

fn pick(poses: &Poses, rows: &[usize]) -> Poses {
    match poses {
        Poses::Planar(all) => Poses::Planar(rows.iter().map(|&row| all[row]).collect()),
        Poses::Spatial(all) => Poses::Spatial(rows.iter().map(|&row| all[row]).collect()),
        Poses::SixDof(all) => Poses::SixDof(rows.iter().map(|&row| all[row]).collect()),
    }
}
