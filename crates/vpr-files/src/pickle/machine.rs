//! The stack machine that a pickle is a program for, as far as programs that only build data go.

use std::collections::HashMap;

use super::{
    Refusal,
    cursor::Cursor,
    numpy,
    object::{Arena, Global, Name, Node, Object},
    scikit, text, torch,
};

/// Runs a pickle up to its STOP; returns its root and the objects made on the way.
pub(super) fn run(bytes: &[u8]) -> Result<(Node<'_>, Arena<'_>), Refusal> {
    run_whole(bytes, Dialect::NumPy)
}

/// The same of a pickle with estimators of scikit-learn.
pub(super) fn run_estimators(bytes: &[u8]) -> Result<(Node<'_>, Arena<'_>), Refusal> {
    run_whole(bytes, Dialect::Estimators)
}

fn run_whole(bytes: &[u8], dialect: Dialect) -> Result<(Node<'_>, Arena<'_>), Refusal> {
    let (root, machine) = Machine::new(bytes, dialect).run()?;
    match machine.cursor.left() {
        0 => Ok((root, machine.arena)),
        left => machine.refuse(format!("STOP: {left} bytes follow")),
    }
}

/// Runs the pickle of a PyTorch checkpoint that `bytes` begin with; returns its length as well.
pub(super) fn run_checkpoint(bytes: &[u8]) -> Result<(Node<'_>, Arena<'_>, usize), Refusal> {
    let (root, machine) = Machine::new(bytes, Dialect::Torch).run()?;
    let len = bytes.len() - machine.cursor.left();
    Ok((root, machine.arena, len))
}

/// Whose names may be called.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Dialect {
    NumPy,
    /// NumPy's and scikit-learn's.
    Estimators,
    /// NumPy's, scikit-learn's and PyTorch's.
    Torch,
}

struct Machine<'a> {
    cursor: Cursor<'a>,
    arena: Arena<'a>,
    stack: Vec<Node<'a>>,
    /// Stack heights at which MARK was seen.
    marks: Vec<usize>,
    memo: HashMap<u64, Node<'a>>,
    dialect: Dialect,
}

impl<'a> Machine<'a> {
    fn new(bytes: &'a [u8], dialect: Dialect) -> Self {
        Self {
            cursor: Cursor::new(bytes),
            arena: Arena::new(bytes.len()),
            stack: Vec::new(),
            marks: Vec::new(),
            memo: HashMap::new(),
            dialect,
        }
    }

    /// Runs to STOP.
    fn run(mut self) -> Result<(Node<'a>, Self), Refusal> {
        loop {
            match self.cursor.opcode()? {
                b'.' => return self.stop(),
                code => self.step(code)?,
            }
        }
    }

    fn step(&mut self, code: u8) -> Result<(), Refusal> {
        match code {
            0x80 => self.protocol(),
            0x95 => self.frame(),
            b'(' => {
                self.marks.push(self.stack.len());
                Ok(())
            }
            b'N' => self.push(Node::None),
            0x88 => self.push(Node::Bool(true)),
            0x89 => self.push(Node::Bool(false)),
            b'I' | b'L' | b'J' | b'K' | b'M' | 0x8a | 0x8b | b'F' | b'G' => self.number(code),
            b'S' | b'T' | b'U' | b'B' | b'C' | 0x8e | 0x96 => self.bytes(code),
            b'V' | b'X' | 0x8c | 0x8d => self.text(code),
            b']' | b'l' | b'}' | b'd' | b')' | b't' | 0x85..=0x87 => self.container(code),
            b'a' | b'e' | b's' | b'u' => self.extend(code),
            b'p' | b'q' | b'r' | 0x94 => self.put(code),
            b'g' | b'h' | b'j' => self.get(code),
            b'c' | 0x93 => self.global(code),
            b'R' => self.reduce(),
            b'b' => self.build(),
            b'Q' if self.dialect == Dialect::Torch => self.persistent(),
            0x81 if self.dialect != Dialect::NumPy => self.new_object(),
            _ => {
                self.cursor.refuse(format!("opcode 0x{code:02x}{} is not read", opcode_name(code)))
            }
        }
    }

    fn stop(mut self) -> Result<(Node<'a>, Self), Refusal> {
        let root = self.pop()?;
        if !self.stack.is_empty() || !self.marks.is_empty() {
            return self.refuse("STOP: more than one object is left");
        }
        Ok((root, self))
    }

