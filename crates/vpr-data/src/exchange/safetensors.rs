//! Any safetensors file with descriptors in it: other programs' files, not maps.

use std::{fs::File, path::Path};

use ndarray::Array2;

use super::{
    npz::{arrays_of, poses_of},
    parts::Parts,
    report::Read,
    rounded,
};
use vpr_core::{
    Descriptors, Error, Result,
    map::{About, ElementType, Header, Names, RowType, TensorEntry},
};
use vpr_files::{access, replace, shorten};

const ALIGNMENT: usize = 64;

/// Descriptors are the tensor `descriptors`, or the only matrix of numbers, if there are any; `scales`, `positions`,
/// `orientations`, `names` and `name_offsets` are used if they are there.
pub(super) fn read(path: &Path) -> Read<Parts> {
    read_parts(path).map_err(|err| vec![err])
}

fn read_parts(path: &Path) -> Result<Parts> {
    let file = File::open(path).map_err(Error::io(path))?;
    let (header, _) = Header::read(path, &file)?;
    let tensors = Tensors { path, file: &file, header: &header };
    let wrong =
        |name: &str, reason: String| Error::format(path, format!("tensor `{name}`"), reason);
    let matrix = tensors.matrix()?;
    let mut parts = Parts::default();
    if let Some((rows, entry)) = matrix {
        parts.descriptors = Some(tensors.descriptors(rows, entry)?);
        parts.notes.extend(rounded::note(path, Some(rows), element_name(entry.dtype)));
    }
    parts.about = About::read_from(&header.metadata)
        .map_err(|(place, reason)| Error::format(path, place, reason))?;
    if let Some(positions) = tensors.doubles("positions")? {
        let orientations = tensors.doubles("orientations")?;
        let poses = poses_of(&positions, orientations.as_ref());
        parts.poses = Some(poses.map_err(|(name, reason)| wrong(name, reason))?);
    }
    let lone = |there: &str, missing: &str| {
        Err(wrong(there, format!("is there, but no `{missing}`, without which it says nothing")))
    };
    if parts.poses.is_none() && header.tensors.contains_key("orientations") {
        return lone("orientations", "positions");
    }
    match (
        tensors.bytes("names", ElementType::U8)?,
        tensors.bytes("name_offsets", ElementType::I64)?,
    ) {
        (Some(text), Some(offsets)) => {
            let offsets: Vec<i64> =
                offsets.as_chunks().0.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect();
            let names = Names::from_parts(text, &offsets);
            parts.names = Some(names.map_err(|reason| wrong("names", reason))?);
        }
        (Some(_), None) => return lone("names", "name_offsets"),
        (None, Some(_)) => return lone("name_offsets", "names"),
        (None, None) => {}
    }
    let rows = matrix.map(|(name, _)| name);
    let is_used = |name: &&String| Some(*name) == rows || KNOWN.contains(&name.as_str());
    let unused: Vec<&str> =
        header.tensors.keys().filter(|name| !is_used(name)).map(String::as_str).collect();
    if !unused.is_empty() {
        let unused = shorten(&unused.join(", "));
        parts.notes.push(format!("{}: tensors that are not used: {unused}", path.display()));
    }
    parts.check()?;
    Ok(parts)
}

/// The tensors with a meaning, and what maps have besides.
const KNOWN: [&str; 8] = [
    "descriptors",
    "scales",
    "positions",
    "orientations",
    "names",
    "name_offsets",
    "padding",
    "block_digests",
];

/// `NumPy`'s name of an element type.
fn element_name(element: ElementType) -> &'static str {
    match element {
        ElementType::F64 => "float64",
        ElementType::F32 => "float32",
        ElementType::F16 => "float16",
        ElementType::BF16 => "bfloat16",
        ElementType::I8 => "int8",
        ElementType::U8 => "uint8",
        ElementType::I16 => "int16",
        ElementType::U16 => "uint16",
        ElementType::I32 => "int32",
        ElementType::U32 => "uint32",
        ElementType::I64 => "int64",
        ElementType::U64 => "uint64",
        _ => "another type",
    }
}

