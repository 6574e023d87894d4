//! Vision without neural networks: what the pixels of an image say.
//!
//! Everything here is a function, or a small struct that keeps its memory between frames, over [`Plane`]s and [`Rgb`]
//! images: the same bytes on every machine, and no allocation in steady state.
//!
//! Absences: no message, no engine, no simulator, no file, no clock, no thread.

pub mod acf;
pub mod boosting;
pub mod channels;
pub mod correlation;
pub mod hog;
mod image;
pub mod lanes;
pub mod pyramid;
mod regions;
#[cfg(test)]
mod samples;
pub mod segmentation;
pub mod shipped;
pub mod signs;
mod stack;
pub mod stereo;
pub mod svm;
pub mod traffic_light;
#[cfg(test)]
mod video;
mod weights_file;

pub use image::{ImageError, Plane, Rgb};
pub use stack::Stack;
