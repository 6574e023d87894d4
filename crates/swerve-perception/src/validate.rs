//! Parameters within their ranges.

/// A parameter outside its range.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("`{key}` is {value}, expected {low} to {high}")]
pub struct ParamsError {
    /// Its name.
    pub key: &'static str,
    /// What was given.
    pub value: f64,
    /// Least allowed.
    pub low: f64,
    /// Most allowed.
    pub high: f64,
}

/// The first of (key, value, \[least, most\]) that is outside.
pub(crate) fn within(all: &[(&'static str, f64, [f64; 2])]) -> Result<(), ParamsError> {
    match all.iter().find(|(_, value, [low, high])| !(low..=high).contains(&value)) {
        Some(&(key, value, [low, high])) => Err(ParamsError { key, value, low, high }),
        None => Ok(()),
    }
}
