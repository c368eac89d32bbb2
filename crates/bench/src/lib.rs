//! VPR-Bench, chapter 3 of the thesis: techniques × datasets × metrics, invariance and cost.
//!
//! ```
//! use bench::evaluate::{Evaluation, Positives};
//! use ndarray::array;
//! use vpr_core::{GroundTruth, Similarities};
//!
//! // Two queries, three references; higher is more similar.
//! let similarities = Similarities::new(array![[0.9, 0.2, 0.1], [0.3, 0.1, 0.4]])?;
//! let truth = GroundTruth::from_lists(vec![vec![0], vec![1]], 3)?;
//!
//! let evaluation = Evaluation::new(&similarities, &truth)?;
//! assert_eq!(evaluation.recall_at(1)?, 0.5);
//! assert_eq!(evaluation.auc_pr(Positives::Published)?, 1.0); // the right match is the surer one
//! assert_eq!(evaluation.auc_pr(Positives::corrected(&truth))?, 0.5);
//! # Ok::<(), vpr_core::Error>(())
//! ```

pub mod data;
pub mod evaluate;
pub mod study;
pub mod technique;
