//! Streams the elements of an array, after its header has been held against the real length.

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
};

use ndarray::{Array, ArrayD, Dimension, IxDyn, ShapeBuilder};

use super::{
    at,
    header::{Header, MAX_START},
};
use crate::{Error, Result, dtype::Dtype, value::Elements};

/// An element type that arrays are read into.
///
/// `u8` is read from exactly that; `f32` also from `float16`; `f64` from these, `float64` and
/// integers up to 2^53; `i64` from every integer type, as far as values fit; `String` from text of
/// fixed length (`<U5`, `|S5`). Either byte order will do. Nothing is narrowed.
pub trait Element: Clone + sealed::FromElements {}

impl Element for f32 {}
impl Element for f64 {}
impl Element for i64 {}
impl Element for u8 {}
impl Element for String {}

/// Any number, rounded to single precision.
#[derive(Clone, Copy)]
pub(super) struct Rounded(pub(super) f32);

impl Element for Rounded {}

/// How many bytes are decoded at a time, about.
const CHUNK: usize = 1 << 16;

/// What a file held: the elements, and `NumPy`'s name of their type.
pub(super) type Stored<T> = (ArrayD<T>, &'static str);

/// The file at `path`, as an array of any shape.
pub(super) fn read_file<T: Element>(path: &Path) -> Result<Stored<T>> {
    let file = File::open(path).map_err(Error::io(path))?;
    let len = file.metadata().map_err(Error::io(path))?.len();
    read_from(file, len, |offset, reason| at(path, offset, reason)).map_err(|failure| match failure
    {
        Failure::Io(source) => Error::Io { path: path.to_owned(), source },
        Failure::Refused(err) => err,
    })
}

/// Why reading from a stream failed.
pub(super) enum Failure {
    Io(io::Error),
    Refused(Error),
}

/// An array from a stream of `n_bytes`, which the caller vouches for as the size to allocate.
pub(super) fn read_from<T: Element>(
    mut stream: impl Read,
    n_bytes: u64,
    err: impl Fn(usize, String) -> Error,
) -> Result<Stored<T>, Failure> {
    let refuse = |offset: usize, reason: String| Failure::Refused(err(offset, reason));
    let mut start = Vec::new();
    stream.by_ref().take(MAX_START as u64).read_to_end(&mut start).map_err(Failure::Io)?;
    let header = Header::parse(&start).map_err(|(offset, reason)| refuse(offset, reason))?;
    let n_body = n_bytes.saturating_sub(header.len as u64);
    let Some((n, size)) = header.size().filter(|&(_, size)| size as u64 == n_body) else {
        let (shape, name) = (&header.shape, header.dtype.kind.name());
        let reason = format!("the header says {shape:?} {name}, but {n_body} bytes follow");
        return Err(refuse(header.len, reason));
    };
    if !T::ACCEPTED.contains(&header.dtype.kind.name()) {
        let reason = format!("holds {}, not {}", header.dtype.kind.name(), T::NAME);
        return Err(refuse(0, reason));
    }
    let mut body = start[header.len..].chain(stream).take(size as u64);
    let elements = elements::<T>(&mut body, header.dtype, n).map_err(Failure::Io)?;
    if elements.len() != n {
        let reason = format!("of {n} elements, only {} are there and fit", elements.len());
        return Err(refuse(header.len, reason));
    }
    let shape = IxDyn(&header.shape).set_f(header.fortran_order);
    let array = ArrayD::from_shape_vec(shape, elements)
        .map_err(|cause| refuse(header.len, format!("shape {:?}: {cause}", header.shape)))?;
    let array = if header.fortran_order { array.as_standard_layout().into_owned() } else { array };
    Ok((array, header.dtype.kind.name()))
}

/// The type of the elements and the shape of an array, from its header alone.
pub(super) fn describe(mut stream: impl Read) -> Result<(&'static str, Vec<usize>), String> {
    let mut start = Vec::new();
    stream
        .by_ref()
        .take(MAX_START as u64)
        .read_to_end(&mut start)
        .map_err(|err| err.to_string())?;
    let header = Header::parse(&start).map_err(|(at, reason)| format!("byte {at}: {reason}"))?;
    Ok((header.dtype.kind.name(), header.shape))
}

/// Gives an array the number of dimensions that is wanted.
pub(super) fn with_dimensions<T, D: Dimension>(array: ArrayD<T>) -> Result<Array<T, D>, String> {
    let shape = array.shape().to_vec();
    array.into_dimensionality().map_err(|_| {
        format!("has shape {shape:?}, but {} dimensions are expected", D::NDIM.unwrap_or(0))
    })
}

/// Up to `n` elements; fewer if the stream ends or one does not fit.
fn elements<T: Element>(body: &mut impl Read, dtype: Dtype, n: usize) -> io::Result<Vec<T>> {
    let mut elements = Vec::with_capacity(n);
    let size = dtype.kind.size();
    let chunk_bytes = (CHUNK / size).max(1) * size;
    let mut chunk = Vec::with_capacity(chunk_bytes);
    while elements.len() < n {
        chunk.clear();
        body.by_ref().take(chunk_bytes as u64).read_to_end(&mut chunk)?;
        match dtype.decode(&chunk).and_then(T::from_elements) {
            Some(decoded) if !decoded.is_empty() => elements.extend(decoded),
            _ => break,
        }
    }
    Ok(elements)
}

mod sealed {
    use super::Elements;

    /// `NumPy`'s names of the types of numbers.
    const NUMBERS: [&str; 11] = [
        "float16", "float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16",
        "uint32", "uint64",
    ];

    pub trait FromElements: Sized {
        const NAME: &'static str;
        /// NumPy's names of the types that are read as this.
        const ACCEPTED: &'static [&'static str];
        fn from_elements(elements: Elements) -> Option<Vec<Self>>;
    }

    impl FromElements for f32 {
        const NAME: &'static str = "float32";
        const ACCEPTED: &'static [&'static str] = &["float16", "float32"];

        fn from_elements(elements: Elements) -> Option<Vec<Self>> {
            match elements {
                Elements::F32(values) => Some(values),
                _ => None,
            }
        }
    }

    impl FromElements for f64 {
        const NAME: &'static str = "numbers";
        const ACCEPTED: &'static [&'static str] = &NUMBERS;

        #[expect(clippy::cast_precision_loss, reason = "checked")]
        fn from_elements(elements: Elements) -> Option<Vec<Self>> {
            const EXACT: u64 = 1 << 53;
            let whole = |value: i64| (value.unsigned_abs() <= EXACT).then_some(value as Self);
            match elements {
                Elements::F32(values) => Some(values.into_iter().map(Self::from).collect()),
                Elements::F64(values) => Some(values),
                Elements::Int(values) => values.into_iter().map(whole).collect(),
                _ => None,
            }
        }
    }

    impl FromElements for super::Rounded {
        const NAME: &'static str = "numbers";
        const ACCEPTED: &'static [&'static str] = &NUMBERS;

        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_precision_loss,
            reason = "rounding is what the name says"
        )]
        fn from_elements(elements: Elements) -> Option<Vec<Self>> {
            match elements {
                Elements::F32(values) => Some(values.into_iter().map(Self).collect()),
                Elements::F64(values) => Some(values.iter().map(|&it| Self(it as f32)).collect()),
                Elements::Int(values) => Some(values.iter().map(|&it| Self(it as f32)).collect()),
                _ => None,
            }
        }
    }

    impl FromElements for String {
        const NAME: &'static str = "text";
        const ACCEPTED: &'static [&'static str] = &["str", "bytes"];

        fn from_elements(elements: Elements) -> Option<Vec<Self>> {
            match elements {
                Elements::Text(values) => Some(values),
                _ => None,
            }
        }
    }

    impl FromElements for i64 {
        const NAME: &'static str = "integers";
        const ACCEPTED: &'static [&'static str] =
            &["int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"];

        fn from_elements(elements: Elements) -> Option<Vec<Self>> {
            match elements {
                Elements::Int(values) => Some(values),
                _ => None,
            }
        }
    }

    impl FromElements for u8 {
        const NAME: &'static str = "uint8";
        const ACCEPTED: &'static [&'static str] = &["uint8"];

        fn from_elements(elements: Elements) -> Option<Vec<Self>> {
            match elements {
                Elements::Int(values) => {
                    values.into_iter().map(|value| Self::try_from(value).ok()).collect()
                }
                _ => None,
            }
        }
    }
}
