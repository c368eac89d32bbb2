//! What a recipe must not have, and the ranges its numbers are held to.

/// A number or key that a recipe must not have.
pub(crate) struct Refusal {
    pub(crate) key: &'static str,
    pub(crate) reason: String,
}

/// Refuses a number outside `low..=high`, NaN included.
pub(crate) fn between(key: &'static str, value: f64, low: f64, high: f64) -> Result<(), Refusal> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(Refusal { key, reason: format!("{value} is not within {low} to {high}") })
}

/// Refuses a count outside `low..=high`.
pub(crate) fn count(
    key: &'static str,
    value: usize,
    low: usize,
    high: usize,
) -> Result<(), Refusal> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(Refusal { key, reason: format!("{value} is not within {low} to {high}") })
}
