//! How often the promise of `calibrate_precision` is broken: the tables of `docs/statistics.md`.
//!
//! ```sh
//! cargo run --release --example promise > promise.md
//! ```
#![expect(clippy::print_stdout, reason = "an example prints")]

#[path = "../tests/promise/draw.rs"]
mod draw;

use draw::{Outcome, Population, Wrong, goal};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Calibration sets of each kind.
const SETS: u64 = 10_000;
const PRECISION: f64 = 0.9;

fn main() -> sue::Result<()> {
    ties()?;
    conditional()
}

/// Share of the sets that find a threshold, and that break the promise.
fn shares(population: Population, n: usize, risk: f64) -> sue::Result<(f64, f64)> {
    let one = |set| {
        let mut rng = ChaCha8Rng::seed_from_u64(16);
        rng.set_stream(set);
        population.calibrate(n, goal(PRECISION, risk), &mut rng)
    };
    let sets: Vec<Outcome> = (0..SETS).into_par_iter().map(one).collect::<sue::Result<_>>()?;
    let share =
        |is: fn(Outcome) -> bool| sets.iter().filter(|it| is(**it)).count() as f64 / SETS as f64;
    Ok((share(|it| it != Outcome::NoThreshold), share(|it| it == Outcome::Broken)))
}

/// Ties of every share, over a few numbers of values; risk .1.
fn ties() -> sue::Result<()> {
    let kinds = [
        ("rising to .4", Wrong::Rising(0.4)),
        (".101 everywhere", Wrong::Flat(0.101)),
        ("waves about .09", Wrong::Waves { mean: 0.09, n: 7.3 }),
    ];
    println!("| tied | values | {} |", kinds.map(|it| format!("wrong: {}", it.0)).join(" | "));
    println!("|---|---|---|---|---|");
    for tenths in 0..=10 {
        for n_values in [1, 3, 20] {
            let mut text = Vec::new();
            for (_, wrong) in kinds {
                let tied = f64::from(tenths) / 10.0;
                let (found, broken) = shares(Population { wrong, tied, n_values }, 200, 0.1)?;
                text.push(format!("{broken:.3} of {found:.3}"));
            }
            println!("| {:.1} | {n_values} | {} |", f64::from(tenths) / 10.0, text.join(" | "));
        }
    }
    Ok(())
}

/// What is broken among the sets that find a threshold.
fn conditional() -> sue::Result<()> {
    println!(
        "\n| wrong | n | risk | with a threshold | broken, of all | of those with one | risk / share |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (name, wrong) in [
        ("rising to .2", Wrong::Rising(0.2)),
        ("rising to .4", Wrong::Rising(0.4)),
        ("rising to .8", Wrong::Rising(0.8)),
        (".09 everywhere", Wrong::Flat(0.09)),
        (".101 everywhere", Wrong::Flat(0.101)),
    ] {
        for n in [100, 300, 1000] {
            for risk in [0.1, 0.01] {
                let population = Population { wrong, tied: 0.0, n_values: 1 };
                let (found, broken) = shares(population, n, risk)?;
                let of = |part: f64| {
                    if found > 0.0 {
                        format!("{:.3}", (part / found).min(1.0))
                    } else {
                        "–".to_owned()
                    }
                };
                println!(
                    "| {name} | {n} | {risk} | {found:.4} | {broken:.4} | {} | {} |",
                    of(broken),
                    of(risk)
                );
            }
        }
    }
    Ok(())
}
