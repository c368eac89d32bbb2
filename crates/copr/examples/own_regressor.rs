//! A regressor of your own: what takes a `&dyn Regressor` takes yours, and is judged beside ours.
//!
//! ```text
//! cd crates/copr && cargo run --no-default-features --example own_regressor
//! ```
#![expect(clippy::print_stdout, reason = "an example prints what it found")]

use copr::{
    Anchors, LinearInterpolation, Options, PoseErrors, Regressor, Result, Selection, Targets, Told,
    regressed, regression::Request, sequences,
};
use ndarray::Array2;
use vpr_core::{Descriptors, Map, Pose, Poses, retrieve};

/// The three nearest anchors, each weighing the inverse of its squared distance.
struct Shepard;

impl Regressor for Shepard {
    fn name(&self) -> &'static str {
        "inverse distance"
    }

    fn selection(&self) -> Selection {
        Selection::Nearest(3)
    }

    fn regress(&self, requests: &[Request<'_>], out: &mut [f32]) -> Result<Told> {
        let dim = out.len() / requests.len().max(1);
        for (request, out) in requests.iter().zip(out.chunks_mut(dim.max(1))) {
            let at = request.pose.translation.vector;
            let mut total = 0.0;
            out.fill(0.0);
            for anchor in &request.anchors {
                let distance = (at - anchor.pose.translation.vector).norm_squared();
                let weight = 1.0 / distance.max(1e-12);
                total += weight;
                for (out, value) in out.iter_mut().zip(anchor.descriptor) {
                    *out += narrow(weight) * value;
                }
            }
            for value in &mut *out {
                *value /= narrow(total);
            }
        }
        Ok(Told::default())
    }
}

#[expect(clippy::cast_possible_truncation, reason = "descriptors are f32")]
fn narrow(value: f64) -> f32 {
    value as f32
}

fn main() -> Result<()> {
    // A corridor with an image every 4 m, and queries in between.
    let poses = along((0..12).map(|at| 4.0 * f64::from(at)));
    let sparse = Map::new(looks(&poses)?, Poses::SixDof(poses.clone()))?;
    let truth = along((0..11).map(|at| 4.0 * f64::from(at) + 1.2));
    let queries = looks(&truth)?;

    let anchors = Anchors::every(&poses, &sequences(None, poses.len()), 1)?;
    let targets = Targets::between(&anchors, 3)?; // a row every metre
    let mean_error = |map: &Map| -> Result<f64> {
        let best = retrieve(&queries, map.descriptors(), 1)?.best();
        let errors = PoseErrors::of_retrieval(&best, map.poses(), &Poses::SixDof(truth.clone()))?;
        Ok(errors.translation_m.iter().sum::<f64>() / errors.translation_m.len() as f64)
    };
    println!("sparse map: {:.2} m", mean_error(&sparse)?);
    for regressor in [&LinearInterpolation as &dyn Regressor, &Shepard] {
        let (dense, _) = regressed(&sparse, &targets, regressor, Options::default())?;
        println!("{}: {:.2} m", regressor.name(), mean_error(&dense)?);
    }
    Ok(())
}

fn along(xs: impl Iterator<Item = f64>) -> Vec<Pose> {
    xs.map(|x| Pose::translation(x, 0.0, 0.0)).collect()
}

/// What a camera sees changes smoothly as it moves.
fn looks(poses: &[Pose]) -> vpr_core::Result<Descriptors> {
    let value = |(row, column): (usize, usize)| {
        narrow((0.05 * poses[row].translation.vector.x * (1.0 + column as f64)).sin())
    };
    Descriptors::new(Array2::from_shape_fn((poses.len(), 4), value))
}
