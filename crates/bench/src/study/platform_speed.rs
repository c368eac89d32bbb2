//! Retrieval time against platform speed: figure 3.18.

use serde::Deserialize;
use vpr_core::{
    Provenance, Result,
    metrics::{SearchCost, Timing, required_fps, retrieval_time, speed_limit},
};
use vpr_report::{
    figure::{Curve, Figure, Panel, Scale},
    table::{Cell, Table},
};

use vpr_study::Runner;

use super::Context;

/// The times of one technique, as somebody published them.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TechniqueTiming {
    /// Name of the technique.
    pub technique: String,
    /// Seconds to encode an image.
    pub encoding_s: f64,
    /// Milliseconds to match a pair of descriptors.
    pub matching_ms: f64,
}

/// What is asked of the platform.
pub(super) struct Drive<'a> {
    pub(super) map_sizes: &'a [usize],
    pub(super) frames_per_metre: f64,
    pub(super) max_speed: f64,
}

/// Images timed per technique.
const TIMED: usize = 40;
/// Pieces of the curve of what is required.
const STEPS: u32 = 200;

pub(super) fn run(
    table: &mut Table,
    timings: &[TechniqueTiming],
    drive: Drive<'_>,
    timed_on: &[String],
    context: Context<'_>,
) -> Result<Option<Figure>> {
    let mut figure = Figure::default();
    for timing in timings {
        let name = &timing.technique;
        let timing = Timing { encoding: timing.encoding_s, matching: timing.matching_ms * 1e-3 };
        let note = "from the times of table 3.6, the author's machine";
        for cell in limits(name, timing, &drive, Provenance::Published)? {
            table.push(cell.noted(note));
        }
        figure.panels.push(panel(name, timing, &drive)?);
    }
    let images = if context.timings { context.first_images(timed_on)? } else { None };
    for Runner { column, technique, .. } in context.sources.runners()? {
        let row = format!("{column}, this machine");
        let Some(images) = &images else {
            for &size in drive.map_sizes {
                table.push(Cell::absent(
                    &row,
                    limit_column(size),
                    "measured on request: --timings",
                ));
            }
            continue;
        };
        let paths = &images.queries[..images.queries.len().min(TIMED)];
        let timing = technique.time(paths)?;
        for cell in limits(&row, timing, &drive, images.provenance)? {
            table.push(cell.timing());
        }
    }
    Ok(Some(figure))
}

fn limit_column(map_size: usize) -> String {
    format!("fastest platform, Z={map_size} (m/s)")
}

/// For every map size the speed at which retrieval just keeps up, and its frames per second.
fn limits(
    row: &str,
    timing: Timing,
    drive: &Drive<'_>,
    provenance: Provenance,
) -> Result<Vec<Cell>> {
    let mut cells = Vec::new();
    for &size in drive.map_sizes {
        let time = retrieval_time(timing, size, SearchCost::Linear)?;
        let limit = speed_limit(time, drive.frames_per_metre)?;
        cells.push(Cell::new(row, limit_column(size), limit, provenance, 1));
        cells.push(Cell::new(row, format!("FPS, Z={size}"), 1.0 / time, provenance, 1));
    }
    Ok(cells)
}

fn panel(name: &str, timing: Timing, drive: &Drive<'_>) -> Result<Panel> {
    let required = required_fps(drive.frames_per_metre, drive.max_speed)?;
    // Proportional to speed, which is a curve where frames per second are drawn by factors.
    let at = |step: u32| f64::from(step) / f64::from(STEPS);
    let points = (1..=STEPS).map(|step| (at(step) * drive.max_speed, at(step) * required));
    let mut curves = vec![Curve::new("required", points.collect())];
    for &size in drive.map_sizes {
        let fps = 1.0 / retrieval_time(timing, size, SearchCost::Linear)?;
        let points = vec![(0.0, fps), (drive.max_speed, fps)];
        curves.push(Curve::new(format!("Z={size}"), points));
    }
    Ok(Panel {
        title: name.to_owned(),
        x_label: "platform speed, m/s".to_owned(),
        y_label: "frames per second".to_owned(),
        curves,
        y_scale: Scale::Log,
        ..Panel::default()
    })
}
