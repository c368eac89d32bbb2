//! The element types that are read, and how their bytes become numbers.

use crate::value::Elements;

/// What one element is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Bool,
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    F16,
    F32,
    F64,
    Object,
    /// Text of fixed length, as many UTF-32 characters.
    Text(u32),
    /// Text of fixed length, as many bytes.
    Bytes(u32),
}

/// Texts of fixed length are no longer than this; a path is not.
const MAX_TEXT: u32 = 1 << 16;

/// An element type with its byte order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Dtype {
    pub(crate) kind: Kind,
    pub(crate) big_endian: bool,
}

impl Dtype {
    /// Parses NumPy's short form, with or without byte order: `<f8`, `f8`, `|b1`, `O`, `<U5`, `|S5`.
    pub(crate) fn parse(descr: &str) -> Option<Self> {
        let (order, name) = match descr.as_bytes().first()? {
            b'<' | b'>' | b'|' => descr.split_at(1),
            _ => ("", descr),
        };
        let kind = match name {
            "b1" | "?" => Kind::Bool,
            "i1" => Kind::I8,
            "i2" => Kind::I16,
            "i4" => Kind::I32,
            "i8" => Kind::I64,
            "u1" => Kind::U8,
            "u2" => Kind::U16,
            "u4" => Kind::U32,
            "u8" => Kind::U64,
            "f2" => Kind::F16,
            "f4" => Kind::F32,
            "f8" => Kind::F64,
            "O" | "O4" | "O8" => Kind::Object,
            _ => Self::text(name)?,
        };
        let has_order = kind.size() > 1 && !matches!(kind, Kind::Bytes(_));
        (order.is_empty() || (order == "|") != has_order)
            .then_some(Self { kind, big_endian: order == ">" })
    }

    /// `U5` or `S5`; texts without room for a character are refused, since any number of them would
    /// fit into a file.
    fn text(name: &str) -> Option<Kind> {
        let length = |digits: &str| digits.parse().ok().filter(|it| (1..=MAX_TEXT).contains(it));
        match name.split_at_checked(1)? {
            ("U", digits) => length(digits).map(Kind::Text),
            ("S", digits) => length(digits).map(Kind::Bytes),
            _ => None,
        }
    }

    /// Sets the byte order to `<`, `>` or `|` (does not matter); `false` if it is none of these.
    pub(crate) fn set_order(&mut self, order: &str) -> bool {
        self.big_endian = order == ">";
        match order {
            "<" | ">" => true,
            "|" => self.kind.size() == 1,
            _ => false,
        }
    }

    /// The numbers in `bytes`; what is left of an incomplete last element is ignored.
    ///
    /// `None` for objects, if an unsigned integer does not fit i64, and if a text is none.
    pub(crate) fn decode(self, bytes: &[u8]) -> Option<Elements> {
        Some(match self.kind {
            Kind::Object => return None,
            Kind::Bool => Elements::Bool(bytes.iter().map(|&byte| byte != 0).collect()),
            Kind::I8 => Elements::Int(self.map(bytes, |b| i8::from_le_bytes(b).into())),
            Kind::I16 => Elements::Int(self.map(bytes, |b| i16::from_le_bytes(b).into())),
            Kind::I32 => Elements::Int(self.map(bytes, |b| i32::from_le_bytes(b).into())),
            Kind::I64 => Elements::Int(self.map(bytes, i64::from_le_bytes)),
            Kind::U8 => Elements::Int(self.map(bytes, |b| u8::from_le_bytes(b).into())),
            Kind::U16 => Elements::Int(self.map(bytes, |b| u16::from_le_bytes(b).into())),
            Kind::U32 => Elements::Int(self.map(bytes, |b| u32::from_le_bytes(b).into())),
            Kind::U64 => {
                let checked = self.map(bytes, |b| i64::try_from(u64::from_le_bytes(b)).ok());
                Elements::Int(checked.into_iter().collect::<Option<_>>()?)
            }
            Kind::F16 => Elements::F32(self.map(bytes, |b| half::f16::from_le_bytes(b).to_f32())),
            Kind::F32 => Elements::F32(self.map(bytes, f32::from_le_bytes)),
            Kind::F64 => Elements::F64(self.map(bytes, f64::from_le_bytes)),
            Kind::Text(_) => {
                let texts = bytes.chunks_exact(self.kind.size()).map(|text| {
                    let codes: Vec<u32> = self.map(text, u32::from_le_bytes);
                    let end = codes.iter().rposition(|&code| code != 0).map_or(0, |last| last + 1);
                    codes[..end].iter().map(|&code| char::from_u32(code)).collect()
                });
                Elements::Text(texts.collect::<Option<_>>()?)
            }
            Kind::Bytes(_) => {
                let texts = bytes.chunks_exact(self.kind.size()).map(|text| {
                    let end = text.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1);
                    std::str::from_utf8(&text[..end]).map(str::to_owned)
                });
                Elements::Text(texts.collect::<Result<_, _>>().ok()?)
            }
        })
    }

    /// Applies `from_le_bytes` to every element, after turning big-endian ones round.
    fn map<T, const N: usize>(self, bytes: &[u8], from_le_bytes: impl Fn([u8; N]) -> T) -> Vec<T> {
        let (elements, _) = bytes.as_chunks::<N>();
        let turn = |&(mut element): &[u8; N]| {
            if self.big_endian {
                element.reverse();
            }
            from_le_bytes(element)
        };
        elements.iter().map(turn).collect()
    }
}

