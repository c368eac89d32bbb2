//! What every chapter's command line shares. Behind the `cli` feature.
#![expect(clippy::print_stderr, reason = "the one place that prints")]

mod progress;
mod shell;

use std::{
    io::{BufWriter, ErrorKind, Write},
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::bail;
use clap::Args;
use serde::de::DeserializeOwned;

use crate::{
    experiment::{self, Experiment},
    page::Report,
    report,
    table::{Checked, Format, WIDTH},
};
use vpr_files::NewFile;

pub use progress::{Bar, Quiet, progress};
pub use shell::Shell;

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

/// What `--data` and `--cache` are where nobody named a folder.
const DATA: &str = "data";
const CACHE: &str = "data/worlds";

impl DataArgs {
    /// The folders that are searched, the first that has something wins: the one that was named,
    /// `data` where the program runs, and that of the checkout that the program was built in.
    #[must_use]
    pub fn folders(&self) -> Vec<PathBuf> {
        self.folders_before(checkout_data())
    }

    /// The folder that keeps generated places: the one that was named, or, where the program runs
    /// without a data folder, the one in the checkout that it was built in.
    #[must_use]
    pub fn cache(&self) -> PathBuf {
        self.cache_before(checkout_data())
    }

    fn folders_before(&self, last: impl IntoIterator<Item = PathBuf>) -> Vec<PathBuf> {
        let mut folders = vec![self.data.clone()];
        for folder in std::iter::once(PathBuf::from(DATA)).chain(last) {
            if !folders.contains(&folder) {
                folders.push(folder);
            }
        }
        folders
    }

    fn cache_before(&self, data: Option<PathBuf>) -> PathBuf {
        match data {
            Some(data) if self.cache == Path::new(CACHE) && !Path::new(DATA).is_dir() => {
                data.join("worlds")
            }
            _ => self.cache.clone(),
        }
    }
}

/// `data/` of the checkout that this program was built in, if it still lies there.
#[must_use]
pub fn checkout_data() -> Option<PathBuf> {
    let program = std::env::current_exe().and_then(|it| it.canonicalize()).ok()?;
    let is_checkout = |it: &&Path| it.join("Cargo.lock").is_file() && it.join("data").is_dir();
    program.ancestors().skip(1).find(is_checkout).map(|it| it.join("data"))
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
    /// Also write the page into this folder as HTML, with a list of all pages in it: `index.html`
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
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

/// A report to look at.
#[derive(Args, Clone, Debug)]
pub struct ReportArgs {
    /// Also write a report to look at, one HTML file: curves, map, gallery, filters
    #[arg(id = "report", long = "report", value_name = "HTML")]
    pub path: Option<PathBuf>,
    /// Keep all thumbnails of the report, however large it becomes; otherwise it has at most 10 MB
    #[arg(long, requires = "report")]
    pub full: bool,
}

impl ReportArgs {
    /// Bytes that the report may take.
    #[must_use]
    pub fn budget(&self) -> Option<usize> {
        (!self.full).then_some(report::BUDGET)
    }

    /// Before the work: whether the report could be written where it is asked for.
    ///
    /// # Errors
    ///
    /// Those of [`check_out`].
    pub fn check(&self) -> anyhow::Result<()> {
        self.path.as_deref().map_or(Ok(()), check_out)
    }

    /// Writes the report if one is asked for; the file appears whole or not at all.
    ///
    /// # Errors
    ///
    /// Runs that do not fit their dataset, or a folder that cannot be written.
    pub fn write(&self, report: &report::Report<'_>) -> anyhow::Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        let mut file = NewFile::create(path)?;
        let failed = file.io_error();
        let mut out = BufWriter::new(file.file());
        let written = report.write(&mut out).and_then(|()| out.flush());
        drop(out);
        written.map_err(failed)?;
        Ok(file.commit()?)
    }
}

/// The command line as it was typed, quoted where a shell would need it.
#[must_use]
pub fn command_line() -> String {
    let program =
        |it: String| Path::new(&it).file_name().map(|it| it.to_string_lossy().into_owned());
    let is_plain = |it: char| it.is_ascii_alphanumeric() || "-_./=:,@+%".contains(it);
    let quoted = |it: String| {
        if it.chars().all(is_plain) && !it.is_empty() {
            return it;
        }
        format!("'{}'", it.replace('\'', "'\\''"))
    };
    let mut words = std::env::args_os().map(|it| it.to_string_lossy().into_owned());
    let program = words.next().and_then(program);
    program.into_iter().chain(words.map(quoted)).collect::<Vec<_>>().join(" ")
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
        let data = &self.data.data;
        // The usual name is looked for beside the experiment as well.
        let is_beside = data == Path::new(DATA) && self.workspace_data().is_dir();
        if !(data.is_dir() || is_beside) {
            bail!("{}: the data folder does not exist", data.display());
        }
        Ok(experiments)
    }

    /// The folders that are searched: those of [`DataArgs::folders`], that beside the experiment
    /// before the last.
    #[must_use]
    pub fn folders(&self) -> Vec<PathBuf> {
        self.data.folders_before(std::iter::once(self.workspace_data()).chain(checkout_data()))
    }

    /// The folder that keeps generated places, see [`DataArgs::cache`]; beside the experiment
    /// before that in the checkout.
    #[must_use]
    pub fn cache(&self) -> PathBuf {
        let beside = Some(self.workspace_data()).filter(|it| it.is_dir());
        self.data.cache_before(beside.or_else(checkout_data))
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

/// Refuses, before the work, a file that could not be written after it: something that is no file
/// is called so, or the folder it should lie in is not there. A file that is there is replaced.
///
/// # Errors
///
/// Which of these it is, by the path.
pub fn check_out(path: &Path) -> anyhow::Result<()> {
    if path.is_dir() {
        bail!("{}: is a folder, not a file to write", path.display());
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    match folder.filter(|folder| !folder.is_dir()) {
        Some(folder) => bail!("{}: {} is no folder", path.display(), folder.display()),
        None => Ok(()),
    }
}

/// A count that must not be zero, for `value_parser`.
///
/// # Errors
///
/// Why a text is none.
pub fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(0) => Err("must be at least 1".to_owned()),
        Ok(n) => Ok(n),
        Err(err) => Err(err.to_string()),
    }
}

/// Tells a person something, on stderr.
pub fn note(text: &str) {
    eprintln!("{text}");
}

/// Says, before long work begins, that it may be ended at any time, and how it goes on.
pub fn resumes(checkpoints: &Path) {
    note(&format!(
        "may be ended at any time (Ctrl-C): the same command goes on from {}",
        checkpoints.display()
    ));
}

/// Letters of a line: `COLUMNS`, or what pages have.
#[must_use]
pub fn columns() -> usize {
    let columns = std::env::var("COLUMNS").ok().and_then(|it| it.parse().ok());
    columns.filter(|columns| *columns > 0).unwrap_or(WIDTH)
}

/// Prints a result and, as the flags say, writes its page or checks it; `without` names the methods
/// whose weights are not at hand, which the page may have and this run cannot.
///
/// # Errors
///
/// If stdout is closed, or a page cannot be read or written.
pub fn finish<S>(
    experiment: &Experiment<S>,
    report: &Report,
    output: &OutputArgs,
    without: &[&str],
) -> anyhow::Result<Outcome> {
    let table = &report.table;
    print(&table.render_within(output.format, columns()))?;
    if let Some(folder) = &output.write {
        report.write(experiment, folder)?;
    }
    if let Some(folder) = &output.report {
        report.write_site(experiment, folder)?;
    }
    let Some(folder) = &output.check else { return Ok(Outcome::Success) };
    let Checked { findings, n_compared, n_not_at_hand } =
        report.check(experiment, folder, without)?;
    for finding in &findings {
        note(&format!("{}: {finding}", table.id));
    }
    let rest = match n_not_at_hand {
        0 => String::new(),
        n => format!("; {n} cells of the page need data that is not at hand"),
    };
    note(&format!("{}: {n_compared} comparisons, {} off{rest}", table.id, findings.len()));
    Ok(if findings.is_empty() { Outcome::Success } else { Outcome::Mismatch })
}
