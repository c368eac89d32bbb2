//! What a map on disk costs: time to open, first query, a batch, memory of the process.
//!
//! ```text
//! map_from_disk write FILE ROWS DIM
//! map_from_disk search FILE mapped|read check|trust QUERIES
//! ```
#![expect(clippy::print_stdout, reason = "a program that prints what it measured")]

use std::{error::Error, fs, io::Read as _, path::Path, time::Instant};

use ndarray::Array2;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use vpr_core::{
    Descriptors, PlanarPosition, Poses,
    knn::{SearchParams, search},
    map::{About, Access, MapFile, MapWriter, Names, Opening, RowType},
};

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["write", file, rows, dim] => write(Path::new(file), rows.parse()?, dim.parse()?),
        ["search", file, access, check, queries] => {
            let access = if access == "mapped" { Access::Mapped } else { Access::Read };
            let opening = Opening { access, trust: check == "trust" };
            measure(Path::new(file), opening, queries.parse()?)
        }
        ["read", file] => read_once(Path::new(file)),
        _ => {
            Err("expected write FILE ROWS DIM, search FILE ACCESS CHECK QUERIES, read FILE".into())
        }
    }
}

/// Rows of uniform noise: the time does not depend on what they hold.
fn rows(n: usize, dim: usize, rng: &mut ChaCha8Rng) -> Array2<f32> {
    Array2::from_shape_fn((n, dim), |_| rng.random_range(-1.0_f32..1.0))
}

fn write(file: &Path, n: usize, dim: usize) -> Result<(), Box<dyn Error>> {
    const AT_ONCE: usize = 4096;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut writer = MapWriter::create(file, dim, RowType::F32, About::default())?;
    let start_time = Instant::now();
    for start in (0..n).step_by(AT_ONCE) {
        let range = start..(start + AT_ONCE).min(n);
        let names: Names = range.clone().map(|row| format!("{row:07}.jpg")).collect();
        let positions = range.clone().map(|row| PlanarPosition::new(row as f64, 0.0));
        let poses = Poses::Planar(positions.collect());
        let values = rows(range.len(), dim, &mut rng);
        writer.append(values.view(), Some(&poses), Some(&names))?;
    }
    writer.finish()?;
    println!("written in {:.1} s, {}", start_time.elapsed().as_secs_f64(), memory()?);
    Ok(())
}

fn measure(file: &Path, opening: Opening, n_queries: usize) -> Result<(), Box<dyn Error>> {
    let start_time = Instant::now();
    let map = MapFile::open_with(file, opening)?;
    let open = start_time.elapsed();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let one = Descriptors::new(rows(1, map.dim(), &mut rng))?;
    let batch = Descriptors::new(rows(n_queries, map.dim(), &mut rng))?;
    let params = SearchParams::default();
    println!("{opening:?}: {} × {}, {}", map.len(), map.dim(), memory()?);
    println!("open          {:9.3} ms", open.as_secs_f64() * 1e3);
    for (what, queries) in
        [("first query", &one), ("second query", &one), ("batch", &batch), ("batch again", &batch)]
    {
        let start_time = Instant::now();
        let retrieval = search(&map, queries, &params)?;
        let seconds = start_time.elapsed().as_secs_f64();
        let best = retrieval.best()[0];
        println!("{what:13} {:9.1} ms (best {best}), {}", seconds * 1e3, memory()?);
    }
    let size = fs::metadata(file)?.len();
    println!("file          {:9.1} MB", size as f64 / 1e6);
    Ok(())
}

fn read_once(file: &Path) -> Result<(), Box<dyn Error>> {
    let mut buffer = vec![0; 1 << 20];
    let start_time = Instant::now();
    let mut file = fs::File::open(file)?;
    let mut total = 0;
    loop {
        match file.read(&mut buffer)? {
            0 => break,
            n => total += n,
        }
    }
    let seconds = start_time.elapsed().as_secs_f64();
    let rate = total as f64 / seconds / 1e9;
    println!("read once     {:9.1} ms ({rate:.2} GB/s, one thread)", seconds * 1e3);
    Ok(())
}

/// The largest resident memory so far, and how much of the present one is of mapped files.
fn memory() -> Result<String, Box<dyn Error>> {
    let status = fs::read_to_string("/proc/self/status")?;
    let line = |key: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(key)).unwrap_or_default();
        line.trim_start_matches(':').trim().trim_end_matches(" kB").parse::<f64>().unwrap_or(0.0)
    };
    let [peak, file] = [line("VmHWM"), line("RssFile")].map(|kilobytes| kilobytes / 1024.0);
    Ok(format!("peak {peak:.1} MiB, mapped {file:.1} MiB"))
}
