//! Accept or reject.

use serde::{Serialize, Serializer};

/// The smallest uncertainty at which a match is rejected.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Threshold(f64);

impl Serialize for Threshold {
    /// A number, or `"everything"` or `"nothing"` if that is what is accepted.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            f64::INFINITY => serializer.serialize_str("everything"),
            f64::NEG_INFINITY => serializer.serialize_str("nothing"),
            limit => serializer.serialize_f64(limit),
        }
    }
}

impl Threshold {
    /// Rejects every match.
    pub const NOTHING: Self = Self(f64::NEG_INFINITY);

    /// Accepts uncertainties **below** `limit`, which may be infinite but not NaN.
    ///
    /// # Errors
    ///
    /// [`vpr_core::Error::Parameter`] for NaN.
    pub fn below(limit: f64) -> crate::Result<Self> {
        if limit.is_nan() {
            let reason = "must be a number";
            let value = limit.to_string();
            return Err(vpr_core::Error::Parameter { name: "threshold", value, reason }.into());
        }
        Ok(Self(limit))
    }

    /// The uncertainty that is just rejected.
    #[must_use]
    pub fn limit(self) -> f64 {
        self.0
    }

    /// Whether a match of this uncertainty is accepted; NaN is not.
    #[must_use]
    pub fn accepts(self, uncertainty: f64) -> bool {
        uncertainty < self.0
    }
}
