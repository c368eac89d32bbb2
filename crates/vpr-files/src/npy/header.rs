//! The header of a `.npy` file: a Python literal, of which one form is read.

use crate::dtype::{Dtype, n_elements};

/// What the header of a `.npy` file promises.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    pub(crate) dtype: Dtype,
    pub(crate) fortran_order: bool,
    pub(crate) shape: Vec<usize>,
    /// Number of bytes before the elements.
    pub(crate) len: usize,
}

/// The first bytes of every `.npy` file.
const MAGIC: &[u8] = b"\x93NUMPY";
/// Longer headers are refused; NumPy's own limit.
const MAX_LEN: usize = 10_000;
/// How many bytes at most hold a whole header.
pub(crate) const MAX_START: usize = MAX_LEN + 12;

impl Header {
    /// Parses the start of a file; on failure says at which byte and why.
    pub(crate) fn parse(start: &[u8]) -> Result<Self, (usize, String)> {
        let at = |offset: usize, reason: &str| Err((offset, reason.to_owned()));
        if !start.starts_with(MAGIC) {
            return at(0, "does not start with `\\x93NUMPY`");
        }
        let (text_at, text_len) = match start[MAGIC.len()..] {
            [1, _, a, b, ..] => (10, usize::from(u16::from_le_bytes([a, b]))),
            [2 | 3, _, a, b, c, d, ..] => (12, u32::from_le_bytes([a, b, c, d]) as usize),
            [version, ..] if version > 3 || version == 0 => return at(6, "unknown version"),
            _ => return at(start.len(), "ends inside the header"),
        };
        if text_len > MAX_LEN {
            return at(8, "the header is longer than 10 000 bytes");
        }
        let Some(text) = start.get(text_at..text_at + text_len) else {
            return at(start.len(), "ends inside the header");
        };
        let Some(text) = std::str::from_utf8(text).ok().filter(|text| text.is_ascii()) else {
            return at(text_at, "the header is not text");
        };
        let mut literal = Literal { rest: text };
        literal.header(text_at + text_len).map_err(|reason| {
            (text_at + text.len() - literal.rest.len(), format!("in the header: {reason}"))
        })
    }

    /// Number of elements, and the bytes they take; `None` if these do not fit.
    pub(crate) fn size(&self) -> Option<(usize, usize)> {
        let n = n_elements(&self.shape)?;
        Some((n, n.checked_mul(self.dtype.kind.size())?))
    }

    /// The header that NumPy would write (version 1), elements start at a multiple of 64 bytes.
    pub(crate) fn write(descr: &str, shape: &[usize]) -> Vec<u8> {
        let axes: String = match shape {
            [len] => format!("{len},"),
            _ => shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", "),
        };
        let text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({axes}), }}");
        let len = (10 + text.len() + 1).next_multiple_of(64) - 10;
        let mut out =
            [MAGIC, &[1, 0], &u16::try_from(len).unwrap_or(u16::MAX).to_le_bytes()].concat();
        out.extend_from_slice(format!("{text:<width$}\n", width = len - 1).as_bytes());
        out
    }
}

/// Reads the dictionary of the header, token by token.
struct Literal<'a> {
    rest: &'a str,
}

impl<'a> Literal<'a> {
    fn header(&mut self, len: usize) -> Result<Header, String> {
        let (mut dtype, mut fortran_order, mut shape) = (None, None, None);
        self.expect("{")?;
        while !self.accept("}") {
            let key = self.string()?;
            self.expect(":")?;
            match key {
                "descr" => dtype = Some(self.dtype()?),
                "fortran_order" => fortran_order = Some(self.bool()?),
                "shape" => shape = Some(self.shape()?),
                _ => return Err("unknown key".into()),
            }
            if !self.accept(",") {
                self.expect("}")?;
                break;
            }
        }
        if !self.rest.trim().is_empty() {
            return Err("something follows the dictionary".into());
        }
        Ok(Header {
            dtype: dtype.ok_or("`descr` is missing")?,
            fortran_order: fortran_order.ok_or("`fortran_order` is missing")?,
            shape: shape.ok_or("`shape` is missing")?,
            len,
        })
    }

