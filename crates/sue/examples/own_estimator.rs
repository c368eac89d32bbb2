//! An estimator of uncertainty of your own, judged beside SUE.
//!
//! ```text
//! cd crates/sue && cargo run --no-default-features --example own_estimator
//! ```
#![expect(clippy::print_stdout, reason = "an example prints what it found")]

use ndarray::Array2;
use sue::{Category, Error, Evidence, Places, Result, Sue, SueParams, UncertaintyEstimator};
use vpr_core::{
    Definition, Descriptors, Evaluation, GroundTruth, Judged, Map, PlanarPosition, Poses, retrieve,
};

/// How many metres the two best references lie apart: two neighbours confirm each other.
struct TwoBest;

impl UncertaintyEstimator for TwoBest {
    /// What it looks at: neighbours and their poses. [`sue::Neighbors`] would be distances alone.
    type Evidence<'a> = Places<'a>;

    const CATEGORY: Category = Category::Spatial;

    fn name(&self) -> &'static str {
        "two best"
    }

    fn estimate_into(&self, places: &Places<'_>, out: &mut [f64]) -> Result<()> {
        let (expected, actual) = (places.len(), out.len());
        if expected != actual {
            let what = "places for uncertainties, one per query";
            return Err(vpr_core::Error::Mismatch { what, expected, actual }.into());
        }
        let (retrieval, poses) = (places.retrieval(), places.poses());
        if retrieval.k() < 2 {
            let (estimator, available) = (self.name(), retrieval.k());
            return Err(Error::TooFewNeighbors { estimator, needed: 2, available });
        }
        for (query, out) in out.iter_mut().enumerate() {
            let ranked = retrieval.indices(query);
            *out = (poses.position(ranked[0]) - poses.position(ranked[1])).norm();
        }
        Ok(())
    }
}

/// Three streets: the direction of each descriptor in degrees, and where it was taken, in metres
/// east. The end of the first street looks like the start of the second.
const LOOKS: [f32; 9] = [0.0, 5.0, 10.0, 16.0, 21.0, 26.0, 60.0, 65.0, 70.0];
const EAST: [f64; 9] = [0.0, 4.0, 8.0, 300.0, 304.0, 308.0, 600.0, 604.0, 608.0];
/// The third and fourth query are between look-alikes; the seventh was taken where no map is.
const QUERY_LOOKS: [f32; 8] = [2.0, 7.0, 12.5, 15.0, 22.0, 62.0, 40.0, 68.0];
const QUERY_EAST: [f64; 8] = [1.0, 5.0, 303.0, 9.0, 305.0, 601.0, 900.0, 607.0];

fn main() -> Result<()> {
    let map = Map::new(descriptors(&LOOKS)?, poses(&EAST))?;
    let retrieval = retrieve(&descriptors(&QUERY_LOOKS)?, map.descriptors(), 3)?;

    // Which best references are right: those within 25 m.
    let truth = GroundTruth::within_radius(&poses(&QUERY_EAST), map.poses(), 25.0)?;
    let judged = Judged::new(&retrieval.best(), &truth)?;
    println!("{} queries, {:.3} of them right", judged.len(), judged.base_rate());

    // Both look at the same evidence and are judged by the same matches.
    let places = Places::new(&retrieval, &map)?;
    let sue = Sue::new(SueParams { k: 3, lambda: 10.0, ..*Sue::corrected().params() })?;
    report(&TwoBest, &places, &judged)?;
    report(&sue, &places, &judged) // asks a third reference, and so doubts the unknown place
}

fn report<E>(estimator: &E, places: &Places<'_>, judged: &Judged) -> Result<()>
where
    E: for<'a> UncertaintyEstimator<Evidence<'a> = Places<'a>>,
{
    let uncertainty = estimator.estimate(places)?; // higher is less certain
    let area = Evaluation::new(&uncertainty, judged)?.auc_pr(Definition::Published)?;
    println!("{}: AUC-PR {area:.3}, uncertainties {uncertainty:.0?}", estimator.name());
    Ok(())
}

fn descriptors(looks: &[f32]) -> vpr_core::Result<Descriptors> {
    let degrees =
        Array2::from_shape_fn((looks.len(), 2), |(row, axis)| [0.0, 90.0][axis] - looks[row]);
    Descriptors::new(degrees.mapv(|it| it.to_radians().cos()))
}

fn poses(east: &[f64]) -> Poses {
    Poses::Planar(east.iter().map(|&east| PlanarPosition::new(east, 0.0)).collect())
}
