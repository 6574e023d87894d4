//! Files of a simulation.

use std::path::Path;

use swerve_map_io::FILE_MAX;
use swerve_text::{read_bytes, unpacked};

use crate::SumoError;

/// Text of a file, which may be packed by gzip.
///
/// # Errors
/// If it cannot be read.
pub fn text_of(path: &Path) -> Result<String, SumoError> {
    let wrong = |error: &dyn core::fmt::Display| {
        SumoError::Setting(format!("{} cannot be read: {error}", path.display()))
    };
    let bytes = read_bytes(path, FILE_MAX).map_err(|error| wrong(&error))?;
    unpacked(bytes).map_err(|error| wrong(&error))
}
