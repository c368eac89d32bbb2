//! What an experiment file of chapter 6 can ask for, one file per study.

mod calibration;
mod dense;
mod density;
mod encoder;
mod encoders;
mod extrapolation;
mod fine;
mod footprint;
mod interpolation;
mod lanes;
mod lesson;
mod matches;
mod methods;
mod place;
mod real;
mod rooms;
mod rows;
mod sequences;
mod setup;
mod stray;
mod thinned;
mod variants;
mod viewpoints;

use std::path::PathBuf;

use serde::Deserialize;
use vpr_core::{Provenance, metrics::bootstrap::Resampling};
use vpr_report::{
    experiment::Experiment,
    page::Report,
    table::{Cell, Table},
};
use vpr_study::Sources;

pub use dense::Method;
pub use encoder::encoder_weights;
pub use matches::{Classes, Looked};
pub use place::{Aside, Place};
pub use rooms::{Paths, Room, Rooms, Scene, Side};
pub use sequences::{Images, Recorded};
pub use variants::{Doubt, Keep, Variant};

use crate::Result;

/// What to compute; the key `kind` of `[study]` chooses.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Study {
    /// Grids around every so many-th image of one sequence: table 6.1.
    Extrapolation {
        /// The scenes.
        scenes: Vec<Scene>,
        /// Every so many-th image of the real sequence is an anchor.
        every: usize,
        /// Distance between targets, metres.
        step_m: f64,
        /// How descriptors are regressed on generated rooms.
        methods: Vec<Method>,
        /// The generated rooms.
        rooms: Rooms,
    },
    /// The other image of a lane, a street or an escalator: table 6.2.
    Lanes {
        /// The places.
        places: Vec<Place>,
        /// How descriptors are regressed.
        methods: Vec<Method>,
    },
    /// Images left out between every so many-th: table 6.3.
    Interpolation {
        /// The scenes.
        scenes: Vec<Scene>,
        /// Every so many-th image of each real sequence stays.
        every: usize,
        /// How descriptors are regressed on generated rooms.
        methods: Vec<Method>,
        /// The generated rooms.
        rooms: Rooms,
    },
    /// Sparse and dense maps under several encoders: table 6.4.
    Encoders {
        /// The scenes.
        scenes: Vec<Scene>,
        /// Distance between targets, metres.
        step_m: f64,
        /// The generated rooms, once for every encoder.
        rooms: Rooms,
    },
    /// Times and sizes: table 6.5.
    Footprint {
        /// The scene.
        scene: Scene,
        /// Distance between targets, metres.
        step_m: f64,
        /// The generated room.
        rooms: Rooms,
        /// Further places.
        places: Vec<Place>,
        /// How descriptors are regressed.
        method: Method,
        /// Steps of the training of H that is timed; without it none is.
        #[serde(default)]
        steps: Option<usize>,
    },
    /// The sparse map under several encoders: figures 6.6 and 6.7.
    Viewpoints {
        /// The scenes.
        scenes: Vec<Scene>,
        /// The generated rooms, once for every encoder.
        rooms: Rooms,
        /// Places of another kind, which no encoder has seen.
        #[serde(default)]
        places: Vec<Place>,
    },
    /// Where images, anchors, targets and queries are: figure 6.2.
    Setup {
        /// The scenes.
        scenes: Vec<Scene>,
        /// Distance between targets of a grid, metres.
        step_m: f64,
        /// The generated rooms.
        rooms: Rooms,
    },
    /// Other ways to make a map denser beside the plain one, on the same queries.
    Variants {
        /// The scenes.
        scenes: Vec<Scene>,
        /// Distance between targets, metres.
        step_m: f64,
        /// The one that others are compared with.
        plain: Variant,
        /// The others.
        variants: Vec<Variant>,
        /// The generated rooms, once for every encoder.
        rooms: Rooms,
    },
    /// A retrieval, then the pose between two descriptors, with and without densification.
    CoarseToFine {
        /// The scenes.
        scenes: Vec<Scene>,
        /// Distance between targets, metres.
        step_m: f64,
        /// How descriptors are regressed.
        method: Method,
        /// Weights of networks for poses, relative to a data folder; `{encoder}` stands for the encoder.
        poses: Vec<PathBuf>,
        /// The generated rooms, once for every encoder.
        rooms: Rooms,
    },
    /// How few images keep the error: every so many-th stays, the others are regressed or missed.
    Thinned {
        /// The scenes.
        scenes: Vec<Scene>,
        /// Every so many-th image stays.
        every: Vec<usize>,
        /// How the others are regressed.
        methods: Vec<Method>,
        /// The generated rooms.
        rooms: Rooms,
    },
    /// Where queries are found: figures 6.8, 6.9 and 6.13.
    Matches {
        /// What is looked at.
        looked: Looked,
        /// Near, middle, far.
        classes: Classes,
        /// How descriptors are regressed.
        methods: Vec<Method>,
    },
    /// Error against the step of a grid: figure 6.11.
    Density {
        /// The scenes.
        scenes: Vec<Scene>,
        /// Distances between targets, metres.
        steps_m: Vec<f64>,
        /// How descriptors are regressed.
        method: Method,
        /// The generated rooms.
        rooms: Rooms,
    },
    /// References of other rooms that look more like the query: figure 6.12.
    Stray {
        /// The scenes.
        scenes: Vec<Scene>,
        /// How descriptors are regressed.
        methods: Vec<Method>,
        /// The generated rooms.
        rooms: Rooms,
    },
    /// Real images along one path, interpolated.
    Sequences {
        /// The paths.
        sequences: Vec<Recorded>,
        /// Techniques that describe the images.
        encoders: Vec<String>,
        /// Every so many-th image of the map stays.
        every: usize,
        /// How descriptors are regressed.
        methods: Vec<Method>,
    },
}

