//! The elements of a `.mat` file: a tag, its data, padding.

use super::Refused;

/// The types of data, as their tags number them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
    I64,
    U64,
    Matrix,
    Compressed,
    /// Text, which names may be.
    Utf8,
    /// Text of wider units, which is skipped.
    Wide,
}

impl Kind {
    fn of(number: u32) -> Option<Self> {
        Some(match number {
            1 => Self::I8,
            2 => Self::U8,
            3 => Self::I16,
            4 => Self::U16,
            5 => Self::I32,
            6 => Self::U32,
            7 => Self::F32,
            9 => Self::F64,
            12 => Self::I64,
            13 => Self::U64,
            14 => Self::Matrix,
            15 => Self::Compressed,
            16 => Self::Utf8,
            17 | 18 => Self::Wide,
            _ => return None,
        })
    }

    /// Bytes of a number; `None` of what is none.
    pub(super) fn size(self) -> Option<usize> {
        match self {
            Self::I8 | Self::U8 => Some(1),
            Self::I16 | Self::U16 => Some(2),
            Self::I32 | Self::U32 | Self::F32 => Some(4),
            Self::F64 | Self::I64 | Self::U64 => Some(8),
            Self::Matrix | Self::Compressed | Self::Utf8 | Self::Wide => None,
        }
    }
}

/// One element.
#[derive(Clone, Copy)]
pub(super) struct Element<'a> {
    pub(super) kind: Kind,
    /// Offset of its tag.
    pub(super) at: usize,
    /// Offset of its data.
    pub(super) data_at: usize,
    pub(super) data: &'a [u8],
}

/// A walk over elements.
#[derive(Clone)]
pub(super) struct Elements<'a> {
    bytes: &'a [u8],
    /// Offset of the first byte in the file, or in what an element inflated to.
    start: usize,
    next: usize,
    big_endian: bool,
}

impl<'a> Elements<'a> {
    pub(super) fn new(bytes: &'a [u8], start: usize, big_endian: bool) -> Self {
        Self { bytes, start, next: 0, big_endian }
    }

    /// The elements inside of one.
    pub(super) fn inside(&self, element: &Element<'a>) -> Self {
        Self::new(element.data, element.data_at, self.big_endian)
    }

    /// Offset of what comes next.
    pub(super) fn at(&self) -> usize {
        self.start + self.next
    }

    pub(super) fn is_at_end(&self) -> bool {
        self.next == self.bytes.len()
    }

    /// The next element, with its padding.
    pub(super) fn element(&mut self) -> Result<Element<'a>, Refused> {
        let at = self.at();
        let refuse = |reason: String| Err(Refused { offset: at, reason });
        let Some(tag) = self.bytes.get(self.next..).and_then(|rest| rest.first_chunk::<8>()) else {
            return refuse("a tag of 8 bytes is cut off".to_owned());
        };
        let [first, second] = [&tag[..4], &tag[4..]].map(|it| self.u32(it));
        // A short element has its length in the upper half of the type, its data in the tag.
        let short = (first >> 16) as usize;
        let (number, len, skip) =
            if short > 0 { (first & 0xffff, short, 4) } else { (first, second as usize, 8) };
        let Some(kind) = Kind::of(number) else {
            return refuse(format!("data of type {number} are not read"));
        };
        if short > 4 {
            return refuse(format!("a short element of {short} bytes"));
        }
        let start = self.next + skip;
        let left = self.bytes.len() - start;
        if len > left {
            return refuse(format!("needs {len} bytes, only {left} follow"));
        }
        let element = Element {
            kind,
            at,
            data_at: self.start + start,
            data: &self.bytes[start..start + len],
        };
        let is_padded = kind != Kind::Compressed;
        let end = if is_padded { (start + len).next_multiple_of(8) } else { start + len };
        // The last padding of a file may be missing.
        self.next = end.min(self.bytes.len());
        Ok(element)
    }

    /// Four bytes as a number.
    pub(super) fn u32(&self, bytes: &[u8]) -> u32 {
        let mut four = [0; 4];
        four.copy_from_slice(&bytes[..4]);
        if self.big_endian { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) }
    }
}
