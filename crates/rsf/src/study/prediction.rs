//! Whether a map says, before a query is seen, what adapting to it gains.

use vpr_core::metrics::spearman;
use vpr_report::table::{Cell, Table};
use vpr_study::Sources;

use super::{Encoder, Place, recalls};
use crate::{
    MiningParams, Preset, Result,
    net::{Material, Trial, default_network},
};

/// Variants of each reference that are looked up; their draws are none of those of an adaptation.
const VARIANTS: usize = 2;
/// References that are looked up, at most.
const TRIED: usize = 200;
/// Columns of a row.
const COLUMNS: [&str; 4] =
    ["own R@1 before", "own R@1 after", "predicted gain", "gain of queries' R@1"];

pub(super) fn run(
    table: &mut Table,
    places: &[Place],
    encoder: &Encoder,
    sources: &Sources<'_>,
) -> Result<()> {
    let mut rows: Vec<(bool, [f64; 4])> = Vec::new();
    for place in places {
        let Some(dataset) = place.at_hand(&COLUMNS, table, sources)? else { continue };
        let Some(set) = place.references(sources)? else { continue };
        let material = Material::open(&set)?;
        let adapted = recalls::adapted_now(place, encoder, None, sources)?;
        let step = material.len().div_ceil(TRIED).max(1);
        let tried: Vec<usize> = (0..material.len()).step_by(step).collect();
        let augmentations = Preset::All.augmentations();
        let mining = MiningParams::default();
        let trial = Trial::new(&material, &tried, VARIANTS, &augmentations, (&mining, 1))?;
        let own = |weights: Option<&std::path::Path>| -> Result<f64> {
            let (network, _) = default_network(weights)?;
            Ok(trial.score(&network, &material.describe(&network)?)?.recall)
        };
        let (before, after) = (own(None)?, own(adapted.as_deref())?);
        let recall = |encoder: &Encoder| -> Result<f64> {
            let hits = recalls::of_seeds(place, encoder, (&dataset, &[1]), sources)?;
            let hits = hits.unwrap_or_default().concat().concat();
            Ok(hits.iter().filter(|hit| **hit).count() as f64 / hits.len().max(1) as f64)
        };
        let gain = recall(encoder)? - recall(&encoder.unadapted())?;
        let row = [before, after, after - before, gain];
        let n = [tried.len() * VARIANTS, dataset.truth.n_known()];
        for (number, (column, value)) in COLUMNS.into_iter().zip(row).enumerate() {
            let n = n[usize::from(number == 3)];
            table.push(Cell::new(&place.name, column, value, dataset.provenance, n));
        }
        rows.push((dataset.provenance == vpr_core::Provenance::Generated, row));
    }
    correlations(table, &rows, places.len());
    Ok(())
}

/// Rank correlations of what is known before with the gain, over the generated places and over all.
fn correlations(table: &mut Table, rows: &[(bool, [f64; 4])], n_places: usize) {
    let all = (rows.len() == n_places).then_some(vpr_core::Provenance::Measured);
    let generated = Some(vpr_core::Provenance::Generated);
    for (name, origin, is_of) in
        [("rank correlation, generated", generated, true), ("rank correlation, all", all, false)]
    {
        let taken: Vec<&[f64; 4]> =
            rows.iter().filter(|it| it.0 || !is_of).map(|it| &it.1).collect();
        let gains: Vec<f64> = taken.iter().map(|it| it[3]).collect();
        for number in 0..3 {
            let known: Vec<f64> = taken.iter().map(|it| it[number]).collect();
            match (origin, spearman(&known, &gains)) {
                (Some(origin), Some(value)) => {
                    table.push(Cell::new(name, COLUMNS[number], value, origin, taken.len()));
                }
                (None, _) => {
                    table.push(Cell::absent(
                        name,
                        COLUMNS[number],
                        "images of some rows are not at hand",
                    ));
                }
                (Some(_), None) => {
                    table.push(Cell::absent(name, COLUMNS[number], "no order in it"));
                }
            }
        }
    }
}
