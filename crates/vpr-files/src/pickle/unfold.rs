//! Turns the machine's objects into a tree of values, within bounds of depth and size.

use super::{
    Elements, Refusal, Value,
    object::{Arena, Array, Global, Name, Node, Object},
};
use crate::dtype::{Dtype, Kind, n_elements};

/// How deeply objects may be nested; the published files need five levels.
pub const MAX_DEPTH: usize = 32;

/// How many times as many bytes and objects as the pickle has bytes its values may hold.
///
/// Without sharing they hold fewer than one per byte, since every object takes an opcode.
pub const MAX_EXPANSION: usize = 4;

/// The value that `root` is, in a pickle of `n_bytes`.
pub(super) fn unfold(root: Node<'_>, arena: &Arena<'_>, n_bytes: usize) -> Result<Value, Refusal> {
    let budget = n_bytes.saturating_mul(MAX_EXPANSION).saturating_add(64);
    Unfolder { arena, budget }.value(root, 0, 0)
}

struct Unfolder<'s, 'a> {
    arena: &'s Arena<'a>,
    /// How many more bytes and objects there may be.
    budget: usize,
}

impl<'a> Unfolder<'_, 'a> {
    /// One value; `parent` is the object it is part of, for messages.
    fn value(&mut self, node: Node<'a>, parent: usize, depth: usize) -> Result<Value, Refusal> {
        Ok(match node {
            Node::None | Node::Global(Global::Torch(Name::Inert)) => {
                self.spend(1, parent, Value::None)?
            }
            Node::Bool(value) => self.spend(1, parent, Value::Bool(value))?,
            Node::Int(value) => self.spend(1, parent, Value::Int(value))?,
            Node::Float(value) => self.spend(1, parent, Value::Float(value))?,
            Node::Bytes(bytes) => {
                self.spend(bytes.len(), parent, ())?;
                Value::Bytes(bytes.to_vec())
            }
            Node::Text(text) => {
                self.spend(text.len(), parent, ())?;
                Value::Text(text.to_owned())
            }
            Node::Global(global) => {
                let reason = format!("{global:?} is a function, not data");
                return Err(Refusal { offset: 0, reason });
            }
            Node::Object(id) => self.object(id, depth + 1)?,
        })
    }

    fn object(&mut self, id: usize, depth: usize) -> Result<Value, Refusal> {
        if depth > MAX_DEPTH {
            return self.arena.refuse(id, format!("nested more than {MAX_DEPTH} levels deep"));
        }
        let arena = self.arena;
        self.spend(1, id, ())?;
        Ok(match arena.get(id) {
            Object::List(items) => Value::List(self.values(items, id, depth)?),
            Object::Tuple(items) => Value::Tuple(self.values(items, id, depth)?),
            Object::Dict(items) => {
                let mut values = self.values(items, id, depth)?.into_iter();
                let pairs = std::iter::from_fn(|| Some((values.next()?, values.next()?)));
                Value::Dict(pairs.collect())
            }
            Object::Bytes(bytes) => {
                self.spend(bytes.len(), id, ())?;
                Value::Bytes(bytes.clone())
            }
            Object::Text(text) => {
                self.spend(text.len(), id, ())?;
                Value::Text(text.clone())
            }
            Object::Dtype(_) => return arena.refuse(id, "a dtype is not data"),
            Object::Array(None) => return arena.refuse(id, "the array has no state"),
            Object::Array(Some(array)) => self.array(array, id, depth)?,
            Object::Storage { .. } => return arena.refuse(id, "a storage is not data"),
            Object::Tensor(tensor) => {
                self.spend(tensor.storage.len() + 2 * tensor.shape.len(), id, ())?;
                Value::Tensor(tensor.clone())
            }
            Object::Record { fields: None, .. } => {
                return arena.refuse(id, "the estimator has no fields");
            }
            Object::Record { class, fields: Some(fields) } => {
                self.spend(class.len(), id, ())?;
                let Value::Dict(fields) = self.object(*fields, depth + 1)? else {
                    return arena.refuse(id, "the fields of an estimator are not a dict");
                };
                Value::Record { class: (*class).to_owned(), fields }
            }
            Object::Inert => Value::None,
        })
    }

    fn values(
        &mut self,
        nodes: &[Node<'a>],
        id: usize,
        depth: usize,
    ) -> Result<Vec<Value>, Refusal> {
        // Checked as a whole before the vector is allocated.
        self.spend(nodes.len(), id, ())?;
        self.budget += nodes.len();
        nodes.iter().map(|&node| self.value(node, id, depth)).collect()
    }

    fn array(&mut self, array: &Array<'a>, id: usize, depth: usize) -> Result<Value, Refusal> {
        let Array { shape, dtype, fortran_order, data } = array;
        let elements = if dtype.kind == Kind::Object {
            // The list is in C order whatever the flag says: NumPy writes it by iterating.
            let Node::Object(list) = *data else {
                return self.arena.refuse(id, "the elements of an object array are not a list");
            };
            let Object::List(items) = self.arena.get(list) else {
                return self.arena.refuse(id, "the elements of an object array are not a list");
            };
            if n_elements(shape) != Some(items.len()) {
                let reason = format!("an array of {shape:?} objects cannot have {}", items.len());
                return self.arena.refuse(id, reason);
            }
            Elements::Object(self.values(items, id, depth)?)
        } else {
            self.numbers(*dtype, shape, *fortran_order, *data, id)?
        };
        self.spend(shape.len(), id, ())?;
        Ok(Value::Array { shape: shape.clone(), elements })
    }

    /// The elements of an array of numbers, brought into C order.
    fn numbers(
        &mut self,
        dtype: Dtype,
        shape: &[usize],
        fortran_order: bool,
        data: Node<'a>,
        id: usize,
    ) -> Result<Elements, Refusal> {
        let arena = self.arena;
        let Some(bytes) = arena.bytes(data) else {
            return arena.refuse(id, "the elements of an array are not bytes");
        };
        self.spend(bytes.len(), id, ())?;
        let decoded = if fortran_order && shape.len() > 1 {
            match c_order(bytes, shape, dtype.kind.size()) {
                Some(bytes) => dtype.decode(&bytes),
                None => {
                    return arena.refuse(id, "a Fortran-ordered array of more than 2 dimensions");
                }
            }
        } else {
            dtype.decode(bytes)
        };
        match decoded {
            Some(elements) => Ok(elements),
            None => arena.refuse(id, "an integer does not fit 64 bits with sign"),
        }
    }

    /// Takes `amount` from the budget and hands `value` on.
    fn spend<T>(&mut self, amount: usize, id: usize, value: T) -> Result<T, Refusal> {
        match self.budget.checked_sub(amount) {
            Some(left) => {
                self.budget = left;
                Ok(value)
            }
            None => self.arena.refuse(
                id,
                format!("shared objects expand to more than {MAX_EXPANSION} times the pickle"),
            ),
        }
    }
}

/// A matrix in Fortran order, rearranged; `None` if it has not two dimensions.
fn c_order(bytes: &[u8], shape: &[usize], size: usize) -> Option<Vec<u8>> {
    let &[n_rows, n_columns] = shape else { return None };
    let mut out = Vec::with_capacity(bytes.len());
    for row in 0..n_rows {
        for column in 0..n_columns {
            let at = (column * n_rows + row) * size;
            out.extend_from_slice(bytes.get(at..at + size)?);
        }
    }
    Some(out)
}