    fn protocol(&mut self) -> Result<(), Refusal> {
        match self.cursor.array()? {
            [0..=5] => Ok(()),
            [protocol] => self.refuse(format!("PROTO: protocol {protocol} is not known")),
        }
    }

    /// A frame only promises that its bytes follow.
    fn frame(&mut self) -> Result<(), Refusal> {
        let len = u64::from_le_bytes(self.cursor.array()?);
        let left = self.cursor.left();
        if usize::try_from(len).is_ok_and(|len| len <= left) {
            return Ok(());
        }
        self.refuse(format!("FRAME: of {len} bytes, only {left} follow"))
    }

    fn number(&mut self, code: u8) -> Result<(), Refusal> {
        let node = match code {
            b'K' => Node::Int(i64::from(self.cursor.array::<1>()?[0])),
            b'M' => Node::Int(u16::from_le_bytes(self.cursor.array()?).into()),
            b'J' => Node::Int(i32::from_le_bytes(self.cursor.array()?).into()),
            b'G' => Node::Float(f64::from_be_bytes(self.cursor.array()?)),
            0x8a | 0x8b => {
                let len = match code {
                    0x8a => u64::from(self.cursor.array::<1>()?[0]),
                    _ => u32::from_le_bytes(self.cursor.array()?).into(),
                };
                Node::Int(self.long(len)?)
            }
            b'F' => {
                let line = self.cursor.ascii_line()?;
                match line.parse() {
                    Ok(value) => Node::Float(value),
                    Err(_) => return self.refuse("FLOAT: not a number"),
                }
            }
            _ => match self.cursor.ascii_line()? {
                "00" if code == b'I' => Node::Bool(false),
                "01" if code == b'I' => Node::Bool(true),
                line => match line.strip_suffix('L').unwrap_or(line).parse() {
                    Ok(value) => Node::Int(value),
                    Err(_) => return self.refuse("INT: not an integer of 64 bits"),
                },
            },
        };
        self.push(node)
    }

    /// A little-endian two's complement integer of `len` bytes.
    fn long(&mut self, len: u64) -> Result<i64, Refusal> {
        let bytes = self.cursor.take(len)?;
        if bytes.len() > 8 {
            return self.refuse("LONG: does not fit 64 bits");
        }
        let negative = bytes.last().is_some_and(|&byte| byte >= 0x80);
        let mut value = [if negative { 0xff } else { 0 }; 8];
        value[..bytes.len()].copy_from_slice(bytes);
        Ok(i64::from_le_bytes(value))
    }

    fn bytes(&mut self, code: u8) -> Result<(), Refusal> {
        if code == b'S' {
            let line = self.cursor.line()?;
            return match text::unescape_literal(line) {
                Some(bytes) => self.make(Object::Bytes(bytes)),
                None => self.refuse("STRING: not a string literal"),
            };
        }
        let len = match code {
            b'U' | b'C' => self.length_1()?,
            0x8e | 0x96 => u64::from_le_bytes(self.cursor.array()?),
            _ => self.length_4()?,
        };
        let bytes = self.cursor.take(len)?;
        self.push(Node::Bytes(bytes))
    }

    fn text(&mut self, code: u8) -> Result<(), Refusal> {
        if code == b'V' {
            let line = self.cursor.line()?;
            return match text::unescape_unicode(line) {
                Some(text) => self.make(Object::Text(text)),
                None => self.refuse("UNICODE: malformed escape"),
            };
        }
        let len = match code {
            0x8c => self.length_1()?,
            0x8d => u64::from_le_bytes(self.cursor.array()?),
            _ => self.length_4()?,
        };
        match std::str::from_utf8(self.cursor.take(len)?) {
            Ok(text) => self.push(Node::Text(text)),
            Err(_) => self.refuse("UNICODE: not UTF-8"),
        }
    }

    fn container(&mut self, code: u8) -> Result<(), Refusal> {
        let object = match code {
            b']' => Object::List(Vec::new()),
            b'}' => Object::Dict(Vec::new()),
            b')' => Object::Tuple(Vec::new()),
            b'l' => Object::List(self.pop_to_mark()?),
            b't' => Object::Tuple(self.pop_to_mark()?),
            b'd' => Object::Dict(self.pop_pairs()?),
            _ => Object::Tuple(self.pop_last(usize::from(code - 0x84))?),
        };
        self.make(object)
    }

