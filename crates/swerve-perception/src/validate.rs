//! Parameters within their ranges.

use swerve_core::param::{ParamError, require_within};

/// The first of (key, value, \[least, most\]) that is outside.
pub(crate) fn within(all: &[(&'static str, f64, [f64; 2])]) -> Result<(), ParamError> {
    all.iter().try_for_each(|&(key, value, ends)| require_within(key, value, ends))
}
