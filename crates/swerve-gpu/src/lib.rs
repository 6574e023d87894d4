//! Graphics adapters: detection, selection, and devices shared between back ends.
//!
//! ```text
//! probe ─> Adapters ─> choose (or every reason for rejection)
//! Gpu::shared ─> Gpu: device, queue, limits, and the first error since it was opened
//! ```
//!
//! Only this crate depends on `wgpu` directly. Back ends use its re-export, so that there is a single version,
//! and none exposes it in its own API. Without the feature `gpu` there is none, and [`MISSING`] is the reason in
//! [`Adapters::absent`].

#![cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "without the feature, its helpers are unused"))]

mod adapter;
#[cfg(feature = "gpu")]
mod buffer;
#[cfg(feature = "gpu")]
mod device;
mod drivers;
#[cfg(not(feature = "gpu"))]
mod no_device;
#[cfg(feature = "gpu")]
mod open;

pub use adapter::{AdapterKind, AdapterReport, Adapters, NoAdapter};
#[cfg(feature = "gpu")]
pub use buffer::GrowingBuffer;
#[cfg(feature = "gpu")]
pub use device::Gpu;
pub use drivers::turn_off_display_layer;
#[cfg(not(feature = "gpu"))]
pub use no_device::{Gpu, probe};
#[cfg(feature = "gpu")]
pub use open::probe;
#[cfg(feature = "gpu")]
pub use wgpu;

/// Reason why this program uses no graphics adapter; `None` if it can.
pub const MISSING: Option<&str> = if cfg!(feature = "gpu") { None } else { Some(NOT_BUILT) };

const NOT_BUILT: &str =
    "this program was built without GPU: build it with `--features gpu` (all: `--features full`)";
