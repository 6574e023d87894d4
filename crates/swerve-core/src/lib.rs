//! Vocabulary shared by all other crates: time, seeded random numbers, digests, parameter errors.
//!
//! Excluded: threads, files, clocks, maths beyond integers and the normal distribution.

// For the derive within this crate.
#[cfg(test)]
extern crate self as swerve_core;

mod digest;
pub mod param;
mod rng;
mod time;

pub use digest::{Digest, Hasher, digest_of, unless_default};
pub use param::{ParamError, ParamValue, Ranges};
pub use rng::Rng;
pub use time::{Span, Time};
