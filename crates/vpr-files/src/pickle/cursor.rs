//! Walks over the bytes of a pickle; every read is checked against what is left.

use super::Refusal;

/// A position in the input, with the start of the current opcode for messages.
pub(super) struct Cursor<'a> {
    bytes: &'a [u8],
    next: usize,
    opcode_at: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, next: 0, opcode_at: 0 }
    }

    /// Reads an opcode and remembers where it stood.
    pub(super) fn opcode(&mut self) -> Result<u8, Refusal> {
        self.opcode_at = self.next;
        let [code] = self.array()?;
        Ok(code)
    }

    /// Offset of the current opcode.
    pub(super) fn opcode_at(&self) -> usize {
        self.opcode_at
    }

    /// How many bytes follow.
    pub(super) fn left(&self) -> usize {
        self.bytes.len() - self.next
    }

    /// A refusal at the current opcode.
    pub(super) fn refuse<T>(&self, reason: impl Into<String>) -> Result<T, Refusal> {
        Err(Refusal { offset: self.opcode_at, reason: reason.into() })
    }

    /// The next `len` bytes; `len` is whatever the file says.
    pub(super) fn take(&mut self, len: u64) -> Result<&'a [u8], Refusal> {
        let left = self.left();
        match usize::try_from(len) {
            Ok(len) if len <= left => {
                let taken = &self.bytes[self.next..self.next + len];
                self.next += len;
                Ok(taken)
            }
            _ => self.refuse(format!("needs {len} bytes, only {left} follow")),
        }
    }

    /// The next `N` bytes, as an array.
    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], Refusal> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N as u64)?);
        Ok(array)
    }

    /// The bytes up to the next line feed, which is consumed but not returned.
    pub(super) fn line(&mut self) -> Result<&'a [u8], Refusal> {
        let rest = &self.bytes[self.next..];
        match rest.iter().position(|&byte| byte == b'\n') {
            Some(len) => {
                self.next += len + 1;
                Ok(&rest[..len])
            }
            None => self.refuse("the line does not end"),
        }
    }

    /// A line of ASCII text, as numbers and names of protocol 0 are.
    pub(super) fn ascii_line(&mut self) -> Result<&'a str, Refusal> {
        let line = self.line()?;
        match std::str::from_utf8(line) {
            Ok(text) if text.is_ascii() => Ok(text),
            _ => self.refuse("the line is not ASCII text"),
        }
    }
}
