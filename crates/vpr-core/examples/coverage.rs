//! How often 95 % intervals of AUC-PR hold the true area: the tables of `docs/statistics.md`.
//!
//! ```sh
//! cargo run --release --example coverage -- 2000 300 > coverage.md
//! ```
//!
//! draws 2000 samples per cell and resamples each 300 times where an interval needs that; the
//! intervals of areas themselves need no resamples and are also drawn for 1000 queries.
#![expect(clippy::print_stdout, reason = "an example prints")]

use std::f64::consts::PI;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use vpr_core::{
    Definition, Evaluation, Judged,
    metrics::bootstrap::{Interval, Resampling, Z_95},
};

const BASE_RATES: [f64; 8] = [0.05, 0.1, 0.2, 0.5, 0.7, 0.86, 0.95, 0.98];
const SEPARATIONS: [f64; 4] = [0.0, 1.0, 2.0, 3.0];

/// Confidences of right and wrong matches: two normals of unit variance.
#[derive(Clone, Copy)]
struct Model {
    base_rate: f64,
    separation: f64,
    /// Share of the wrong matches that are as confident as right ones: look-alikes.
    aliased: f64,
}

impl Model {
    /// The area under the curve of infinitely many matches, by rectangles from the top.
    fn area(self) -> f64 {
        const STEPS: u32 = 200_000;
        let (low, high) = (-9.0, 9.0 + self.separation);
        let width = (high - low) / f64::from(STEPS);
        let density = |x: f64| (-x * x / 2.0).exp() / (2.0 * PI).sqrt() * width;
        let (mut right, mut wrong, mut area) = (0.0, 0.0, 0.0);
        for step in (0..STEPS).rev() {
            let at = low + (f64::from(step) + 0.5) * width;
            let (of_right, of_wrong) = (density(at - self.separation), density(at));
            right += self.base_rate * of_right;
            let of_wrong = self.aliased * of_right + (1.0 - self.aliased) * of_wrong;
            wrong += (1.0 - self.base_rate) * of_wrong;
            if right > 0.0 {
                area += of_right * right / (right + wrong);
            }
        }
        area
    }

    /// Confidences and judgements; with `twin`, also confidences that are related to the first.
    fn draw(self, n: usize, rng: &mut ChaCha8Rng) -> (Vec<f64>, Vec<f64>, Vec<bool>) {
        let (mut confidence, mut twin, mut correct) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..n {
            let is_right = rng.random::<f64>() < self.base_rate;
            let seems_right = is_right || rng.random::<f64>() < self.aliased;
            let shift = if seems_right { self.separation } else { 0.0 };
            let (shared, own, other) = (normal(rng), normal(rng), normal(rng));
            confidence.push(shift + 0.8 * shared + 0.6 * own);
            twin.push(shift * 0.75 + 0.8 * shared + 0.6 * other);
            correct.push(is_right);
        }
        (confidence, twin, correct)
    }
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (radius, turn): (f64, f64) = (1.0 - rng.random::<f64>(), rng.random());
    (-2.0 * radius.ln()).sqrt() * (2.0 * PI * turn).cos()
}

/// How many intervals hold the truth, miss it above, miss it below; and their widths.
#[derive(Clone, Copy, Default)]
struct Tally {
    n: u32,
    too_high: u32,
    too_low: u32,
    width: f64,
}

impl Tally {
    fn add(&mut self, (low, high): (f64, f64), truth: f64) {
        self.n += 1;
        self.too_high += u32::from(truth < low - 1e-12);
        self.too_low += u32::from(truth > high + 1e-12);
        self.width += high - low;
    }

    fn coverage(&self) -> f64 {
        1.0 - f64::from(self.too_high + self.too_low) / f64::from(self.n)
    }
}

/// What is drawn for one cell of the tables.
#[derive(Clone, Copy)]
struct Cell {
    model: Model,
    n: usize,
    seed: u64,
    samples: u64,
    resamples: usize,
}

/// The rows of the first table.
const METHODS: [&str; 5] =
    ["percentile", "BCa", "logit, bootstrap", "studentised, logit", "Wilson, effective queries"];