    /// APPEND, APPENDS, SETITEM and SETITEMS.
    fn extend(&mut self, code: u8) -> Result<(), Refusal> {
        let items = match code {
            b'a' => self.pop_last(1)?,
            b's' => self.pop_last(2)?,
            b'e' => self.pop_to_mark()?,
            _ => self.pop_pairs()?,
        };
        let to_list = matches!(code, b'a' | b'e');
        let Node::Object(id) = self.top()? else {
            return self.refuse("adds to what holds nothing");
        };
        match self.arena.get_mut(id) {
            Object::List(list) if to_list => list.extend(items),
            Object::Dict(dict) if !to_list => dict.extend(items),
            Object::Inert => {}
            _ => return self.refuse("adds to an object of another kind"),
        }
        Ok(())
    }

    fn put(&mut self, code: u8) -> Result<(), Refusal> {
        let key = match code {
            b'p' => self.text_key()?,
            b'q' => self.length_1()?,
            b'r' => self.length_4()?,
            _ => self.memo.len() as u64,
        };
        let node = self.top()?;
        self.memo.insert(key, node);
        Ok(())
    }

    fn get(&mut self, code: u8) -> Result<(), Refusal> {
        let key = match code {
            b'g' => self.text_key()?,
            b'h' => self.length_1()?,
            _ => self.length_4()?,
        };
        match self.memo.get(&key) {
            Some(&node) => self.push(node),
            None => self.refuse(format!("GET: nothing was stored under {key}")),
        }
    }

    fn global(&mut self, code: u8) -> Result<(), Refusal> {
        let found = if code == b'c' {
            let names = (self.cursor.ascii_line()?, self.cursor.ascii_line()?);
            self.lookup(names.0, names.1).ok_or_else(|| shown(names.0, names.1))
        } else {
            let (name, module) = (self.pop()?, self.pop()?);
            match (self.arena.text(module), self.arena.text(name)) {
                (Some(module), Some(name)) => {
                    self.lookup(module, name).ok_or_else(|| shown(module, name))
                }
                _ => return self.refuse("STACK_GLOBAL: a name is not a string"),
            }
        };
        match found {
            Ok(global) => self.push(Node::Global(global)),
            Err(name) => {
                self.refuse(format!("GLOBAL: `{name}` is not on the list of what is read"))
            }
        }
    }

    fn lookup(&self, module: &str, name: &str) -> Option<Global> {
        let torch = || torch::global(module, name).map(Global::Torch);
        let scikit = || scikit::global(module, name);
        let others = || match self.dialect {
            Dialect::NumPy => None,
            Dialect::Estimators => scikit(),
            Dialect::Torch => torch().or_else(scikit),
        };
        numpy::global(module, name).or_else(others)
    }

    /// Sets the state of an object; of a dictionary or of settings it is not kept.
    fn build(&mut self) -> Result<(), Refusal> {
        let state = self.pop()?;
        let target = self.top()?;
        if let Node::Object(id) = target
            && self.dialect != Dialect::NumPy
        {
            match self.arena.get(id) {
                Object::Dict(_) | Object::Inert => return Ok(()),
                Object::Record { .. } => {
                    let built = scikit::build(&mut self.arena, id, state);
                    return built.or_else(|reason| self.refuse(format!("BUILD: {reason}")));
                }
                _ => {}
            }
        }
        numpy::build(&mut self.arena, target, state).or_else(|reason| self.refuse(reason))
    }

    /// BINPERSID, a storage.
    fn persistent(&mut self) -> Result<(), Refusal> {
        let argument = self.pop()?;
        match torch::persistent(&self.arena, argument) {
            Ok(object) => self.make(object),
            Err(reason) => self.refuse(format!("BINPERSID: {reason}")),
        }
    }

    /// NEWOBJ, settings or an estimator.
    fn new_object(&mut self) -> Result<(), Refusal> {
        let (arguments, class) = (self.pop()?, self.pop()?);
        let made = match class {
            Node::Global(Global::Torch(Name::Inert)) => Ok(Object::Inert),
            Node::Global(Global::Estimator(class)) => scikit::new(&self.arena, class, arguments),
            _ => Err("makes what is not on the list".to_owned()),
        };
        match made {
            Ok(object) => self.make(object),
            Err(reason) => self.refuse(format!("NEWOBJ: {reason}")),
        }
    }

