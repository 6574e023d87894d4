//! GPU back end of a program that was built without the feature `gpu`: it has no value.

use std::sync::Arc;

use swerve_gpu::Gpu;
use swerve_scene::Scene;

use crate::View;
use crate::frame::{FrameMut, Outputs};
use crate::frontend::Threads;

/// Back end for one device.
pub(crate) struct GpuRenderer(Arc<Gpu>);

/// Images in progress on the device.
pub(crate) enum InFlight {}

impl GpuRenderer {
    pub(crate) fn new(gpu: Arc<Gpu>, _: Threads) -> Result<Self, String> {
        match *gpu {}
    }

    pub(crate) fn gpu(&self) -> &Arc<Gpu> {
        &self.0
    }

    pub(crate) fn submit(&mut self, _: &Scene, _: &[(View<'_>, Outputs)]) -> Result<InFlight, String> {
        match *self.0 {}
    }

    pub(crate) fn collect(&mut self, in_flight: InFlight, _: &mut [FrameMut<'_>]) -> Result<(), String> {
        match in_flight {}
    }
}
