//! What a new chapter starts from: a [`Study`], [`run`], and `main`. No line is another chapter's.
//!
//! `cargo run -p vpr-study --example chapter` runs the file below, `… -- run FILE --write DIR` yours.
//! In `crates/<chapter>/src/main.rs` it is what `cargo xtask reproduce <id>` finds by `chapter`.

use std::{env, ffi::OsString, fs, process::ExitCode};

use clap::Parser;
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

/// What to compute; `kind` chooses. A misspelled key is an error with its line.
#[derive(serde::Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
enum Study {
    /// Recall@1 of every technique that runs here.
    Recall { datasets: Vec<String> },
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
        return sources.push_absent(table, id, &sources.entry(id)?.name);
    };
    for runner in sources.runners()? {
        let scores = sources.scores(runner, &dataset, Direction::AsReleased)?; // computed once
        let recall = recall_at(1, scores.ranking()?, &dataset.truth)?;
        let (provenance, n) = (dataset.provenance, dataset.truth.len());
        table.push(Cell::new(&dataset.name, runner.column, recall, provenance, n));
    }
    Ok(())
}

#[derive(Parser)]
enum Command {
    /// Run experiment files and compare them with the numbers of the thesis
    Run(RunArgs),
}

fn main() -> ExitCode {
    cli::main(|| {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("table-0.toml");
        fs::write(&file, EXPERIMENT)?;
        let mut words: Vec<OsString> = env::args_os().collect();
        if words.len() < 2 {
            words.extend(["run".into(), file.into_os_string()]);
        }
        let Command::Run(args) = Command::parse_from(words);
        let experiments = args.open::<Study>("chapter")?; // the name of your program
        let bar = Bar::default();
        let folders = [&*args.data.data, &args.workspace_data()];
        let sources = Sources::new(folders, &args.data.cache, &bar);
        let without = sources.without_weights()?;
        let mut outcome = Outcome::Success;
        for experiment in &experiments {
            let report = run(experiment, &sources)?;
            outcome = outcome.and(cli::finish(experiment, &report, &args.output, &without)?);
        }
        Ok(outcome)
    })
}
