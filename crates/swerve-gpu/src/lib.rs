//! Graphics adapters: detection, selection, and devices shared between back ends.
//!
//! ```text
//! probe ─> Adapters ─> choose (or every reason for rejection)
//! Gpu::shared ─> Gpu: device, queue, limits, and the first error since it was opened
//! ```
//!
//! Only this crate depends on [`wgpu`] directly. Back ends use its re-export, so that there is a single version,
//! and none exposes it in its own API.

mod adapter;
mod buffer;
mod device;
mod drivers;

pub use adapter::{AdapterKind, AdapterReport, Adapters, NoAdapter, probe};
pub use buffer::GrowingBuffer;
pub use device::Gpu;
pub use drivers::turn_off_display_layer;
pub use wgpu;
