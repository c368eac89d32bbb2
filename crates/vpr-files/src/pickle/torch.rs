//! The names that PyTorch's checkpoints call, and what they make: tensors that point into
//! storages outside of the pickle.

use crate::value::{Element, Tensor};

use super::object::{Arena, Global, Name, Node, Object};

/// Why something was refused; the caller knows where.
type Reason = String;

/// PyTorch's own limit is 64 as well.
const MAX_DIMENSIONS: usize = 64;

/// Looks up what a checkpoint names; `None` if it is not on the list.
pub(super) fn global(module: &str, name: &str) -> Option<Name> {
    Some(match (module, name) {
        ("collections", "OrderedDict") => Name::OrderedDict,
        ("torch._utils", "_rebuild_tensor" | "_rebuild_tensor_v2") => Name::RebuildTensor,
        ("torch._utils", "_rebuild_parameter") => Name::RebuildParameter,
        ("torch" | "torch.cuda", "DoubleStorage") => Name::Storage(Element::F64),
        ("torch" | "torch.cuda", "FloatStorage") => Name::Storage(Element::F32),
        ("torch" | "torch.cuda", "HalfStorage") => Name::Storage(Element::F16),
        ("torch" | "torch.cuda", "BFloat16Storage") => Name::Storage(Element::BF16),
        ("torch" | "torch.cuda", "LongStorage") => Name::Storage(Element::I64),
        ("torch" | "torch.cuda", "IntStorage") => Name::Storage(Element::I32),
        ("torch" | "torch.cuda", "ShortStorage") => Name::Storage(Element::I16),
        ("torch" | "torch.cuda", "CharStorage") => Name::Storage(Element::I8),
        ("torch" | "torch.cuda", "ByteStorage") => Name::Storage(Element::U8),
        ("torch" | "torch.cuda", "BoolStorage") => Name::Storage(Element::Bool),
        ("torch", "Size" | "device" | "float32" | "float16" | "bfloat16" | "float64" | "int64")
        | ("argparse", "Namespace")
        | ("collections", "defaultdict")
        | ("builtins" | "__builtin__", "dict" | "set" | "list" | "int" | "float")
        | ("pathlib", "PosixPath" | "PurePosixPath" | "WindowsPath") => Name::Inert,
        _ => return None,
    })
}

/// Calls `name` with `arguments`, a tuple; `at` is the offset of the opcode.
pub(super) fn reduce<'a>(
    arena: &mut Arena<'a>,
    name: Name,
    arguments: Node<'a>,
    at: usize,
) -> Result<Node<'a>, Reason> {
    if name == Name::Inert {
        return Ok(arena.add(Object::Inert, at));
    }
    let arguments = arena
        .tuple(arguments)
        .filter(|items| items.len() <= 8)
        .ok_or("the arguments are not a short tuple")?
        .to_vec();
    match (name, &arguments[..]) {
        (Name::OrderedDict, []) => Ok(arena.add(Object::Dict(Vec::new()), at)),
        (Name::OrderedDict, &[Node::Object(pairs)]) => {
            let items = pairs_of(arena, pairs).ok_or("an OrderedDict is made from pairs")?;
            Ok(arena.add(Object::Dict(items), at))
        }
        (Name::RebuildTensor, &[storage, offset, shape, strides, ..]) => {
            let tensor = tensor(arena, storage, offset, shape, strides)?;
            Ok(arena.add(Object::Tensor(tensor), at))
        }
        (Name::RebuildParameter, &[tensor, ..]) => match tensor {
            Node::Object(id) if matches!(arena.get(id), Object::Tensor(_)) => Ok(tensor),
            _ => Err("a parameter is made from a tensor".into()),
        },
        _ => Err(format!("unexpected arguments of {name:?}")),
    }
}

/// What a persistent id stands for: always a storage.
pub(super) fn persistent<'a>(arena: &Arena<'a>, id: Node<'a>) -> Result<Object<'a>, Reason> {
    let wrong = "a persistent id is not a storage";
    let &[tag, class, key, _location, len, ref view @ ..] = arena.tuple(id).ok_or(wrong)? else {
        return Err(wrong.into());
    };
    let Node::Global(Global::Torch(Name::Storage(element))) = class else {
        return Err(wrong.into());
    };
    if arena.text(tag) != Some("storage") || !matches!(view, [] | [Node::None]) {
        return Err(wrong.into());
    }
    let key = arena.text(key).filter(|key| key.len() <= 64).ok_or("the key of a storage")?;
    let len = length(len).ok_or("the length of a storage")?;
    Ok(Object::Storage { key: key.to_owned(), element, len })
}

fn tensor<'a>(
    arena: &Arena<'a>,
    storage: Node<'a>,
    offset: Node<'a>,
    shape: Node<'a>,
    strides: Node<'a>,
) -> Result<Tensor, Reason> {
    let Node::Object(id) = storage else { return Err("a tensor without storage".into()) };
    let Object::Storage { key, element, len } = arena.get(id) else {
        return Err("a tensor without storage".into());
    };
    let offset = length(offset).ok_or("the offset of a tensor is not a count")?;
    let shape = lengths(arena, shape).ok_or("the shape of a tensor is not a tuple of lengths")?;
    let strides = lengths(arena, strides).filter(|strides| strides.len() == shape.len());
    let strides = strides.ok_or("the strides of a tensor are not as many as its axes")?;
    if !fits(offset, &shape, &strides, *len) {
        return Err(format!("a tensor of {shape:?} at {offset} exceeds its storage of {len}"));
    }
    let storage_len = *len;
    Ok(Tensor { storage: key.clone(), element: *element, storage_len, offset, shape, strides })
}

/// Whether every element lies inside the storage, and there are no more than it has.
fn fits(offset: usize, shape: &[usize], strides: &[usize], len: usize) -> bool {
    let n_elements = shape.iter().try_fold(1_usize, |n, &axis| n.checked_mul(axis));
    if n_elements == Some(0) {
        return true;
    }
    let last = shape.iter().zip(strides).try_fold(offset, |last, (&axis, &stride)| {
        last.checked_add((axis - 1).checked_mul(stride)?)
    });
    n_elements.is_some_and(|n| n <= len) && last.is_some_and(|last| last < len)
}

fn lengths<'a>(arena: &Arena<'a>, node: Node<'a>) -> Option<Vec<usize>> {
    let axes = arena.tuple(node).filter(|axes| axes.len() <= MAX_DIMENSIONS)?;
    axes.iter().map(|&axis| length(axis)).collect()
}

fn length(node: Node<'_>) -> Option<usize> {
    match node {
        Node::Int(len) => usize::try_from(len).ok(),
        _ => None,
    }
}

/// Keys and values in turns, of a list of pairs.
fn pairs_of<'a>(arena: &Arena<'a>, list: usize) -> Option<Vec<Node<'a>>> {
    let (Object::List(items) | Object::Tuple(items)) = arena.get(list) else { return None };
    let mut flat = Vec::with_capacity(2 * items.len());
    for &item in items {
        let Node::Object(id) = item else { return None };
        match arena.get(id) {
            Object::List(pair) | Object::Tuple(pair) if pair.len() == 2 => flat.extend(pair),
            _ => return None,
        }
    }
    Some(flat)
}
