//! How to fine-tune.

use std::path::Path;

use serde::Deserialize;
use vpr_core::Error as CoreError;
use vpr_nets::train::Log;

use super::{Material, Parts};
use crate::{MiningParams, Preset, Result};

/// Steps between two lines of the log.
const LOG_EVERY: usize = 5;

/// How to fine-tune. Of these the thesis gives the learning rate alone, 1e-7 for its `DINOv2` models;
/// the default network, of 0.65 M parameters, needs a larger one. Steps, batch and rate of the default
/// are those, of a few, after which held-out references of the generated railway were found best; no
/// query was looked at. That the network is mixed with the one before was decided after the recall
/// of rail's queries had been seen; the share is chosen by held-out references.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Finetuning {
    /// Most steps, a multiple of those of a round.
    pub steps: usize,
    /// Steps between two minings and validations, a multiple of 5.
    pub round: usize,
    /// Rounds without a gain after which it ends.
    pub patience: usize,
    /// Triplets of a step.
    pub batch: usize,
    /// Learning rate of Adam, after a warm-up over the first twentieth; 0 changes nothing.
    pub rate: f64,
    /// Margin of the triplet loss.
    pub margin: f64,
    /// Which references are compared.
    pub mining: MiningParams,
    /// How queries are made of references.
    pub augmentations: Preset,
    /// How the held-out references are changed: always the same, so that what is tuned with other
    /// augmentations is judged alike.
    pub trial: Preset,
    /// Share of references that are not learned from but say when it was best.
    pub held_out: f64,
    /// Variants of each of them.
    pub variants: usize,
    /// What of the network learns.
    pub parts: Parts,
    /// Rank of its updates, where they have one.
    pub rank: usize,
    /// Parts of the network that stay as they are besides, by the names of its parameters.
    pub frozen: Vec<String>,
    /// Decides what is held out, drawn and changed.
    pub seed: u64,
}

impl Default for Finetuning {
    fn default() -> Self {
        Self {
            steps: 50,
            round: 25,
            patience: 6,
            batch: 16,
            rate: 3e-4,
            margin: 0.3,
            mining: MiningParams::default(),
            augmentations: Preset::All,
            trial: Preset::All,
            held_out: 0.15,
            variants: 4,
            parts: Parts::All,
            rank: 4,
            frozen: Vec::new(),
            seed: 1,
        }
    }
}

/// The log that a fine-tuning keeps.
#[must_use]
pub fn run_log(path: &Path) -> Log {
    Log::new(path, &["loss", "rate", "recall_held_out", "gap_held_out"], LOG_EVERY)
}

impl Finetuning {
    /// Steps for about five passes over a map of so many references, in whole rounds.
    #[must_use]
    pub fn steps_for(&self, n_references: usize) -> usize {
        let queries = n_references as f64 * (1.0 - self.held_out);
        let rounds = 5.0 * queries / (self.batch * self.round).max(1) as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count")]
        let rounds = rounds.round().max(1.0) as usize;
        rounds * self.round
    }

    /// Everything that two runs must share to be one; `weights` stands for the network that it
    /// begins with.
    #[must_use]
    pub fn facts(&self, material: &Material, weights: &str) -> Vec<(&'static str, String)> {
        let MiningParams { positive_m, negative_m, hardest } = self.mining;
        let mining = match material.poses() {
            Some(_) => {
                format!("positives to {positive_m} m, the {hardest} hardest from {negative_m} m")
            }
            None => "no poses, random negatives".to_owned(),
        };
        vec![
            ("finetuned_from", weights.to_owned()),
            ("references", format!("{}, digest {}", material.len(), material.digest())),
            ("mining", mining),
            ("augmentations", self.augmentations.key().to_owned()),
            ("trial", format!("{}, {} variants", self.trial.key(), self.variants)),
            ("held_out", self.held_out.to_string()),
            ("steps", format!("{} in rounds of {}", self.steps, self.round)),
            ("patience", self.patience.to_string()),
            ("batch", format!("{} triplets", self.batch)),
            ("rate", self.rate.to_string()),
            ("margin", self.margin.to_string()),
            (
                "parts",
                match self.parts {
                    Parts::LowRank => format!("{}, rank {}", self.parts.key(), self.rank),
                    parts => parts.key().to_owned(),
                },
            ),
            ("frozen", self.frozen.join(" ")),
            ("seed", self.seed.to_string()),
            ("licence", "MIT OR Apache-2.0".to_owned()),
        ]
    }

    /// Checks the numbers.
    ///
    /// # Errors
    ///
    /// [`CoreError::Parameter`] with the first that is out of range.
    pub fn check(&self) -> Result<()> {
        let refuse = |name, value: String, reason| -> Result<()> {
            Err(CoreError::Parameter { name, value, reason }.into())
        };
        self.mining.check()?;
        if self.round == 0 || !self.round.is_multiple_of(LOG_EVERY) {
            return refuse("round", self.round.to_string(), "must be a multiple of 5 steps");
        }
        if self.steps == 0 || !self.steps.is_multiple_of(self.round) {
            return refuse("steps", self.steps.to_string(), "must be a multiple of `round`");
        }
        for (name, count) in [
            ("batch", self.batch),
            ("patience", self.patience),
            ("variants", self.variants),
            ("rank", self.rank),
        ] {
            if count == 0 {
                return refuse(name, "0".to_owned(), "must be at least 1");
            }
        }
        for (name, value) in [("rate", self.rate), ("margin", self.margin)] {
            if !(value >= 0.0 && value.is_finite()) {
                return refuse(name, value.to_string(), "must be a number from 0");
            }
        }
        Ok(())
    }
}
