//! Matches whose precision below any threshold is known, with ties of any share.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use sue::{
    Threshold,
    calibrate::{PrecisionGoal, Scope, calibrate_precision},
};

/// How the chance of being wrong depends on `x`, uniform on (0, 1).
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wrong {
    /// `worst · x`.
    Rising(f64),
    /// The same everywhere.
    Flat(f64),
    /// `mean · (1 + sin(2π n x))`: the precision below a threshold rises and falls.
    Waves {
        /// Mean chance.
        mean: f64,
        /// Number of waves.
        n: f64,
    },
}

/// A population of matches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Population {
    /// Who is wrong.
    pub(crate) wrong: Wrong,
    /// Share of the matches whose uncertainty is `x` rounded up to one of few values.
    pub(crate) tied: f64,
    /// How many such values there are.
    pub(crate) n_values: u32,
}

/// What one calibration set gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// No threshold.
    NoThreshold,
    /// A threshold as precise as promised.
    Kept,
    /// A threshold that is not.
    Broken,
}

impl Population {
    fn draw(&self, n: usize, rng: &mut ChaCha8Rng) -> (Vec<f64>, Vec<bool>) {
        let one = |_| {
            let x: f64 = 1.0 - rng.random::<f64>();
            let is_wrong = rng.random::<f64>() < self.chance(x);
            let is_tied = rng.random::<f64>() < self.tied;
            let values = f64::from(self.n_values);
            (if is_tied { (x * values).ceil() / values } else { x }, !is_wrong)
        };
        (0..n).map(one).unzip()
    }

    fn chance(&self, x: f64) -> f64 {
        match self.wrong {
            Wrong::Rising(worst) => worst * x,
            Wrong::Flat(chance) => chance,
            Wrong::Waves { mean, n } => mean * (1.0 + (std::f64::consts::TAU * n * x).sin()),
        }
    }

    /// The share of all matches that are wrong and have `x` up to this.
    fn wrong_up_to(&self, x: f64) -> f64 {
        match self.wrong {
            Wrong::Rising(worst) => worst * x * x / 2.0,
            Wrong::Flat(chance) => chance * x,
            Wrong::Waves { mean, n } => {
                let turn = std::f64::consts::TAU * n;
                mean * (x + (1.0 - (turn * x).cos()) / turn)
            }
        }
    }

    /// The precision of all matches below a limit, exactly.
    pub(crate) fn precision_below(&self, limit: f64) -> f64 {
        let plain = limit.clamp(0.0, 1.0);
        let values = f64::from(self.n_values);
        // The largest of the few values below the limit.
        let tied =
            if limit > 1.0 { 1.0 } else { ((limit * values).ceil() - 1.0).max(0.0) / values };
        let all = (1.0 - self.tied) * plain + self.tied * tied;
        let wrong =
            (1.0 - self.tied) * self.wrong_up_to(plain) + self.tied * self.wrong_up_to(tied);
        if all > 0.0 { 1.0 - wrong / all } else { 1.0 }
    }

    /// Calibrates on one set of `n` matches.
    pub(crate) fn calibrate(
        &self,
        n: usize,
        goal: PrecisionGoal,
        rng: &mut ChaCha8Rng,
    ) -> sue::Result<Outcome> {
        let (uncertainty, correct) = self.draw(n, rng);
        let threshold = calibrate_precision(&uncertainty, &correct, goal)?.threshold;
        Ok(if threshold == Threshold::NOTHING {
            Outcome::NoThreshold
        } else if self.precision_below(threshold.limit()) < goal.precision {
            Outcome::Broken
        } else {
            Outcome::Kept
        })
    }
}

/// A promise about all queries there could be.
pub(crate) fn goal(precision: f64, risk: f64) -> PrecisionGoal {
    PrecisionGoal { precision, risk, scope: Scope::Population }
}
