//! Recall@1 of HOG on two folders of images.
//!
//! ```text
//! cargo run -p vpr-study --example recall_of_a_folder                      # a generated street
//! cargo run -p vpr-study --example recall_of_a_folder -- database/ queries/
//! ```
//!
//! Images of your own are named `@utm_east@utm_north@….jpg`, as VPR-methods-evaluation has them: the
//! file's name says where it was taken. A reference is correct within 25 m of the query.
#![expect(clippy::print_stdout, reason = "an example prints what it found")]

use std::{
    env,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};
use vpr_core::{
    GroundTruth,
    metrics::{
        bootstrap::{Z_95, wilson_interval},
        recall_at,
    },
};
use vpr_data::layout::utm_names::UtmFolder;
use vpr_study::{Sources, technique};

/// Twenty places of a city, rendered once into `data/worlds`.
const WORLD: &str = "world/street?places=20&camera.width=160&camera.height=120&camera.focal=115.0";

/// Images on both sides, and which references are correct for which query.
struct Sides {
    queries: Vec<PathBuf>,
    references: Vec<PathBuf>,
    truth: GroundTruth,
}

fn main() -> Result<()> {
    let arguments: Vec<PathBuf> = env::args_os().skip(1).map(PathBuf::from).collect();
    let sides = match &arguments[..] {
        [] => generated()?,
        [database, queries] => folders(database, queries)?,
        _ => bail!("usage: recall_of_a_folder [DATABASE QUERIES]"),
    };

    // A technique describes images; the closure is called after each, for a progress bar.
    let hog = technique::hand_crafted("hog").context("HOG needs no weights")?.technique;
    let queries = hog.encode(&sides.queries, &|| ())?;
    let references = hog.encode(&sides.references, &|| ())?;

    // Every query is compared with every reference; higher is more similar.
    let similarities = queries.match_with(&references)?.similarities;
    let ranking = similarities.ranked(5)?;
    println!("{} queries, {} references", queries.len(), references.len());
    println!("R@5 {:.3}", recall_at(5, &ranking, &sides.truth)?);

    // How much of R@1 is the luck of these queries? Wilson's interval says it also at 0 and 1.
    let correct = sides.truth.judge(&similarities.best().reference)?;
    let n_correct = correct.iter().filter(|&&it| it).count();
    let recall = wilson_interval(n_correct, correct.len(), Z_95)?;
    println!("R@1 {:.3}, 95 % interval {:.3} to {:.3}", recall.estimate, recall.low, recall.high);
    Ok(())
}

/// Positions come from the names of the files.
fn folders(database: &Path, queries: &Path) -> Result<Sides> {
    let (references, queries) = (UtmFolder::open(database)?, UtmFolder::open(queries)?);
    let truth = GroundTruth::within_radius(&queries.poses(), &references.poses(), 25.0)?;
    Ok(Sides { queries: queries.images, references: references.images, truth })
}

/// A dataset by its name has its own truth; `corridor` would be looked for in `data`.
fn generated() -> Result<Sides> {
    let sources = Sources::new([Path::new("data")], Path::new("data/worlds"), &());
    let dataset = sources.images(WORLD)?.context("a generated world is always at hand")?;
    Ok(Sides {
        queries: dataset.queries.clone(),
        references: dataset.references.clone(),
        truth: dataset.truth.clone(),
    })
}
