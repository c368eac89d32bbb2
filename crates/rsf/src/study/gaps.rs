//! How far places are from the training domain: table 4.2.

use vpr_core::{Descriptors, Error as CoreError, Provenance};
use vpr_report::table::{Cell, Table};
use vpr_study::Sources;

use super::Place;
use crate::{
    Result,
    gap::{frechet, own_neighbours},
};

/// Distance of a map from another set of images, as the default network sees both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// See [`frechet`].
    pub frechet: f64,
    /// See [`own_neighbours`].
    pub own_neighbours: f64,
    /// Images of each set that were compared.
    pub n: usize,
}

/// Compares as many descriptors of a map as of the training domain: the first of each.
///
/// # Errors
///
/// As [`frechet`].
pub fn gap(map: &Descriptors, training: &Descriptors) -> Result<Gap> {
    let n = map.len().min(training.len());
    let first = |rows: &Descriptors| {
        let rows = rows.view().slice(ndarray::s![..n, ..]).to_owned();
        Descriptors::new(rows)
    };
    let (map, training) = (first(map)?, first(training)?);
    let frechet = frechet(&map, &training)?;
    Ok(Gap { frechet, own_neighbours: own_neighbours(&map, &training)?, n })
}

pub(super) fn run(
    table: &mut Table,
    training: &str,
    places: &[Place],
    sources: &Sources<'_>,
) -> Result<()> {
    let describe = |images: &[std::path::PathBuf], name: &str| -> Result<Descriptors> {
        let runner = sources.runner("default")?.ok_or(CoreError::Empty("default network"))?;
        let rows = sources.features(&runner, images, name)?.into_descriptors();
        Ok(rows.ok_or(CoreError::Empty("descriptors"))?)
    };
    let Some(domain) = sources.images(training)? else {
        return Err(CoreError::Empty("images of the training domain").into());
    };
    let domain = describe(&domain.references, "training domain")?;
    for place in places {
        let columns = ["Queries", "Refs.", "Fréchet distance", "own neighbours"];
        let Some(dataset) = place.at_hand(&columns, table, sources)? else { continue };
        let rows = describe(&dataset.references, &dataset.name)?;
        let gap = gap(&rows, &domain)?;
        let mut push = |column: &str, value: f64, n: usize| {
            let provenance: Provenance = dataset.provenance;
            table.push(Cell::new(&place.name, column, value, provenance, n));
        };
        push(columns[0], dataset.queries.len() as f64, dataset.queries.len());
        push(columns[1], dataset.references.len() as f64, dataset.references.len());
        push(columns[2], gap.frechet, gap.n);
        push(columns[3], gap.own_neighbours, gap.n);
    }
    Ok(())
}
