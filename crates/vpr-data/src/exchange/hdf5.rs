//! hloc's HDF5 files: one group per image, its name, with a dataset `global_descriptor`.

use std::{collections::BTreeMap, path::Path};

use hdf5_pure::{
    DType, Dataset, Datatype, DatatypeByteOrder, File, FileBuilder, FinishedGroup, Group,
    GroupBuilder,
};
use ndarray::Array2;

use super::{
    parts::Parts,
    report::{Read, Report},
};
use vpr_core::{Descriptors, Error, Result, map::Names};
use vpr_files::{replace, shorten};

const DATASET: &str = "global_descriptor";
/// Groups in groups: image names with more folders than this are not believed.
const DEEPEST: usize = 32;
/// No filter makes data grow by more than DEFLATE.
const MAX_INFLATION: u64 = 1032;

/// Images in the order of their names; a name with `/` is a group in a group.
pub(super) fn read(path: &Path) -> Read<Parts> {
    let not_hdf5 = |err: hdf5_pure::Error| vec![Error::format(path, "file", one_line(&err))];
    let length = path.metadata().map_err(|source| vec![Error::io(path)(source)])?.len();
    let file = File::open(path).map_err(not_hdf5)?;
    let mut report = Report::new(path);
    let mut found = BTreeMap::new();
    let walk = Walk { path, length };
    walk.group(&file.root(), "", 0, &mut found, &mut report);
    let dim = found.values().next().map_or(0, Vec::len);
    let mut names = Names::default();
    let mut values = Vec::new();
    for (name, descriptor) in found {
        if descriptor.len() != dim {
            let reason = format!("has {} values, the images before have {dim}", descriptor.len());
            report.error(Error::format(path, place(&name), reason));
        }
        names.push(&name);
        values.extend(descriptor);
    }
    if names.is_empty() {
        report.file(format!("no image has a `{DATASET}`"));
    }
    let rows = report.finish(Array2::from_shape_vec((names.len(), dim), values))?;
    let rows = rows.map_err(|err| vec![Error::format(path, "file", err.to_string())])?;
    let descriptors =
        Descriptors::new(rows).map_err(|err| vec![Error::format(path, "file", err.to_string())])?;
    Ok(Parts { names: Some(names), descriptors: Some(descriptors), ..Parts::default() })
}

/// What does not change on the way down.
struct Walk<'a> {
    path: &'a Path,
    length: u64,
}

impl Walk<'_> {
    fn group(
        &self,
        group: &Group,
        name: &str,
        depth: usize,
        found: &mut BTreeMap<String, Vec<f32>>,
        report: &mut Report<'_>,
    ) {
        let children = group.groups().and_then(|groups| Ok((groups, group.datasets()?)));
        let (groups, datasets) = match children {
            Ok(children) => children,
            Err(err) => return report.error(Error::format(self.path, place(name), one_line(&err))),
        };
        if datasets.iter().any(|dataset| dataset == DATASET) {
            let opened = group.dataset(DATASET).map_err(|err| one_line(&err));
            match opened.and_then(|dataset| self.values(&dataset)) {
                Ok(values) => {
                    found.insert(name.to_owned(), values);
                }
                Err(reason) => report.error(Error::format(self.path, place(name), reason)),
            }
        }
        if depth == DEEPEST && !groups.is_empty() {
            return report.error(Error::format(self.path, place(name), "is nested too deeply"));
        }
        for child in groups {
            let full = if name.is_empty() { child.clone() } else { format!("{name}/{child}") };
            match group.group(&child) {
                Ok(group) => self.group(&group, &full, depth + 1, found, report),
                Err(err) => report.error(Error::format(self.path, place(&full), one_line(&err))),
            }
        }
    }

    /// One descriptor: a vector (or a matrix of one row) of f16, f32 or f64.
    fn values(&self, dataset: &Dataset) -> Result<Vec<f32>, String> {
        let shape = dataset.shape().map_err(|err| one_line(&err))?;
        let n = shape.iter().try_fold(1_u64, |n, &side| n.checked_mul(side));
        let room = self.length.saturating_mul(MAX_INFLATION);
        if n.and_then(|n| n.checked_mul(2)).is_none_or(|bytes| bytes > room) {
            return Err(format!("shape {shape:?} does not fit in a file of {} bytes", self.length));
        }
        let values = match dataset.dtype().map_err(|err| one_line(&err))? {
            DType::F32 | DType::F64 => dataset.read_f32().map_err(|err| one_line(&err))?,
            DType::Other(other) => match *other {
                Datatype::FloatingPoint {
                    size: 2,
                    byte_order: DatatypeByteOrder::LittleEndian,
                    ..
                } => {
                    let bytes = dataset.read_raw().map_err(|err| one_line(&err))?;
                    let halves = bytes.as_chunks().0.iter();
                    halves.map(|bytes| half::f16::from_le_bytes(*bytes).to_f32()).collect()
                }
                _ => return Err("holds no floats".to_owned()),
            },
            other => return Err(format!("holds {other}, not floats")),
        };
        match values.iter().position(|value| !value.is_finite()) {
            None if values.is_empty() => Err("has no values".to_owned()),
            None => Ok(values),
            Some(column) => Err(format!("value {column} is not a finite number")),
        }
    }
}

fn place(name: &str) -> String {
    format!("image `{}`", shorten(name))
}

fn one_line(err: &hdf5_pure::Error) -> String {
    err.to_string().replace('\n', " ")
}

pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    let descriptors = parts.descriptors()?;
    let mut root = Tree::default();
    for row in 0..descriptors.len() {
        let name = parts.name(row);
        let node = name
            .split('/')
            .filter(|part| !part.is_empty())
            .fold(&mut root, |node, part| node.children.entry(part.to_owned()).or_default());
        if node.row.replace(row).is_some() {
            return Err(Error::format(path, place(&name), "is the name of two images"));
        }
    }
    let mut builder = FileBuilder::new();
    for (name, child) in &root.children {
        let group = child.build(builder.create_group(name), descriptors);
        builder.add_group(group);
    }
    let bytes = builder.finish().map_err(|err| Error::format(path, "file", one_line(&err)))?;
    Ok(replace(path, &bytes)?)
}

/// Groups by the parts of image names.
#[derive(Default)]
struct Tree {
    row: Option<usize>,
    children: BTreeMap<String, Self>,
}

impl Tree {
    fn build(&self, mut group: GroupBuilder, descriptors: &Descriptors) -> FinishedGroup {
        if let Some(row) = self.row {
            let values = descriptors.row(row).to_vec();
            let shape = [values.len() as u64];
            group.create_dataset(DATASET).with_f32_data(&values).with_shape(&shape);
        }
        for (name, child) in &self.children {
            let child = child.build(group.create_group(name), descriptors);
            group.add_group(child);
        }
        group.finish()
    }
}
