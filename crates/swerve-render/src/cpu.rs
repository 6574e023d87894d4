//! The rasteriser.

use crate::frame::FrameMut;
use crate::renderer::{RenderError, View};
use crate::scene::Scene;

/// The back end for CPUs.
pub(crate) struct CpuRenderer {}

impl CpuRenderer {
    pub(crate) fn new(_threads: usize) -> Result<Self, RenderError> {
        Ok(Self {})
    }

    pub(crate) fn render(&mut self, _scene: &Scene, _view: &View<'_>, _out: FrameMut<'_>) {}
}