    fn accept(&mut self, token: &str) -> bool {
        match self.rest.trim_start().strip_prefix(token) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn expect(&mut self, token: &str) -> Result<(), String> {
        if self.accept(token) { Ok(()) } else { Err(format!("expected `{token}`")) }
    }

    fn string(&mut self) -> Result<&'a str, String> {
        let quote = ['\'', '"'].into_iter().find(|quote| self.accept(&quote.to_string()));
        let end = quote.and_then(|quote| self.rest.find(quote)).ok_or("expected a string")?;
        let string = &self.rest[..end];
        self.rest = &self.rest[end + 1..];
        Ok(string)
    }

    fn dtype(&mut self) -> Result<Dtype, String> {
        if self.rest.trim_start().starts_with('[') {
            return Err("structured dtypes are not read".into());
        }
        let descr = self.string()?;
        Dtype::parse(descr).ok_or_else(|| {
            // Bytes without a meaning: what NumPy writes for types that it does not know.
            if matches!(descr, "|V2" | "<V2") {
                return "dtype `|V2` says of two bytes not what they are; if bfloat16, save it as \
                        float32"
                    .to_owned();
            }
            let shown: String = descr.chars().take(40).collect();
            format!("dtype `{}` is not read", shown.escape_debug())
        })
    }

    fn bool(&mut self) -> Result<bool, String> {
        if self.accept("True") {
            Ok(true)
        } else {
            self.expect("False").map(|()| false).map_err(|_| "expected True or False".into())
        }
    }

    fn shape(&mut self) -> Result<Vec<usize>, String> {
        let mut shape = Vec::new();
        self.expect("(")?;
        while !self.accept(")") {
            self.rest = self.rest.trim_start();
            let end = self.rest.find(|char: char| !char.is_ascii_digit()).unwrap_or(0);
            shape.push(self.rest[..end].parse().map_err(|_| "expected a length of 64 bits")?);
            self.rest = &self.rest[end..];
            self.accept("L");
            if !self.accept(",") {
                self.expect(")")?;
                break;
            }
        }
        Ok(shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Header, (usize, String)> {
        let len = u16::try_from(text.len()).unwrap().to_le_bytes();
        Header::parse(&[MAGIC, &[1, 0], &len, text.as_bytes()].concat())
    }

    #[test]
    fn what_is_written_is_read() {
        for shape in [vec![], vec![7], vec![3, 2], vec![1, 2, 3, 4]] {
            let start = Header::write("<f4", &shape);
            let header = Header::parse(&start).unwrap();
            assert_eq!((header.shape, header.len, start.len() % 64), (shape, start.len(), 0));
        }
    }

    #[test]
    fn python_2_wrote_long_lengths() {
        let header = parse("{'descr': '<f8', 'fortran_order': True, 'shape': (3L, 2L)}").unwrap();
        assert_eq!((header.shape, header.fortran_order), (vec![3, 2], true));
    }

    #[test]
    fn refusals_name_the_byte() {
        let of = |text: &str| parse(text).unwrap_err();
        let structured = of("{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': ()}");
        assert_eq!(structured, (19, "in the header: structured dtypes are not read".to_owned()));
        assert!(of("{'descr': '<c16', 'shape': ()}").1.contains("dtype `<c16` is not read"));
        assert!(of("{'descr': '<f4', 'shape': (-1,)}").1.contains("expected a length"));
        assert!(of("{'descr': '<f4', 'fortran_order': False}").1.contains("`shape` is missing"));
        assert!(of("{'shape': (99999999999999999999,)}").1.contains("expected a length"));
        assert!(of("{'shape': (3").1.contains("expected"));
        assert_eq!(Header::parse(b"\x93NUMPY\x01\x00\xff").unwrap_err().0, 9);
    }
}
