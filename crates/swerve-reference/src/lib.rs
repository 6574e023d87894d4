//! Reference of configurations, generated from the code: operator kinds with their ports (`swerve operators`), keys
//! with type, default, unit, range and values (`swerve keys`), and schemas for editors.
//!
//! The crate starts no run and writes no file except on request; nothing in it is maintained by hand twice.

pub mod editor;
mod files;
mod key;
pub mod keys;
mod limits;
pub mod operators;
mod params;
mod schema;

pub use files::FileKind;
