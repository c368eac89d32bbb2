//! `copr localize`: where queries were taken.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
};

use anyhow::{bail, ensure};
use copr::{PoseErrors, WITHIN, oracle};
use vpr_core::{
    Error, GroundTruth, Pose, Poses,
    knn::{self, SearchParams},
    map::{Access, Names, OpenMap, Opening, Origins},
    metrics::bootstrap::{Interval, Resampling},
};
use vpr_data::exchange::{self, Format, Parts};
use vpr_files::replace;
use vpr_report::{
    cli::{self, Outcome, ReportArgs},
    report::{Dataset, Match, Report, Run},
};

/// The map, the queries and what is known of them.
#[derive(clap::Args)]
pub(crate) struct LocalizeArgs {
    /// Map with full poses: a file or the folder of a growing map
    #[arg(long, value_name = "PATH")]
    map: PathBuf,
    /// Descriptors of the queries, perhaps with poses; with --oracle poses are enough
    #[arg(long, value_name = "PATH")]
    queries: PathBuf,
    /// Its format, if its name does not say it
    #[arg(long, value_name = "FORMAT")]
    queries_format: Option<Format>,
    /// Poses of the queries, if their descriptors did not come with them: errors are printed too
    #[arg(long, value_name = "PATH")]
    query_poses: Option<PathBuf>,
    /// Its format, if its name does not say it
    #[arg(long, value_name = "FORMAT")]
    query_poses_format: Option<Format>,
    /// Leave out rows that were regressed
    #[arg(long)]
    measured: bool,
    /// Take the reference nearest in space, whatever it looks like: what the map could at best give
    #[arg(long)]
    oracle: bool,
    /// Write there instead of stdout
    #[arg(long, short, value_name = "PATH")]
    out: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
}

pub(crate) fn run(args: &LocalizeArgs) -> anyhow::Result<Outcome> {
    args.report.check()?;
    let map = OpenMap::open(&args.map, Opening { access: Access::Read, trust: false })?;
    let none = || Error::Empty("poses").in_file(&args.map);
    let poses = map.poses()?.ok_or_else(none)?;
    poses.six_dof().map_err(|err| err.in_file(&args.map))?;
    let mut queries = read(args.queries_format, &args.queries)?;
    if let Some(path) = &args.query_poses {
        let more = read(args.query_poses_format, path)?;
        queries = queries.join(more).map_err(|err| err.in_file(path))?;
    }
    let origins = map.origins()?;
    let rows = origins.as_ref().filter(|_| args.measured).map(Origins::measured_rows);
    let found = if args.oracle {
        by_pose(&queries, &poses, rows, &args.queries)?
    } else {
        by_descriptor(&queries, &map, rows, &args.queries)?
    };
    let errors = match &queries.poses {
        Some(truth @ Poses::SixDof(_)) => {
            Some(PoseErrors::of_retrieval(&found.best, &poses, truth)?)
        }
        _ => None,
    };
    let text = Answer { found: &found, poses: poses.six_dof()?, origins: origins.as_ref() }
        .text((queries.names.as_ref(), map.names()?.as_ref()), errors.as_ref());
    match &args.out {
        Some(path) => replace(path, text.as_bytes())?,
        None => cli::print(&text)?,
    }
    if let Some(errors) = &errors {
        cli::note(&summary(errors)?);
    }
    if args.report.path.is_some() {
        report(args, &queries, &found, (&poses, map.names()?.as_ref(), origins.as_ref()))?;
    }
    Ok(Outcome::Success)
}

/// The report that the flags ask for: where each query was placed. Right are references within
/// the middle one of [`WITHIN`]'s distances.
fn report(
    args: &LocalizeArgs,
    queries: &Parts,
    found: &Found,
    (poses, names, origins): (&Poses, Option<&Names>, Option<&Origins>),
) -> anyhow::Result<()> {
    let (radius_m, _) = WITHIN[1];
    let truth = match &queries.poses {
        Some(at @ Poses::SixDof(_)) => Some(GroundTruth::within_radius(at, poses, radius_m)?),
        _ => None,
    };
    let plain = |names: Option<&Names>, index: usize| {
        names.and_then(|all| all.get(index)).map_or_else(|| index.to_string(), str::to_owned)
    };
    let of_reference = |row: usize| {
        let is_measured = origins.is_none_or(|all| all.is_measured(row));
        let name = plain(names, row);
        if is_measured { name } else { format!("{name} (regressed)") }
    };
    let matches = found.best.iter().enumerate().map(|(query, &reference)| {
        let distance = found.distances.as_ref().map_or(f64::NAN, |all| f64::from(all[query]));
        vec![Match { reference, distance, inliers: None }]
    });
    let dataset = Dataset {
        name: "queries on the map".to_owned(),
        queries: (0..found.best.len()).map(|at| plain(queries.names.as_ref(), at)).collect(),
        references: (0..poses.len()).map(of_reference).collect(),
        poses: queries.poses.as_ref().map(|at| (at, poses)),
        truth: truth.as_ref(),
        thumbnails: None,
        similarities: None,
    };
    let name = if args.oracle { "nearest in space" } else { "nearest descriptor" };
    let run = Run { name: name.to_owned(), matches: matches.collect(), ..Run::default() };
    let mut facts = vec![
        ("command".to_owned(), cli::command_line()),
        ("program".to_owned(), format!("copr {}", env!("CARGO_PKG_VERSION"))),
    ];
    if truth.is_some() {
        facts.push(("right".to_owned(), format!("references within {radius_m} m")));
    }
    args.report.write(&Report {
        title: "Where queries were taken".to_owned(),
        facts,
        datasets: vec![dataset],
        runs: vec![run],
        budget: args.report.budget(),
    })
}