    fn reduce(&mut self) -> Result<(), Refusal> {
        let (arguments, function) = (self.pop()?, self.pop()?);
        let Node::Global(function) = function else {
            return self.refuse("REDUCE: calls what is not a function");
        };
        let at = self.cursor.opcode_at();
        let made = match function {
            Global::Torch(name) => torch::reduce(&mut self.arena, name, arguments, at),
            Global::DefaultDict => Ok(self.arena.add(Object::Dict(Vec::new()), at)),
            Global::Reconstructor => match scikit::reconstructed(&self.arena, arguments) {
                Ok(object) => Ok(self.arena.add(object, at)),
                Err(reason) => Err(reason),
            },
            function => numpy::reduce(&mut self.arena, function, arguments, at),
        };
        match made {
            Ok(node) => self.push(node),
            Err(reason) => self.refuse(format!("REDUCE: {reason}")),
        }
    }
}

/// Short forms of what several opcodes need.
impl<'a> Machine<'a> {
    fn refuse<T>(&self, reason: impl Into<String>) -> Result<T, Refusal> {
        self.cursor.refuse(reason)
    }

    #[expect(clippy::unnecessary_wraps, reason = "ends the arms of `step`")]
    fn push(&mut self, node: Node<'a>) -> Result<(), Refusal> {
        self.stack.push(node);
        Ok(())
    }

    fn make(&mut self, object: Object<'a>) -> Result<(), Refusal> {
        let node = self.arena.add(object, self.cursor.opcode_at());
        self.push(node)
    }

    /// Where the part of the stack begins that the current opcode may touch.
    fn floor(&self) -> usize {
        self.marks.last().copied().unwrap_or(0)
    }

    fn top(&self) -> Result<Node<'a>, Refusal> {
        match self.stack[self.floor()..].last() {
            Some(&node) => Ok(node),
            None => self.refuse("the stack is empty"),
        }
    }

    fn pop(&mut self) -> Result<Node<'a>, Refusal> {
        let node = self.top()?;
        self.stack.pop();
        Ok(node)
    }

    fn pop_last(&mut self, n_nodes: usize) -> Result<Vec<Node<'a>>, Refusal> {
        if self.stack.len() - self.floor() < n_nodes {
            return self.refuse("the stack is empty");
        }
        Ok(self.stack.split_off(self.stack.len() - n_nodes))
    }

    fn pop_to_mark(&mut self) -> Result<Vec<Node<'a>>, Refusal> {
        match self.marks.pop() {
            Some(height) => {
                Ok(self.stack[height..].to_vec()).inspect(|_| self.stack.truncate(height))
            }
            None => self.refuse("there is no mark"),
        }
    }

    /// Keys and values in turns.
    fn pop_pairs(&mut self) -> Result<Vec<Node<'a>>, Refusal> {
        let items = self.pop_to_mark()?;
        if items.len() % 2 == 0 { Ok(items) } else { self.refuse("a key without a value") }
    }

    fn length_1(&mut self) -> Result<u64, Refusal> {
        Ok(u64::from(self.cursor.array::<1>()?[0]))
    }

    fn length_4(&mut self) -> Result<u64, Refusal> {
        Ok(u32::from_le_bytes(self.cursor.array()?).into())
    }

    fn text_key(&mut self) -> Result<u64, Refusal> {
        match self.cursor.ascii_line()?.parse() {
            Ok(key) => Ok(key),
            Err(_) => self.refuse("the key of the memo is not a number"),
        }
    }
}

/// A name as messages show it: escaped, and no longer than a line.
fn shown(module: &str, name: &str) -> String {
    let shown: String = format!("{module}.{name}").chars().take(80).collect();
    shown.escape_debug().to_string()
}

/// The names of the opcodes that can do harm, or that programs other than NumPy write.
fn opcode_name(code: u8) -> &'static str {
    match code {
        b'i' => " (INST)",
        b'o' => " (OBJ)",
        0x81 => " (NEWOBJ)",
        0x92 => " (NEWOBJ_EX)",
        b'P' | b'Q' => " (PERSID)",
        0x82..=0x84 => " (EXT)",
        0x8f..=0x91 => " (SET)",
        0x97 | 0x98 => " (BUFFER)",
        b'0' | b'1' | b'2' => " (POP or DUP)",
        _ => "",
    }
}
