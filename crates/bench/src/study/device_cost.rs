//! Times of networks on a device besides the processor: table 3.8.

use vpr_core::Result;
use vpr_report::table::{Cell, Table};
use vpr_study::{Technique, technique::hand_crafted_names};

use super::Context;

/// Images timed per network; with batches of one, as in the thesis.
#[cfg(feature = "networks")]
const TIMED: usize = 40;

const ENCODING: &str = "t_e (s)";
const MATCHING: &str = "t_m (ms)";

pub(super) fn run(
    table: &mut Table,
    techniques: &[Technique],
    timed_on: &[String],
    context: Context<'_>,
) -> Result<()> {
    let runners = context.sources.runners()?;
    let is_network = |name: &str| hand_crafted_names().all(|it| it != name);
    for technique in techniques {
        if runners.iter().all(|it| it.column != technique.name()) {
            absent(
                table,
                technique.name(),
                "its weights are not at hand; `bench methods` says where they are from",
            );
        }
    }
    for runner in runners.iter().filter(|it| is_network(&it.name)) {
        match context.device.filter(|_| context.timings) {
            Some(device) => {
                measured(table, (&runner.name, runner.column), device, timed_on, context)?;
            }
            None => absent(
                table,
                runner.column,
                "measured on request: --timings --device wgpu (or cuda), built with that feature",
            ),
        }
    }
    Ok(())
}

fn absent(table: &mut Table, row: &str, why: &str) {
    for column in [ENCODING, MATCHING] {
        table.push(Cell::absent(row, column, why));
    }
}

/// Median times of one network on the device, a batch of one, copies there and back included.
#[cfg(feature = "networks")]
fn measured(
    table: &mut Table,
    (name, row): (&str, &str),
    device: &str,
    timed_on: &[String],
    context: Context<'_>,
) -> Result<()> {
    use std::sync::Arc;

    use vpr_core::Error;
    use vpr_nets::encode::{Request, by_request};
    use vpr_study::{Describe as _, Network};

    let Some(images) = context.first_images(timed_on)? else {
        absent(table, row, "no images to time are at hand");
        return Ok(());
    };
    let refused = |reason: String| Error::format("--device", device, reason);
    let request = Request {
        name: name.to_owned(),
        roots: context.sources.roots().roots.clone(),
        device: device.parse().map_err(refused)?,
        ..Request::default()
    };
    let network = Network::new(Arc::from(by_request(&request)?));
    let paths = &images.queries[..images.queries.len().min(TIMED)];
    // Kernels are compiled at the first pass.
    network.time(&paths[..paths.len().min(2)])?;
    let timing = network.time(paths)?;
    let note = format!("median on {device}, batch of 1, {} images", images.name);
    for (column, value) in [(ENCODING, timing.encoding), (MATCHING, timing.matching * 1e3)] {
        let cell = Cell::new(row, column, value, images.provenance, paths.len());
        table.push(cell.noted(&note).timing());
    }
    Ok(())
}

#[cfg(not(feature = "networks"))]
fn measured(
    table: &mut Table,
    (_, row): (&str, &str),
    _: &str,
    _: &[String],
    _: Context<'_>,
) -> Result<()> {
    absent(table, row, "this program was built without networks");
    Ok(())
}
