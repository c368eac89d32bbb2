//! The NumPy constructors a pickle may call, and what they make.

use crate::dtype::{Dtype, Kind, n_elements};

use super::{
    Elements,
    object::{Arena, Array, Global, Node, Object},
    text::latin1,
};

/// Why a constructor was refused; the caller knows where.
type Reason = String;

/// NumPy's own limit.
const MAX_DIMENSIONS: usize = 64;

/// Looks up what a pickle names; `None` if it is not on the list.
pub(super) fn global(module: &str, name: &str) -> Option<Global> {
    Some(match (module, name) {
        ("numpy.core.multiarray" | "numpy._core.multiarray", "_reconstruct") => Global::Reconstruct,
        ("numpy.core.multiarray" | "numpy._core.multiarray", "scalar") => Global::Scalar,
        ("numpy.core.numeric" | "numpy._core.numeric", "_frombuffer") => Global::FromBuffer,
        ("numpy", "ndarray") => Global::Ndarray,
        ("numpy", "dtype") => Global::Dtype,
        ("_codecs", "encode") => Global::Encode,
        ("builtins" | "__builtin__", "bytes") => Global::Bytes,
        _ => return None,
    })
}

/// Calls `function` with `arguments`, a tuple; `at` is the offset of the REDUCE.
pub(super) fn reduce<'a>(
    arena: &mut Arena<'a>,
    function: Global,
    arguments: Node<'a>,
    at: usize,
) -> Result<Node<'a>, Reason> {
    let arguments = parts(arena, arguments).ok_or("the arguments are not a short tuple")?;
    let wrong = || format!("unexpected arguments of {function:?}");
    let object = match (function, &arguments[..]) {
        (Global::Reconstruct, &[Node::Global(Global::Ndarray), _, _]) => Object::Array(None),
        (Global::Dtype, &([name, _, _] | [name])) => Object::Dtype(named_dtype(arena, name)?),
        (Global::FromBuffer, &[data, dtype, shape, order]) => {
            let fortran_order = match arena.text(order) {
                Some("C") => false,
                Some("F") => true,
                _ => return Err(wrong()),
            };
            Object::Array(Some(array(arena, shape, dtype, fortran_order, data)?))
        }
        (Global::Scalar, &[dtype, data]) => return scalar(arena, dtype, data),
        (Global::Encode, &[text, encoding]) => {
            let encoding = arena.text(encoding).ok_or_else(wrong)?;
            if !["latin1", "latin-1"].iter().any(|it| it.eq_ignore_ascii_case(encoding)) {
                return Err(wrong());
            }
            return encode(arena, text, at);
        }
        (Global::Bytes, []) => Object::Bytes(Vec::new()),
        (Global::Torch(name), _) => return Err(format!("{name:?} is not of NumPy")),
        (Global::Ndarray, _) => return Err("numpy.ndarray is not called".into()),
        (Global::Estimator(class), _) => return Err(format!("{class} is not called")),
        _ => return Err(wrong()),
    };
    Ok(arena.add(object, at))
}

/// Gives `target`, an array or a dtype, its `state`.
pub(super) fn build<'a>(
    arena: &mut Arena<'a>,
    target: Node<'a>,
    state: Node<'a>,
) -> Result<(), Reason> {
    let Node::Object(id) = target else { return Err("builds what is not an object".into()) };
    let state = parts(arena, state).ok_or("the state is not a short tuple")?;
    let built = match arena.get(id) {
        Object::Array(Some(_)) => return Err("the array has its state already".into()),
        Object::Array(None) => {
            let [_version, shape, dtype, order, data] = state[..] else {
                return Err(format!("the state of an array has 5 parts, not {}", state.len()));
            };
            let fortran_order = match order {
                Node::Bool(value) => value,
                Node::Int(value) => value != 0,
                _ => return Err("the order of an array is not a bool".into()),
            };
            Object::Array(Some(array(arena, shape, dtype, fortran_order, data)?))
        }
        Object::Dtype(dtype) => {
            let mut dtype = *dtype;
            let [_version, order, Node::None, Node::None, Node::None, ..] = state[..] else {
                return Err("structured dtypes are not read".into());
            };
            let order = arena.text(order).unwrap_or("not a string");
            if !dtype.set_order(order) && dtype.kind != Kind::Object {
                return Err(format!("the byte order is `{}`", order.escape_debug()));
            }
            Object::Dtype(dtype)
        }
        _ => return Err("only arrays and dtypes are built".into()),
    };
    *arena.get_mut(id) = built;
    Ok(())
}

