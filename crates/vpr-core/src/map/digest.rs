//! Digests: which bytes a block had when it was written, which images a map was made of.

use std::fmt::Write as _;

use sha2::{Digest as _, Sha256};

/// Digest of a block of bytes: XXH3, 128 bits, which finds damage but is no signature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockDigest([u8; Self::LENGTH]);

impl BlockDigest {
    /// Bytes of one digest in a file.
    pub const LENGTH: usize = 16;

    /// The digest of these bytes.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        Self(xxhash_rust::xxh3::xxh3_128(bytes).to_be_bytes())
    }

    /// The digest as stored in a file.
    #[must_use]
    pub fn to_bytes(self) -> [u8; Self::LENGTH] {
        self.0
    }

    /// As 32 hexadecimal digits, the way `xxh128sum` and Python's `xxhash` print it.
    #[must_use]
    pub fn to_hex(self) -> String {
        hex(&self.0)
    }
}

/// Digest of a list of image names: SHA-256 over every name followed by a line feed.
///
/// The same as `sha256sum` of a text file with one name per line.
#[must_use]
pub fn image_list_digest<S: AsRef<str>>(names: &[S]) -> String {
    let mut digest = Sha256::new();
    for name in names {
        digest.update(name.as_ref());
        digest.update(b"\n");
    }
    format!("sha256:{}", hex(&digest.finalize()))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("writing to a string");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn block_digest_is_xxh3_128_of_the_reference_implementation() {
        assert_eq!(BlockDigest::of(b"").to_hex(), "99aa06d3014798d86001c324468d497f");
    }

    #[test]
    fn image_list_digest_is_sha256_of_lines() {
        let expected = "sha256:ae991490ddec641f32c2a9283efe577e379738f1d9e0f6494f4a351af5293626";
        assert_eq!(image_list_digest(&["a.jpg", "b.jpg"]), expected);
        assert_ne!(image_list_digest(&["a.jpg", "b.jpg"]), image_list_digest(&["a.jpgb.jpg"]));
    }
}
