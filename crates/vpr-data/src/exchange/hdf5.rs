//! hloc's HDF5 files: one group per image, its name, with a dataset `global_descriptor`.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use hdf5_pure::{
    DType, Dataset, Datatype, DatatypeByteOrder, File, FileBuilder, FinishedGroup, Group,
    GroupBuilder,
};
use ndarray::Array2;

use super::{
    parts::Parts,
    report::{Read, Report},
    rounded,
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
    let mut found = Found::default();
    let walk = Walk { path, length };
    walk.group(&file.root(), "", 0, &mut found, &mut report);
    let notes = found.notes(path);
    let dim = found.rows.values().next().map_or(0, Vec::len);
    let mut names = Names::default();
    let mut values = Vec::new();
    for (name, descriptor) in found.rows {
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
    Ok(Parts { names: Some(names), descriptors: Some(descriptors), notes, ..Parts::default() })
}

/// What the groups have.
#[derive(Default)]
struct Found {
    /// Descriptors by the name of their image.
    rows: BTreeMap<String, Vec<f32>>,
    /// The types that descriptors have in the file.
    stored: BTreeSet<&'static str>,
    /// Groups with datasets of which none is a descriptor.
    others: Vec<String>,
}

impl Found {
    fn notes(&self, path: &Path) -> Vec<String> {
        let mut notes: Vec<String> =
            self.stored.iter().filter_map(|stored| rounded::note(path, None, stored)).collect();
        if let Some(first) = self.others.first() {
            let (path, n, first) = (path.display(), self.others.len(), shorten(first));
            notes.push(format!("{path}: {n} groups have no `{DATASET}`, such as `{first}`"));
        }
        notes
    }
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
        found: &mut Found,
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
                Ok((values, stored)) => {
                    found.rows.insert(name.to_owned(), values);
                    found.stored.insert(stored);
                }
                Err(reason) => report.error(Error::format(self.path, place(name), reason)),
            }
        } else if !datasets.is_empty() {
            found.others.push(name.to_owned());
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

    /// One descriptor, a vector or a matrix of one row, and `NumPy`'s name of its type.
    fn values(&self, dataset: &Dataset) -> Result<(Vec<f32>, &'static str), String> {
        let shape = dataset.shape().map_err(|err| one_line(&err))?;
        let n = shape.iter().try_fold(1_u64, |n, &side| n.checked_mul(side));
        let room = self.length.saturating_mul(MAX_INFLATION);
        if n.is_none_or(|bytes| bytes > room) {
            return Err(format!("shape {shape:?} does not fit in a file of {} bytes", self.length));
        }
        let (values, stored) = numbers(dataset)?;
        match values.iter().position(|value| !value.is_finite()) {
            None if values.is_empty() => Err("has no values".to_owned()),
            None => Ok((values, stored)),
            Some(column) => Err(format!("value {column} is not a finite number")),
        }
    }
}

/// The numbers of a dataset as f32.
fn numbers(dataset: &Dataset) -> Result<(Vec<f32>, &'static str), String> {
    let one_line = |err: hdf5_pure::Error| one_line(&err);
    let stored = match dataset.dtype().map_err(one_line)? {
        DType::F32 => "float32",
        DType::F64 => "float64",
        DType::I8 => "int8",
        DType::U8 => "uint8",
        DType::I16 => "int16",
        DType::U16 => "uint16",
        DType::I32 => "int32",
        DType::U32 => "uint32",
        DType::I64 => "int64",
        DType::U64 => "uint64",
        DType::Other(other) => return halves(dataset, &other),
        other => return Err(format!("holds {other}, not numbers")),
    };
    let values = match stored {
        "uint64" => {
            let values = dataset.read_u64().map_err(one_line)?;
            values.into_iter().map(|value| value as f32).collect()
        }
        integer if integer.contains("int") => {
            let values = dataset.read_i64().map_err(one_line)?;
            values.into_iter().map(|value| value as f32).collect()
        }
        _ => dataset.read_f32().map_err(one_line)?,
    };
    Ok((values, stored))
}

/// Floats of two bytes: halves, or the upper halves of single precision.
fn halves(dataset: &Dataset, datatype: &Datatype) -> Result<(Vec<f32>, &'static str), String> {
    let Datatype::FloatingPoint { size: 2, byte_order, layout } = datatype else {
        return Err("holds no numbers that are read".to_owned());
    };
    let mut bytes = dataset.read_raw().map_err(|err| one_line(&err))?;
    match byte_order {
        DatatypeByteOrder::LittleEndian => {}
        DatatypeByteOrder::BigEndian => {
            bytes.as_chunks_mut::<2>().0.iter_mut().for_each(|it| it.reverse());
        }
        DatatypeByteOrder::Vax => return Err("holds floats in VAX order".to_owned()),
    }
    let pairs = bytes.as_chunks().0.iter();
    match (layout.exponent_size, layout.mantissa_size) {
        (5, 10) => {
            Ok((pairs.map(|it| half::f16::from_le_bytes(*it).to_f32()).collect(), "float16"))
        }
        (8, 7) => {
            Ok((pairs.map(|it| half::bf16::from_le_bytes(*it).to_f32()).collect(), "bfloat16"))
        }
        _ => Err("holds floats of an unknown layout".to_owned()),
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
        if name.split('/').any(|part| ["", ".", DATASET].contains(&part)) {
            let reason = format!("has a part that is empty, `.` or `{DATASET}`: rename the image");
            return Err(Error::format(path, place(&name), reason));
        }
        let node = name
            .split('/')
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
