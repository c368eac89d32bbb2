//! What a pickle holds, once decoded.

/// A decoded Python object.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// `None`.
    None,
    /// A truth value.
    Bool(bool),
    /// An integer, as far as it fits 64 bits.
    Int(i64),
    /// A floating-point number.
    Float(f64),
    /// `bytes`, or a string of Python 2, whose encoding nobody wrote down.
    Bytes(Vec<u8>),
    /// A Unicode string.
    Text(String),
    /// A list.
    List(Vec<Value>),
    /// A tuple.
    Tuple(Vec<Value>),
    /// A dictionary in the order of the file; a repeated key appears repeatedly.
    Dict(Vec<(Value, Value)>),
    /// A NumPy array.
    Array {
        /// Length along each axis; empty for a scalar array.
        shape: Vec<usize>,
        /// The elements in C order, as many as the product of `shape`.
        elements: Elements,
    },
    /// An estimator of scikit-learn with its fields, as
    /// [`decode_estimators`](crate::pickle::decode_estimators) and
    /// [`decode_checkpoint`](crate::pickle::decode_checkpoint) read it.
    Record {
        /// The name of its class.
        class: String,
        /// What it holds, in the order of the file.
        fields: Vec<(Value, Value)>,
    },
    /// A tensor of a PyTorch checkpoint; only [`decode_checkpoint`](crate::pickle::decode_checkpoint)
    /// makes these.
    Tensor(Tensor),
}

/// The elements of a NumPy array, in C order.
#[derive(Clone, Debug, PartialEq)]
pub enum Elements {
    /// `bool`.
    Bool(Vec<bool>),
    /// Any integer type.
    Int(Vec<i64>),
    /// `float32`, or `float16`, which fits.
    F32(Vec<f32>),
    /// `float64`.
    F64(Vec<f64>),
    /// Text of fixed length, without its padding.
    Text(Vec<String>),
    /// `object`.
    Object(Vec<Value>),
}

impl Value {
    /// What this is called in messages.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::None => "None",
            Self::Bool(_) => "a bool",
            Self::Int(_) => "an int",
            Self::Float(_) => "a float",
            Self::Bytes(_) => "bytes",
            Self::Text(_) => "a string",
            Self::List(_) => "a list",
            Self::Tuple(_) => "a tuple",
            Self::Dict(_) => "a dict",
            Self::Array { .. } => "an array",
            Self::Record { .. } => "an estimator",
            Self::Tensor(_) => "a tensor",
        }
    }

    /// The number, of an int, a float or an array of no dimension.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "counts and scores, far below 2^53")]
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Int(value) => Some(*value as f64),
            Self::Float(value) => Some(*value),
            Self::Array { shape, .. } if shape.is_empty() => self.to_f64s()?.first().copied(),
            _ => None,
        }
    }

    /// The integer, of an int or of a float without fraction.
    #[must_use]
    pub fn as_i64(&self) -> Option<i64> {
        match self {
            Self::Int(value) => Some(*value),
            Self::Float(value) => whole(*value),
            _ => None,
        }
    }

    /// The text, of a string of either Python; bytes count if they are ASCII.
    #[must_use]
    pub fn as_text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            Self::Bytes(bytes) if bytes.is_ascii() => std::str::from_utf8(bytes).ok(),
            _ => None,
        }
    }

    /// The numbers of a one-dimensional array, a list or a tuple, as f64.
    #[must_use]
    pub fn to_f64s(&self) -> Option<Vec<f64>> {
        match self {
            Self::List(values) | Self::Tuple(values) => values.iter().map(Self::as_f64).collect(),
            Self::Array { shape, elements } if shape.len() <= 1 => elements.to_f64s(),
            _ => None,
        }
    }

    /// The integers of a one-dimensional array, a list or a tuple; floats count if they are whole.
    #[must_use]
    pub fn to_i64s(&self) -> Option<Vec<i64>> {
        match self {
            Self::List(values) | Self::Tuple(values) => values.iter().map(Self::as_i64).collect(),
            Self::Array { shape, elements } if shape.len() == 1 => elements.to_i64s(),
            _ => None,
        }
    }
}

impl Elements {
    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Bool(values) => values.len(),
            Self::Int(values) => values.len(),
            Self::F32(values) => values.len(),
            Self::F64(values) => values.len(),
            Self::Text(values) => values.len(),
            Self::Object(values) => values.len(),
        }
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All as f64, if they are numbers.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "counts and scores, far below 2^53")]
    pub fn to_f64s(&self) -> Option<Vec<f64>> {
        match self {
            Self::Bool(_) | Self::Text(_) => None,
            Self::Int(values) => Some(values.iter().map(|&value| value as f64).collect()),
            Self::F32(values) => Some(values.iter().copied().map(f64::from).collect()),
            Self::F64(values) => Some(values.clone()),
            Self::Object(values) => values.iter().map(Value::as_f64).collect(),
        }
    }

    /// All as i64, if they are whole numbers.
    #[must_use]
    pub fn to_i64s(&self) -> Option<Vec<i64>> {
        match self {
            Self::Bool(_) | Self::Text(_) => None,
            Self::Int(values) => Some(values.clone()),
            Self::F32(values) => values.iter().map(|&value| whole(f64::from(value))).collect(),
            Self::F64(values) => values.iter().map(|&value| whole(value)).collect(),
            Self::Object(values) => values.iter().map(Value::as_i64).collect(),
        }
    }
}

/// The integer that `value` is, if it is one that f64 represents exactly.
fn whole(value: f64) -> Option<i64> {
    const EXACT: f64 = 9_007_199_254_740_992.0; // 2^53
    #[expect(clippy::cast_possible_truncation, reason = "whole and below 2^53")]
    (value.fract() == 0.0 && value.abs() <= EXACT).then_some(value as i64)
}

/// The type of the elements of a storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// `torch.double`.
    F64,
    /// `torch.float`.
    F32,
    /// `torch.half`.
    F16,
    /// `torch.bfloat16`.
    BF16,
    /// `torch.long`.
    I64,
    /// `torch.int`.
    I32,
    /// `torch.short`.
    I16,
    /// `torch.int8`.
    I8,
    /// `torch.uint8`.
    U8,
    /// `torch.bool`.
    Bool,
}

impl Element {
    /// Bytes per element.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::F64 | Self::I64 => 8,
            Self::F32 | Self::I32 => 4,
            Self::F16 | Self::BF16 | Self::I16 => 2,
            Self::I8 | Self::U8 | Self::Bool => 1,
        }
    }
}

/// A tensor of a checkpoint: a view into a storage that lies elsewhere in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tensor {
    /// Which storage, as the checkpoint names it.
    pub storage: String,
    /// What its elements are.
    pub element: Element,
    /// How many elements the storage has.
    pub storage_len: usize,
    /// The first element of the tensor.
    pub offset: usize,
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// Distance in elements between neighbours along each axis.
    pub strides: Vec<usize>,
}
