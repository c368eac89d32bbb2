//! What every chapter's command line shares. Behind the `cli` feature.
#![expect(clippy::print_stderr, reason = "the one place that prints")]

use std::{
    io::{ErrorKind, IsTerminal, Write},
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Mutex,
};

use anyhow::{Context, bail};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde::de::DeserializeOwned;

use crate::{
    Observer,
    experiment::{self, Experiment},
    figure::Figure,
    table::{Format, Table, check, csv_page, markdown_page, read_csv},
};

/// What a command concluded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It ran, and every checked number is right. Exit code 0.
    Success,
    /// It ran, and a checked number is off or something checked is wrong. Exit code 1.
    Mismatch,
}

impl Outcome {
    /// The worse of two.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        if self == Self::Success { other } else { self }
    }
}

/// Where an experiment finds its data.
#[derive(Args, Clone, Debug)]
pub struct DataArgs {
    /// Folder of the datasets; `data/README.md` says what belongs in it
    #[arg(long, env = "VPR_DATA", value_name = "DIR", default_value = "data", global = true)]
    pub data: PathBuf,
    /// Folder that keeps generated places once they are rendered
    #[arg(
        long,
        env = "VPR_CACHE",
        value_name = "DIR",
        default_value = "data/worlds",
        global = true
    )]
    pub cache: PathBuf,
}

/// How results are printed and kept.
#[derive(Args, Clone, Debug)]
pub struct OutputArgs {
    /// Format on stdout
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT")]
    pub format: Format,
    /// Also write the page, its CSV and its figure into this folder
    #[arg(long, value_name = "DIR")]
    pub write: Option<PathBuf>,
    /// Compare with the page in this folder and with the expected numbers
    #[arg(long, value_name = "DIR", conflicts_with = "write")]
    pub check: Option<PathBuf>,
    /// Measure what differs from run to run (timings) as well
    #[arg(long)]
    pub timings: bool,
}

/// Which experiments to run, from which data, and what becomes of their results.
#[derive(Args, Clone, Debug)]
pub struct RunArgs {
    /// Experiment files, such as `experiments/table-3.5.toml`; what they have in common is computed
    /// once
    #[arg(required = true, value_name = "FILE")]
    pub experiments: Vec<PathBuf>,
    /// Where their data is.
    #[command(flatten)]
    pub data: DataArgs,
    /// How results are printed and kept.
    #[command(flatten)]
    pub output: OutputArgs,
}

impl RunArgs {
    /// The experiments, all of them `chapter`'s.
    ///
    /// # Errors
    ///
    /// A file that is malformed or another chapter's, by its path; a data folder that is not there.
    pub fn open<S: DeserializeOwned>(&self, chapter: &str) -> anyhow::Result<Vec<Experiment<S>>> {
        let open = |path: &PathBuf| {
            let experiment = experiment::load::<S>(path)?;
            if experiment.chapter != chapter {
                bail!("{}: belongs to `{}`", path.display(), experiment.chapter);
            }
            Ok(experiment)
        };
        let experiments = self.experiments.iter().map(open).collect::<anyhow::Result<_>>()?;
        if !self.data.data.is_dir() {
            bail!("{}: the data folder does not exist", self.data.data.display());
        }
        Ok(experiments)
    }

    /// `data/` beside the folder of the first experiment file: where the fixture lies.
    #[must_use]
    pub fn workspace_data(&self) -> PathBuf {
        let first = self.experiments.first().map_or(Path::new(""), PathBuf::as_path);
        let absolute = std::path::absolute(first).unwrap_or_else(|_| first.to_owned());
        absolute.ancestors().nth(2).unwrap_or(Path::new("")).join("data")
    }
}

