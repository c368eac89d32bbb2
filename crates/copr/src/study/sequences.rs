//! Real images along one path, a part of them queries: what 7-Scenes' and TUM's sequences at hand
//! can say.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use vpr_core::{Error as CoreError, Map, Pose, Poses, Provenance};
use vpr_data::{
    exchange::{self, Format},
    layout::folder,
};
use vpr_report::table::{Cell, Table};
use vpr_study::{Runner, technique::Found};

use super::{
    Context, Method, calibration,
    dense::{densified, localize, remark, selected},
    encoder,
    rows::Row,
};
use crate::{Anchors, PoseErrors, Result, Targets, oracle};

/// A path along which images were taken, and how it is cut into map and queries.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recorded {
    /// Column in tables.
    pub name: String,
    /// Where images and poses are from.
    pub images: Images,
    /// Takes one image of so many.
    #[serde(default = "one")]
    pub thin: usize,
    /// So many images of the map, then as many queries, and so on; 1 interleaves them.
    pub blocks: Vec<usize>,
}

fn one() -> usize {
    1
}

/// Images in the order in which they were taken, with poses.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Images {
    /// A dataset whose references come before its queries.
    Dataset(String),
    /// A folder of images and a trajectory of TUM, relative to a data folder: images are called after
    /// their times, or there is a line for each.
    Tum {
        /// The folder.
        folder: PathBuf,
        /// The trajectory.
        trajectory: PathBuf,
    },
}

/// The longest time between an image and its pose, seconds.
const APART_S: f64 = 0.01;

pub(super) fn run(
    table: &mut Table,
    sequences: &[Recorded],
    (encoders, every, methods): (&[String], usize, &[Method]),
    context: Context<'_>,
) -> Result<()> {
    for recorded in sequences {
        let images = match recorded.open(context)? {
            Ok(images) => images,
            Err(why) => {
                table.push(Cell::absent("MTE, m: sparse map", &recorded.name, why));
                continue;
            }
        };
        for encoder in encoders {
            let runner = match encoder::find(encoder, context.sources)? {
                Found::Runs(runner) => runner,
                Found::Absent(why) => {
                    table.push(Cell::absent("MTE, m: sparse map", &recorded.name, why));
                    continue;
                }
            };
            let all = described(&images, (&runner, &recorded.name), context)?;
            for &block in &recorded.blocks {
                let name = &recorded.name;
                let cut = Cut { name, encoder, all: &all, block: block.max(1) };
                cut.push(table, every, methods, context)?;
            }
        }
    }
    Ok(())
}

fn described(
    images: &[(PathBuf, Pose)],
    (runner, name): (&Runner, &str),
    context: Context<'_>,
) -> Result<Map> {
    let paths: Vec<PathBuf> = images.iter().map(|it| it.0.clone()).collect();
    let what = format!("{} on {name}", runner.column);
    let rows = context.sources.features(runner, &paths, &what)?.into_descriptors();
    let rows = rows.ok_or(CoreError::Empty("descriptors of one length"))?;
    Ok(Map::new(rows, Poses::SixDof(images.iter().map(|it| it.1).collect()))?)
}

impl Recorded {
    /// Images and poses in order, or why they are not at hand.
    fn open(&self, context: Context<'_>) -> Result<Result<Vec<(PathBuf, Pose)>, String>> {
        let all = match &self.images {
            Images::Dataset(id) => {
                let Some(dataset) = context.sources.images(id)? else {
                    return Ok(Err(context.sources.why_absent(id, "images")?));
                };
                let none = || CoreError::Empty("poses of a sequence");
                let (queries, references) = dataset.poses.as_ref().ok_or_else(none)?;
                let paths = dataset.references.iter().chain(&dataset.queries).cloned();
                let poses = references.six_dof()?.iter().chain(queries.six_dof()?).copied();
                paths.zip(poses).collect()
            }
            Images::Tum { folder, trajectory } => {
                let places = [folder, trajectory].map(|it| context.sources.locate(it));
                let [Ok(Some(folder)), Ok(Some(trajectory))] = places else {
                    return Ok(Err(format!("{} is not at hand", folder.display())));
                };
                of_tum(&folder, &trajectory)?
            }
        };
        Ok(Ok(all.into_iter().step_by(self.thin.max(1)).collect()))
    }
}

/// Images whose time is that of a pose, or, if they are not called after times, one for each line.
fn of_tum(images: &Path, trajectory: &Path) -> Result<Vec<(PathBuf, Pose)>> {
    let paths = folder::images_of(images)?.images;
    let parts = exchange::read(Format::Tum, trajectory)?;
    let none = || CoreError::Empty("poses").in_file(trajectory);
    let (names, poses) = (parts.names.ok_or_else(none)?, parts.poses.ok_or_else(none)?);
    let poses = poses.six_dof()?;
    let time = |path: &PathBuf| path.file_stem()?.to_str()?.parse::<f64>().ok();
    let times: Option<Vec<f64>> = paths.iter().map(time).collect();
    let Some(times) = times else {
        if paths.len() != poses.len() {
            let (expected, actual) = (paths.len(), poses.len());
            let what = "poses, one for every image";
            return Err(CoreError::Mismatch { what, expected, actual }.into());
        }
        return Ok(paths.into_iter().zip(poses.iter().copied()).collect());
    };
    let stamps: Vec<f64> = names.iter().map(|it| it.parse().unwrap_or(f64::NAN)).collect();
    let nearest = |time: f64| {
        let order =
            |&a: &usize, &b: &usize| (stamps[a] - time).abs().total_cmp(&(stamps[b] - time).abs());
        (0..stamps.len()).min_by(order).filter(|&at| (stamps[at] - time).abs() <= APART_S)
    };
    let pairs = paths.into_iter().zip(times);
    Ok(pairs.filter_map(|(path, time)| Some((path, poses[nearest(time)?]))).collect())
}

