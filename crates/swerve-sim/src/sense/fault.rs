//! Parameters that no sensor can have.

use core::fmt;

/// A sensor's parameter outside its range.
#[derive(Clone, PartialEq, Debug)]
pub struct ParamsFault {
    /// Key below the sensor's own.
    pub key: &'static str,
    /// The value given.
    pub value: f64,
    /// The range allowed, as in `0 to 100`.
    pub must: String,
}

impl fmt::Display for ParamsFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { key, value, must } = self;
        write!(f, "{key}: expected {must}, found {value}")
    }
}

impl core::error::Error for ParamsFault {}

/// A fault where `value` is not from `low` to `high`.
pub(super) fn fault(key: &'static str, value: f64, [low, high]: [f64; 2]) -> Option<ParamsFault> {
    let must = || format!("{low} to {high}");
    (!(low..=high).contains(&value)).then(|| ParamsFault { key, value, must: must() })
}
