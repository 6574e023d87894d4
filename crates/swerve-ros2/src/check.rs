//! Whether a message that came from outside may be believed.
//!
//! The transport does not compare type names, so that a message of another type may be decoded as one that was
//! asked for, with numbers like 5e180 in it. Nothing is handed on before all of it was looked at: every number
//! finite and of a plausible size, nanoseconds below a billion, names short and printable, sizes consistent,
//! enumerations within their values.

pub(crate) mod parts;
mod walk;

pub use walk::check_numbers;

/// No coordinate, speed, covariance or the like is beyond this.
pub const NUMBER_MAX: f64 = 1e12;
/// Frames and names are shorter than this, bytes.
pub const NAME_MAX: usize = 256;
/// Texts are shorter than this, bytes.
pub const TEXT_MAX: usize = 1 << 16;
/// Images have no more rows or columns than this.
pub const IMAGE_SIDE_MAX: u32 = 1 << 14;
/// Point clouds have no more points than this.
pub const POINTS_MAX: u64 = 1 << 24;

/// Checks beyond those that hold for every message: ranges, sizes, enumerations.
pub trait Check {
    /// Fields that may be not-a-number, where the writer has no such number.
    const MAY_BE_NAN: &[&str] = &[];

    /// Whether its fields fit one another.
    ///
    /// # Errors
    /// The first field that does not.
    fn check(&self) -> Result<(), Invalid>;

    /// Sets the fields that have to fit one another, in an example of arbitrary values.
    fn fit(&mut self) {}
}

/// A field of a message that is not as it has to be.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("`{field}` {why}")]
pub struct Invalid {
    /// Which: `pose.pose.position.x`.
    pub field: String,
    /// The mistake.
    pub why: Why,
}

/// The mistake in a field.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum Why {
    /// Not-a-number or infinite.
    #[error("is not a finite number")]
    NotFinite,
    /// Beyond what there can be.
    #[error("is {value}, not from {min} to {max}")]
    OutOfRange {
        /// The number.
        value: f64,
        /// The least allowed.
        min: f64,
        /// The most allowed.
        max: f64,
    },
    /// A part of a second of a second or more.
    #[error("is {0} ns, not less than a second")]
    Nanoseconds(u32),
    /// Not a name.
    #[error("is no name: {0:?}")]
    Name(String),
    /// A text without end.
    #[error("is a text of {0} bytes")]
    TooLong(usize),
    /// More or fewer elements than other fields say.
    #[error("has {found} bytes or elements, where {wanted} are to be")]
    Length {
        /// How many there are.
        found: u64,
        /// How many the other fields say.
        wanted: u64,
    },
    /// A value that the enumeration does not have.
    #[error("has no meaning at {0}")]
    NoSuchValue(i64),
    /// No rotation: not of length one.
    #[error("is a quaternion of length {0}")]
    Quaternion(f64),
    /// Two of one name.
    #[error("is there twice")]
    Twice,
    /// Shares bytes with another.
    #[error("overlaps `{0}`")]
    Overlaps(String),
}

pub(crate) fn invalid(field: impl Into<String>, why: Why) -> Result<(), Invalid> {
    Err(Invalid { field: field.into(), why })
}

/// `value` from `min` to `max`; not-a-number is not.
pub(crate) fn within(field: &str, value: f64, min: f64, max: f64) -> Result<(), Invalid> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    invalid(field, Why::OutOfRange { value, min, max })
}

/// As [`within`], but not-a-number says that there is none.
pub(crate) fn within_if_any(field: &str, value: f32, min: f64, max: f64) -> Result<(), Invalid> {
    if value.is_nan() { Ok(()) } else { within(field, f64::from(value), min, max) }
}

/// `value` is one of the numbers of an enumeration.
pub(crate) fn one_of(field: &str, value: u8, known: &[u8]) -> Result<(), Invalid> {
    if known.contains(&value) { Ok(()) } else { invalid(field, Why::NoSuchValue(i64::from(value))) }
}
