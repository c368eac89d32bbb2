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
    /// Datasets, and what of them is at hand: images, what is correct, stored scores
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
            Technique::Hog | Technique::CoHog | Technique::DenseVlad => {
                "runs on images, and from stored matches"
            }
            _ => "from stored matches",
        };
        format!("{:<12}{how}", technique.name())
    };
    Technique::ALL.into_iter().map(line).collect()
}

/// One line each: what of it is at hand, how large it is.
fn datasets(data: &Sources<'_>) -> vpr_core::Result<Vec<String>> {
    let worlds: Vec<String> =
        vpr_worlds::names().into_iter().map(|world| format!("world/{world}")).collect();
    let ids = data.entries().map(|entry| &entry.id).chain(&worlds);
    let width = ids.map(String::len).max().unwrap_or_default();
    let mut lines = Vec::new();
    for entry in data.entries() {
        let at_hand = data.at_hand(entry)?;
        let said = |is_there: bool, what: &'static str| if is_there { what } else { "-" };
        let count = |n: Option<usize>| n.map_or_else(|| "-".to_owned(), |n| n.to_string());
        lines.push(format!(
            "{:<width$}  {:<6} {:<5} {:<6} {:>6} queries {:>6} references  {}",
            entry.id,
            said(at_hand.images, "images"),
            said(at_hand.truth, "truth"),
            said(at_hand.scores, "scores"),
            count(entry.queries),
            count(entry.references),
            entry.name,
        ));
    }
    for id in &worlds {
        let origin = data.entry(id).map_or_else(|err| err.to_string(), |entry| entry.origin);
        lines.push(format!("{id:<width$}  {origin}"));
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
