//! `copr densify`: a sparse map in, a dense one out.

use std::path::PathBuf;

use anyhow::ensure;
use copr::{
    Anchors, Options, Regressor, Selection, Targets, Told, densify, regression::Request, sequences,
};
use ndarray::ArrayView2;
use vpr_core::{
    Error, Map, Observer as _, Poses,
    knn::RowSource as _,
    map::{Access, MapWriter, OpenMap, Opening, Origin, Origins, RowType},
};
use vpr_data::exchange::{self, Format, Parts};
use vpr_report::cli::{self, Bar, Outcome};

use super::strategy::{PlacementArgs, StrategyArgs};

/// Bytes of a full pose in a map.
const POSE_BYTES: u128 = 7 * 8;
/// Rows copied at a time.
const BLOCK: usize = 1024;

/// The map, the targets and how they are regressed.
#[derive(clap::Args)]
pub(crate) struct DensifyArgs {
    /// Map with full poses: a file or the folder of a growing map
    #[arg(long, value_name = "PATH")]
    map: PathBuf,
    /// Poses of its images, if it has none
    #[arg(long, value_name = "PATH")]
    map_poses: Option<PathBuf>,
    /// Every so many-th image of each sequence is an anchor; images are one sequence as long as their
    /// names lie in one folder
    #[arg(long, default_value_t = 1, value_name = "K")]
    every: usize,
    #[command(flatten)]
    placement: PlacementArgs,
    #[command(flatten)]
    strategy: StrategyArgs,
    /// Scale regressed descriptors to unit length
    #[arg(long)]
    renormalise: bool,
    /// How the dense map stores descriptors: f32, f16 or int8 [default: as the sparse one]
    #[arg(long, value_name = "TYPE")]
    row_type: Option<RowType>,
    /// Only say how many rows and bytes the dense map would have
    #[arg(long)]
    dry_run: bool,
    /// The map to write
    #[arg(long, short, value_name = "FILE", required_unless_present = "dry_run")]
    out: Option<PathBuf>,
}

pub(crate) fn run(args: &DensifyArgs) -> anyhow::Result<Outcome> {
    let map = OpenMap::open(&args.map, Opening { access: Access::Read, trust: false })?;
    let sparse = Sparse::new(&map, args)?;
    let anchors = sparse.anchors(args.every)?;
    let targets = args.placement.targets(&anchors, &args.strategy)?;
    let row_type = args.row_type.unwrap_or(map.row_type());
    let encoder = map.about().encoder.as_deref();
    if args.dry_run {
        cli::print(&forecast(&sparse, &targets, row_type))?;
        return Ok(Outcome::Success);
    }
    let Some(out) = &args.out else { anyhow::bail!("`--out` says where the map goes") };
    let regressor = args.strategy.regressor(map.dim(), encoder)?;
    ensure!(
        regressor.selection() != Selection::Neighbours || anchors.len() > 1,
        "linear interpolation needs two anchors, there is one"
    );
    let source = sparse.source()?;
    let mut writer = MapWriter::create(out, map.dim(), row_type, map.about().clone())?;
    sparse.copy_to(&mut writer)?;
    let options = Options { renormalise: args.renormalise, ..Options::default() };
    let named = sparse.parts.names.is_some();
    let watched = Watched { regressor, bar: Bar::default() };
    watched.bar.start("regressing", targets.len().div_ceil(options.batch));
    let told = densify(&source, &targets, &watched, options, named, &mut writer)?;
    watched.bar.end();
    writer.finish()?;
    let (n, n_all) = (targets.len(), map.len() + targets.len());
    cli::note(&format!("{n} regressed rows after {} of the map: {n_all}", map.len()));
    if let Some(first) = told.first_flat {
        cli::note(&format!(
            "{} targets, {first} the first, lie outside of what their anchors span and take the \
             nearest point of it",
            told.n_flat
        ));
    }
    Ok(Outcome::Success)
}

/// Shows how far it is.
struct Watched {
    regressor: Box<dyn Regressor>,
    bar: Bar,
}

impl Regressor for Watched {
    fn name(&self) -> &'static str {
        self.regressor.name()
    }

    fn selection(&self) -> Selection {
        self.regressor.selection()
    }

    fn regress(&self, requests: &[Request<'_>], out: &mut [f32]) -> copr::Result<Told> {
        let told = self.regressor.regress(requests, out)?;
        self.bar.step();
        Ok(told)
    }
}

