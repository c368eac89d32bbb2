//! Times H of the thesis' size, 512 values and seven hidden layers, a case per line of stdin:
//! `experiments/peers/regressor.py` asks, and runs PyTorch in between. Answers with nanoseconds.
//!
//! Cases: `train BATCH STEPS`, a training from its first weights to its file, for one step; `densify N`,
//! descriptors at N targets around 1 000 images; `office N`, the same and then 1 000 queries in the dense
//! map.
#![expect(clippy::print_stdout, reason = "prints its measurements")]

use std::{error::Error, io::BufRead, path::Path, time::Instant};

use copr::{
    Anchors, Grid, Options, Targets,
    net::{NetworkRegressor, Pairs, Training, train},
    regressed, sequences,
};
use ndarray::Array2;
use vpr_core::{Definition, Descriptors, Map, Pose, Poses, retrieve};
use vpr_nets::train::Run;

/// Length of a descriptor.
const DIM: usize = 512;
/// Images of the map and queries.
const IMAGES: usize = 1000;

fn main() -> Result<(), Box<dyn Error>> {
    // This thread works along, as PyTorch's does.
    rayon::ThreadPoolBuilder::new().use_current_thread().build_global()?;
    let folder = tempfile::tempdir()?;
    let map = map(0.0)?;
    let one = map.clone();
    let pairs = Pairs::near(one, &sequences(None, IMAGES), (0.5, 180.0), Definition::Corrected)?;
    let validation = pairs.clone().thinned(1);
    let (_, network) = trained((&pairs, &validation), (32, 1), folder.path())?;
    for (number, line) in std::io::stdin().lock().lines().enumerate() {
        let line = line?;
        let (name, rest) = line.split_once(' ').ok_or("a case has numbers")?;
        let numbers = rest.split(' ').map(str::parse).collect::<Result<Vec<usize>, _>>()?;
        let nanoseconds = match (name, &numbers[..]) {
            ("train", &[batch, steps]) => {
                let folder = folder.path().join(number.to_string());
                trained((&pairs, &validation), (batch, steps), &folder)?.0
            }
            ("densify", &[n]) => dense(&map, &network, n, false)?,
            ("office", &[n]) => dense(&map, &network, n, true)?,
            _ => return Err(format!("no case `{line}`").into()),
        };
        println!("{nanoseconds}");
    }
    Ok(())
}

/// Images along a line, whose descriptors turn with it.
fn map(shift: f64) -> Result<Map, Box<dyn Error>> {
    let at = |row: usize| shift + 0.01 * row as f64;
    #[expect(clippy::cast_possible_truncation, reason = "descriptors are f32")]
    let value =
        |(row, column): (usize, usize)| ((at(row) + 1.7 * column as f64).sin() / 16.0) as f32;
    let rows = Descriptors::new(Array2::from_shape_fn((IMAGES, DIM), value))?;
    let poses = (0..IMAGES).map(|row| Pose::translation(at(row), 0.0, 0.0)).collect();
    Ok(Map::new(rows, Poses::SixDof(poses))?)
}

/// Nanoseconds of a step, and the network.
fn trained(
    (pairs, validation): (&Pairs, &Pairs),
    (batch, steps): (usize, usize),
    folder: &Path,
) -> Result<(u128, NetworkRegressor), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let settings = Training { steps, batch, validated_every: steps, ..Training::default() };
    let facts = settings.facts(pairs, validation, "none");
    let work = folder.join("work");
    let mut run = Run::open(&work, &facts, settings.log(&folder.join("log.csv")))?;
    let output = folder.join("h.safetensors");
    let start = Instant::now();
    let both = (pairs, validation);
    let quiet = |_: &_, _| Ok(());
    let network = train(&settings, both, &mut run, &work, (&output, &facts), quiet)?;
    Ok((start.elapsed().as_nanos() / steps as u128, network))
}

/// Nanoseconds of regressing `n` rows and, if asked for, of searching all.
fn dense(
    map: &Map,
    network: &NetworkRegressor,
    n: usize,
    is_searched: bool,
) -> Result<u128, Box<dyn Error>> {
    let poses = map.poses().six_dof()?;
    let anchors = Anchors::every(poses, &sequences(None, IMAGES), 40)?;
    // As many targets around each of 25 anchors as it takes, along x.
    let around = n.div_ceil(anchors.len()).saturating_sub(1) as f64;
    let grid = Grid::new([0.01 * around, 0.0], 0.01, Definition::Corrected)?;
    let targets = Targets::around(&anchors, &grid)?;
    let queries = self::map(0.003)?;
    let start = Instant::now();
    let (rows, _) = regressed(map, &targets, network, Options::default())?;
    if is_searched {
        let mut poses = map.poses().clone();
        poses.extend(rows.poses())?;
        let both = [map.descriptors().view(), rows.descriptors().view()];
        let both = Descriptors::new(ndarray::concatenate(ndarray::Axis(0), &both)?)?;
        let dense = Map::new(both, poses)?;
        let found = retrieve(queries.descriptors(), dense.descriptors(), 1)?.best();
        assert_eq!(found.len(), IMAGES);
    }
    Ok(start.elapsed().as_nanos())
}