/// Numbers as f64, which holds all but the largest integers; `None` for a type of no numbers.
fn numbers(element: ElementType, bytes: &[u8]) -> Option<Vec<f64>> {
    fn all<const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
        bytes.as_chunks().0.iter().map(|bytes| number(*bytes)).collect()
    }
    Some(match element {
        ElementType::F64 => all(bytes, f64::from_le_bytes),
        ElementType::F32 => all(bytes, |it| f32::from_le_bytes(it).into()),
        ElementType::F16 => all(bytes, |it| half::f16::from_le_bytes(it).into()),
        ElementType::BF16 => all(bytes, |it| half::bf16::from_le_bytes(it).into()),
        ElementType::I8 => all(bytes, |it| i8::from_le_bytes(it).into()),
        ElementType::U8 => all(bytes, |it| u8::from_le_bytes(it).into()),
        ElementType::I16 => all(bytes, |it| i16::from_le_bytes(it).into()),
        ElementType::U16 => all(bytes, |it| u16::from_le_bytes(it).into()),
        ElementType::I32 => all(bytes, |it| i32::from_le_bytes(it).into()),
        ElementType::U32 => all(bytes, |it| u32::from_le_bytes(it).into()),
        ElementType::I64 => all(bytes, |it| i64::from_le_bytes(it) as f64),
        ElementType::U64 => all(bytes, |it| u64::from_le_bytes(it) as f64),
        _ => return None,
    })
}

struct Tensors<'a> {
    path: &'a Path,
    file: &'a File,
    header: &'a Header,
}

impl Tensors<'_> {
    fn wrong(&self, name: &str, reason: impl Into<String>) -> Error {
        Error::format(self.path, format!("tensor `{}`", shorten(name)), reason)
    }

    fn read(&self, entry: &TensorEntry) -> Result<Vec<u8>> {
        let mut bytes = vec![0; usize::try_from(entry.n_bytes()).unwrap_or(usize::MAX)];
        let start = self.header.data_start + entry.data_offsets[0];
        access::read_exact_at(self.file, &mut bytes, start).map_err(Error::io(self.path))?;
        Ok(bytes)
    }

    /// The bytes of a tensor of this type, if there is one of this name.
    fn bytes(&self, name: &str, dtype: ElementType) -> Result<Option<Vec<u8>>> {
        let Some(entry) = self.header.tensors.get(name) else { return Ok(None) };
        if entry.dtype != dtype {
            let reason = format!("holds {:?}, expected {dtype:?}", entry.dtype);
            return Err(self.wrong(name, reason));
        }
        self.read(entry).map(Some)
    }

    /// A matrix of f64, if there is one of this name; f32 will do.
    fn doubles(&self, name: &str) -> Result<Option<Array2<f64>>> {
        let Some(entry) = self.header.tensors.get(name) else { return Ok(None) };
        if !matches!(entry.dtype, ElementType::F32 | ElementType::F64) {
            let reason = format!("holds {}, expected float64", element_name(entry.dtype));
            return Err(self.wrong(name, reason));
        }
        let values = numbers(entry.dtype, &self.read(entry)?).unwrap_or_default();
        let array = shape_of(entry).and_then(|shape| Array2::from_shape_vec(shape, values).ok());
        array.map(Some).ok_or_else(|| self.wrong(name, "is no matrix"))
    }

    /// The matrix that descriptors are in; `None` if there are only positions.
    fn matrix(&self) -> Result<Option<(&String, &TensorEntry)>> {
        let is_other = |name: &str| KNOWN[1..].contains(&name);
        let is_matrix = |(name, entry): &(&String, &TensorEntry)| {
            entry.shape.len() == 2 && entry.dtype != ElementType::Other && !is_other(name)
        };
        let mut matrices = self.header.tensors.iter().filter(is_matrix);
        let named = self.header.tensors.get_key_value("descriptors");
        match (named, matrices.next(), matrices.next()) {
            (Some(named), ..) | (None, Some(named), None) => Ok(Some(named)),
            (None, None, _) if self.header.tensors.contains_key("positions") => Ok(None),
            (None, None, _) => Err(self.wrong("descriptors", "is not there, nor any matrix")),
            _ => Err(self.wrong("descriptors", "is not there, but several matrices are")),
        }
    }

    fn descriptors(&self, name: &str, entry: &TensorEntry) -> Result<Descriptors> {
        let Some((n, dim)) = shape_of(entry) else { return Err(self.wrong(name, "is no matrix")) };
        if dim == 0 {
            return Err(self.wrong(name, "has rows of length zero"));
        }
        // Bytes with a factor per row, as our maps have them; without factors they are numbers.
        let has_scales =
            entry.dtype == ElementType::I8 && self.header.tensors.contains_key("scales");
        let row_type =
            RowType::of_element(entry.dtype).filter(|it| *it != RowType::I8 || has_scales);
        let Some(row_type) = row_type else {
            let Some(values) = numbers(entry.dtype, &self.read(entry)?) else {
                return Err(self.wrong(
                    name,
                    "holds no numbers that are read: floats of 16 to 64 \
                                             bits and integers are",
                ));
            };
            #[expect(clippy::cast_possible_truncation, reason = "rounding is said")]
            let values = values.into_iter().map(|value| value as f32).collect();
            let shape = |err: ndarray::ShapeError| self.wrong(name, err.to_string());
            return Descriptors::new(Array2::from_shape_vec((n, dim), values).map_err(shape)?);
        };
        let scales = self.bytes("scales", ElementType::F32)?.unwrap_or_default();
        let scales: Vec<f32> =
            scales.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        if has_scales && scales.len() != n {
            return Err(self.wrong("scales", format!("has {} scales for {n} rows", scales.len())));
        }
        let bytes = self.read(entry)?;
        let mut values = Array2::zeros((n, dim));
        let stored = bytes.chunks_exact(dim * row_type.size());
        for (row, (bytes, mut values)) in stored.zip(values.rows_mut()).enumerate() {
            let scale = if has_scales { scales.get(row).copied().unwrap_or(1.0) } else { 1.0 };
            row_type.decode(bytes, scale, values.as_slice_mut().unwrap_or_default());
        }
        Descriptors::new(values)
    }
}

