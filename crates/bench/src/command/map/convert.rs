//! `bench map convert`: one format into another.

use std::path::PathBuf;

use vpr_core::map::{OpenMap, Opening, RowType, copy_as};
use vpr_data::exchange::{self, Beside, Format, Kind};
use vpr_report::cli::{self, Outcome};
use vpr_study::reading::{FromArgs, ReadingArgs};

use super::format_to;

#[derive(clap::Args)]
pub(super) struct ConvertArgs {
    /// What to read
    input: PathBuf,
    #[command(flatten)]
    reading: ReadingArgs,
    /// What to write
    out: PathBuf,
    /// Its format, if its name does not say it
    #[arg(long, value_name = "FORMAT")]
    to: Option<Format>,
    /// How a map stores descriptors: f32, f16 or int8
    #[arg(long, value_name = "TYPE")]
    row_type: Option<RowType>,
}

pub(super) fn run(args: &ConvertArgs) -> anyhow::Result<Outcome> {
    // What is converted may be poses alone.
    let from = FromArgs { from: args.reading.from.from.or(args.reading.poses.poses_format) };
    let from = from.format_of(&args.input)?;
    let to = format_to(args.to, &args.out)?;
    if from == Format::Map && to == Format::Map {
        // Row by row: the map may be larger than memory.
        let map = OpenMap::open(&args.input, Opening::default())?;
        let n = copy_as(&map, args.row_type.unwrap_or(map.row_type()), &args.out)?;
        cli::note(&format!("wrote {n} references"));
        return Ok(Outcome::Success);
    }
    if from.kind() == Kind::Pairs || to.kind() == Kind::Pairs {
        let pairs = exchange::read_pairs(from, &args.input)?;
        exchange::write_pairs(to, &args.out, &pairs)?;
        cli::note(&format!("wrote the references of {} queries", pairs.lists.len()));
        return Ok(Outcome::Success);
    }
    let parts = exchange::read_with(from, &args.input, args.reading.poses.reading(Beside::Used))?;
    match (to, args.row_type) {
        (Format::Map, Some(row_type)) => parts.write_map(&args.out, row_type),
        _ => exchange::write(to, &args.out, &parts),
    }
    .map_err(|err| err.in_file(&args.input))?;
    for note in &parts.notes {
        cli::note(&format!("note: {note}"));
    }
    for what in exchange::left_out(to, &parts) {
        cli::note(&format!("note: {to} has no place for the {what}: they are left out"));
    }
    if let Some(origins) = parts.origins.as_ref().filter(|_| to != Format::Map) {
        let n = origins.n_regressed();
        cli::note(&format!("note: {to} cannot say which rows are regressed: {n} of them are"));
    }
    Ok(Outcome::Success)
}