fn main() {
    let mut arguments = std::env::args().skip(1).map_while(|it| it.parse().ok());
    let samples = arguments.next().unwrap_or(500);
    let resamples = usize::try_from(arguments.next().unwrap_or(200)).unwrap_or(200);
    println!("{samples} samples per cell, {resamples} resamples.\n");
    rivals(samples, resamples);
    ours(samples);
    differences(samples, resamples);
}

/// All ways beside each other, the mean over the separations.
fn rivals(samples: u64, resamples: usize) {
    println!(
        "| n | base rate | {} |\n|---|---|{}",
        METHODS.join(" | "),
        "---|".repeat(METHODS.len())
    );
    for (n, base_rate) in grid(&[50, 100, 300], &BASE_RATES) {
        let cells = SEPARATIONS.map(|separation| {
            let model = Model { base_rate, separation, aliased: 0.0 };
            let cell = Cell { model, n, seed: seed(n, base_rate, separation), samples, resamples };
            tallies(cell)
        });
        let text: Vec<String> = (0..METHODS.len())
            .map(|method| {
                let of: Vec<f64> = cells.iter().map(|it| it[method].coverage()).collect();
                let lowest = of.iter().copied().fold(f64::INFINITY, f64::min);
                let mean = of.iter().sum::<f64>() / of.len() as f64;
                format!("{mean:.3}, lowest {lowest:.3}")
            })
            .collect();
        println!("| {n} | {base_rate} | {} |", text.join(" | "));
    }
}

/// The interval of the library in every cell, also with look-alikes and under the other definition.
fn ours(samples: u64) {
    let columns = SEPARATIONS.map(|it| it.to_string()).join(" | ");
    for (title, aliased, definition) in [
        ("published", 0.0, Definition::Published),
        ("corrected, every query known", 0.0, Definition::Corrected),
        ("published, 30 % of the wrong matches look right", 0.3, Definition::Published),
    ] {
        println!(
            "\n{title}\n\n| n | base rate | separation {columns} |\n|---|---|---|---|---|---|"
        );
        for (n, base_rate) in grid(&[50, 100, 300, 1000], &BASE_RATES) {
            let text = SEPARATIONS.map(|separation| {
                let model = Model { base_rate, separation, aliased };
                let seed = seed(n, base_rate, separation);
                let cell = Cell { model, n, seed, samples, resamples: 0 };
                let tally = wilson(cell, definition);
                format!("{:.3} ({:.3})", tally.coverage(), tally.width / f64::from(tally.n))
            });
            println!("| {n} | {base_rate} | {} |", text.join(" | "));
        }
    }
}

/// Paired percentile intervals of a difference.
fn differences(samples: u64, resamples: usize) {
    let columns = SEPARATIONS.map(|it| it.to_string()).join(" | ");
    println!(
        "\npaired differences, percentile\n\n| n | base rate | separation {columns} |\n|---|---|---|---|---|---|"
    );
    for (n, base_rate) in grid(&[50, 100, 300], &BASE_RATES) {
        let text = SEPARATIONS.map(|separation| {
            let model = Model { base_rate, separation, aliased: 0.0 };
            let truth = model.area() - Model { separation: 0.75 * separation, ..model }.area();
            let one = |sample: u64| {
                let (confidence, twin, correct) = model.draw(n, &mut stream(n as u64, sample));
                let judged = Judged::from_flags(correct, vec![true; n]).ok()?;
                let resampling =
                    Resampling { n_resamples: resamples, seed: sample, ..Resampling::default() };
                let first = Evaluation::of_confidence(&confidence, &judged).ok()?;
                let second = Evaluation::of_confidence(&twin, &judged).ok()?;
                first.auc_pr_difference(&second, &resampling).ok()
            };
            let mut tally = Tally::default();
            for Interval { low, high, .. } in all(samples, one) {
                tally.add((low, high), truth);
            }
            format!("{:.3}", tally.coverage())
        });
        println!("| {n} | {base_rate} | {} |", text.join(" | "));
    }
}