/// The map as it is, and where its images were taken.
struct Sparse<'a> {
    map: &'a OpenMap,
    /// Names, poses and origins.
    parts: Parts,
}

impl<'a> Sparse<'a> {
    fn new(map: &'a OpenMap, args: &DensifyArgs) -> anyhow::Result<Self> {
        let (names, poses, origins) = (map.names()?, map.poses()?, map.origins()?);
        let mut parts = Parts { names, poses, origins, ..Parts::default() };
        if let Some(path) = &args.map_poses {
            parts = parts
                .join(exchange::read(Format::guess(path)?, path)?)
                .map_err(|err| err.in_file(path))?;
        }
        let none = || Error::Empty("poses; `--map-poses` gives some").in_file(&args.map);
        let poses = parts.poses.as_ref().ok_or_else(none)?;
        poses.six_dof().map_err(|err| err.in_file(&args.map))?;
        ensure!(
            poses.len() == map.len(),
            "{}: {} poses for {} rows of the map",
            args.map_poses.as_ref().unwrap_or(&args.map).display(),
            poses.len(),
            map.len()
        );
        Ok(Self { map, parts })
    }

    fn poses(&self) -> anyhow::Result<&Poses> {
        Ok(self.parts.poses.as_ref().ok_or(Error::Empty("poses"))?)
    }

    /// Every `k`-th measured row of each sequence.
    fn anchors(&self, k: usize) -> anyhow::Result<Anchors> {
        ensure!(k > 0, "`--every` must be at least 1");
        let measured = match &self.parts.origins {
            Some(origins) => origins.measured_rows(),
            None => (0..self.map.len()).collect(),
        };
        let is_measured = |row: usize| measured.binary_search(&row).is_ok();
        let sequences = sequences(self.parts.names.as_ref(), self.map.len());
        let rows: Vec<Vec<usize>> = sequences
            .into_iter()
            .map(|rows| rows.filter(|&row| is_measured(row)).step_by(k).collect())
            .collect();
        Ok(Anchors::of_rows(self.poses()?.six_dof()?, &rows)?)
    }

    /// The map in memory: anchors are read at random.
    fn source(&self) -> anyhow::Result<Map> {
        Ok(Map::new(self.map.descriptors()?, self.poses()?.clone())?)
    }

    /// The rows as they are, block by block.
    fn copy_to(&self, writer: &mut MapWriter) -> anyhow::Result<()> {
        let n = self.map.len();
        let mut scratch = Vec::new();
        for start in (0..n).step_by(BLOCK) {
            let rows = start..(start + BLOCK).min(n);
            let images: Vec<usize> = rows.clone().collect();
            let poses = self.poses()?.select(&images);
            let names = self.parts.names.as_ref();
            let names = names.map(|all| images.iter().filter_map(|&row| all.get(row)).collect());
            let values = self.map.block(rows, &mut scratch)?;
            let values = ArrayView2::from_shape((images.len(), self.map.dim()), values)?;
            match &self.parts.origins {
                None => writer.append(values, Some(&poses), names.as_ref())?,
                Some(all) => {
                    let mut origins = Origins::default();
                    for &row in &images {
                        match all.get(row) {
                            Some(Origin::Regressed(anchors)) => {
                                origins.push_regressed(anchors)?;
                            }
                            _ => origins.push_measured(),
                        }
                    }
                    writer.append_regressed(values, Some(&poses), names.as_ref(), &origins)?;
                }
            }
        }
        Ok(())
    }
}

/// Rows and bytes of the dense map, names and header apart.
fn forecast(sparse: &Sparse<'_>, targets: &Targets<'_>, row_type: RowType) -> String {
    let (n, n_new) = (sparse.map.len() as u128, targets.len() as u128);
    let row = (sparse.map.dim() * row_type.size()) as u128 + POSE_BYTES;
    let bytes = (n + n_new) * row;
    let (anchors, dim) = (targets.anchors().len(), sparse.map.dim());
    format!(
        "anchors: {anchors}\nregressed rows: {n_new}\nrows: {}\ndimension: {dim}\n\
         row type: {row_type}\nbytes: {bytes}\n",
        n + n_new
    )
}
