//! Vision without neural networks: what the pixels of an image say.
//!
//! Everything here is a function, or a small struct that keeps its memory between frames, over [`Plane`]s and [`Rgb`]
//! images: the same bytes on every machine, and no allocation in steady state.
//!
//! Absences: no message, no engine, no simulator, no file, no clock, no thread.

pub mod correlation;
mod image;
#[cfg(test)]
mod samples;
pub mod stereo;
pub mod traffic_light;

pub use image::{ImageError, Plane, Rgb};
