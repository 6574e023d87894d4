//! Vocabulary that every other crate shares: time, seeded random numbers, digests, parameter errors.
//!
//! Absences: no thread, no file, no clock, no maths beyond integers and the normal distribution.

mod digest;
pub mod param;
mod rng;
mod time;

pub use digest::{Digest, Hasher, digest_of};
pub use param::{ParamError, ParamValue};
pub use rng::Rng;
pub use time::{Span, Time};
