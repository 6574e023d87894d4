//! Checks of parameters.

/// A parameter outside its range.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("{key} = {value} is out of range: {expected}")]
pub struct InvalidParam {
    /// Name of the field.
    pub key: &'static str,
    /// Its value.
    pub value: f64,
    /// The range that it should be in.
    pub expected: &'static str,
}

/// Fails unless `holds` (which a comparison with not-a-number does not).
pub fn require(
    key: &'static str,
    value: f64,
    holds: bool,
    expected: &'static str,
) -> Result<(), InvalidParam> {
    if holds && value.is_finite() { Ok(()) } else { Err(InvalidParam { key, value, expected }) }
}

/// Fails unless `value` is above zero.
pub fn require_positive(key: &'static str, value: f64) -> Result<(), InvalidParam> {
    require(key, value, value > 0.0, "must be above zero")
}

/// Fails unless `value` is zero or more.
pub fn require_not_negative(key: &'static str, value: f64) -> Result<(), InvalidParam> {
    require(key, value, value >= 0.0, "must not be below zero")
}