impl Kind {
    /// Bytes per element, at least one.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 | Self::Object => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
            Self::Text(length) => 4 * length as usize,
            Self::Bytes(length) => length as usize,
        }
    }

    /// NumPy's name of it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::I8 => "int8",
            Self::I16 => "int16",
            Self::I32 => "int32",
            Self::I64 => "int64",
            Self::U8 => "uint8",
            Self::U16 => "uint16",
            Self::U32 => "uint32",
            Self::U64 => "uint64",
            Self::F16 => "float16",
            Self::F32 => "float32",
            Self::F64 => "float64",
            Self::Object => "object",
            Self::Text(_) => "str",
            Self::Bytes(_) => "bytes",
        }
    }
}

/// Number of elements of an array, `None` if it does not fit.
///
/// A zero anywhere makes it zero only if the other lengths are sound as well.
pub(crate) fn n_elements(shape: &[usize]) -> Option<usize> {
    shape.iter().try_fold(1_usize, |product, &len| product.checked_mul(len))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn byte_order_must_be_given_where_it_matters_and_only_there() {
        assert!(Dtype::parse(">f8").unwrap().big_endian);
        assert!(!Dtype::parse("f8").unwrap().big_endian);
        assert_eq!(Dtype::parse("|O").unwrap().kind, Kind::Object);
        assert_eq!(Dtype::parse("<U5").unwrap().kind, Kind::Text(5));
        assert_eq!(Dtype::parse("|S5").unwrap().kind, Kind::Bytes(5));
        for bad in ["|f8", "<u1", "<c16", "", "<", "<S5", "|U5", "<U0", "|S", "<U9999999999", "é"]
        {
            assert_eq!(Dtype::parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn both_byte_orders_decode() {
        let big = Dtype::parse(">i2").unwrap().decode(&[0, 1, 255, 255]);
        assert_eq!(big, Some(Elements::Int(vec![1, -1])));
        let little = Dtype::parse("<f4").unwrap().decode(&1.5_f32.to_le_bytes());
        assert_eq!(little, Some(Elements::F32(vec![1.5])));
        assert_eq!(Dtype::parse("<u8").unwrap().decode(&[255; 8]), None);
        let half = Dtype::parse(">f2").unwrap().decode(&[0x3c, 0, 0xc0, 0]);
        assert_eq!(half, Some(Elements::F32(vec![1.0, -2.0])));
    }

    #[test]
    fn texts_end_before_their_padding_and_must_be_text() {
        let texts =
            |texts: &[&str]| Some(Elements::Text(texts.iter().map(|&it| it.into()).collect()));
        let utf_32: Vec<u8> =
            ['é', '\0', 'a', 'b'].iter().flat_map(|&it| u32::from(it).to_be_bytes()).collect();
        assert_eq!(Dtype::parse(">U2").unwrap().decode(&utf_32), texts(&["é", "ab"]));
        assert_eq!(Dtype::parse("|S3").unwrap().decode(b"a\0\0b.c"), texts(&["a", "b.c"]));
        assert_eq!(Dtype::parse("<U1").unwrap().decode(&0xd800_u32.to_le_bytes()), None);
        assert_eq!(Dtype::parse("|S1").unwrap().decode(&[0xff]), None);
    }
}
