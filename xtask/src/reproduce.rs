//! From ids to experiment files to the chapters' programs.
#![expect(clippy::print_stdout, reason = "`--list` is data")]
#![expect(clippy::print_stderr, reason = "a person waits for the build")]

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, ExitCode},
};

use anyhow::{Context, bail};
use serde::Deserialize;

#[expect(clippy::struct_excessive_bools, reason = "one per command-line flag")]
/// What to reproduce, from which data, in which format.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Tables and figures, such as `table-3.5`
    #[arg(value_name = "ID", required_unless_present_any = ["all", "list"])]
    ids: Vec<String>,
    /// Every experiment there is
    #[arg(long, conflicts_with = "ids")]
    all: bool,
    /// Leave these out
    #[arg(long, value_name = "ID", num_args = 1.., requires = "all")]
    except: Vec<String>,
    /// Say which experiments there are
    #[arg(long)]
    list: bool,
    /// Folder of the datasets
    #[arg(long, env = "VPR_DATA", value_name = "DIR", default_value = "data")]
    data: PathBuf,
    /// Folder that keeps generated places once they are rendered; `data/worlds` by default
    #[arg(long, env = "VPR_CACHE", value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Format on stdout: table, csv, json, markdown or html
    #[arg(long, value_name = "FORMAT", default_value = "table")]
    format: String,
    /// Write the pages in `docs/results`
    #[arg(long)]
    write: bool,
    /// Compare with the pages in `docs/results` and with the expected numbers
    #[arg(long, conflicts_with = "write")]
    check: bool,
    /// Write pages to look at and a list of them, `index.html`, into this folder
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Measure timings as well; they differ from run to run
    #[arg(long)]
    timings: bool,
    /// With --timings: the device that table 3.8 is timed on, `wgpu` or `cuda`, or `cuda:1`
    #[arg(long, value_name = "DEVICE", requires = "timings")]
    device: Option<String>,
    /// Build networks too, for their rows; pages always have them
    #[arg(long)]
    networks: bool,
}

/// The two keys of an experiment file that matter here.
#[derive(Deserialize)]
struct Experiment {
    title: String,
    chapter: String,
}

/// Runs every experiment asked for, then reports the worst exit code: 0, 1 (a number is off) or
/// 2 (could not run).
pub(crate) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let root = workspace_root()?;
    let known = ids(&root)?;
    if args.list {
        for id in &known {
            println!("{id}  {}", read(&root, id)?.title);
        }
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(id) = args.ids.iter().chain(&args.except).find(|id| !known.contains(id)) {
        bail!("no experiment `{id}`; `cargo xtask reproduce --list` names them");
    }
    let asked = if args.all { known } else { args.ids.clone() };
    let ids: Vec<String> = asked.into_iter().filter(|id| !args.except.contains(id)).collect();
    let mut worst = 0;
    for (chapter, ids) in by_chapter(&root, &ids)? {
        let code = reproduce(&root, &chapter, &ids, args)?;
        worst = worst.max(code);
    }
    Ok(ExitCode::from(worst))
}

/// The ids of each chapter, chapters in the order of their first id: one process runs them all,
/// so that it can share what they have in common.
fn by_chapter<'a>(root: &Path, ids: &'a [String]) -> anyhow::Result<Vec<(String, Vec<&'a str>)>> {
    let mut chapters: Vec<(String, Vec<&str>)> = Vec::new();
    for id in ids {
        let chapter = read(root, id)?.chapter;
        match chapters.iter_mut().find(|(known, _)| *known == chapter) {
            Some((_, ids)) => ids.push(id),
            None => chapters.push((chapter, vec![id])),
        }
    }
    Ok(chapters)
}

fn reproduce(root: &Path, chapter: &str, ids: &[&str], args: &Args) -> anyhow::Result<u8> {
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.current_dir(root).args(["run", "--quiet", "--bin", chapter]);
    command.args(features(chapter, args));
    command.args(["--", "run"]).args(ids.iter().map(|id| format!("experiments/{id}.toml")));
    let from_here =
        |path: &Path| env::current_dir().context("current folder").map(|it| it.join(path));
    command.arg("--data").arg(from_here(&args.data)?).args(["--format", &args.format]);
    if let Some(cache) = &args.cache {
        command.arg("--cache").arg(from_here(cache)?);
    }
    if let Some(folder) = &args.report {
        command.arg("--report").arg(from_here(folder)?);
    }
    for (is_set, flag) in [(args.write, "--write"), (args.check, "--check")] {
        if is_set {
            command.args([flag, "docs/results"]);
        }
    }
    if args.timings {
        command.arg("--timings");
    }
    if let Some(device) = args.device.as_ref().filter(|_| chapter == "bench") {
        command.args(["--device", device]);
    }
    let status = command.status().with_context(|| format!("running `{chapter}`"))?;
    Ok(status.code().and_then(|code| u8::try_from(code).ok()).map_or(2, |code| code.min(2)))
}

pub(crate) fn workspace_root() -> anyhow::Result<PathBuf> {
    let manifest = env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
    let xtask = manifest.unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")));
    Ok(xtask.parent().context("xtask lies in the workspace")?.to_owned())
}

/// What cargo is told to build. Chapter 3 has a first table without networks, in minutes; pages have
/// all that can be computed. All members of the workspace are selected either way, so that what both
/// need is built once.
fn features(chapter: &str, args: &Args) -> &'static [&'static str] {
    match args.device.as_deref().map(|it| it.split(':').next().unwrap_or(it)) {
        Some("wgpu") if chapter == "bench" => return &["--features", "vpr-bench/wgpu"],
        Some("cuda") if chapter == "bench" => return &["--features", "vpr-bench/cuda"],
        _ => {}
    }
    let is_page = args.all || args.write || args.check || args.report.is_some();
    if chapter != "bench" || is_page || args.networks {
        return &[];
    }
    eprintln!(
        "note: without networks; `--networks` adds their rows (and some minutes of compiling)"
    );
    &["--no-default-features", "--features", "vpr-bench/cli"]
}

/// Ids of all experiment files, tables before figures, by number.
fn ids(root: &Path) -> anyhow::Result<Vec<String>> {
    let folder = root.join("experiments");
    let mut ids = Vec::new();
    for entry in fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            ids.extend(path.file_stem().and_then(|stem| stem.to_str()).map(str::to_owned));
        }
    }
    ids.sort_by_key(|id| sort_key(id));
    Ok(ids)
}

fn sort_key(id: &str) -> (bool, Vec<u32>, String) {
    let numbers = id.split(['-', '.']).filter_map(|part| part.parse().ok()).collect();
    (!id.starts_with("table"), numbers, id.to_owned())
}

fn read(root: &Path, id: &str) -> anyhow::Result<Experiment> {
    let path = root.join("experiments").join(format!("{id}.toml"));
    let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    toml::from_str(&text).with_context(|| path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_come_before_figures_and_numbers_count_as_numbers() {
        let mut ids = ["figure-3.10", "table-3.10", "figure-3.9", "table-3.9"].map(String::from);
        ids.sort_by_key(|id| sort_key(id));
        assert_eq!(ids, ["table-3.9", "table-3.10", "figure-3.9", "figure-3.10"]);
    }
}
