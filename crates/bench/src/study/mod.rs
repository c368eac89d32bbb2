//! What an experiment file of chapter 3 can ask for, one file per study.

mod auc_pr;
mod best;
mod chronology;
mod cost;
mod datasets;
mod descriptor_size;
mod device_cost;
mod invariance;
mod lights;
mod metrics;
mod overlap;
mod platform_speed;
mod pr_curves;
mod range;
mod recall_curves;
mod roc;
mod sheets;
mod spacing;
mod swap;
mod tolerances;
mod verification;
mod vocabularies;
mod winners;
mod worlds;

use std::sync::Arc;

use serde::Deserialize;
use vpr_core::Result;
use vpr_data::Dataset;
use vpr_report::{
    experiment::Experiment,
    figure::{Figure, Panel},
    page::Report,
};

pub use chronology::Published;
pub use invariance::Stage;
pub use platform_speed::TechniqueTiming;
pub use sheets::Scene;
pub use vocabularies::Vocabularies;
use vpr_study::{Runner, Sources, Technique, technique::hand_crafted_names};
pub use worlds::{Domain, Likeness, Worlds};

/// What to compute; the key `kind` of `[study]` chooses.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Study {
    /// Sizes of the datasets: table 3.1.
    Datasets {
        /// Datasets, by id.
        datasets: Vec<String>,
    },
    /// Tolerances that the published ground truths really have: table 3.2.
    Tolerances {
        /// Datasets, by id.
        datasets: Vec<String>,
    },
    /// The taxonomy of metrics: table 3.3.
    Metrics,
    /// The lights of Point Features: table 3.4.
    Lights,
    /// AUC-PR of techniques on datasets: table 3.5.
    AucPr {
        /// Datasets, by id.
        datasets: Vec<String>,
    },
    /// Times and sizes: table 3.6.
    Cost {
        /// Datasets, of which the first at hand has its images timed.
        timed_on: Vec<String>,
        /// Datasets with stored times.
        stored: Vec<String>,
        /// Techniques with the shape of their descriptors.
        descriptors: Vec<cost::DescriptorShape>,
    },
    /// AUC-PR, size and time over descriptor size: table 3.9.
    DescriptorSize {
        /// Datasets, by id.
        datasets: Vec<String>,
        /// Side of a cell in pixels.
        cell_sizes: Vec<usize>,
        /// Dimensions after PCA, for sizes only.
        pca_dimensions: Vec<usize>,
        /// Largest number of region pairs for `CoHOG`; larger work is left out.
        max_region_pairs: f64,
    },
    /// Precision–recall curves and what is read off them: figure 3.10.
    PrCurves {
        /// Datasets, by id.
        datasets: Vec<String>,
    },
    /// RecallRate@N: figure 3.11.
    RecallCurves {
        /// Datasets, by id.
        datasets: Vec<String>,
    },
    /// Distances between consecutive true positives: figure 3.14.
    Spacing {
        /// Datasets, by id; traverses only.
        datasets: Vec<String>,
    },
    /// Queries and references exchanged: figure 3.15.
    Swap {
        /// Datasets, by id.
        datasets: Vec<String>,
    },
    /// AUC-PR over the accepted range of frames: figure 3.17.
    Range {
        /// Datasets, by id; traverses aligned frame by frame.
        datasets: Vec<String>,
        /// Tolerances in frames.
        tolerances: Vec<usize>,
    },
    /// Retrieval time against platform speed: figure 3.18.
    PlatformSpeed {
        /// Times per technique.
        timings: Vec<TechniqueTiming>,
        /// Map sizes `Z`.
        map_sizes: Vec<usize>,
        /// `K` of eq. 3.7.
        frames_per_metre: f64,
        /// Fastest platform drawn, in metres per second.
        max_speed: f64,
        /// Datasets, of which the first at hand has its images timed.
        timed_on: Vec<String>,
    },
    /// Scores under growing variation and the area between the curves: figure 3.19.
    Invariance {
        /// Dataset with the stored curves.
        stored: Option<String>,
        /// Datasets with image series.
        #[serde(default)]
        series: Vec<String>,
        /// Datasets that are a stage: one place varied, another varied alike.
        #[serde(default)]
        stages: Vec<Stage>,
    },
    /// Generated worlds: nuisances, domains, likeness to real places.
    Worlds(Worlds),
    /// Finding new places: figure 3.13 with curves, table 3.7 without.
    Roc {
        /// Datasets, by id; some of their queries are new places.
        datasets: Vec<String>,
        /// Whether to draw the curves and sample them.
        curves: bool,
    },
    /// Contact sheets of what is at hand: figures 3.3, 3.5, 3.7, 3.8, 3.9, 3.12 and 3.16.
    Sheet {
        /// What it shows.
        scene: Scene,
        /// Datasets, by id.
        datasets: Vec<String>,
    },
    /// Where the lights of the Point Features dataset are: figure 3.6.
    LightsFromAbove,
    /// Precision at 100 % recall over the years of techniques: figure 3.2.
    Chronology {
        /// Datasets, by id.
        datasets: Vec<String>,
        /// Techniques in the order of their years.
        order: Vec<Published>,
    },
    /// Times of networks on a device besides the processor: table 3.8.
    DeviceCost {
        /// Techniques that the thesis timed.
        techniques: Vec<Technique>,
        /// Datasets, by id; the first at hand is timed.
        timed_on: Vec<String>,
    },
    /// The best technique on each dataset, and whom it cannot be told from: winners.
    Winners {
        /// Datasets, by id.
        datasets: Vec<String>,
    },
    /// Techniques with a vocabulary that every clone has, beside others: dense-vlad.
    Vocabularies(Vocabularies),
    /// How often a radius and what two images share disagree: overlap.
    Overlap {
        /// Generated places whose recipe asks for `overlap`.
        worlds: Vec<String>,
        /// Radii in metres.
        radii: Vec<f64>,
    },
    /// Inliers of near and far pairs of images: verification.
    Verification {
        /// A scene of 7-Scenes, by id.
        dataset: String,
        /// Which pairs.
        pairs: verification::Pairs,
        /// Local features and how they are matched.
        methods: Vec<verification::LocalMethod>,
    },
}

