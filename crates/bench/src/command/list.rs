//! `bench list`: techniques, datasets, metrics.

use std::path::PathBuf;

use clap::ValueEnum;
use vpr_core::metrics::catalogue::CATALOGUE;
use vpr_report::cli::{self, DataArgs, Outcome};
use vpr_study::{Sources, Technique};

/// What to list.
#[derive(clap::Args)]
pub(crate) struct ListArgs {
    /// What to list
    #[arg(value_enum)]
    what: What,
    #[command(flatten)]
    data: DataArgs,
}

#[derive(Clone, Copy, ValueEnum)]
enum What {
    /// Techniques, and whether they run here
    Techniques,
    /// Datasets, and whether they are at hand
    Datasets,
    /// Metrics, and the functions that compute them
    Metrics,
}

pub(crate) fn run(args: &ListArgs) -> anyhow::Result<Outcome> {
    let lines = match args.what {
        What::Techniques => techniques(),
        What::Datasets => {
            let (folders, cache) = (args.data.folders(), args.data.cache());
            datasets(&Sources::new(folders.iter().map(PathBuf::as_path), &cache, &()))?
        }
        What::Metrics => metrics(),
    };
    cli::print(&(lines.join("\n") + "\n"))?;
    Ok(Outcome::Success)
}

fn techniques() -> Vec<String> {
    let line = |technique: Technique| {
        let how = match technique {
            Technique::Hog | Technique::CoHog => "runs on images, and from stored matches",
            _ => "from stored matches",
        };
        format!("{:<12}{how}", technique.name())
    };
    Technique::ALL.into_iter().map(line).collect()
}

fn datasets(data: &Sources<'_>) -> vpr_core::Result<Vec<String>> {
    let mut lines = Vec::new();
    for entry in data.entries() {
        let at_hand = if data.locate(&entry.path)?.is_some() { "at hand" } else { "absent" };
        let count = |n: Option<usize>| n.map_or_else(|| "-".to_owned(), |n| n.to_string());
        lines.push(format!(
            "{:<22}{:<9}{:>6} queries {:>6} references  {}",
            entry.id,
            at_hand,
            count(entry.queries),
            count(entry.references),
            entry.name,
        ));
    }
    for world in vpr_worlds::names() {
        let id = format!("world/{world}");
        let origin = data.entry(&id).map_or_else(|err| err.to_string(), |entry| entry.origin);
        lines.push(format!("{id:<34}{origin}"));
    }
    Ok(lines)
}

fn metrics() -> Vec<String> {
    let line = |metric: &vpr_core::metrics::catalogue::MetricInfo| {
        format!("{:<24}{:<30}{}", metric.id, metric.name, metric.functions.join(", "))
            .trim_end()
            .to_owned()
    };
    CATALOGUE.iter().map(line).collect()
}
