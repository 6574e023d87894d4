//! Computer vision without neural networks.
//!
//! Everything here is a function over [`Plane`]s and [`Rgb`] images, or a small struct that reuses its buffers between
//! frames. Results are bit-identical on every machine, and nothing is allocated in steady state.
//!
//! Does not depend on messages, the engine, the simulator, files, clocks or threads.

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
