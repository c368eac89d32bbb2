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
    F32,
    F64,
    Object,
}

/// An element type with its byte order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Dtype {
    pub(crate) kind: Kind,
    pub(crate) big_endian: bool,
}

impl Dtype {
    /// Parses NumPy's short form, with or without byte order: `<f8`, `f8`, `|b1`, `O`.
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
            "f4" => Kind::F32,
            "f8" => Kind::F64,
            "O" | "O4" | "O8" => Kind::Object,
            _ => return None,
        };
        let has_order = kind.size() > 1;
        (order.is_empty() || (order == "|") != has_order)
            .then_some(Self { kind, big_endian: order == ">" })
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
    /// `None` for objects, and if an unsigned integer does not fit i64.
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
            Kind::F32 => Elements::F32(self.map(bytes, f32::from_le_bytes)),
            Kind::F64 => Elements::F64(self.map(bytes, f64::from_le_bytes)),
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
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
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
            Self::F32 => "float32",
            Self::F64 => "float64",
            Self::Object => "object",
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
        for bad in ["|f8", "<u1", "f2", "<c16", "", "<", "|S5", "<M8[ns]"] {
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
    }
}
