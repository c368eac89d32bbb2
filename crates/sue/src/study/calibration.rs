//! Whether calibrated thresholds keep their promise on random splits.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use vpr_core::metrics::bootstrap::{Z_95, pick, wilson_interval};
use vpr_report::table::Table;

use super::{
    Context,
    subject::{Labelled, Subject, open},
};
use crate::{
    EstimatorChoice, Result,
    calibrate::{PrecisionGoal, Scope, calibrate_precision},
};

/// What is promised and how often that is tried.
#[derive(Clone, Copy)]
pub(super) struct Plan {
    pub(super) splits: usize,
    pub(super) precision: f64,
    pub(super) risk: f64,
}

/// What one split gave.
#[derive(Clone, Copy)]
struct Outcome {
    found: bool,
    /// Share of the held-out queries that are accepted.
    coverage: f64,
    /// Whether the held-out matches fall below the promise.
    held_out_below: bool,
    /// Whether all matches, calibration and held out, fall below it.
    all_below: bool,
}

pub(super) fn run(
    table: &mut Table,
    subjects: &[Subject],
    plan: Plan,
    context: Context<'_>,
) -> Result<()> {
    for (opened, _) in open(table, subjects, "splits with a threshold", context)? {
        let choices = [EstimatorChoice::Sue, EstimatorChoice::L2, EstimatorChoice::Pa];
        for scored in opened.score(&choices)? {
            let Ok(uncertainty) = &scored.uncertainty else { continue };
            for (scope, name) in
                [(Scope::Population, "population"), (Scope::NextBatch, "next batch")]
            {
                let goal = PrecisionGoal { precision: plan.precision, risk: plan.risk, scope };
                let outcomes = (0..plan.splits)
                    .into_par_iter()
                    .map(|split| one(&opened, uncertainty, goal, (context.seed, split)))
                    .collect::<Result<Vec<_>>>()?;
                push(
                    table,
                    &opened,
                    &format!("{}: {}, {name}", opened.row, scored.name),
                    &outcomes,
                )?;
            }
        }
    }
    Ok(())
}

/// Calibrates on one random half and looks at the other.
fn one(
    opened: &Labelled,
    uncertainty: &[f64],
    goal: PrecisionGoal,
    (seed, split): (u64, usize),
) -> Result<Outcome> {
    let correct = opened.corpus.judged.correct();
    let mut order: Vec<usize> = (0..correct.len()).collect();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(split as u64);
    for i in (1..order.len()).rev() {
        #[expect(clippy::cast_possible_truncation, reason = "an index")]
        order.swap(i, rng.random_range(0..=i as u64) as usize);
    }
    let (calibration, held_out) = order.split_at(order.len() / 2);
    let result =
        calibrate_precision(&pick(uncertainty, calibration), &pick(correct, calibration), goal)?;
    let judge = |queries: &[usize]| {
        let accepted = queries.iter().filter(|&&it| result.threshold.accepts(uncertainty[it]));
        accepted
            .fold((0_usize, 0_usize), |(n, right), &it| (n + 1, right + usize::from(correct[it])))
    };
    let below = |(n, right): (usize, usize)| (right as f64) < goal.precision * n as f64 - 1e-9;
    let outside = judge(held_out);
    Ok(Outcome {
        found: result.n_accepted > 0,
        coverage: outside.0 as f64 / held_out.len() as f64,
        held_out_below: below(outside),
        all_below: below(judge(&order)),
    })
}

fn push(table: &mut Table, opened: &Labelled, row: &str, outcomes: &[Outcome]) -> Result<()> {
    let share = |is: fn(&Outcome) -> bool| outcomes.iter().filter(|it| is(it)).count();
    let n = outcomes.len();
    let mut count = |column: &str, hits: usize| -> Result<()> {
        let interval = wilson_interval(hits, n, Z_95)?;
        let cell = vpr_report::table::Cell::new(
            row,
            column,
            interval.estimate,
            opened.corpus.provenance,
            n,
        );
        table.push(cell.within(interval.low, interval.high, "Wilson, over splits"));
        Ok(())
    };
    count("splits with a threshold", share(|it| it.found))?;
    count("broken on held-out queries", share(|it| it.held_out_below))?;
    count("broken on all queries", share(|it| it.all_below))?;
    let coverage = outcomes.iter().map(|it| it.coverage).sum::<f64>() / n as f64;
    let cell =
        vpr_report::table::Cell::new(row, "mean coverage", coverage, opened.corpus.provenance, n);
    table.push(cell);
    table.push(opened.cell(row, "base rate", opened.corpus.judged.base_rate()));
    Ok(())
}
