//! Tests of the tests: of methods that are equal as many are called different as the level says, and
//! of others as many as the power says. All draws are from seeds that stand here.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::print_stdout, reason = "docs/statistics.md quotes what is found")]

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use vpr_core::{
    Definition, Evaluation, Judged, best_by_auc_pr, best_by_hits,
    metrics::{Difference, Discordant, McNemar, Plan, bootstrap::Resampling, holm},
};

const LEVEL: f64 = 0.05;
const STUDIES: u64 = 1000;
/// Two standard deviations of 5 % of a thousand studies.
const ALLOWED: f64 = 0.014;
/// How far power may be from what was predicted.
const POINTS: f64 = 0.03;

/// What a study asks two methods, in chances: of a query that both get right, and of one that only
/// the first or only the second gets right.
#[derive(Clone, Copy)]
struct World {
    n: usize,
    both: f64,
    first: f64,
    second: f64,
}

/// What the two methods found: whether right, and how sure.
struct Study {
    correct: [Vec<bool>; 2],
    confidence: [Vec<f64>; 2],
}

/// The sum of twelve even draws less six: nearly normal, of variance 1.
fn noise(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

impl World {
    /// One study; methods are surer by one standard deviation where they are right, and share half
    /// the variance of what else makes them sure.
    fn study(self, seed: u64) -> Study {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        rng.set_stream(seed);
        let mut study = Study { correct: [vec![], vec![]], confidence: [vec![], vec![]] };
        for _ in 0..self.n {
            let draw: f64 = rng.random();
            let right = match draw {
                it if it < self.both => [true, true],
                it if it < self.both + self.first => [true, false],
                it if it < self.both + self.first + self.second => [false, true],
                _ => [false, false],
            };
            let shared = noise(&mut rng);
            for (method, right) in right.into_iter().enumerate() {
                let own = (shared + noise(&mut rng)) * 0.5_f64.sqrt();
                study.correct[method].push(right);
                study.confidence[method].push(f64::from(u8::from(right)) + own);
            }
        }
        study
    }

    /// The share of studies in which something is found.
    fn share(self, found: impl Fn(&Study) -> bool + Sync) -> f64 {
        let found = |seed: u64| u32::from(found(&self.study(seed)));
        f64::from((0..STUDIES).into_par_iter().map(found).sum::<u32>()) / STUDIES as f64
    }
}

fn mcnemar(study: &Study, test: McNemar) -> f64 {
    Discordant::count(&study.correct[0], &study.correct[1]).unwrap().p_value(test)
}

fn auc_pr(study: &Study, n_resamples: usize) -> Difference {
    let known = vec![true; study.correct[0].len()];
    let judged =
        [0, 1].map(|it| Judged::from_flags(study.correct[it].clone(), known.clone()).unwrap());
    let [first, second] =
        [0, 1].map(|it| Evaluation::of_confidence(&study.confidence[it], &judged[it]).unwrap());
    let resampling = Resampling { n_resamples, ..Resampling::default() };
    first.auc_pr_test(&second, Definition::Corrected, &resampling).unwrap()
}

/// Two methods that are right as often, on 20 % of the queries not on the same.
const EQUAL: World = World { n: 300, both: 0.6, first: 0.1, second: 0.1 };
/// Two methods of which the first is right on 8 % more.
const BETTER: World = World { n: 300, both: 0.6, first: 0.14, second: 0.06 };

#[test]
fn of_equal_methods_five_per_cent_are_called_different_by_mcnemar() {
    let share = |test| EQUAL.share(|study| mcnemar(study, test) <= LEVEL);
    let (mid, exact) = (share(McNemar::MidP), share(McNemar::Exact));
    println!("mid-p {mid}, exact {exact}");
    assert!((mid - LEVEL).abs() <= ALLOWED, "{mid}");
    assert!(exact <= mid && exact <= LEVEL + ALLOWED, "{exact}");
    // The exact test keeps below the level for any number of discordant queries.
    for n in [10, 50, 300] {
        let plan = Plan { first: 0.1, second: 0.1, level: LEVEL, test: McNemar::Exact };
        assert!(plan.power(n).unwrap() <= LEVEL, "{n}");
    }
}

#[test]
fn of_equal_methods_five_per_cent_are_called_different_by_the_bootstrap() {
    let share = EQUAL.share(|study| auc_pr(study, 399).p_value <= LEVEL);
    println!("bootstrap of AUC-PR {share}");
    assert!((share - LEVEL).abs() <= ALLOWED, "{share}");
}

#[test]
fn mcnemar_has_the_power_that_was_predicted() {
    for test in [McNemar::Exact, McNemar::MidP] {
        let plan = Plan { first: BETTER.first, second: BETTER.second, level: LEVEL, test };
        let predicted = plan.power(BETTER.n).unwrap();
        let share = BETTER.share(|study| mcnemar(study, test) <= LEVEL);
        println!("{test:?}: predicted {predicted:.3}, found {share}");
        assert!((share - predicted).abs() <= POINTS, "{test:?}: {predicted} {share}");
        // And with as many queries as it says are needed.
        let n = plan.queries_for(0.9).unwrap().unwrap();
        let share = World { n, ..BETTER }.share(|study| mcnemar(study, test) <= LEVEL);
        println!("{test:?}: {n} queries for 0.9, found {share}");
        assert!((share - 0.9).abs() <= POINTS, "{test:?}: {n} queries, {share}");
    }
}

#[test]
fn the_bootstrap_has_the_power_that_was_predicted() {
    // What is known before: a hundred studies of 2000 queries each, so that neither the difference
    // nor its error is off by more than a point of power.
    let studies = STUDIES..STUDIES + 100;
    let pilots: Vec<Difference> = studies
        .into_par_iter()
        .map(|seed| auc_pr(&World { n: 2000, ..BETTER }.study(seed), 199))
        .collect();
    let mean = |of: fn(&Difference) -> f64| pilots.iter().map(of).sum::<f64>() / 100.0;
    let mut pilot = pilots[0];
    pilot.interval.estimate = mean(|it| it.interval.estimate);
    pilot.standard_error = mean(|it| it.standard_error);
    println!("difference {:.4}, error {:.4}", pilot.interval.estimate, pilot.standard_error);
    for n in [150, 300] {
        let predicted = pilot.power(n, LEVEL).unwrap();
        let share = World { n, ..BETTER }.share(|study| auc_pr(study, 399).p_value <= LEVEL);
        println!("{n} queries: predicted {predicted:.3}, found {share}");
        assert!((share - predicted).abs() <= POINTS, "{n} queries: {predicted} {share}");
    }
}

#[test]
fn of_ten_equal_pairs_one_is_called_different_in_five_per_cent_of_studies_after_holm() {
    let any = |study: u64, corrected: bool| {
        let pairs = (0..10).map(|pair| mcnemar(&EQUAL.study(10 * study + pair), McNemar::MidP));
        let raw: Vec<f64> = pairs.collect();
        let p = if corrected { holm(&raw).unwrap() } else { raw };
        u32::from(p.iter().any(|it| *it <= LEVEL))
    };
    let share = |corrected| {
        let studies = (0..STUDIES).into_par_iter().map(|study| any(study, corrected));
        f64::from(studies.sum::<u32>()) / STUDIES as f64
    };
    let (raw, corrected) = (share(false), share(true));
    println!("without {raw}, with Holm {corrected}");
    assert!(raw > 0.3 && corrected <= LEVEL + ALLOWED, "{raw} {corrected}");
}

fn right(share: usize, n: usize) -> Vec<bool> {
    (0..n).map(|query| query * 7 % 10 < share).collect()
}

#[test]
fn only_what_a_test_tells_from_every_other_is_best() {
    let best = |hits: &[Vec<bool>]| best_by_hits(hits, McNemar::MidP, 0.05).unwrap();
    assert_eq!(best(&[right(3, 200), right(9, 200), right(5, 200)]), Some(1));
    // The same two are told apart alone and not beside a third that is as good.
    assert_eq!(best(&[right(9, 200), right(5, 200), right(9, 200)]), None);
    assert_eq!(best(&[right(9, 10), right(7, 10)]), None);
    assert_eq!((best(&[right(9, 10)]), best(&[])), (None, None));
    assert!(best_by_hits(&[right(9, 10), right(9, 11)], McNemar::MidP, 0.05).is_err());
}

/// Six wins of six have p = 1/64: enough alone, not among three pairs.
#[test]
fn more_comparisons_ask_for_more() {
    let a: Vec<bool> = (0..20).map(|it| it < 16).collect();
    let b: Vec<bool> = (0..20).map(|it| it < 10).collect();
    let p = Discordant::count(&a, &b).unwrap().p_value(McNemar::MidP);
    assert!((p - 1.0 / 64.0).abs() < 1e-12, "{p}");
    let best = |hits: &[Vec<bool>], level| best_by_hits(hits, McNemar::MidP, level).unwrap();
    assert_eq!(best(&[a.clone(), b.clone()], 0.02), Some(0));
    assert_eq!(best(&[a, b.clone(), b], 0.02), None);
}

#[test]
fn areas_are_told_apart_by_the_same_p_values() {
    let n = 120;
    let confidence: Vec<f64> = (0..n).map(|query| (query * 31 % 17) as f64).collect();
    let judged = [9, 4, 8].map(|it| Judged::from_flags(right(it, n), vec![true; n]).unwrap());
    let evaluations: Vec<_> =
        judged.iter().map(|it| Evaluation::of_confidence(&confidence, it).unwrap()).collect();
    let (definition, resampling) = (Definition::Corrected, Resampling::default());
    let best = |it: &[Evaluation<'_>]| best_by_auc_pr(it, definition, &resampling, 0.05).unwrap();
    assert_eq!(best(&evaluations[..2]), Some(0));
    let test = evaluations[0].auc_pr_test(&evaluations[2], definition, &resampling).unwrap();
    let is_best = best(&[evaluations[0].clone(), evaluations[2].clone()]).is_some();
    assert_eq!(is_best, test.p_value <= 0.05, "{}", test.p_value);
    assert_eq!(best(&[evaluations[0].clone(), evaluations[0].clone()]), None);
}

/// With the default number of resamples no corrected p-value of fifteen methods is below .1.
#[test]
fn many_methods_are_resampled_often_enough() {
    let n = 60;
    let confidence = vec![0.0; n];
    let share = |it: usize| if it == 0 { 10 } else { 1 };
    let judged: Vec<_> =
        (0..15).map(|it| Judged::from_flags(right(share(it), n), vec![true; n]).unwrap()).collect();
    let evaluations: Vec<_> =
        judged.iter().map(|it| Evaluation::of_confidence(&confidence, it).unwrap()).collect();
    let best = best_by_auc_pr(&evaluations, Definition::Corrected, &Resampling::default(), 0.05);
    assert_eq!(best.unwrap(), Some(0));
}
