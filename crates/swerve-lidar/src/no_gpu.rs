//! Lidars on a GPU in a program that was built without the feature `gpu`: the engine has no value.

use core::ops::Range;
use std::sync::Arc;

use swerve_gpu::Gpu;

use crate::cloud::CloudMut;
use crate::returns::Receiver;
use crate::scene_tree::SceneTree;
use crate::scene_tree::flat::DynamicState;
use crate::sweeper::{Pattern, Piece};

/// GPU part of a sweeper.
pub(crate) struct GpuEngine(Arc<Gpu>);

/// Batch in progress on the device.
pub(crate) enum InFlight {}

/// Parameters shared by all shots of a batch.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct ShotParams {
    pub(crate) receiver: Receiver,
    pub(crate) hidden: Option<u32>,
}

impl GpuEngine {
    pub(crate) fn new(gpu: &Arc<Gpu>, _: &[[f32; 3]]) -> Self {
        Self(Arc::clone(gpu))
    }

    pub(crate) fn forget_pieces(&mut self) {
        match *self.0 {}
    }

    pub(crate) fn columns_waiting(&self) -> usize {
        match *self.0 {}
    }

    pub(crate) fn needs_flush(&self, _: &SceneTree, _: &ShotParams) -> bool {
        match *self.0 {}
    }

    pub(crate) fn add(&mut self, _: &Pattern, _: &SceneTree, _: ShotParams, _: &Piece) {
        match *self.0 {}
    }

    pub(crate) fn flush(&mut self, _: &Pattern, _: &mut CloudMut<'_>) -> Result<(), String> {
        match *self.0 {}
    }

    pub(crate) fn send(
        &mut self,
        _: &Pattern,
        _: &SceneTree,
        _: ShotParams,
        _: &Piece,
    ) -> Result<InFlight, String> {
        match *self.0 {}
    }

    pub(crate) fn receive(
        &mut self,
        _: &Pattern,
        in_flight: InFlight,
        _: Range<u32>,
        _: &mut CloudMut<'_>,
    ) -> Result<(), String> {
        match in_flight {}
    }

    pub(crate) fn into_pieces(self) -> (Option<ShotParams>, Vec<(Piece, DynamicState)>) {
        match *self.0 {}
    }
}