/// A file in the format that was named, or in the one that its name shows.
fn read(format: Option<Format>, path: &Path) -> anyhow::Result<Parts> {
    let format = format.map_or_else(|| Format::guess(path), Ok)?;
    Ok(exchange::read(format, path)?)
}

/// The best reference of every query, and how far its descriptor is.
struct Found {
    best: Vec<usize>,
    distances: Option<Vec<f32>>,
}

fn by_descriptor(
    queries: &Parts,
    map: &OpenMap,
    rows: Option<Vec<usize>>,
    path: &Path,
) -> anyhow::Result<Found> {
    let Some(descriptors) = &queries.descriptors else {
        bail!("{}: has no descriptors", path.display())
    };
    ensure!(!descriptors.is_empty(), "{}: no queries", path.display());
    if let (Some(ours), Some(theirs)) = (&map.about().encoder, &queries.about.encoder) {
        let both = format!("the map is of `{ours}`, the queries are of `{theirs}`");
        ensure!(ours == theirs, "{}: {both}", path.display());
    }
    let metric = map.about().metric.unwrap_or_default();
    let params = SearchParams { metric, k: 1, ..SearchParams::default() };
    let found = match rows {
        None => knn::search(map, descriptors, &params)?,
        Some(rows) => knn::search_among(map, rows, descriptors, &params)?,
    };
    let distances = (0..found.len()).map(|query| found.distances(query)[0]).collect();
    Ok(Found { best: found.best(), distances: Some(distances) })
}

fn by_pose(
    queries: &Parts,
    poses: &Poses,
    rows: Option<Vec<usize>>,
    path: &Path,
) -> anyhow::Result<Found> {
    let Some(truth) = &queries.poses else {
        bail!("{}: `--oracle` needs poses of the queries", path.display())
    };
    let best = match rows {
        None => oracle(truth, poses)?,
        Some(rows) => {
            let found = oracle(truth, &poses.select(&rows))?;
            found.into_iter().map(|index| rows[index]).collect()
        }
    };
    Ok(Found { best, distances: None })
}

/// What is printed.
struct Answer<'a> {
    found: &'a Found,
    poses: &'a [Pose],
    origins: Option<&'a Origins>,
}

impl Answer<'_> {
    /// One line per query: its best reference, and that one's pose.
    fn text(
        &self,
        (queries, references): (Option<&Names>, Option<&Names>),
        errors: Option<&PoseErrors>,
    ) -> String {
        let mut text = String::from("query,reference,origin,distance,x,y,z,qw,qx,qy,qz");
        text.push_str(if errors.is_some() { ",translation_m,rotation_deg\n" } else { "\n" });
        for (query, &best) in self.found.best.iter().enumerate() {
            let origin = self.origins.is_none_or(|origins| origins.is_measured(best));
            let origin = if origin { "measured" } else { "regressed" };
            let distance = self.found.distances.as_ref().map(|it| it[query].to_string());
            let pose = &self.poses[best];
            let (t, q) = (pose.translation.vector, pose.rotation);
            let _ = write!(
                text,
                "{},{},{origin},{},{},{},{},{},{},{},{}",
                field(queries, query),
                field(references, best),
                distance.unwrap_or_default(),
                t.x,
                t.y,
                t.z,
                q.w,
                q.i,
                q.j,
                q.k
            );
            if let Some(errors) = errors {
                let (far, turned) = (errors.translation_m[query], errors.rotation_deg[query]);
                let _ = write!(text, ",{far},{turned}");
            }
            text.push('\n');
        }
        text
    }
}

/// The name of an image, or its number, as a field of a CSV line.
fn field(names: Option<&Names>, index: usize) -> String {
    let name = names.and_then(|names| names.get(index));
    let name = name.map_or_else(|| index.to_string(), str::to_owned);
    if name.contains([',', '"', '\n', '\r']) {
        return format!("\"{}\"", name.replace('"', "\"\""));
    }
    name
}

/// Medians and shares, for people.
fn summary(errors: &PoseErrors) -> anyhow::Result<String> {
    let accuracy = errors.accuracy(&Resampling::default())?;
    let value = |it: &Interval| format!("{:.3} ({:.3} to {:.3})", it.estimate, it.low, it.high);
    let mut text = format!(
        "{} queries, 95 % intervals\nmedian translation error: {} m\nmedian rotation error: {}°",
        errors.len(),
        value(&accuracy.mte_m),
        value(&accuracy.mre_deg)
    );
    for ((metres, degrees), share) in WITHIN.into_iter().zip(&accuracy.within) {
        let _ = write!(text, "\nwithin {metres} m and {degrees}°: {}", value(share));
    }
    Ok(text)
}