fn shape_of(entry: &TensorEntry) -> Option<(usize, usize)> {
    let [n, dim] = entry.shape[..] else { return None };
    Some((usize::try_from(n).ok()?, usize::try_from(dim).ok()?))
}

/// Writes the tensors of a map, without its digests.
pub(super) fn write(path: &Path, parts: &Parts) -> Result<()> {
    parts.check()?;
    let descriptors = parts.descriptors()?;
    let n = descriptors.len();
    let mut header = Header::default();
    parts.about.write_to(&mut header.metadata);
    let mut data: Vec<u8> = Vec::new();
    let mut add = |name: &str, dtype, shape: &[usize], bytes: &mut dyn Iterator<Item = u8>| {
        let from = data.len() as u64;
        data.extend(bytes);
        let shape = shape.iter().map(|&side| side as u64).collect();
        let entry = TensorEntry { dtype, shape, data_offsets: [from, data.len() as u64] };
        header.tensors.insert(name.to_owned(), entry);
    };
    // Doubles come first, so that everything is aligned.
    if let Some(poses) = &parts.poses {
        let (positions, width, orientations) = arrays_of(poses);
        let mut bytes = positions.iter().flat_map(|it| it.to_le_bytes());
        add("positions", ElementType::F64, &[n, width], &mut bytes);
        if let Some(wxyz) = orientations {
            let mut bytes = wxyz.iter().flat_map(|it| it.to_le_bytes());
            add("orientations", ElementType::F64, &[n, 4], &mut bytes);
        }
    }
    let names = parts.names.as_ref().map(Names::to_parts);
    if let Some((_, offsets)) = &names {
        let mut bytes = offsets.iter().flat_map(|it| it.to_le_bytes());
        add("name_offsets", ElementType::I64, &[n + 1], &mut bytes);
    }
    let values = descriptors.view();
    let mut bytes = values.iter().flat_map(|it| it.to_le_bytes());
    add("descriptors", ElementType::F32, &[n, descriptors.dim()], &mut bytes);
    if let Some((text, _)) = names {
        add("names", ElementType::U8, &[text.len()], &mut text.bytes());
    }
    let mut bytes = header.render(ALIGNMENT);
    bytes.extend(data);
    Ok(replace(path, &bytes)?)
}