/// A path cut into map and queries, as one encoder sees it.
struct Cut<'a> {
    name: &'a str,
    encoder: &'a str,
    all: &'a Map,
    block: usize,
}

impl Cut<'_> {
    fn label(&self) -> String {
        match self.block {
            1 => format!("{}, every second image a query", self.encoder),
            block => format!("{}, blocks of {block}", self.encoder),
        }
    }

    fn row<'a>(
        &'a self,
        map: &str,
        of: &'a str,
        definition: Option<&'static str>,
        note: Option<String>,
    ) -> Row<'a> {
        let (map, column, provenance) = (map.to_owned(), self.name, Provenance::Measured);
        Row { map, column, provenance, of, definition, note }
    }

    fn push(
        &self,
        table: &mut Table,
        every: usize,
        methods: &[Method],
        context: Context<'_>,
    ) -> Result<()> {
        let of = self.label();
        let row = |map: &str| self.row(map, &of, None, None);
        let n = self.all.len();
        let is_query = |&row: &usize| row / self.block % 2 == 1;
        let (queries, references): (Vec<usize>, Vec<usize>) = (0..n).partition(is_query);
        let (queries, map) = (selected(self.all, &queries)?, selected(self.all, &references)?);
        // Neighbours along the path stay neighbours only within a block.
        let run = if self.block == 1 { map.len() } else { self.block };
        let blocks: Vec<_> =
            (0..map.len()).step_by(run).map(|from| from..(from + run).min(map.len())).collect();
        let poses = map.poses().six_dof()?;
        let best = oracle(queries.poses(), map.poses())?;
        let errors = PoseErrors::of_retrieval(&best, map.poses(), queries.poses())?;
        row("ground-truth map, oracle").push_errors(table, &errors, context)?;
        let errors = localize(&map, &queries)?;
        row("ground-truth map").push_errors(table, &errors, context)?;
        let anchors = Anchors::every_and_last(poses, &blocks, every)?;
        let sparse = selected(&map, anchors.rows())?;
        let errors = localize(&sparse, &queries)?;
        row("sparse map").push_errors(table, &errors, context)?;
        let left_out: Vec<usize> =
            (0..map.len()).filter(|it| anchors.rows().binary_search(it).is_err()).collect();
        let targets = Targets::frames(&anchors, poses, &left_out)?;
        let what = (of.as_str(), self.name, Provenance::Measured);
        calibration::push(table, what, methods, (&map, &left_out, &targets))?;
        self.push_methods(table, methods, (&sparse, &map, &queries), &targets, context)
    }

    /// Every method with its gains over the sparse map.
    fn push_methods(
        &self,
        table: &mut Table,
        methods: &[Method],
        (sparse, map, queries): (&Map, &Map, &Map),
        targets: &Targets<'_>,
        context: Context<'_>,
    ) -> Result<()> {
        let of = self.label();
        let sparse_errors = localize(sparse, queries)?;
        let (mut network, mut shuffled) = (None, None);
        for method in methods {
            let name = method.map();
            let ready = match method.at(self.encoder).ready(context)? {
                Ok(ready) => ready,
                Err(why) => {
                    self.row(&name, &of, None, None).push_absent(table, &why);
                    continue;
                }
            };
            match densified(sparse, map, targets, &ready)? {
                Ok((dense, told)) => {
                    let errors = localize(&dense, queries)?;
                    let row = self.row(&name, &of, ready.definition, remark(told));
                    row.push_errors(table, &errors, context)?;
                    row.push_gain(table, &errors, &sparse_errors, context)?;
                    row.push_turn_gain(table, &errors, &sparse_errors, context)?;
                    if method.is_network() {
                        network = Some(errors);
                    } else if method.is_shuffled_network() {
                        shuffled = Some(errors);
                    }
                }
                Err(why) => {
                    self.row(&name, &of, ready.definition, None).push_absent(table, &why);
                }
            }
        }
        if let (Some(network), Some(shuffled)) = (network, shuffled) {
            let row = self.row("dense map, Non-lin. Reg.", &of, None, None);
            row.push_gain_over_shuffled(table, &network, &shuffled, context)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_tum_go_with_their_times_or_with_their_lines() {
        let data = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = data.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, text).unwrap();
            path
        };
        let line = |time: f64, x: f64| format!("{time} {x} 0 0 0 0 0 1\n");
        let lines = [line(10.0, 0.0), line(10.008, 1.0), line(10.5, 2.0)].concat();
        let trajectory = write("poses.txt", &lines);
        for name in ["timed/10.007.jpg", "timed/10.300.jpg", "timed/10.501.jpg"] {
            write(name, "");
        }
        let found = of_tum(&data.path().join("timed"), &trajectory).unwrap();
        let xs: Vec<f64> = found.iter().map(|it| it.1.translation.x).collect();
        assert_eq!(xs, [1.0, 2.0], "no pose is near enough for the second");
        for name in ["lines/a_0.jpg", "lines/a_1.jpg", "lines/a_2.jpg"] {
            write(name, "");
        }
        let found = of_tum(&data.path().join("lines"), &trajectory).unwrap();
        assert_eq!((found.len(), found[2].1.translation.x), (3, 2.0));
        write("lines/a_3.jpg", "");
        let err = of_tum(&data.path().join("lines"), &trajectory).unwrap_err().to_string();
        assert!(err.contains("one for every image"), "{err}");
    }
}