/// Runs `body` as a program: errors to stderr, exit code 0, 1 or 2. A closed pipe is no error.
pub fn main(body: impl FnOnce() -> anyhow::Result<Outcome>) -> ExitCode {
    match body() {
        Ok(Outcome::Success) => ExitCode::SUCCESS,
        Ok(Outcome::Mismatch) => ExitCode::from(1),
        Err(err) if is_broken_pipe(&err) => ExitCode::SUCCESS,
        Err(err) => {
            eprintln!("error: {err:#}");
            ExitCode::from(2)
        }
    }
}

fn is_broken_pipe(err: &anyhow::Error) -> bool {
    err.chain().any(|cause| {
        cause.downcast_ref::<std::io::Error>().is_some_and(|it| it.kind() == ErrorKind::BrokenPipe)
    })
}

/// Prints data on stdout.
///
/// # Errors
///
/// If stdout is closed.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut stdout = std::io::stdout().lock();
    stdout.write_all(text.as_bytes())?;
    Ok(stdout.flush()?)
}

/// Tells a person something, on stderr.
pub fn note(text: &str) {
    eprintln!("{text}");
}

/// A progress bar on stderr; invisible if stderr is no terminal or `VPR_NO_PROGRESS` is set.
#[must_use]
pub fn progress(what: &str, n: usize) -> ProgressBar {
    if !std::io::stderr().is_terminal() || std::env::var_os("VPR_NO_PROGRESS").is_some() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{msg} {bar:30} {pos}/{len} {eta}");
    let bar = ProgressBar::new(n as u64);
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.set_message(what.to_owned());
    bar
}

/// The progress bar of the work under way, on stderr.
#[derive(Default)]
pub struct Bar(Mutex<Option<ProgressBar>>);

impl Bar {
    fn with(&self, act: impl FnOnce(&mut Option<ProgressBar>)) {
        // A poisoned lock means another thread panicked: progress no longer matters.
        if let Ok(mut bar) = self.0.lock() {
            act(&mut bar);
        }
    }
}

impl Observer for Bar {
    fn start(&self, what: &str, n: usize) {
        self.with(|bar| *bar = Some(progress(what, n)));
    }

    fn step(&self) {
        self.with(|bar| bar.iter().for_each(|bar| bar.inc(1)));
    }

    fn end(&self) {
        self.with(|bar| bar.take().iter().for_each(ProgressBar::finish_and_clear));
    }
}

/// Prints a result and, as the flags say, writes its page or checks it.
///
/// # Errors
///
/// If stdout is closed, or a page cannot be read or written.
pub fn finish<S>(
    experiment: &Experiment<S>,
    table: &Table,
    figure: Option<&Figure>,
    output: &OutputArgs,
) -> anyhow::Result<Outcome> {
    print(&table.render(output.format))?;
    if let Some(folder) = &output.write {
        write_page(folder, table, &experiment.source, figure)?;
    }
    let Some(folder) = &output.check else { return Ok(Outcome::Success) };
    let page = folder.join(format!("{}.csv", table.id));
    let committed = page.exists().then(|| read_csv(&page)).transpose()?;
    if committed.is_none() {
        note(&format!("{}: no committed page at {}", table.id, page.display()));
    }
    let (findings, n_compared) = check(table, committed.as_deref(), &experiment.expect);
    for finding in &findings {
        note(&format!("{}: {finding}", table.id));
    }
    note(&format!("{}: {n_compared} comparisons, {} off", table.id, findings.len()));
    let is_fine = findings.is_empty() && committed.is_some();
    Ok(if is_fine { Outcome::Success } else { Outcome::Mismatch })
}

fn write_page(
    folder: &Path,
    table: &Table,
    source: &str,
    figure: Option<&Figure>,
) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let write = |extension: &str, text: &str| {
        let path = folder.join(format!("{}.{extension}", table.id));
        std::fs::write(&path, text).with_context(|| path.display().to_string())
    };
    write("md", &markdown_page(table, source, figure.is_some()))?;
    write("csv", &csv_page(table))?;
    if let Some(figure) = figure {
        write("svg", &figure.svg().map_err(anyhow::Error::msg)?)?;
    }
    Ok(())
}
