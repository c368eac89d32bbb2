//! `bench map info`: what a map is of, without reading its descriptors.

use std::{fmt::Write as _, path::PathBuf};

use vpr_core::map::{OpenMap, Opening};
use vpr_report::cli::{self, Outcome};

#[derive(clap::Args)]
pub(super) struct InfoArgs {
    /// Map file, or folder of a growing map
    map: PathBuf,
}

pub(super) fn run(args: &InfoArgs) -> anyhow::Result<Outcome> {
    let map = OpenMap::open(&args.map, Opening::default())?;
    let mut text = String::new();
    let mut line = |key: &str, value: &str| {
        let _ = writeln!(text, "{key}: {value}");
    };
    line("references", &map.len().to_string());
    line("dimension", &map.dim().to_string());
    line("row type", &map.row_type().to_string());
    if let Some(origins) = map.origins()? {
        line("regressed", &origins.n_regressed().to_string());
    }
    line("segments", &map.segments().len().to_string());
    let first = &map.segments()[0];
    line("poses", first.pose_kind().unwrap_or("none"));
    for (key, value) in &first.header().metadata {
        line(&key.replace('_', " "), value);
    }
    cli::print(&text)?;
    Ok(Outcome::Success)
}