/// What every study is given.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Datasets, techniques and what was computed before.
    pub sources: &'a Sources<'a>,
    /// Whether to measure what differs from run to run.
    pub timings: bool,
    /// On which device networks are timed besides, by name.
    pub device: Option<&'a str>,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Context<'_> {
    /// The first of these datasets that is at hand.
    fn first_images(&self, ids: &[String]) -> Result<Option<Arc<Dataset>>> {
        for id in ids {
            if let Some(dataset) = self.images(id)? {
                return Ok(Some(dataset));
            }
        }
        Ok(None)
    }

    /// The images of a dataset, if at hand.
    fn images(&self, id: &str) -> Result<Option<Arc<Dataset>>> {
        self.sources.images(id)
    }
}

/// Whether every clone has the technique: where other rows depend on who takes part, generated places
/// are left to these, so that their rows are the same with data and without.
fn in_every_clone(runner: &Runner) -> bool {
    runner.name == "default" || hand_crafted_names().any(|name| name == runner.name)
}

/// The panel with this title, added if there is none yet.
fn panel_of<'a>(figure: &'a mut Figure, title: &str, new: impl FnOnce() -> Panel) -> &'a mut Panel {
    let index = figure.panels.iter().position(|panel| panel.title == title).unwrap_or_else(|| {
        figure.panels.push(Panel { title: title.to_owned(), ..new() });
        figure.panels.len() - 1
    });
    &mut figure.panels[index]
}

fn no_figure((): ()) -> Option<Figure> {
    None
}

/// Computes what the experiment asks for, as far as its data is at hand.
///
/// # Errors
///
/// Wrong files name themselves; missing ones make absent cells.
pub fn run(experiment: &Experiment<Study>, context: Context<'_>) -> Result<Report> {
    let mut table = experiment.table();
    let mut sheet = None;
    let figure = match &experiment.study {
        Study::Datasets { datasets } => datasets::run(&mut table, datasets, context)?,
        Study::Tolerances { datasets } => tolerances::run(&mut table, datasets, context)?,
        Study::Metrics => metrics::run(&mut table),
        Study::Lights => lights::run(&mut table),
        Study::LightsFromAbove => Some(lights::from_above(&mut table)),
        Study::Chronology { datasets, order } => {
            chronology::run(&mut table, datasets, order, context)?
        }
        Study::AucPr { datasets } => auc_pr::run(&mut table, datasets, context)?,
        Study::Cost { timed_on, stored, descriptors } => {
            cost::run(&mut table, timed_on, stored, descriptors, context)?
        }
        Study::DeviceCost { techniques, timed_on } => {
            device_cost::run(&mut table, techniques, timed_on, context).map(no_figure)?
        }
        Study::DescriptorSize { datasets, cell_sizes, pca_dimensions, max_region_pairs } => {
            let max_region_pairs = *max_region_pairs;
            let sweep = descriptor_size::Sweep { cell_sizes, pca_dimensions, max_region_pairs };
            descriptor_size::run(&mut table, datasets, sweep, context)?
        }
        Study::PrCurves { datasets } => pr_curves::run(&mut table, datasets, context)?,
        Study::RecallCurves { datasets } => recall_curves::run(&mut table, datasets, context)?,
        Study::Spacing { datasets } => spacing::run(&mut table, datasets, context)?,
        Study::Swap { datasets } => swap::run(&mut table, datasets, context)?,
        Study::Range { datasets, tolerances } => {
            range::run(&mut table, datasets, tolerances, context)?
        }
        Study::PlatformSpeed { timings, map_sizes, frames_per_metre, max_speed, timed_on } => {
            let (frames_per_metre, max_speed) = (*frames_per_metre, *max_speed);
            let platform = platform_speed::Drive { map_sizes, frames_per_metre, max_speed };
            platform_speed::run(&mut table, timings, platform, timed_on, context)?
        }
        Study::Invariance { stored, series, stages } => {
            let sources = invariance::Sources { stored: stored.as_deref(), series, stages };
            invariance::run(&mut table, &sources, context)?
        }
        Study::Verification { dataset, pairs, methods } => {
            verification::run(&mut table, dataset, *pairs, methods, context)?
        }
        Study::Sheet { scene, datasets } => {
            sheet = sheets::run(&mut table, *scene, datasets, context)?;
            None
        }
        Study::Winners { datasets } => {
            winners::run(&mut table, datasets, context).map(no_figure)?
        }
        Study::Vocabularies(study) => {
            vocabularies::run(&mut table, study, context).map(no_figure)?
        }
        Study::Overlap { worlds, radii } => {
            overlap::run(&mut table, worlds, radii, context).map(no_figure)?
        }
        Study::Worlds(worlds) => worlds::run(&mut table, worlds, context)?,
        Study::Roc { datasets, curves } => roc::run(&mut table, datasets, *curves, context)?,
    };
    experiment.fill_thesis(&mut table);
    Ok(Report { table, figure, sheet })
}
