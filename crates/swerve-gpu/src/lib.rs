//! Graphics adapters: which there are, which may be used and why not, and devices that back ends share.
//!
//! ```text
//! probe ─> Adapters ─> choose (or every reason why there is none)
//! Gpu::shared ─> Gpu: device, queue, limits, and the first error since it was opened
//! ```
//!
//! This crate alone names [`wgpu`] in its manifest. Back ends take it from here, so that there is one version of
//! it, and none of them shows it to its own users.

mod adapter;
mod buffer;
mod device;
mod drivers;
pub mod testing;

pub use adapter::{AdapterKind, AdapterReport, Adapters, NoAdapter, probe};
pub use buffer::GrowingBuffer;
pub use device::Gpu;
pub use drivers::turn_off_display_layer;
pub use wgpu;
