//! What an experiment file of chapter 6 can ask for, one file per study.

mod dense;
mod encoder;
mod encoders;
mod extrapolation;
mod interpolation;
mod lanes;
mod methods;
mod place;
mod real;
mod rooms;
mod rows;

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
pub use place::{Aside, Place};
pub use rooms::{Paths, Room, Rooms, Scene, Side};

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
}

impl Study {
    /// Scenes and generated rooms, if it has any.
    #[must_use]
    pub fn rooms(&self) -> Option<(&[Scene], &Rooms)> {
        match self {
            Self::Extrapolation { scenes, rooms, .. }
            | Self::Interpolation { scenes, rooms, .. }
            | Self::Encoders { scenes, rooms, .. } => Some((scenes, rooms)),
            Self::Lanes { .. } => None,
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
    }
    experiment.fill_thesis(&mut table);
    Ok(Report::new(table, None))
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
