//! Exact nearest neighbours over rows in memory or on disk, and smaller rows that lead to them.

#[cfg(feature = "approximate")]
mod approximate;
mod block;
mod compact;
mod encoding;
mod exact;
mod margin;
mod metric;
mod nearest;
mod pca;
mod rescore;
mod row_lengths;
mod rows;
mod selected;
mod shortlist;
mod single;

#[cfg(feature = "approximate")]
pub use approximate::{Hnsw, HnswCodes, HnswParams, MeasuredRecall};
pub use compact::{F16Rows, Int8Rows, SignRows};
pub use encoding::{Int8Row, decode_f16, decode_int8, encode_f16, encode_int8};
pub use exact::{SearchParams, search};
pub use metric::Metric;
pub use nearest::nearest;
pub use pca::{Pca, PcaParams};
pub use rescore::{Coarse, rescore, search_rescored};
pub use row_lengths::RowLengths;
pub use rows::{RowSource, row};
pub use selected::{PositionIndex, Selected, search_among};
