//! Fields of a protobuf message, one after the other; every length is checked against what is left.

use crate::Refusal;

/// One field of a message.
pub(super) struct Field<'a> {
    /// Its number in the schema.
    pub(super) number: u64,
    /// Offset of its tag in the file.
    pub(super) at: usize,
    /// What it holds.
    pub(super) value: Value<'a>,
}

/// What a field holds, as far as its bytes say.
#[derive(Clone, Copy)]
pub(super) enum Value<'a> {
    /// A number of variable length.
    Varint(u64),
    /// Four bytes.
    Fixed32([u8; 4]),
    /// Eight bytes.
    Fixed64([u8; 8]),
    /// A text, a message, or packed numbers.
    Bytes(Message<'a>),
}

/// A run of bytes that knows where in the file it lies.
#[derive(Clone, Copy)]
pub(super) struct Message<'a> {
    pub(super) bytes: &'a [u8],
    /// Offset of its first byte in the file.
    start: usize,
    next: usize,
}

impl<'a> Message<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, start: 0, next: 0 }
    }

    /// The next field; `None` at the end.
    pub(super) fn field(&mut self) -> Result<Option<Field<'a>>, Refusal> {
        if self.next == self.bytes.len() {
            return Ok(None);
        }
        let at = self.start + self.next;
        let refuse = |reason: String| Err(Refusal { offset: at, reason });
        let tag = self.varint(at)?;
        let value = match tag & 7 {
            0 => Value::Varint(self.varint(at)?),
            1 => Value::Fixed64(self.array(at)?),
            2 => {
                let len = self.varint(at)?;
                let start = self.start + self.next;
                Value::Bytes(Message { bytes: self.take(len, at)?, start, next: 0 })
            }
            5 => Value::Fixed32(self.array(at)?),
            other => return refuse(format!("wire type {other} is not read")),
        };
        match tag >> 3 {
            0 => refuse("field number 0".to_owned()),
            number => Ok(Some(Field { number, at, value })),
        }
    }

    /// All as numbers of variable length, as packed fields hold them.
    pub(super) fn varints(mut self, mut each: impl FnMut(u64)) -> Result<(), Refusal> {
        while self.next < self.bytes.len() {
            let at = self.start + self.next;
            each(self.varint(at)?);
        }
        Ok(())
    }

    fn varint(&mut self, at: usize) -> Result<u64, Refusal> {
        let mut value = 0_u64;
        for shift in (0..64).step_by(7) {
            let [byte] = self.array(at)?;
            let part = u64::from(byte & 0x7f);
            if shift == 63 && part > 1 {
                break;
            }
            value |= part << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(Refusal { offset: at, reason: "a number is longer than 64 bits".to_owned() })
    }

    fn array<const N: usize>(&mut self, at: usize) -> Result<[u8; N], Refusal> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N as u64, at)?);
        Ok(array)
    }

    fn take(&mut self, len: u64, at: usize) -> Result<&'a [u8], Refusal> {
        let left = self.bytes.len() - self.next;
        match usize::try_from(len) {
            Ok(len) if len <= left => {
                let taken = &self.bytes[self.next..self.next + len];
                self.next += len;
                Ok(taken)
            }
            _ => {
                let reason = format!("needs {len} bytes, only {left} follow");
                Err(Refusal { offset: at, reason })
            }
        }
    }
}
