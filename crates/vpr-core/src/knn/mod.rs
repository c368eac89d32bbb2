//! Exact nearest neighbours over rows in memory or on disk, and smaller rows that lead to them.

mod encoding;
mod rows;

pub use encoding::{Int8Row, decode_f16, decode_int8, encode_f16, encode_int8};
pub use rows::{RowSource, row};
