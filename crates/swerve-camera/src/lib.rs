//! Cameras: models, and images of a scene rendered on the CPU or on GPUs.
//!
//! Create a [`Camera`], and let a [`Renderer`] write colour, depth, semantic and instance images of a
//! [`swerve_scene::Scene`] into your memory:
//!
//! ```text
//! Scene ───────────────────────┐
//! CameraSpec ─> Camera ─> View ┴─> Renderer::render ─> Frame (rgb, depth, class, instance)
//!
//! inside: frontend (sub-frames, pinhole and lens, light, lamps, shadow maps, surfaces, sensor) ─> cpu or gpu
//! ```
//!
//! **Frames.** Camera: x right, y down, z forward; [`mount`] creates a pose from a position and angles on the vehicle.
//! Colours are linear internally, sRGB in the image.
//!
//! **Guarantees.** Images are a function of scene, view and options, independent of earlier passes, of the number of
//! threads, and of the x86-64 machine. Ids are never blended. Data kept between passes (static shadow maps, lens maps)
//! is keyed by content. A pass into used buffers allocates nothing that grows with the image.
//!
//! These are the guarantees of [`Backend::Cpu`]. The other back ends, on adapters found by `swerve-gpu`, give the first
//! one only for one adapter and driver: compared with the CPU, colours may differ by a level or two and outlines by a
//! pixel. When their adapter fails, the [`Renderer`] continues on the CPU, in the same frame.

#![cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "without the feature, its helpers are unused"))]

#[cfg(test)]
mod allocations;
mod check;
mod cpu;
mod error;
mod frame;
mod frontend;
#[cfg(feature = "gpu")]
mod gpu;
#[cfg(not(feature = "gpu"))]
#[path = "no_gpu.rs"]
mod gpu;
mod model;
mod renderer;
mod view;

pub use error::RenderError;
pub use frame::{Frame, FrameMut, FrameSizeError, Outputs};
pub use model::{
    Camera, CameraSpec, Distortion, Exposure, IMAGE_SIDE_MAX_PX, Intrinsics, SUBFRAMES_MAX, SensorNoise,
    Shutter, mount,
};
pub use renderer::{Backend, RenderOptions, Renderer, Submission};
pub use view::View;
