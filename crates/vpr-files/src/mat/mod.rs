//! Reads numeric arrays of MATLAB's `.mat` files of version 5 (`-v6`, `-v7`).
//!
//! Numeric arrays of any shape and precision are read; what else a file holds (cells, structures,
//! text, sparse and complex arrays) is listed by name and not decoded. Version 7.3 is HDF5 and refused.
//!
//! An array stays in the bytes of its file until its numbers are asked for. Compressed elements are
//! inflated: all of a file together to at most [`MAX_INFLATION`] times its length (and 64 KiB), or the
//! file is refused. No other length is believed before it was checked.
//!
//! ```
//! use vpr_files::mat::MatFile;
//!
//! let refusal = MatFile::decode(b"MATLAB 7.3 MAT-file".to_vec()).unwrap_err();
//! assert_eq!(refusal.to_string(), "byte 0: a header of 128 bytes is cut off");
//! ```

mod element;

use std::{io::Read as _, ops::Range, path::Path};

use flate2::bufread::ZlibDecoder;
use ndarray::{Array2, ShapeBuilder as _};

use self::element::{Element, Elements, Kind};
use crate::{Error, Refusal, Result};

/// No file of `n` bytes is inflated to more than this many times `n`, and 64 KiB. Numbers of
/// measured things compress two-fold, an array of small whole numbers in double precision eight-fold.
pub const MAX_INFLATION: usize = 16;

/// What is inflated of a file however short.
const FREE: usize = 64 << 10;
/// Length of the header.
const HEADER: usize = 128;
/// The most axes an array may have.
const MAX_AXES: usize = 32;

type Refused = Refusal;

/// A `.mat` file.
#[derive(Clone, Debug)]
pub struct MatFile {
    /// The file, then what each of its compressed elements inflated to.
    buffers: Vec<Vec<u8>>,
    big_endian: bool,
    variables: Vec<Variable>,
    others: Vec<Other>,
}

/// A numeric array.
#[derive(Clone, Debug)]
struct Variable {
    name: String,
    shape: Vec<usize>,
    kind: Kind,
    buffer: usize,
    bytes: Range<usize>,
}

/// A variable that is not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Other {
    /// Its name.
    pub name: String,
    /// What it is.
    pub what: &'static str,
}

/// A numeric array of a file.
#[derive(Clone, Copy, Debug)]
pub struct Array<'a> {
    file: &'a MatFile,
    variable: &'a Variable,
}

/// What the class of an array is called, if it is not numeric.
fn not_numeric(class: u8) -> Option<&'static str> {
    Some(match class {
        1 => "a cell array",
        2 => "a structure",
        3 => "an object",
        4 => "text",
        5 => "a sparse array",
        6..=15 => return None,
        16 => "a function",
        17 => "an opaque object",
        _ => "of an unknown class",
    })
}

