//! Range checks of parameters, with one error type for all algorithms.

use std::borrow::Cow;
use std::fmt;

/// A parameter with an invalid value.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("`{key}` is {value}, expected {expected}")]
pub struct ParamError {
    /// Dotted key from the root of the parameters.
    pub key: Cow<'static, str>,
    /// The invalid value.
    pub value: ParamValue,
    /// Allowed values, as in `0 to 100`.
    pub expected: Cow<'static, str>,
}

/// The value of a parameter.
#[derive(Clone, PartialEq, Debug)]
pub enum ParamValue {
    /// A number, in the unit that the key names.
    Number(f64),
    /// Any other value, as text.
    Text(String),
}

impl From<f64> for ParamValue {
    fn from(x: f64) -> Self {
        Self::Number(x)
    }
}

impl From<u32> for ParamValue {
    fn from(n: u32) -> Self {
        Self::Number(f64::from(n))
    }
}

impl From<usize> for ParamValue {
    fn from(n: usize) -> Self {
        Self::Number(n as f64)
    }
}

impl From<String> for ParamValue {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<&str> for ParamValue {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl ParamValue {
    /// The number, or `None` for text.
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Self::Number(x) => Some(*x),
            Self::Text(_) => None,
        }
    }
}

impl fmt::Display for ParamValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // Unlike `{}`, `{:?}` switches to exponents before the digits run into the hundreds.
            Self::Number(x) => {
                let digits = format!("{x:?}");
                f.write_str(digits.strip_suffix(".0").unwrap_or(&digits))
            }
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// Requires that `holds` is true (comparisons with NaN are false).
///
/// # Errors
/// If it is not, or if the value is a number that is not finite.
pub fn require(
    key: impl Into<Cow<'static, str>>,
    value: impl Into<ParamValue>,
    holds: bool,
    expected: impl Into<Cow<'static, str>>,
) -> Result<(), ParamError> {
    let value = value.into();
    if holds && value.as_f64().is_none_or(f64::is_finite) {
        return Ok(());
    }
    Err(ParamError { key: key.into(), value, expected: expected.into() })
}

/// Requires a parameter from `low` to `high`, both included.
///
/// # Errors
/// If the value is outside, or NaN.
pub fn require_within(
    key: impl Into<Cow<'static, str>>,
    value: f64,
    [low, high]: [f64; 2],
) -> Result<(), ParamError> {
    // The message is formatted only on failure: planners check their parameters in every call.
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(ParamError { key: key.into(), value: value.into(), expected: format!("{low} to {high}").into() })
}

/// Key, value and range (ends included) of a parameter.
pub type Ranged = (&'static str, f64, [f64; 2]);

/// Requires that all parameters of a table are within their ranges; reports the first that is not.
///
/// # Errors
/// If a value is outside its range, or NaN.
pub fn require_all_within(table: &[Ranged]) -> Result<(), ParamError> {
    table.iter().try_for_each(|&(key, value, range)| require_within(key, value, range))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_states_key_value_and_range() {
        let said = |result: Result<(), ParamError>| result.unwrap_err().to_string();
        assert_eq!(said(require_within("share", 1.5, [0.0, 1.0])), "`share` is 1.5, expected 0 to 1");
        assert_eq!(said(require_within("gain", f64::NAN, [0.5, 2.0])), "`gain` is NaN, expected 0.5 to 2");
        assert_eq!(said(require("n", 513_usize, false, "at most 512")), "`n` is 513, expected at most 512");
        assert_eq!(
            said(require("list", "empty", false, "one at least")),
            "`list` is empty, expected one at least"
        );
        assert_eq!(said(require("far", 1e308, false, "less")), "`far` is 1e308, expected less");
    }

    #[test]
    fn require_accepts_finite_values_for_which_the_condition_holds() {
        assert_eq!(require_within("a", 1.0, [0.0, 1.0]), Ok(()));
        assert!(require("a", f64::INFINITY, true, "finite").is_err());
        assert!(require_within("a", f64::NAN, [0.0, 1.0]).is_err());
        assert!(require_within("a", 1e300, [0.0, f64::INFINITY]).is_ok());
    }

    #[test]
    fn first_parameter_outside_its_range_is_refused() {
        let table = [("a", 1.0, [0.0, 1.0]), ("b", 3.0, [0.0, 2.0]), ("c", -1.0, [0.0, 1.0])];
        assert_eq!(require_all_within(&table).unwrap_err().key, "b");
        assert_eq!(require_all_within(&table[..1]), Ok(()));
    }
}
