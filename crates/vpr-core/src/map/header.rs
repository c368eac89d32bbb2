//! The header of a safetensors file: eight bytes of length, then JSON, then the tensors.

use std::{collections::BTreeMap, fs::File, path::Path};

use serde::{Deserialize, Serialize};

use crate::{Error, Result};
use vpr_files::{access::read_exact_at, shorten};

/// No header is longer than this, as in the format's own implementation.
const LONGEST_HEADER: u64 = 100_000_000;

/// Element types of the tensors we read, by the format's names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
#[non_exhaustive]
pub enum ElementType {
    /// Unsigned byte.
    U8,
    /// Signed byte.
    I8,
    /// Signed 16-bit integer.
    I16,
    /// Unsigned 16-bit integer.
    U16,
    /// Half-precision float.
    F16,
    /// The upper half of a single-precision float.
    BF16,
    /// Signed 32-bit integer.
    I32,
    /// Unsigned 32-bit integer.
    U32,
    /// Signed 64-bit integer.
    I64,
    /// Unsigned 64-bit integer.
    U64,
    /// Single-precision float.
    F32,
    /// Double-precision float.
    F64,
    /// One of the format's other types: truth values, eight-bit floats.
    #[serde(other)]
    Other,
}

impl ElementType {
    /// Bytes of one element; `None` for [`Self::Other`].
    #[must_use]
    pub fn size(self) -> Option<u64> {
        match self {
            Self::U8 | Self::I8 => Some(1),
            Self::F16 | Self::BF16 | Self::I16 | Self::U16 => Some(2),
            Self::F32 | Self::I32 | Self::U32 => Some(4),
            Self::I64 | Self::U64 | Self::F64 => Some(8),
            Self::Other => None,
        }
    }
}

/// One tensor as the header describes it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TensorEntry {
    /// Type of its elements.
    pub dtype: ElementType,
    /// Its shape, outermost dimension first.
    pub shape: Vec<u64>,
    /// First byte and the byte after the last, counted from the end of the header.
    pub data_offsets: [u64; 2],
}

impl TensorEntry {
    /// Number of bytes.
    #[must_use]
    pub fn n_bytes(&self) -> u64 {
        self.data_offsets[1].saturating_sub(self.data_offsets[0])
    }
}

/// Everything a safetensors file says before its data.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Header {
    /// Tensors by name.
    pub tensors: BTreeMap<String, TensorEntry>,
    /// Free text by key.
    pub metadata: BTreeMap<String, String>,
    /// Where in the file the data start.
    pub data_start: u64,
}

/// The JSON of a header.
#[derive(Serialize, Deserialize)]
struct Json {
    #[serde(rename = "__metadata__", default)]
    metadata: BTreeMap<String, String>,
    #[serde(flatten)]
    tensors: BTreeMap<String, TensorEntry>,
}

impl Header {
    /// Reads the header of an open file and checks it against the file's length.
    ///
    /// Returns the JSON bytes too, for digests. Nothing but the header is read.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] for a file that is too short, a header that is no JSON of this format, a
    /// tensor whose length does not follow from its shape, and tensors that overlap, leave a hole
    /// or do not end where the file ends.
    pub fn read(path: &Path, file: &File) -> Result<(Self, Vec<u8>)> {
        let file_length = file.metadata().map_err(Error::io(path))?.len();
        let mut length = [0; 8];
        if file_length < 8 {
            let reason = format!("the file has {file_length} bytes, a header needs 8");
            return Err(Error::format(path, "byte 0", reason));
        }
        read_exact_at(file, &mut length, 0).map_err(Error::io(path))?;
        let length = u64::from_le_bytes(length);
        if length > LONGEST_HEADER || length > file_length - 8 {
            let reason = format!("header of {length} bytes in a file of {file_length} bytes");
            return Err(Error::format(path, "byte 0", reason));
        }
        let mut bytes = vec![0; usize::try_from(length).unwrap_or(usize::MAX)];
        read_exact_at(file, &mut bytes, 8).map_err(Error::io(path))?;
        let header = Self::parse(&bytes, file_length - 8 - length)
            .map_err(|(place, reason)| Error::format(path, place, reason))?;
        Ok((header, bytes))
    }

    /// Parses the JSON of a header in front of `data_length` bytes.
    ///
    /// # Errors
    ///
    /// Place and reason of the first thing that is wrong.
    pub fn parse(json: &[u8], data_length: u64) -> Result<Self, (String, String)> {
        let at_json = |err: serde_json::Error| {
            ("header".to_owned(), format!("not the JSON of a safetensors header: {err}"))
        };
        let Json { metadata, tensors } = serde_json::from_slice(json).map_err(at_json)?;
        let data_start = 8 + json.len() as u64;
        let header = Self { tensors, metadata, data_start };
        header.check(data_length)?;
        Ok(header)
    }

