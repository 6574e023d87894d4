//! Range checks of parameters, with one error type for all algorithms.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

pub use swerve_core_derive::Ranges;

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

impl ParamError {
    /// The same error of a parameter within the table or list `key`.
    #[must_use]
    pub fn under(self, key: &str) -> Self {
        let dot = if self.key.starts_with('[') { "" } else { "." };
        Self { key: format!("{key}{dot}{}", self.key).into(), ..self }
    }
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

/// Receiver of errors: an error that it returns ends the check.
pub type Report<'a> = &'a mut dyn FnMut(ParamError) -> Result<(), ParamError>;

/// Numbers of a field: one, none, or those of an array.
pub trait Numbers {
    /// Reports the numbers outside a range; the key of one in a list of any length has its place there.
    ///
    /// # Errors
    /// The first error that `report` returns.
    fn check_within(&self, key: &'static str, range: [f64; 2], report: Report<'_>) -> Result<(), ParamError>;
}

macro_rules! numbers {
    ($($number:ty),*) => {$(
        impl Numbers for $number {
            fn check_within(
                &self,
                key: &'static str,
                range: [f64; 2],
                report: Report<'_>,
            ) -> Result<(), ParamError> {
                require_within(key, *self as f64, range).or_else(report)
            }
        }
    )*};
}

numbers!(f64, u8, u32, u64, usize);

impl<T: Numbers> Numbers for Option<T> {
    fn check_within(&self, key: &'static str, range: [f64; 2], report: Report<'_>) -> Result<(), ParamError> {
        self.iter().try_for_each(|one| one.check_within(key, range, report))
    }
}

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    fn check_within(&self, key: &'static str, range: [f64; 2], report: Report<'_>) -> Result<(), ParamError> {
        self.iter().try_for_each(|one| one.check_within(key, range, report))
    }
}

impl<T: Numbers> Numbers for Vec<T> {
    fn check_within(&self, key: &'static str, range: [f64; 2], report: Report<'_>) -> Result<(), ParamError> {
        let placed = |k, error| ParamError { key: format!("{key}[{k}]").into(), ..error };
        let mut all = self.iter().enumerate();
        all.try_for_each(|(k, one)| one.check_within(key, range, &mut |error| report(placed(k, error))))
    }
}

/// Settings whose numbers have ranges, each written once, at its field.
///
/// `#[derive(Ranges)]` reads the attribute from which the JSON schema takes `minimum` and `maximum`, both included:
///
/// ```
/// #[derive(Ranges)]
/// struct Params {
///     #[schemars(range(min = 0.5, max = 10.0))]
///     time_gap_s: f64,
///     #[schemars(inner(range(min = -20, max = 20)))]
///     at_m: [f64; 3],
///     #[ranges(nested)]
///     person: Motion,
/// }
/// ```
pub trait Ranges {
    /// Reports every number outside its range, and NaN, by its dotted key.
    ///
    /// # Errors
    /// The first error that `report` returns.
    fn check_each(&self, report: Report<'_>) -> Result<(), ParamError>;

    /// Requires that all numbers are within their ranges; allocates nothing if they are.
    ///
    /// # Errors
    /// The first number that is not.
    fn check_ranges(&self) -> Result<(), ParamError> {
        self.check_each(&mut Err)
    }

    /// All numbers outside their ranges.
    fn out_of_range(&self) -> Vec<ParamError> {
        let mut errors = Vec::new();
        let _never = self.check_each(&mut |error| {
            errors.push(error);
            Ok(())
        });
        errors
    }
}

impl<T: Ranges> Ranges for Option<T> {
    fn check_each(&self, report: Report<'_>) -> Result<(), ParamError> {
        self.iter().try_for_each(|one| one.check_each(report))
    }
}

impl<T: Ranges> Ranges for Vec<T> {
    fn check_each(&self, report: Report<'_>) -> Result<(), ParamError> {
        let mut all = self.iter().enumerate();
        all.try_for_each(|(k, one)| one.check_each(&mut |error| report(error.under(&format!("[{k}]")))))
    }
}

impl<T: Ranges> Ranges for BTreeMap<String, T> {
    fn check_each(&self, report: Report<'_>) -> Result<(), ParamError> {
        self.iter().try_for_each(|(name, one)| one.check_each(&mut |error| report(error.under(name))))
    }
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

    #[derive(Ranges, Default)]
    struct Inner {
        #[schemars(range(min = -1, max = 1.5))]
        x: f64,
    }

    #[derive(Ranges, Default)]
    struct Settings {
        #[schemars(range(min = 1, max = 9), with = "u32", extend("x" = 1))]
        count: usize,
        #[schemars(range(min = 0.0, max = TOP))]
        may: Option<f64>,
        #[schemars(inner(range(min = -TOP, max = TOP)))]
        at: [f64; 3],
        #[schemars(inner(inner(range(min = 0, max = TOP))))]
        pairs: Vec<[f64; 2]>,
        #[ranges(nested)]
        one: Inner,
        #[ranges(nested)]
        list: Vec<Inner>,
        #[ranges(nested)]
        named: BTreeMap<String, Inner>,
        #[ranges(flatten)]
        part: Option<Inner>,
        #[expect(dead_code, reason = "fields without a range are not checked")]
        free: f64,
    }

    const TOP: f64 = 3.0;

    #[test]
    fn derived_check_names_each_number_outside_its_range() {
        let fine = || Settings { count: 1, may: Some(TOP), free: f64::NAN, ..Settings::default() };
        assert_eq!(fine().check_ranges(), Ok(()));
        let wrong = Settings {
            count: 10,
            may: Some(f64::NAN),
            at: [0.0, -3.5, 0.0],
            pairs: vec![[0.0, 3.0], [-1.0, 0.0]],
            one: Inner { x: 2.0 },
            list: vec![Inner { x: 1.5 }, Inner { x: -2.0 }],
            named: [("a".to_owned(), Inner { x: 4.0 })].into(),
            part: Some(Inner { x: 5.0 }),
            free: 0.0,
        };
        let said: Vec<String> = wrong.out_of_range().iter().map(ToString::to_string).collect();
        assert_eq!(
            said,
            [
                "`count` is 10, expected 1 to 9",
                "`may` is NaN, expected 0 to 3",
                "`at` is -3.5, expected -3 to 3",
                "`pairs[1]` is -1, expected 0 to 3",
                "`one.x` is 2, expected -1 to 1.5",
                "`list[1].x` is -2, expected -1 to 1.5",
                "`named.a.x` is 4, expected -1 to 1.5",
                "`x` is 5, expected -1 to 1.5",
            ]
        );
        assert_eq!(wrong.check_ranges().unwrap_err().to_string(), said[0]);
    }
}
