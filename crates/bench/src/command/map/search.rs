//! `bench map search`: the nearest references of every query.

use std::{fmt::Write as _, path::PathBuf, str::FromStr};

use vpr_core::{
    Error, Position, Retrieval,
    knn::{self, Metric, PositionIndex, SearchParams},
    map::{Access, Names, OpenMap, Opening, parse_metric},
};
use vpr_data::exchange::{self, Format, PairList, Pairs};
use vpr_report::cli::{self, Outcome};

use super::format_of;

#[derive(clap::Args)]
pub(super) struct SearchArgs {
    /// Map file, or folder of a growing map
    map: PathBuf,
    /// File with the queries' descriptors
    #[arg(long, value_name = "PATH")]
    queries: PathBuf,
    /// Its format, if its name does not say it
    #[arg(long, value_name = "FORMAT")]
    queries_format: Option<Format>,
    /// How many references per query
    #[arg(short, default_value_t = 10)]
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
    let access = if args.mapped { Access::Mapped } else { Access::Read };
    let map = OpenMap::open(&args.map, Opening { access, trust: args.trust })?;
    let queries = exchange::read(format_of(args.queries_format, &args.queries)?, &args.queries)?;
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
            let _ = writeln!(text, "{},{rank},{reference},{distance}", list.query);
        }
    }
    cli::print(&text)?;
    Ok(Outcome::Success)
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
