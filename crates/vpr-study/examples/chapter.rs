//! What a new chapter starts from: a [`Study`], [`run`], and `main`. No line is another chapter's.
//!
//! `cargo run -p vpr-study --example chapter` runs the file below; `… -- run FILE --write DIR` one of
//! your own, with the flags of all chapters. Move this to `crates/<chapter>/src/main.rs`, without
//! [`EXPERIMENT`]; `cargo xtask reproduce <id>` then finds it by the `chapter` of a file.

use std::{env, ffi::OsStr, fs, process::ExitCode};

use clap::Parser;
use serde::Deserialize;
use vpr_core::{Result, metrics::recall_at};
use vpr_report::{
    cli::{self, Bar, Outcome, RunArgs},
    experiment::Experiment,
    page::Report,
    table::{Cell, Table},
};
use vpr_study::{Direction, Sources};

/// What `experiments/table-0.toml` would say.
const EXPERIMENT: &str = r#"
id = "table-0"
title = "Recall@1 on a generated street"
source = "the example of a chapter"
chapter = "chapter"

[study]
kind = "recall"
datasets = ["world/street?places=20&camera.width=160&camera.height=120&camera.focal=115.0"]
"#;

/// What to compute; the key `kind` of `[study]` chooses. A misspelled key is an error with its line.
#[derive(Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum Study {
    /// Recall@1 of every technique that runs here.
    Recall {
        /// Datasets, by id.
        datasets: Vec<String>,
    },
}

fn run(experiment: &Experiment<Study>, sources: &Sources<'_>) -> Result<Report> {
    let mut table = experiment.table();
    match &experiment.study {
        Study::Recall { datasets } => {
            datasets.iter().try_for_each(|id| recall(&mut table, id, sources))?;
        }
    }
    experiment.fill_thesis(&mut table); // what the thesis prints, beside ours
    Ok(Report::new(table, None))
}

/// One row: a cell per technique; data that is not at hand makes absent cells, not an error.
fn recall(table: &mut Table, id: &str, sources: &Sources<'_>) -> Result<()> {
    let Some(dataset) = sources.images(id)? else {
        let (row, why) = (sources.entry(id)?.name, sources.why_absent(id, "images")?);
        let cells = sources.runners()?.iter().map(|it| Cell::absent(&row, it.column, &why));
        cells.for_each(|cell| table.push(cell));
        return Ok(());
    };
    for runner in sources.runners()? {
        let scores = sources.scores(runner, &dataset, Direction::AsReleased)?; // computed once
        let recall = recall_at(1, scores.ranking()?, &dataset.truth)?;
        let (provenance, n) = (dataset.provenance, dataset.truth.len());
        table.push(Cell::new(&dataset.name, runner.column, recall, provenance, n));
    }
    Ok(())
}

/// The example of a chapter.
#[derive(Parser)]
enum Command {
    /// Run an experiment file and compare it with the numbers of the thesis
    Run(RunArgs),
}

fn main() -> ExitCode {
    cli::main(|| {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("table-0.toml");
        fs::write(&file, EXPERIMENT)?;
        let built_in = [OsStr::new("chapter"), OsStr::new("run"), file.as_os_str()];
        let given = env::args_os().len() > 1;
        let Command::Run(args) =
            if given { Command::parse() } else { Command::parse_from(built_in) };

        let experiments = args.open::<Study>("chapter")?; // env!("CARGO_PKG_NAME") in a crate
        let bar = Bar::default();
        let folders = [&*args.data.data, &args.workspace_data()];
        let sources = Sources::new(folders, &args.data.cache, &bar);
        let mut outcome = Outcome::Success;
        for experiment in &experiments {
            let report = run(experiment, &sources)?;
            outcome = outcome.and(cli::finish(experiment, &report, &args.output)?);
        }
        Ok(outcome)
    })
}
