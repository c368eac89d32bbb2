//! Descriptors that are strings of bits.

use vpr_core::{Error, Result};

/// One string of bits per row, all of the same number of bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BinaryDescriptors {
    row_bytes: usize,
    bytes: Vec<u8>,
}

impl BinaryDescriptors {
    /// Wraps rows of `row_bytes` bytes that follow each other.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] if `row_bytes` is zero, [`Error::Mismatch`] if the last row is incomplete.
    pub fn new(row_bytes: usize, bytes: Vec<u8>) -> Result<Self> {
        if row_bytes == 0 {
            let value = "0".to_owned();
            return Err(Error::Parameter {
                name: "row_bytes",
                value,
                reason: "must be at least 1",
            });
        }
        if !bytes.len().is_multiple_of(row_bytes) {
            return Err(Error::Mismatch {
                what: "bytes of whole binary descriptors",
                expected: bytes.len().next_multiple_of(row_bytes),
                actual: bytes.len(),
            });
        }
        Ok(Self { row_bytes, bytes })
    }

    /// Number of descriptors.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bytes.len() / self.row_bytes
    }

    /// Whether there is no descriptor.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Bytes of one descriptor.
    #[must_use]
    pub fn row_bytes(&self) -> usize {
        self.row_bytes
    }

    /// The bits of one keypoint.
    ///
    /// # Panics
    ///
    /// If `index` is not below [`Self::len`].
    #[must_use]
    pub fn row(&self, index: usize) -> &[u8] {
        &self.bytes[index * self.row_bytes..(index + 1) * self.row_bytes]
    }

    pub(super) fn select(&self, indices: &[usize]) -> Self {
        let bytes = indices.iter().flat_map(|&index| self.row(index).iter().copied()).collect();
        Self { row_bytes: self.row_bytes, bytes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_must_be_whole() {
        assert!(BinaryDescriptors::new(0, Vec::new()).is_err());
        let error = BinaryDescriptors::new(4, vec![0; 6]).unwrap_err().to_string();
        assert_eq!(error, "bytes of whole binary descriptors: expected 8, got 6");
        assert_eq!(BinaryDescriptors::new(4, vec![0; 8]).unwrap().len(), 2);
    }
}
