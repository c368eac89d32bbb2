//! How good a retrieval is: free functions over slices, like scikit-learn's.

mod recall;

pub use recall::recall_at;
