//! Validation of messages from outside.
//!
//! The transport does not compare type names, so a message of another type may be decoded as the expected one, with
//! numbers such as 5e180. No message is passed on before it was checked completely: every number finite and of a
//! plausible size, nanoseconds below a billion, names short and printable, sizes consistent, enumerations within
//! their values.

pub(crate) mod parts;
mod walk;

pub use walk::check_numbers;

/// Limit of the absolute value of any number.
pub const NUMBER_MAX: f64 = 1e12;
/// Length limit of frames and names, bytes.
pub const NAME_MAX: usize = 256;
/// Length limit of strings, bytes.
pub const TEXT_MAX: usize = 1 << 16;
/// Maximum rows or columns of an image.
pub const IMAGE_SIDE_MAX: u32 = 1 << 14;
/// Maximum number of points of a point cloud.
pub const POINTS_MAX: u64 = 1 << 24;

/// Checks beyond those common to all messages: ranges, sizes, enumerations.
pub trait Check {
    /// Fields that may be NaN, if the writer has no value.
    const MAY_BE_NAN: &[&str] = &[];

    /// Checks that the fields are consistent with each other.
    ///
    /// # Errors
    /// The first invalid field.
    fn check(&self) -> Result<(), Invalid>;

    /// Makes the fields consistent with each other, in a sample of arbitrary values.
    fn fit(&mut self) {}
}

/// An invalid field of a message.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("`{field}` {why}")]
pub struct Invalid {
    /// Path of the field, such as `pose.pose.position.x`.
    pub field: String,
    /// Problem of the field.
    pub why: Why,
}

/// Problem of a field.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum Why {
    /// NaN or infinite.
    #[error("is not a finite number")]
    NotFinite,
    /// Outside the plausible range.
    #[error("is {value}, not from {min} to {max}")]
    OutOfRange {
        /// Actual value.
        value: f64,
        /// Minimum.
        min: f64,
        /// Maximum.
        max: f64,
    },
    /// Nanoseconds of a full second or more.
    #[error("is {0} ns, not less than a second")]
    Nanoseconds(u32),
    /// Not a valid name.
    #[error("is not a name: {0:?}")]
    Name(String),
    /// The string is too long.
    #[error("is a text of {0} bytes")]
    TooLong(usize),
    /// Length inconsistent with other fields.
    #[error("has {found} bytes or elements, where {wanted} are to be")]
    Length {
        /// Actual length.
        found: u64,
        /// Length according to the other fields.
        wanted: u64,
    },
    /// Undefined value of an enumeration.
    #[error("has no meaning at {0}")]
    NoSuchValue(i64),
    /// Not a rotation: the norm is not one.
    #[error("is a quaternion of length {0}")]
    Quaternion(f64),
    /// Duplicate name.
    #[error("is there twice")]
    Twice,
    /// Shares bytes with another field.
    #[error("overlaps `{0}`")]
    Overlaps(String),
}

pub(crate) fn invalid(field: impl Into<String>, why: Why) -> Result<(), Invalid> {
    Err(Invalid { field: field.into(), why })
}

/// Checks that `value` is within `min` and `max`; NaN is not.
pub(crate) fn within(field: &str, value: f64, min: f64, max: f64) -> Result<(), Invalid> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    invalid(field, Why::OutOfRange { value, min, max })
}

/// As [`within`], but accepts NaN as a missing value.
pub(crate) fn within_if_any(field: &str, value: f32, min: f64, max: f64) -> Result<(), Invalid> {
    if value.is_nan() { Ok(()) } else { within(field, f64::from(value), min, max) }
}

/// Checks that `value` is defined in an enumeration.
pub(crate) fn one_of(field: &str, value: u8, known: &[u8]) -> Result<(), Invalid> {
    if known.contains(&value) { Ok(()) } else { invalid(field, Why::NoSuchValue(i64::from(value))) }
}
