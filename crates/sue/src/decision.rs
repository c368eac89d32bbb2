//! Accept or reject.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use vpr_core::Error;

/// The smallest uncertainty at which a match is rejected.
///
/// As text and in JSON it is a number, or `everything` or `nothing` if that is what is accepted.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct Threshold(f64);

const EVERYTHING: &str = "everything";
const NOTHING: &str = "nothing";

impl Threshold {
    /// Rejects every match.
    pub const NOTHING: Self = Self(f64::NEG_INFINITY);

    /// Accepts every match.
    pub const EVERYTHING: Self = Self(f64::INFINITY);

    /// Accepts uncertainties **below** `limit`, which may be infinite but not NaN.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for NaN.
    pub fn below(limit: f64) -> crate::Result<Self> {
        if limit.is_nan() {
            let reason = "must be a number";
            let value = limit.to_string();
            return Err(Error::Parameter { name: "threshold", value, reason }.into());
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

    /// What a person does with it.
    pub(crate) fn rule(self) -> String {
        match self {
            Self::EVERYTHING => "Accept every match".to_owned(),
            Self::NOTHING => "Accept no match".to_owned(),
            limit => format!("Accept uncertainties below {limit}"),
        }
    }
}

impl fmt::Display for Threshold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::EVERYTHING => f.write_str(EVERYTHING),
            Self::NOTHING => f.write_str(NOTHING),
            // All digits, with an exponent where there would be many zeros.
            Self(limit) => write!(f, "{limit:?}"),
        }
    }
}

impl FromStr for Threshold {
    type Err = crate::Error;

    /// Reads what [`fmt::Display`] writes.
    fn from_str(text: &str) -> crate::Result<Self> {
        match text {
            EVERYTHING => Ok(Self::EVERYTHING),
            NOTHING => Ok(Self::NOTHING),
            number => Self::below(number.parse().unwrap_or(f64::NAN)).map_err(|_| {
                let (value, reason) =
                    (number.to_owned(), "is no number, `everything` or `nothing`");
                Error::Parameter { name: "threshold", value, reason }.into()
            }),
        }
    }
}

impl Serialize for Threshold {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.0.is_infinite() {
            return serializer.collect_str(self);
        }
        serializer.serialize_f64(self.0)
    }
}

impl<'de> Deserialize<'de> for Threshold {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Form {
            Limit(f64),
            Word(String),
        }
        let parsed = match Form::deserialize(deserializer)? {
            Form::Limit(limit) => Self::below(limit),
            Form::Word(word) => word.parse(),
        };
        parsed.map_err(de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let limits = [0.5, 1.6e-201, -3.0, 1e300, f64::INFINITY, f64::NEG_INFINITY];
        for threshold in limits.map(Threshold) {
            assert_eq!(threshold.to_string().parse::<Threshold>().unwrap(), threshold);
            assert!(threshold.to_string().len() < 25, "{threshold}");
            let json = serde_json::to_string(&threshold).unwrap();
            assert_eq!(serde_json::from_str::<Threshold>(&json).unwrap(), threshold, "{json}");
        }
        assert_eq!(serde_json::from_str::<Threshold>("7").unwrap().limit(), 7.0);
        for wrong in ["", "all", "NaN", "1,5"] {
            assert!(wrong.parse::<Threshold>().is_err(), "{wrong}");
        }
        assert!(serde_json::from_str::<Threshold>("\"some\"").is_err());
    }
}
