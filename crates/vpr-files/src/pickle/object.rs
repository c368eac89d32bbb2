//! What the machine works on: small nodes on the stack, and an arena of the objects they refer to.

use super::Refusal;
use crate::{
    dtype::Dtype,
    value::{Element, Tensor},
};

/// One stack or memo entry; strings are borrowed from the pickle.
#[derive(Clone, Copy, Debug)]
pub(super) enum Node<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Bytes(&'a [u8]),
    Text(&'a str),
    Global(Global),
    /// An object of the [`Arena`].
    Object(usize),
}

/// What checkpoints name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Name {
    /// `collections.OrderedDict`.
    OrderedDict,
    /// `torch._utils._rebuild_tensor` and `_rebuild_tensor_v2`.
    RebuildTensor,
    /// `torch._utils._rebuild_parameter`.
    RebuildParameter,
    /// `torch.FloatStorage` and its like.
    Storage(Element),
    /// Settings that lie beside weights; read as `None`, whatever they are called with.
    Inert,
}

/// The only things a pickle may name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Global {
    /// `numpy.core.multiarray._reconstruct`, which makes an empty array for BUILD to fill.
    Reconstruct,
    /// `numpy.core.numeric._frombuffer`, an array of protocol 5.
    FromBuffer,
    /// `numpy.core.multiarray.scalar`.
    Scalar,
    /// `numpy.ndarray`, only as an argument of the first.
    Ndarray,
    /// `numpy.dtype`.
    Dtype,
    /// `_codecs.encode`, how Python 3 writes bytes for Python 2.
    Encode,
    /// `bytes`, only called without arguments.
    Bytes,
    /// A class of scikit-learn, by its name.
    Estimator(&'static str),
    /// `copyreg._reconstructor`, only called with an estimator.
    Reconstructor,
    /// `object`, only as an argument of the last.
    ObjectBase,
    /// `collections.defaultdict`, read as a dictionary whatever its default.
    DefaultDict,
    /// What checkpoints of PyTorch name.
    Torch(Name),
}

/// Something with identity: later opcodes may still add to it.
#[derive(Debug)]
pub(super) enum Object<'a> {
    List(Vec<Node<'a>>),
    Tuple(Vec<Node<'a>>),
    /// Keys and values in turns.
    Dict(Vec<Node<'a>>),
    Bytes(Vec<u8>),
    Text(String),
    Dtype(Dtype),
    Array(Option<Array<'a>>),
    /// What a tensor is a view of.
    Storage {
        key: String,
        element: Element,
        len: usize,
    },
    Tensor(Tensor),
    /// An estimator of scikit-learn; its fields are a dictionary.
    Record {
        class: &'static str,
        fields: Option<usize>,
    },
    /// Settings beside weights; what they hold is not kept.
    Inert,
}

/// The state of an array, checked except for the number of elements.
#[derive(Clone, Debug)]
pub(super) struct Array<'a> {
    pub(super) shape: Vec<usize>,
    pub(super) dtype: Dtype,
    pub(super) fortran_order: bool,
    /// Bytes, or a list of objects.
    pub(super) data: Node<'a>,
}

/// All objects of a pickle, with the offset of the opcode that made each.
#[derive(Debug)]
pub(super) struct Arena<'a> {
    objects: Vec<(Object<'a>, usize)>,
    /// How many more bytes may be made from text; without sharing, a pickle cannot exceed it.
    encodable: usize,
}

impl<'a> Arena<'a> {
    /// An arena for a pickle of `n_bytes`.
    pub(super) fn new(n_bytes: usize) -> Self {
        Self { objects: Vec::new(), encodable: n_bytes }
    }

    /// How many more bytes [`Self::add_encoded`] takes.
    pub(super) fn encodable(&self) -> usize {
        self.encodable
    }

    /// Adds bytes that were made from text of the pickle.
    pub(super) fn add_encoded(&mut self, bytes: Vec<u8>, offset: usize) -> Node<'a> {
        self.encodable = self.encodable.saturating_sub(bytes.len());
        self.add(Object::Bytes(bytes), offset)
    }

    pub(super) fn add(&mut self, object: Object<'a>, offset: usize) -> Node<'a> {
        self.objects.push((object, offset));
        Node::Object(self.objects.len() - 1)
    }

    pub(super) fn get(&self, id: usize) -> &Object<'a> {
        &self.objects[id].0
    }

    pub(super) fn get_mut(&mut self, id: usize) -> &mut Object<'a> {
        &mut self.objects[id].0
    }

    /// A refusal at the place where an object was made.
    pub(super) fn refuse<T>(&self, id: usize, reason: impl Into<String>) -> Result<T, Refusal> {
        Err(Refusal { offset: self.objects[id].1, reason: reason.into() })
    }

    /// The items of a tuple.
    pub(super) fn tuple(&self, node: Node<'a>) -> Option<&[Node<'a>]> {
        match node {
            Node::Object(id) => match self.get(id) {
                Object::Tuple(items) => Some(items),
                _ => None,
            },
            _ => None,
        }
    }

    /// The bytes of a byte string, wherever they are.
    pub(super) fn bytes<'s>(&'s self, node: Node<'a>) -> Option<&'s [u8]> {
        match node {
            Node::Bytes(bytes) => Some(bytes),
            Node::Object(id) => match self.get(id) {
                Object::Bytes(bytes) => Some(bytes),
                _ => None,
            },
            _ => None,
        }
    }

    /// The text of a string of either Python.
    pub(super) fn text<'s>(&'s self, node: Node<'a>) -> Option<&'s str> {
        match node {
            Node::Text(text) => Some(text),
            Node::Object(id) if matches!(self.get(id), Object::Text(_)) => match self.get(id) {
                Object::Text(text) => Some(text),
                _ => None,
            },
            _ => std::str::from_utf8(self.bytes(node)?).ok(),
        }
    }
}
