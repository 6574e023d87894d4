//! Graphics adapters: what is there, what may be used and why not, and devices that back ends share.

mod buffers;
mod device;
mod engine;
mod maps;
mod meshes;
mod pipelines;
mod plan;
mod records;

pub use device::{AdapterKind, AdapterReport, Adapters, Gpu, NoAdapter, probe};
pub(crate) use engine::{GpuRenderer, Pending};

#[cfg(test)]
mod tests;
