//! What a configuration can hold, told by the code itself: kinds of operators with their ports (`swerve operators`),
//! keys with type, default, unit, range and values (`swerve keys`), the schema that editors read.
//!
//! Absences: no run, no file but what is asked for; nothing here is written down a second time.

pub mod editor;
mod files;
mod key;
pub mod keys;
mod limits;
pub mod operators;
mod params;
mod schema;

pub use files::FileKind;
