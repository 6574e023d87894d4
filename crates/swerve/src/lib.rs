//! The program as a library: what the binary `swerve` is made of.

pub mod story;
