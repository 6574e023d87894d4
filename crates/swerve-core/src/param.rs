//! Parameters in their ranges: the one error of every algorithm whose parameters can be wrong.

use std::borrow::Cow;
use std::fmt;

/// A parameter that nothing can be made with.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("`{key}` is {value}, expected {expected}")]
pub struct ParamError {
    /// Dotted key from the top of the parameters.
    pub key: Cow<'static, str>,
    /// The value that was given.
    pub value: ParamValue,
    /// The values that are allowed, as in `0 to 100`.
    pub expected: Cow<'static, str>,
}

/// The value of a parameter.
#[derive(Clone, PartialEq, Debug)]
pub enum ParamValue {
    /// A number, in the unit that the key names.
    Number(f64),
    /// Something else, described.
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
    /// The number, if it is one.
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
            // Unlike `{}`, this takes to exponents before the digits run into the hundreds.
            Self::Number(x) => {
                let digits = format!("{x:?}");
                f.write_str(digits.strip_suffix(".0").unwrap_or(&digits))
            }
            Self::Text(text) => f.write_str(text),
        }
    }
}

/// Refuses a parameter unless `holds` (which a comparison with not-a-number does not).
///
/// # Errors
/// It does not hold, or the value is a number that is not finite.
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

/// Refuses a parameter that is not from `low` to `high`, both included.
///
/// # Errors
/// The value is outside, or NaN.
pub fn require_within(
    key: impl Into<Cow<'static, str>>,
    value: f64,
    [low, high]: [f64; 2],
) -> Result<(), ParamError> {
    // The message is made only where it is needed: planners check their parameters in every call.
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(ParamError { key: key.into(), value: value.into(), expected: format!("{low} to {high}").into() })
}

/// Key, value and range of a parameter: the ends of the range are included.
pub type Ranged = (&'static str, f64, [f64; 2]);

/// Refuses the first parameter of a table that is outside its range.
///
/// # Errors
/// A value is outside its range, or NaN.
pub fn require_all_within(table: &[Ranged]) -> Result<(), ParamError> {
    table.iter().try_for_each(|&(key, value, range)| require_within(key, value, range))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_says_key_value_and_range() {
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
    fn what_holds_is_let_through_if_it_is_finite() {
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