impl MatFile {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] if it cannot be read, [`Error::Format`] with the byte offset if it is refused.
    pub fn open(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(Error::io(path))?;
        Self::decode(bytes).map_err(|refusal| refusal.in_file(path, 0))
    }

    /// Decodes the bytes of a file.
    ///
    /// # Errors
    ///
    /// A [`Refusal`] with the byte offset of what is malformed or not read.
    pub fn decode(bytes: Vec<u8>) -> Result<Self, Refusal> {
        let refuse = |offset, reason: &str| Err(Refusal { offset, reason: reason.to_owned() });
        let Some(header) = bytes.first_chunk::<HEADER>() else {
            return refuse(0, "a header of 128 bytes is cut off");
        };
        let big_endian = match &header[126..] {
            b"IM" => false,
            b"MI" => true,
            _ => {
                return refuse(
                    126,
                    "no mark of the order of bytes, so no `.mat` file of version 5",
                );
            }
        };
        let version = if big_endian { header[124] } else { header[125] };
        if version != 1 {
            return refuse(124, "not version 5; 7.3 is HDF5: save with `-v7`");
        }
        let mut file =
            Self { buffers: Vec::new(), big_endian, variables: Vec::new(), others: Vec::new() };
        let mut budget = bytes.len().saturating_mul(MAX_INFLATION).saturating_add(FREE);
        let mut elements = Elements::new(&bytes[HEADER..], HEADER, big_endian);
        let mut inflated = Vec::new();
        while !elements.is_at_end() {
            let element = elements.element()?;
            match element.kind {
                Kind::Matrix => file.array(&elements.inside(&element), element.at, 0)?,
                Kind::Compressed => {
                    let content = inflate(&element, &mut budget)?;
                    let within = |refusal: Refusal| Refusal {
                        offset: element.at,
                        reason: format!("inflated {refusal}"),
                    };
                    let mut inner = Elements::new(&content, 0, big_endian);
                    let matrix = inner.element().map_err(within)?;
                    if matrix.kind != Kind::Matrix || !inner.is_at_end() {
                        return refuse(element.at, "what is compressed is not one array");
                    }
                    let buffer = inflated.len() + 1;
                    let array = file.array(&inner.inside(&matrix), matrix.at, buffer);
                    array.map_err(within)?;
                    inflated.push(content);
                }
                kind => {
                    let reason = format!("{kind:?} stands where an array belongs");
                    return Err(Refusal { offset: element.at, reason });
                }
            }
        }
        file.buffers.push(bytes);
        file.buffers.append(&mut inflated);
        Ok(file)
    }

    /// Names of the numeric arrays, in the order of the file.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.variables.iter().map(|it| it.name.as_str())
    }

    /// What else it holds.
    #[must_use]
    pub fn others(&self) -> &[Other] {
        &self.others
    }

    /// The numeric array of this name; the last one if there are several.
    #[must_use]
    pub fn array_named(&self, name: &str) -> Option<Array<'_>> {
        let variable = self.variables.iter().rev().find(|it| it.name == name)?;
        Some(Array { file: self, variable })
    }

    /// Notes one array, whose parts are `parts`, which lie in `buffer`.
    fn array(&mut self, parts: &Elements<'_>, at: usize, buffer: usize) -> Result<(), Refusal> {
        let refuse = |offset, reason: String| Err(Refusal { offset, reason });
        let mut parts = parts.clone();
        // An array without any part is what MATLAB writes for an empty cell.
        if parts.is_at_end() {
            return Ok(());
        }
        let flags = parts.element()?;
        if flags.kind != Kind::U32 || flags.data.len() != 8 {
            return refuse(flags.at, "the flags of an array are not 8 bytes".to_owned());
        }
        let word = parts.u32(flags.data);
        let (class, is_complex) = ((word & 0xff) as u8, word & 0x800 != 0);
        let what = not_numeric(class).or(is_complex.then_some("a complex array"));
        if class == 17 {
            // An opaque object has no dimensions.
            self.others.push(Other { name: String::new(), what: "an opaque object" });
            return Ok(());
        }
        let shape = shape(&parts.element()?, &parts)?;
        let name = parts.element()?;
        let is_name = matches!(name.kind, Kind::I8 | Kind::U8 | Kind::Utf8);
        let Some(text) = str::from_utf8(name.data).ok().filter(|_| is_name) else {
            return refuse(name.at, "the name is no text".to_owned());
        };
        if let Some(what) = what {
            self.others.push(Other { name: text.to_owned(), what });
            return Ok(());
        }
        let data = parts.element()?;
        let n_values = shape.iter().try_fold(1_usize, |n, &len| n.checked_mul(len));
        let fits = match data.kind.size() {
            Some(size) => n_values.and_then(|n| n.checked_mul(size)) == Some(data.data.len()),
            None => false,
        };
        if !fits {
            let (len, kind) = (data.data.len(), data.kind);
            return refuse(data.at, format!("{len} bytes of {kind:?} for the shape {shape:?}"));
        }
        if !parts.is_at_end() {
            return refuse(parts.at(), format!("more follows in the array at byte {at}"));
        }
        let bytes = data.data_at..data.data_at + data.data.len();
        let name = text.to_owned();
        self.variables.push(Variable { name, shape, kind: data.kind, buffer, bytes });
        Ok(())
    }
}

