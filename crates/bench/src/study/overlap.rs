//! How often a radius and what two images really share disagree, on generated places.

use vpr_core::{
    Result,
    metrics::bootstrap::{Z_95, wilson_interval},
};
use vpr_report::table::{Cell, Table};
use vpr_worlds::{Side, World, named_recipe};

use super::Context;

/// Below this share of its surface a query sees another place than the reference.
const APART: f32 = 0.1;
/// Above this share they show the same.
const SAME: f32 = 0.5;

/// What a radius says of pairs of a query and a reference, against what they share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Pairs {
    within: usize,
    /// Within the radius, and yet less than [`APART`] is shared.
    within_apart: usize,
    same: usize,
    /// More than [`SAME`] is shared, and yet beyond the radius.
    same_beyond: usize,
}

impl Pairs {
    fn count(pairs: &[(f64, f32)], radius: f64) -> Self {
        let mut all = Self::default();
        for &(distance, shared) in pairs {
            let (is_within, is_same) = (distance <= radius, shared > SAME);
            all.within += usize::from(is_within);
            all.within_apart += usize::from(is_within && shared < APART);
            all.same += usize::from(is_same);
            all.same_beyond += usize::from(is_same && !is_within);
        }
        all
    }
}

pub(super) fn run(
    table: &mut Table,
    worlds: &[String],
    radii: &[f64],
    context: Context<'_>,
) -> Result<()> {
    for id in worlds {
        let sources = context.sources;
        let Some(dataset) = sources.images(id)? else {
            let why = sources.why_absent(id, "images")?;
            table.push(Cell::absent(&sources.entry(id)?.name, "within", why));
            continue;
        };
        let world = World::open(&named_recipe(id)?, sources.cache(), &|| {})?;
        let (queries, references) = (world.poses(Side::Queries)?, world.poses(Side::References)?);
        let shared = world.overlap()?;
        let pairs: Vec<(f64, f32)> = shared
            .indexed_iter()
            .map(|((query, reference), &shared)| {
                let away = queries.position(query) - references.position(reference);
                (away.norm(), shared)
            })
            .collect();
        for &radius in radii {
            let row = format!("{}, {radius} m", dataset.name);
            let counts = Pairs::count(&pairs, radius);
            let mut push = |columns: [&str; 2], all: usize, some: usize| -> Result<()> {
                let (provenance, n) = (dataset.provenance, all);
                table.push(Cell::new(&row, columns[0], all as f64, provenance, pairs.len()));
                if all == 0 {
                    table.push(Cell::absent(&row, columns[1], "there are no such pairs"));
                    return Ok(());
                }
                let share = wilson_interval(some, all, Z_95)?;
                let cell = Cell::new(&row, columns[1], share.estimate, provenance, n);
                table.push(cell.within(
                    share.low,
                    share.high,
                    "Wilson, pairs taken as independent",
                ));
                Ok(())
            };
            push(["within", "of these < 10 % shared"], counts.within, counts.within_apart)?;
            push(["> 50 % shared", "of these beyond"], counts.same, counts.same_beyond)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_counted_on_both_sides_of_the_radius() {
        let pairs = [(5.0, 0.9), (5.0, 0.05), (25.0, 0.0), (25.1, 0.6), (80.0, 0.0)];
        let counts = Pairs::count(&pairs, 25.0);
        assert_eq!(counts, Pairs { within: 3, within_apart: 2, same: 2, same_beyond: 1 });
        assert_eq!(Pairs::count(&pairs, 1.0).within, 0);
    }
}
