//! Cameras: what they are, and the images that they see of a scene, on the CPU and on graphics adapters.
//!
//! Make a [`Camera`], and let a [`Renderer`] write colour, depth, semantic and instance images of a
//! [`swerve_scene::Scene`] into memory of yours:
//!
//! ```text
//! Scene ───────────────────────┐
//! CameraSpec ─> Camera ─> View ┴─> Renderer::render ─> Frame (rgb, depth, class, instance)
//!
//! inside: frontend (sub-frames, pinhole and lens, light, lamps, shadow maps, surfaces, sensor) ─> cpu or gpu
//! ```
//!
//! **Frames.** Camera: x right, y down, z forward; [`mount`] makes a pose from a position and angles on the
//! vehicle. Colours are linear inside, sRGB in the image.
//!
//! **Promises.** The images are a function of scene, view and options: not of earlier passes, of the number
//! of threads, or of the x86-64 machine. Ids are never blended. What can be kept between passes (static
//! shadow maps, lens maps) is keyed by content. A pass into used buffers allocates nothing that grows with
//! the image.
//!
//! These are the promises of [`Backend::Cpu`]. The other back ends, on adapters that `swerve-gpu` finds, keep the
//! first one on one adapter and driver alone: against the CPU's, colours may be off by a level or two and
//! outlines by a pixel. When their adapter fails, the [`Renderer`] goes on with the CPU, in the same frame.

#[cfg(test)]
mod allocations;
mod check;
mod cpu;
mod error;
mod frame;
mod frontend;
mod gpu;
mod model;
mod renderer;
mod view;

pub use error::RenderError;
pub use frame::{Frame, FrameMut, FrameSizeError, Outputs};
pub use model::{Camera, CameraSpec, Distortion, Exposure, Intrinsics, SensorNoise, Shutter, mount};
pub use renderer::{Backend, RenderOptions, Renderer, Submission};
pub use view::View;
