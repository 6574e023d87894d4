//! GPU back end.

mod cells;
mod encode;
mod instance;
mod layout;
mod lens_points;
mod maps;
mod meshes;
mod pipelines;
mod plan;
mod prepared;
mod read_back;
mod records;
mod renderer;
mod statics;
mod sub_frames;
mod target;
mod upload;

pub(crate) use renderer::{GpuRenderer, InFlight};

#[cfg(test)]
mod tests;