impl Study {
    /// Scenes and generated rooms, if it has any.
    #[must_use]
    pub fn rooms(&self) -> Option<(&[Scene], &Rooms)> {
        match self {
            Self::Extrapolation { scenes, rooms, .. }
            | Self::Interpolation { scenes, rooms, .. }
            | Self::Encoders { scenes, rooms, .. }
            | Self::Viewpoints { scenes, rooms, .. }
            | Self::Setup { scenes, rooms, .. }
            | Self::Variants { scenes, rooms, .. }
            | Self::CoarseToFine { scenes, rooms, .. }
            | Self::Thinned { scenes, rooms, .. }
            | Self::Density { scenes, rooms, .. }
            | Self::Stray { scenes, rooms, .. } => Some((scenes, rooms)),
            Self::Footprint { scene, rooms, .. } => Some((std::slice::from_ref(scene), rooms)),
            Self::Matches { looked, .. } => looked.rooms(),
            Self::Lanes { .. } | Self::Sequences { .. } => None,
        }
    }
}

/// What every study is given.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Datasets, techniques, weights.
    pub sources: &'a Sources<'a>,
    /// The same without real data: rooms that are generated from what every clone has.
    pub bare: &'a Sources<'a>,
    /// Seed of every random draw.
    pub seed: u64,
    /// Whether to measure times, which differ from run to run.
    pub timings: bool,
}

impl Context<'_> {
    /// How intervals are drawn.
    fn resampling(&self) -> Resampling {
        Resampling { n_resamples: 1000, seed: self.seed, ..Resampling::default() }
    }
}

/// Computes what the experiment asks for, as far as its data is at hand.
///
/// # Errors
///
/// Wrong files name themselves; missing ones make absent cells.
pub fn run(experiment: &Experiment<Study>, context: Context<'_>) -> Result<Report> {
    let mut table = experiment.table();
    let out = &mut table;
    let mut figure = None;
    match &experiment.study {
        Study::Extrapolation { scenes, every, step_m, methods, rooms } => {
            let plan = extrapolation::Plan { every: *every, step_m: *step_m, methods, rooms };
            extrapolation::run(out, scenes, plan, context)?;
            average(out);
        }
        Study::Lanes { places, methods } => lanes::run(out, places, methods, context)?,
        Study::Interpolation { scenes, every, methods, rooms } => {
            interpolation::run(out, scenes, (*every, methods, rooms), context)?;
            average(out);
        }
        Study::Encoders { scenes, step_m, rooms } => {
            encoders::run(out, scenes, *step_m, rooms, context)?;
        }
        Study::Footprint { scene, step_m, rooms, places, method, steps } => {
            footprint::run(out, (scene, *step_m, rooms), places, (method, *steps), context)?;
        }
        Study::Viewpoints { scenes, rooms, places } => {
            figure = Some(viewpoints::run(out, scenes, (rooms, places), context)?);
        }
        Study::Setup { scenes, step_m, rooms } => {
            figure = Some(setup::run(out, scenes, (*step_m, rooms), context)?);
        }
        Study::Variants { scenes, step_m, plain, variants, rooms } => {
            let plan = variants::Plan { step_m: *step_m, plain, variants, rooms };
            variants::run(out, scenes, plan, context)?;
            average(out);
        }
        Study::CoarseToFine { scenes, step_m, method, poses, rooms } => {
            let plan = fine::Plan { step_m: *step_m, method, poses, rooms };
            fine::run(out, scenes, plan, context)?;
            average(out);
        }
        Study::Thinned { scenes, every, methods, rooms } => {
            figure = Some(thinned::run(out, scenes, (every, methods, rooms), context)?);
            average(out);
        }
        Study::Matches { looked, classes, methods } => {
            figure = Some(matches::run(out, looked, (*classes, methods), context)?);
        }
        Study::Density { scenes, steps_m, method, rooms } => {
            figure = Some(density::run(out, (scenes, steps_m), (method, rooms), context)?);
        }
        Study::Stray { scenes, methods, rooms } => {
            stray::run(out, scenes, (methods, rooms), context)?;
        }
        Study::Sequences { sequences, encoders, every, methods } => {
            sequences::run(out, sequences, (encoders, *every, methods), context)?;
        }
    }
    experiment.fill_thesis(&mut table);
    Ok(Report::new(table, figure))
}

/// The column of means.
const AVERAGE: &str = "Avg.";

/// The mean of every row that has a value in all columns of its table.
fn average(table: &mut Table) {
    let mut columns: Vec<String> = Vec::new();
    let mut rows: Vec<(String, Option<String>, Provenance)> = Vec::new();
    for cell in &table.cells {
        if !columns.contains(&cell.column) {
            columns.push(cell.column.clone());
        }
        let key = (cell.row.clone(), cell.definition.clone(), cell.provenance);
        if cell.provenance != Provenance::Absent && !rows.contains(&key) {
            rows.push(key);
        }
    }
    for (row, definition, provenance) in rows {
        let of_row = table.cells.iter().filter(|cell| {
            (&cell.row, &cell.definition, cell.provenance) == (&row, &definition, provenance)
        });
        let values: Vec<(f64, usize)> =
            of_row.filter_map(|cell| Some((cell.value.as_ref()?.number()?, cell.n))).collect();
        if values.len() == columns.len() && values.len() > 1 {
            let mean = values.iter().map(|it| it.0).sum::<f64>() / values.len() as f64;
            let n = values.iter().map(|it| it.1).sum();
            let cell = Cell::new(row, AVERAGE, mean, provenance, n);
            table.push(Cell { definition, ..cell });
        }
    }
}
