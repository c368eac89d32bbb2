//! The promise of a precision holds over all calibration sets, with ties of every share. The
//! example `promise` draws 10 000 sets of each kind.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod draw;

use draw::{Outcome, Population, Wrong, goal};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const RISK: f64 = 0.1;

/// How many of so many sets gave a threshold, and how many of these are broken.
fn count(population: Population, sets: u64, n: usize) -> (u32, u32) {
    let (mut n_found, mut n_broken) = (0, 0);
    for set in 0..sets {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        rng.set_stream(set);
        let kept = population.calibrate(n, goal(0.9, RISK), &mut rng).unwrap();
        n_found += u32::from(kept != Outcome::NoThreshold);
        n_broken += u32::from(kept == Outcome::Broken);
    }
    (n_found, n_broken)
}

#[test]
fn at_most_the_risk_is_broken_whatever_share_is_tied() {
    // 10 000 sets: 11 shares, 3 numbers of values, about 300 of each; a share that breaks exactly
    // a tenth of 909 is above 13 % once in a thousand times.
    for tied in 0..=10 {
        let (mut n_found, mut n_broken) = (0, 0);
        for n_values in [1, 3, 20] {
            let tied = f64::from(tied) / 10.0;
            let population = Population { wrong: Wrong::Rising(0.4), tied, n_values };
            let counted = count(population, 303, 200);
            (n_found, n_broken) = (n_found + counted.0, n_broken + counted.1);
        }
        assert!(
            f64::from(n_broken) <= 0.13 * 909.0,
            "{n_broken} of 909 broke it, {tied} tenths tied"
        );
        assert!(n_found > 0, "{tied} tenths tied");
    }
}

#[test]
fn where_no_threshold_is_good_few_sets_find_one_and_all_of_these_break_it() {
    for (tied, n_values) in [(0.0, 1), (0.5, 3), (1.0, 3)] {
        let population = Population { wrong: Wrong::Flat(0.101), tied, n_values };
        let (n_found, n_broken) = count(population, 600, 200);
        assert_eq!(n_found, n_broken);
        assert!(n_broken > 0 && f64::from(n_broken) <= 0.138 * 600.0, "{n_broken} of 600");
    }
}

#[test]
fn a_precision_that_rises_and_falls_is_promised_too() {
    for (tied, n_values) in [(0.0, 1), (0.5, 20)] {
        let population = Population { wrong: Wrong::Waves { mean: 0.09, n: 7.3 }, tied, n_values };
        let (n_found, n_broken) = count(population, 600, 200);
        assert!(n_found > n_broken && f64::from(n_broken) <= 0.138 * 600.0, "{n_broken} of 600");
    }
}

#[test]
fn equal_uncertainties_of_right_matches_are_accepted() {
    // Every match right: all sets find a threshold, whatever is tied.
    for tied in [0.0, 0.3, 0.7, 1.0] {
        for n_values in [1, 2, 5] {
            let population = Population { wrong: Wrong::Flat(0.0), tied, n_values };
            assert_eq!(count(population, 20, 200), (20, 0), "{tied} tied, {n_values} values");
        }
    }
}
