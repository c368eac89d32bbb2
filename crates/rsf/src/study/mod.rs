//! What an experiment file of chapter 4 can ask for, one file per study.

mod adapted;
mod attention;
mod choice;
mod embedding;
mod gallery;
mod gaps;
mod place;
mod prediction;
mod recalls;
mod tuned;

use serde::Deserialize;
use vpr_report::{experiment::Experiment, page::Report};
use vpr_study::Sources;

pub use adapted::Adapted;
pub use gaps::{Gap, gap};
pub use place::{Laps, Place, references};

use crate::{
    Result,
    net::{Finetuning, Whitening},
};

/// What to compute; the key `kind` of `[study]` chooses.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Study {
    /// Recall@N before and after fine-tuning: tables 4.1 and 4.3 to 4.6.
    Recalls {
        /// Columns.
        places: Vec<Place>,
        /// Rows; the first is what the others are held against.
        encoders: Vec<Encoder>,
        /// Which N; a column for each, named so if there are several.
        ranks: Vec<usize>,
    },
    /// What held-out references say of an adaptation before a query is seen, against what queries say.
    Prediction {
        /// Rows.
        places: Vec<Place>,
        /// Which network is adapted.
        encoder: Encoder,
    },
    /// Every pair of a prior and a ridge of projections, by recall@1, and the best of them.
    Choice {
        /// Columns, of which no table has one.
        places: Vec<Place>,
        /// Shares of the old projection.
        priors: Vec<f64>,
        /// Variances within a place beside what was seen.
        ridges: Vec<f64>,
    },
    /// References and the training domain as the network sees them, in a plane: figure 4.1.
    Embedding {
        /// The generated counterpart of the training set.
        training: String,
        /// What else is shown.
        places: Vec<Place>,
    },
    /// A reference of each place under every augmentation: figure 4.3.
    Augmentations {
        /// Rows.
        places: Vec<Place>,
    },
    /// Queries that are matched only before or only after an adaptation: figure 4.4.
    Found {
        /// Rows.
        places: Vec<Place>,
        /// Which network is adapted.
        encoder: Encoder,
    },
    /// Where the learned queries of `BoQ` look before and after an adaptation: figure 4.5.
    Attention {
        /// Rows.
        places: Vec<Place>,
        /// Which network is adapted: one of `boq-default`.
        encoder: Encoder,
    },
    /// Sizes of the places, and how far they are from the training domain: table 4.2.
    Gaps {
        /// The generated counterpart of the training set.
        training: String,
        /// Rows.
        places: Vec<Place>,
    },
}

/// A network with some weights.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Encoder {
    /// Name in tables.
    pub name: String,
    /// The network, `default` if nothing is said; others can have a projection only.
    #[serde(default = "default_network")]
    pub method: String,
    /// Name of the row that this one is held against, the first if nothing is said.
    #[serde(default)]
    pub against: Option<String>,
    /// Seeds of the adaptation; the cell is the mean over them, the note says each.
    #[serde(default)]
    pub seeds: Vec<u64>,
    /// Its weights, relative to a data folder, `{place}` for the key of the place and `{foreign}` for
    /// that of another; those that every clone has if there are none. Without them, what is
    /// `tuned` or `whitened` is adapted while the table is made.
    #[serde(default)]
    pub weights: Option<String>,
    /// How they are made: fine-tuning on the place's references, with these settings.
    #[serde(default)]
    pub tuned: Option<Finetuning>,
    /// How they are made: another projection.
    #[serde(default)]
    pub whitened: Option<Whitening>,
    /// The projection that fine-tuning begins with, instead of the network's own.
    #[serde(default)]
    pub from: Option<Whitening>,
    /// The place whose references it is adapted to, instead of the one that it is judged on.
    #[serde(default)]
    pub on: Option<Place>,
    /// Poses of the references are not told to the fine-tuning.
    #[serde(default)]
    pub without_poses: bool,
}

impl Encoder {
    /// Its weights for a place and a seed; `None` for those that every clone has.
    #[must_use]
    pub fn weights_for(&self, place: &Place, seed: Option<u64>) -> Option<String> {
        let foreign = place.foreign.as_deref().unwrap_or("{foreign}");
        let weights = self.weights.as_ref()?;
        let seed = seed.map_or_else(|| "{seed}".to_owned(), |it| it.to_string());
        let named = weights.replace("{place}", &place.key).replace("{foreign}", foreign);
        Some(named.replace("{seed}", &seed))
    }

    /// Its projection under a seed, if it has one.
    #[must_use]
    pub fn whitening(&self, seed: Option<u64>) -> Option<Whitening> {
        self.whitened.map(|it| it.seeded(seed))
    }

    /// Its fine-tuning under a seed, if it has one.
    #[must_use]
    pub fn finetuning(&self, seed: Option<u64>) -> Option<Finetuning> {
        let settings = self.tuned.as_ref()?;
        Some(Finetuning { seed: seed.unwrap_or(settings.seed), ..settings.clone() })
    }

    /// The place whose references it is adapted to.
    #[must_use]
    pub fn learned_from<'a>(&'a self, place: &'a Place) -> &'a Place {
        self.on.as_ref().unwrap_or(place)
    }

    /// The network before it is adapted.
    #[must_use]
    pub fn unadapted(&self) -> Self {
        Self {
            weights: None,
            tuned: None,
            whitened: None,
            from: None,
            seeds: Vec::new(),
            name: format!("{}, before", self.name),
            ..self.clone()
        }
    }
}

/// Computes what the experiment asks for, as far as its data is at hand.
///
/// # Errors
///
/// Wrong files name themselves; missing ones make absent cells.
pub fn run(experiment: &Experiment<Study>, sources: &Sources<'_>) -> Result<Report> {
    let mut table = experiment.table();
    let (mut figure, mut sheet) = (None, None);
    let seed = experiment.seed;
    match &experiment.study {
        Study::Recalls { places, encoders, ranks } => {
            recalls::run(&mut table, places, (encoders, ranks), sources)?;
        }
        Study::Prediction { places, encoder } => {
            prediction::run(&mut table, places, encoder, sources)?;
        }
        Study::Choice { places, priors, ridges } => {
            choice::run(&mut table, places, (priors, ridges), sources)?;
        }
        Study::Embedding { training, places } => {
            figure = embedding::run(&mut table, training, places, sources)?;
        }
        Study::Augmentations { places } => {
            sheet = gallery::augmentations(&mut table, places, seed, sources)?;
        }
        Study::Found { places, encoder } => {
            sheet = gallery::found(&mut table, places, encoder, sources)?;
        }
        Study::Attention { places, encoder } => {
            sheet = attention::attention(&mut table, places, encoder, sources)?;
        }
        Study::Gaps { training, places } => gaps::run(&mut table, training, places, sources)?,
    }
    experiment.fill_thesis(&mut table);
    Ok(Report { sheet, ..Report::new(table, figure) })
}

fn default_network() -> String {
    "default".to_owned()
}
