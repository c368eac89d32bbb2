//! How good a retrieval is: free functions over slices, like scikit-learn's.
//!
//! Most metrics see one evidence per query: `confidence`, how certain the technique is of its best
//! reference (higher is more certain), and `correct`, whether that reference is correct. Where the
//! released VPR-Bench differs from the thesis or from its own intent, [`Definition`] or an enum
//! with its variant names chooses between the two.
//!
//! A metric without a value for its input is an [`Error::Undefined`], never a NaN.
//!
//! ```
//! use vpr_core::metrics::{Positives, auc_pr, recall_at_precision};
//!
//! let confidence = [0.9, 0.8, 0.7, 0.6];
//! let correct = [true, true, false, true];
//! // Released VPR-Bench: recall is relative to the three correct matches, so it reaches 1.
//! let published = auc_pr(&confidence, &correct, Positives::Published)?;
//! // Five queries of the dataset had a correct reference.
//! let corrected = auc_pr(&confidence, &correct, Positives::Corrected { n_known: 5 })?;
//! assert!(corrected < published);
//! assert_eq!(recall_at_precision(1.0, &confidence, &correct, Positives::Corrected { n_known: 5 })?, 0.4);
//! # Ok::<(), vpr_core::Error>(())
//! ```
//!
//! [`Definition`]: crate::Definition
//! [`Error::Undefined`]: crate::Error::Undefined

mod area;
mod average;
mod binomial;
pub mod bootstrap;
pub mod catalogue;
mod correlation;
mod curve;
mod difference;
mod economy;
pub mod effective;
mod invariance;
mod many;
mod mcnemar;
mod median;
mod normal;
mod operating_point;
mod platform;
mod recall;
mod roc;
mod selective;
mod spacing;

pub use area::auc;
pub use average::mean_average_precision;
pub use binomial::LogFactorials;
pub use correlation::spearman;
pub use curve::{Positives, PrecisionRecall, auc_pr, average_precision, precision_recall_curve};
pub(crate) use difference::share_beyond_zero;
pub use difference::{Difference, paired_test};
pub use economy::{EncodingReference, Platform, RealTimeMatches, pcu, rmf};
pub use invariance::area_between_curves;
pub use many::holm;
pub use mcnemar::{Discordant, MOST_QUERIES, McNemar, Plan};
pub use median::median;
pub use operating_point::{
    accuracy, extended_precision, f1_curve, f1_max, precision_at_full_recall, recall_at_precision,
};
pub use platform::{SearchCost, Timing, required_fps, retrieval_time, speed_limit};
pub use recall::{PUBLISHED_RECALL_RANGE, recall_at, recall_curve};
pub use roc::{RocCurve, auc_roc, roc_curve, roc_positives};
pub use selective::{RiskCoverage, aurc, base_risk, excess_aurc, risk_coverage_curve};
pub use spacing::true_positive_spacing;
