//! Graphics adapters: what is there, what may be used and why not, and devices that back ends share.

mod device;
pub(crate) mod lidar;

pub use device::{AdapterKind, AdapterReport, Adapters, Gpu, NoAdapter, probe};
