//! `bench map search`: the nearest references of every query.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    str::FromStr,
};

use vpr_core::{
    Error, Position, Retrieval,
    knn::{self, Metric, PositionIndex, SearchParams},
    map::{Access, Names, OpenMap, Opening, parse_metric},
};
use vpr_data::exchange::{self, Beside, Format, Kind, PairList, Pairs, csv_field};
use vpr_report::cli::{self, Outcome};
use vpr_study::reading::{FromArgs, ReadingArgs};

#[derive(clap::Args)]
pub(super) struct SearchArgs {
    /// Map file, or folder of a growing map
    map: PathBuf,
    /// File with the queries' descriptors
    #[arg(long, value_name = "PATH")]
    queries: PathBuf,
    #[command(flatten)]
    from: FromArgs,
    /// How many references per query
    #[arg(short, default_value_t = 10, value_parser = cli::at_least_one)]
    k: usize,
    /// The distance; without it that of the map, and Euclidean if the map names none
    #[arg(long, value_parser = parse_metric)]
    metric: Option<Metric>,
    /// Search only references at most RADIUS metres from X,Y (and height zero, or Z)
    #[arg(long, value_name = "X,Y[,Z],RADIUS", allow_hyphen_values = true)]
    near: Option<Near>,
    /// Leave out references that were regressed (`copr densify`): only images are trusted
    #[arg(long)]
    measured: bool,
    /// Search the graph that `build --approximate` left beside the map: faster, and a neighbour may
    /// be missing; distances are exact
    #[cfg(feature = "approximate")]
    #[arg(long, conflicts_with_all = ["near", "measured"])]
    approximate: bool,
    /// Do not check digests and finiteness of the blocks that are read
    #[arg(long)]
    trust: bool,
    /// Map the file into memory, which is faster for repeated searches and takes more of it
    #[arg(long)]
    mapped: bool,
    /// Write pairs there instead of a table to stdout
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// The format of the pairs
    #[arg(long, value_name = "FORMAT", default_value = "hloc-pairs")]
    to: Format,
}

/// Where the query is known to be: GPS, odometry.
#[derive(Clone, Copy)]
struct Near {
    center: Position,
    radius: f64,
}

impl FromStr for Near {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split(',').map(|field| field.trim().parse::<f64>());
        let numbers = numbers.collect::<Result<Vec<f64>, _>>().map_err(|err| err.to_string())?;
        match numbers[..] {
            [x, y, radius] => Ok(Self { center: Position::new(x, y, 0.0), radius }),
            [x, y, z, radius] => Ok(Self { center: Position::new(x, y, z), radius }),
            _ => Err("expected x,y,radius or x,y,z,radius in metres".to_owned()),
        }
    }
}

pub(super) fn run(args: &SearchArgs) -> anyhow::Result<Outcome> {
    if let Some(out) = &args.out {
        check_out(args.to, out)?;
    }
    let access = if args.mapped { Access::Mapped } else { Access::Read };
    let map = OpenMap::open(&args.map, Opening { access, trust: args.trust })?;
    let reading = ReadingArgs { from: args.from, ..ReadingArgs::default() };
    // Queries have names beside them, at best; nobody asks for their poses.
    let queries = reading.read(&args.queries, Beside::IfSound)?;
    if args.k > map.len() {
        let (k, n) = (args.k, map.len());
        cli::note(&format!("note: {}: {n} references, fewer than `-k {k}`", args.map.display()));
    }
    let none = || Error::Empty("descriptors").in_file(&args.queries);
    let descriptors = queries.descriptors.ok_or_else(none)?;
    let metric = args.metric.or(map.about().metric).unwrap_or_default();
    let params = SearchParams { metric, k: args.k, ..SearchParams::default() };
    let measured = map.origins()?.filter(|_| args.measured);
    let retrieval = match &args.near {
        #[cfg(feature = "approximate")]
        None if args.approximate => {
            super::approximate::search(&args.map, &map, &descriptors, &params)?
        }
        None => match &measured {
            None => knn::search(&map, &descriptors, &params)?,
            Some(origins) => {
                knn::search_among(&map, origins.measured_rows(), &descriptors, &params)?
            }
        },
        Some(near) => {
            let no_poses = || Error::Empty("poses").in_file(&args.map);
            let index = PositionIndex::new(&map.poses()?.ok_or_else(no_poses)?)?;
            let mut rows = index.within(near.center, near.radius)?;
            rows.retain(|&row| measured.as_ref().is_none_or(|origins| origins.is_measured(row)));
            knn::search_among(&map, rows, &descriptors, &params)?
        }
    };
    let pairs = pairs_of(&retrieval, queries.names.as_ref(), map.names()?.as_ref());
    if let Some(out) = &args.out {
        exchange::write_pairs(args.to, out, &pairs)?;
        return Ok(Outcome::Success);
    }
    let mut text = String::from("query,rank,reference,distance\n");
    for (query, list) in pairs.lists.iter().enumerate() {
        let references = list.references.iter().zip(retrieval.distances(query));
        for (rank, (reference, distance)) in (1..).zip(references) {
            let (query, reference) = (csv_field(&list.query), csv_field(reference));
            let _ = writeln!(text, "{query},{rank},{reference},{distance}");
        }
    }
    cli::print(&text)?;
    Ok(Outcome::Success)
}

/// Refuses before the search what cannot be written after it.
fn check_out(to: Format, out: &Path) -> anyhow::Result<()> {
    match to.kind() {
        Kind::Pairs => cli::check_out(out),
        // A folder, which may be there.
        Kind::DescriptorsAndPairs if out.is_file() => {
            anyhow::bail!("{}: is a file, and {to} is a folder", out.display())
        }
        Kind::DescriptorsAndPairs => Ok(()),
        _ => anyhow::bail!("`--to {to}`: holds no pairs; hloc-pairs and vpr-eval do"),
    }
}

/// Names of queries and their references; numbers where there are no names.
fn pairs_of(retrieval: &Retrieval, queries: Option<&Names>, references: Option<&Names>) -> Pairs {
    let name = |names: Option<&Names>, index: usize| {
        let name = names.and_then(|names| names.get(index));
        name.map_or_else(|| index.to_string(), str::to_owned)
    };
    let lists = (0..retrieval.len()).map(|query| PairList {
        query: name(queries, query),
        references: retrieval.indices(query).iter().map(|&it| name(references, it)).collect(),
    });
    Pairs { lists: lists.collect() }
}