    fn check(&self, data_length: u64) -> Result<(), (String, String)> {
        let mut in_order: Vec<(&String, &TensorEntry)> = self.tensors.iter().collect();
        in_order.sort_by_key(|(_, entry)| entry.data_offsets);
        let mut end = 0;
        for (name, entry) in in_order {
            let fail = |reason: String| Err((format!("tensor `{}`", shorten(name)), reason));
            let [from, to] = entry.data_offsets;
            if from != end || to < from {
                return fail(format!("occupies bytes {from}..{to}, expected to start at {end}"));
            }
            if to > data_length {
                return fail(format!("ends at byte {to} of {data_length}: the file is cut off"));
            }
            let elements = entry.shape.iter().try_fold(1_u64, |n, &side| n.checked_mul(side));
            let expected = match (elements, entry.dtype.size()) {
                (Some(elements), Some(size)) => elements.checked_mul(size),
                (Some(_), None) => Some(to - from),
                (None, _) => None,
            };
            if expected != Some(to - from) {
                let shape = &entry.shape;
                return fail(format!("{} bytes do not fit its shape {shape:?}", to - from));
            }
            end = to;
        }
        if end == data_length {
            Ok(())
        } else {
            let reason = format!("the tensors end at byte {end} of {data_length}");
            Err(("data".to_owned(), reason))
        }
    }

    /// The bytes before the data: length, JSON and blanks up to `data_start`, which is kept.
    ///
    /// With a `data_start` of zero the data start at the next multiple of `alignment`.
    ///
    /// # Panics
    ///
    /// If `data_start` is set and the JSON does not fit before it.
    #[must_use]
    pub fn render(&self, alignment: usize) -> Vec<u8> {
        let json = Json { metadata: self.metadata.clone(), tensors: self.tensors.clone() };
        let json = serde_json::to_vec(&json).expect("text and numbers become JSON");
        let end = match usize::try_from(self.data_start) {
            Ok(0) | Err(_) => (8 + json.len()).next_multiple_of(alignment),
            Ok(end) => end,
        };
        assert!(8 + json.len() <= end, "the header outgrew the {end} bytes kept for it");
        let mut bytes = Vec::with_capacity(end);
        bytes.extend(((end - 8) as u64).to_le_bytes());
        bytes.extend(json);
        bytes.resize(end, b' ');
        bytes
    }

    /// The tensor of this name.
    ///
    /// # Errors
    ///
    /// [`Error::Format`] if there is none.
    pub fn tensor(&self, path: &Path, name: &str) -> Result<&TensorEntry> {
        self.tensors
            .get(name)
            .ok_or_else(|| Error::format(path, "header", format!("has no tensor `{name}`")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problem(json: &str, data_length: u64) -> String {
        let (place, reason) = Header::parse(json.as_bytes(), data_length).unwrap_err();
        format!("{place}: {reason}")
    }

    #[test]
    fn rendering_and_parsing_agree() {
        let mut header = Header::default();
        let entry =
            TensorEntry { dtype: ElementType::F32, shape: vec![2, 3], data_offsets: [0, 24] };
        header.tensors.insert("descriptors".to_owned(), entry);
        header.metadata.insert("encoder".to_owned(), "HOG".to_owned());
        let bytes = header.render(64);
        assert_eq!(bytes.len() % 64, 0);
        header.data_start = bytes.len() as u64;
        assert_eq!(Header::parse(&bytes[8..], 24).unwrap(), header);
    }

    #[test]
    fn a_hole_is_named() {
        let json = r#"{"a":{"dtype":"U8","shape":[2],"data_offsets":[1,3]}}"#;
        assert_eq!(problem(json, 3), "tensor `a`: occupies bytes 1..3, expected to start at 0");
    }

    #[test]
    fn a_shape_that_overflows_is_an_error() {
        let json = r#"{"a":{"dtype":"U8","shape":[4294967296,4294967296],"data_offsets":[0,3]}}"#;
        assert!(problem(json, 3).contains("do not fit its shape"));
    }

    #[test]
    fn a_file_that_is_cut_off_is_named() {
        let json = r#"{"a":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}}"#;
        assert_eq!(problem(json, 7), "tensor `a`: ends at byte 8 of 7: the file is cut off");
        assert_eq!(problem(json, 9), "data: the tensors end at byte 8 of 9");
    }
}
