//! Configuration: text, then typed, then resolved and checked, once, at start.

pub mod execution;
pub mod text;
