//! Any safetensors file with descriptors in it: other programs' files, not maps.

use std::{fs::File, path::Path};

use ndarray::Array2;

use super::{
    npz::{arrays_of, poses_of},
    parts::Parts,
    report::Read,
};
use vpr_core::{
    Descriptors, Error, Result,
    map::{About, ElementType, Header, Names, RowType, TensorEntry},
};
use vpr_files::{access, replace, shorten};

const ALIGNMENT: usize = 64;

/// Descriptors are the tensor `descriptors`, or the only matrix of f32, f16 or int8; `scales`,
/// `positions`, `orientations`, `names` and `name_offsets` are used if they are there.
pub(super) fn read(path: &Path) -> Read<Parts> {
    read_parts(path).map_err(|err| vec![err])
}

fn read_parts(path: &Path) -> Result<Parts> {
    let file = File::open(path).map_err(Error::io(path))?;
    let (header, _) = Header::read(path, &file)?;
    let tensors = Tensors { path, file: &file, header: &header };
    let wrong =
        |name: &str, reason: String| Error::format(path, format!("tensor `{name}`"), reason);
    let descriptors = tensors.descriptors()?;
    let mut parts = Parts { descriptors: Some(descriptors), ..Parts::default() };
    parts.about = About::read_from(&header.metadata)
        .map_err(|(place, reason)| Error::format(path, place, reason))?;
    if let Some(positions) = tensors.doubles("positions")? {
        let orientations = tensors.doubles("orientations")?;
        let poses = poses_of(&positions, orientations.as_ref());
        parts.poses = Some(poses.map_err(|(name, reason)| wrong(name, reason))?);
    }
    if let (Some(text), Some(offsets)) =
        (tensors.bytes("names", ElementType::U8)?, tensors.bytes("name_offsets", ElementType::I64)?)
    {
        let offsets: Vec<i64> =
            offsets.as_chunks().0.iter().map(|bytes| i64::from_le_bytes(*bytes)).collect();
        let names = Names::from_parts(text, &offsets);
        parts.names = Some(names.map_err(|reason| wrong("names", reason))?);
    }
    parts.check()?;
    Ok(parts)
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

    fn doubles(&self, name: &str) -> Result<Option<Array2<f64>>> {
        let Some(bytes) = self.bytes(name, ElementType::F64)? else { return Ok(None) };
        let shape = shape_of(&self.header.tensors[name]);
        let values = bytes.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
        let array = shape.and_then(|shape| Array2::from_shape_vec(shape, values).ok());
        array.map(Some).ok_or_else(|| self.wrong(name, "is no matrix"))
    }

    fn descriptors(&self) -> Result<Descriptors> {
        let is_matrix = |entry: &TensorEntry| {
            entry.shape.len() == 2 && RowType::of_element(entry.dtype).is_some()
        };
        let mut matrices = self.header.tensors.iter().filter(|(_, entry)| is_matrix(entry));
        let named = self.header.tensors.get_key_value("descriptors");
        let (name, entry) = match (named, matrices.next(), matrices.next()) {
            (Some(named), ..) | (None, Some(named), None) => named,
            (None, None, _) => {
                return Err(self.wrong("descriptors", "is not there, nor any matrix"));
            }
            _ => return Err(self.wrong("descriptors", "is not there, but several matrices are")),
        };
        let (Some((n, dim)), Some(row_type)) = (shape_of(entry), RowType::of_element(entry.dtype))
        else {
            return Err(self.wrong(name, "is no matrix of f32, f16 or int8"));
        };
        if dim == 0 {
            return Err(self.wrong(name, "has rows of length zero"));
        }
        let scales = self.bytes("scales", ElementType::F32)?.unwrap_or_default();
        let scales: Vec<f32> =
            scales.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
        if row_type == RowType::I8 && scales.len() != n {
            return Err(self.wrong("scales", format!("has {} scales for {n} rows", scales.len())));
        }
        let bytes = self.read(entry)?;
        let mut values = Array2::zeros((n, dim));
        let stored = bytes.chunks_exact(dim * row_type.size());
        for (row, (bytes, mut values)) in stored.zip(values.rows_mut()).enumerate() {
            let scale = scales.get(row).copied().unwrap_or(1.0);
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