/// The items of a tuple that is as short as those of constructors are; long ones are not copied.
fn parts<'a>(arena: &Arena<'a>, tuple: Node<'a>) -> Option<Vec<Node<'a>>> {
    arena.tuple(tuple).filter(|items| items.len() <= 16).map(<[_]>::to_vec)
}

/// The bytes that Python 3 wrote as Latin-1 text.
fn encode<'a>(arena: &mut Arena<'a>, text: Node<'a>, at: usize) -> Result<Node<'a>, Reason> {
    let text = arena.text(text).ok_or("encodes what is not a string")?;
    if text.len() > arena.encodable() {
        return Err("encodes shared strings to more than the pickle holds".into());
    }
    let bytes = latin1(text).ok_or("a character is not in Latin-1")?;
    Ok(arena.add_encoded(bytes, at))
}

/// The dtype called `name`, in native (little-endian) order until it is built.
fn named_dtype<'a>(arena: &Arena<'a>, name: Node<'a>) -> Result<Dtype, Reason> {
    let name = arena.text(name).ok_or("the name of a dtype is not a string")?;
    let is_text = |dtype: &Dtype| matches!(dtype.kind, Kind::Text(_) | Kind::Bytes(_));
    Dtype::parse(name).filter(|dtype| !is_text(dtype)).ok_or_else(|| {
        let shown: String = name.chars().take(40).collect();
        format!("dtype `{}` is not read", shown.escape_debug())
    })
}

/// An array's state; the length of its bytes is checked here, before anything is allocated.
fn array<'a>(
    arena: &Arena<'a>,
    shape: Node<'a>,
    dtype: Node<'a>,
    fortran_order: bool,
    data: Node<'a>,
) -> Result<Array<'a>, Reason> {
    let axis = |node: &Node<'_>| match *node {
        Node::Int(len) => usize::try_from(len).ok(),
        _ => None,
    };
    let shape = arena
        .tuple(shape)
        .filter(|axes| axes.len() <= MAX_DIMENSIONS)
        .and_then(|axes| axes.iter().map(axis).collect::<Option<Vec<_>>>());
    let shape = shape.ok_or("the shape of an array is not a tuple of lengths")?;
    let dtype = dtype_of(arena, dtype)?;
    if dtype.kind != Kind::Object {
        let actual = arena.bytes(data).ok_or("the elements of an array are not bytes")?.len();
        let expected = n_elements(&shape).and_then(|n| n.checked_mul(dtype.kind.size()));
        if expected != Some(actual) {
            let name = dtype.kind.name();
            return Err(format!("an array of {shape:?} {name} cannot have {actual} bytes"));
        }
    }
    Ok(Array { shape, dtype, fortran_order, data })
}

/// One NumPy number as a plain one.
fn scalar<'a>(arena: &Arena<'a>, dtype: Node<'a>, data: Node<'a>) -> Result<Node<'a>, Reason> {
    let dtype = dtype_of(arena, dtype)?;
    let bytes = arena.bytes(data).ok_or("the value of a scalar is not bytes")?;
    let decoded = if bytes.len() == dtype.kind.size() { dtype.decode(bytes) } else { None };
    let node = match decoded {
        Some(Elements::Bool(values)) => Node::Bool(values[0]),
        Some(Elements::Int(values)) => Node::Int(values[0]),
        Some(Elements::F32(values)) => Node::Float(values[0].into()),
        Some(Elements::F64(values)) => Node::Float(values[0]),
        _ => return Err(format!("{} bytes are not a {}", bytes.len(), dtype.kind.name())),
    };
    Ok(node)
}

/// The dtype that a node is.
fn dtype_of<'a>(arena: &Arena<'a>, node: Node<'a>) -> Result<Dtype, Reason> {
    match node {
        Node::Object(id) => match arena.get(id) {
            Object::Dtype(dtype) => Ok(*dtype),
            _ => Err("not a dtype where one is needed".into()),
        },
        _ => Err("not a dtype where one is needed".into()),
    }
}