fn inflate(element: &Element<'_>, budget: &mut usize) -> Result<Vec<u8>, Refusal> {
    let refuse = |reason: String| Err(Refusal { offset: element.at, reason });
    let mut content = Vec::new();
    let mut decoder = ZlibDecoder::new(element.data).take(*budget as u64 + 1);
    if let Err(reason) = decoder.read_to_end(&mut content) {
        return refuse(format!("does not inflate: {reason}"));
    }
    let Some(left) = budget.checked_sub(content.len()) else {
        let limit = format!("{MAX_INFLATION} times the length of the file and {FREE} bytes");
        return refuse(format!("all compressed elements inflate to more than {limit}"));
    };
    *budget = left;
    if !decoder.into_inner().into_inner().is_empty() {
        return refuse("bytes follow the end of what is compressed".to_owned());
    }
    Ok(content)
}

fn shape(element: &Element<'_>, parts: &Elements<'_>) -> Result<Vec<usize>, Refusal> {
    let refuse = |reason: String| Err(Refusal { offset: element.at, reason });
    let (lengths, rest) = element.data.as_chunks::<4>();
    if element.kind != Kind::I32 || lengths.len() < 2 || !rest.is_empty() {
        return refuse("the shape of an array is not two or more 32-bit numbers".to_owned());
    }
    if lengths.len() > MAX_AXES {
        return refuse(format!("an array of more than {MAX_AXES} axes"));
    }
    let length = |bytes: &[u8; 4]| i32::try_from(parts.u32(bytes)).ok();
    match lengths.iter().map(|it| length(it).and_then(|it| usize::try_from(it).ok())).collect() {
        Some(shape) => Ok(shape),
        None => refuse("a length is negative".to_owned()),
    }
}

impl Array<'_> {
    /// Length along each axis, two or more.
    #[must_use]
    pub fn shape(&self) -> &[usize] {
        &self.variable.shape
    }

    /// The numbers, the first axis fastest (column by column), as MATLAB keeps them.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "64-bit integers of a file are counts")]
    pub fn to_f64s(&self) -> Vec<f64> {
        let bytes = &self.file.buffers[self.variable.buffer][self.variable.bytes.clone()];
        let big = self.file.big_endian;
        macro_rules! numbers {
            ($type:ty, $widen:expr) => {{
                let decode =
                    |&it| if big { <$type>::from_be_bytes(it) } else { <$type>::from_le_bytes(it) };
                bytes.as_chunks().0.iter().map(decode).map($widen).collect()
            }};
        }
        match self.variable.kind {
            Kind::I8 => numbers!(i8, f64::from),
            Kind::U8 => numbers!(u8, f64::from),
            Kind::I16 => numbers!(i16, f64::from),
            Kind::U16 => numbers!(u16, f64::from),
            Kind::I32 => numbers!(i32, f64::from),
            Kind::U32 => numbers!(u32, f64::from),
            Kind::F32 => numbers!(f32, f64::from),
            Kind::F64 => numbers!(f64, |it| it),
            Kind::I64 => numbers!(i64, |it| it as f64),
            Kind::U64 => numbers!(u64, |it| it as f64),
            Kind::Matrix | Kind::Compressed | Kind::Utf8 | Kind::Wide => Vec::new(),
        }
    }

    /// The array as a matrix; `None` if it has more axes.
    #[must_use]
    pub fn to_matrix(&self) -> Option<Array2<f64>> {
        let &[rows, columns] = self.shape() else { return None };
        Array2::from_shape_vec((rows, columns).f(), self.to_f64s()).ok()
    }
}