fn grid(sizes: &[usize], base_rates: &[f64]) -> Vec<(usize, f64)> {
    sizes.iter().flat_map(|&n| base_rates.iter().map(move |&rate| (n, rate))).collect()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a seed")]
fn seed(n: usize, base_rate: f64, separation: f64) -> u64 {
    n as u64 * 1_000_000 + (base_rate * 1000.0) as u64 * 100 + (separation * 10.0) as u64
}

fn stream(seed: u64, sample: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(sample);
    rng
}

/// What each sample gives, in order, without those that have no area.
fn all<T: Send>(samples: u64, one: impl Fn(u64) -> Option<T> + Sync) -> Vec<T> {
    let results: Vec<Option<T>> = (0..samples).into_par_iter().map(&one).collect();
    results.into_iter().flatten().collect()
}

/// The interval of the library.
fn wilson(cell: Cell, definition: Definition) -> Tally {
    let Model { base_rate, .. } = cell.model;
    let area = cell.model.area();
    let truth = if definition == Definition::Published { area } else { area * base_rate };
    let one = |sample| {
        let (confidence, _, correct) = cell.model.draw(cell.n, &mut stream(cell.seed, sample));
        let judged = Judged::from_flags(correct, vec![true; cell.n]).ok()?;
        if judged.base_rate() == 0.0 {
            return None;
        }
        Evaluation::of_confidence(&confidence, &judged).ok()?.auc_pr_interval(definition).ok()
    };
    let mut tally = Tally::default();
    for Interval { low, high, .. } in all(cell.samples, one) {
        tally.add((low, high), truth);
    }
    tally
}

/// All methods on the same samples.
fn tallies(cell: Cell) -> [Tally; METHODS.len()] {
    let truth = cell.model.area();
    let one = |sample| {
        let mut rng = stream(cell.seed, sample);
        let (confidence, _, correct) = cell.model.draw(cell.n, &mut rng);
        let judged = Judged::from_flags(correct.clone(), vec![true; cell.n]).ok()?;
        let evaluation = Evaluation::of_confidence(&confidence, &judged).ok()?;
        let Interval { low, high, .. } = evaluation.auc_pr_interval(Definition::Published).ok()?;
        let mut order: Vec<usize> = (0..cell.n).collect();
        order.sort_by(|&a, &b| confidence[b].total_cmp(&confidence[a]));
        let ranked: Vec<bool> = order.iter().map(|&query| correct[query]).collect();
        let resampled = resampled(&ranked, cell.resamples, &mut rng);
        let [percentile, bca, logit, studentised] = bootstraps(&ranked, resampled);
        Some([percentile, bca, logit, studentised, (low, high)])
    };
    let mut tallies = [Tally::default(); METHODS.len()];
    for intervals in all(cell.samples, one) {
        for (tally, interval) in tallies.iter_mut().zip(intervals) {
            tally.add(interval, truth);
        }
    }
    tallies
}

/// Area and influence of every match, for matches of falling confidence that are drawn so often;
/// `None` if no drawn match is right.
fn area(ranked: &[bool], drawn: &[f64]) -> Option<(f64, Vec<f64>)> {
    let (mut right, mut all, mut sum, mut before) = (0.0, 0.0, 0.0, 1.0);
    let mut after = Vec::with_capacity(ranked.len());
    for (&is_right, &count) in ranked.iter().zip(drawn) {
        all += count;
        let here = if is_right { count } else { 0.0 };
        right += here;
        let precision: f64 = if all > 0.0 { right / all } else { 1.0 };
        sum += here * f64::midpoint(before, precision);
        after.push((all, precision, here, before));
        before = precision;
    }
    if right == 0.0 {
        return None;
    }
    let value = sum / right;
    let (mut later_right, mut later_wrong, mut next) = (0.0, 0.0, 0.0);
    let mut influence = vec![0.0; ranked.len()];
    for (index, &(all, precision, here, before)) in after.iter().enumerate().rev() {
        if all > 0.0 {
            let weight = f64::midpoint(here, next) / all;
            later_right += weight * (1.0 - precision);
            later_wrong += weight * precision;
        }
        next = here;
        influence[index] = if ranked[index] {
            (f64::midpoint(before, precision) + later_right - value) / right
        } else {
            -later_wrong / right
        };
    }
    Some((value, influence))
}

fn variance(influence: &[f64], drawn: &[f64]) -> f64 {
    influence.iter().zip(drawn).map(|(it, count)| count * it * it).sum()
}

/// Areas of drawn matches and their variances by the delta method.
fn resampled(ranked: &[bool], resamples: usize, rng: &mut ChaCha8Rng) -> Vec<(f64, f64)> {
    let mut areas = Vec::with_capacity(resamples);
    for _ in 0..resamples {
        let mut drawn = vec![0.0; ranked.len()];
        (0..ranked.len()).for_each(|_| drawn[rng.random_range(0..ranked.len())] += 1.0);
        areas.extend(area(ranked, &drawn).map(|(value, it)| (value, variance(&it, &drawn))));
    }
    areas
}

/// Percentile, `BCa`, logit with the bootstrap's variance, studentised on the logit scale.
fn bootstraps(ranked: &[bool], resampled: Vec<(f64, f64)>) -> [(f64, f64); 4] {
    let once = vec![1.0; ranked.len()];
    let Some((value, influence)) = area(ranked, &once) else { return [(0.0, 1.0); 4] };
    let mut values: Vec<f64> = resampled.iter().map(|it| it.0).collect();
    values.sort_by(f64::total_cmp);
    if values.is_empty() {
        return [(0.0, 1.0); 4];
    }
    let n = values.len() as f64;
    let percentile = (quantile(&values, 0.025), quantile(&values, 0.975));

    let below = values.iter().filter(|&&it| it < value).count() as f64;
    let ties = values.iter().filter(|&&it| it == value).count() as f64;
    let bias = probit(((below + ties / 2.0) / n).clamp(0.5 / n, 1.0 - 0.5 / n));
    let moment = |power| influence.iter().map(|it| it.powi(power)).sum::<f64>();
    let acceleration = if moment(2) > 0.0 { moment(3) / (6.0 * moment(2).powf(1.5)) } else { 0.0 };
    let corrected = |z: f64| {
        let sum = bias + z;
        quantile(&values, cumulative(bias + sum / (1.0 - acceleration * sum)))
    };
    let bca = (corrected(-Z_95), corrected(Z_95));

    if value >= 1.0 {
        return [percentile, bca, (1.0, 1.0), (1.0, 1.0)];
    }
    let mean = values.iter().sum::<f64>() / n;
    let spread = (values.iter().map(|it| (it - mean).powi(2)).sum::<f64>() / n).sqrt();
    let slope = |at: f64| 1.0 / (at * (1.0 - at)).max(1e-9);
    let reach = Z_95 * spread * slope(value);
    let logit_interval = (expit(logit(value) - reach), expit(logit(value) + reach));

    let mut ratios: Vec<f64> = resampled
        .iter()
        .filter(|it| it.0 < 1.0 && it.1 > 0.0)
        .map(|&(at, variance)| (logit(at) - logit(value)) / (variance.sqrt() * slope(at)))
        .collect();
    ratios.sort_by(f64::total_cmp);
    let error = variance(&influence, &once).sqrt() * slope(value);
    let end = |share| {
        if ratios.is_empty() {
            return value;
        }
        expit(logit(value) - quantile(&ratios, share) * error)
    };
    [percentile, bca, logit_interval, (end(0.975), end(0.025))]
}

fn logit(share: f64) -> f64 {
    (share / (1.0 - share)).ln()
}

fn expit(value: f64) -> f64 {
    1.0 / (1.0 + (-value).exp())
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
fn quantile(ascending: &[f64], share: f64) -> f64 {
    let last = ascending.len() - 1;
    let position = share.clamp(0.0, 1.0) * last as f64;
    let below = (position.floor() as usize).min(last);
    let above = (below + 1).min(last);
    ascending[below] + (position - below as f64) * (ascending[above] - ascending[below])
}

/// The normal distribution, by Simpson's rule.
fn cumulative(z: f64) -> f64 {
    const STEPS: u32 = 400;
    let width = z.clamp(-9.0, 9.0) / f64::from(STEPS);
    let density = |x: f64| (-x * x / 2.0).exp() / (2.0 * PI).sqrt();
    let sum: f64 = (0..STEPS)
        .map(|step| {
            let at = f64::from(step) * width;
            density(at) + 4.0 * density(at + width / 2.0) + density(at + width)
        })
        .sum();
    0.5 + sum * width / 6.0
}

fn probit(share: f64) -> f64 {
    let (mut low, mut high) = (-9.0, 9.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if cumulative(middle) < share { low = middle } else { high = middle }
    }
    f64::midpoint(low, high)
}
