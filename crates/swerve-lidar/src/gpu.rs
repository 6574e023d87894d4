//! Lidars on a GPU: pieces of a turn are queued until it is complete, sent together, and read back as points.

mod caster;

pub(crate) use caster::InFlight;

use core::ops::Range;
use std::sync::Arc;

use swerve_gpu::Gpu;

use crate::cloud::CloudMut;
use crate::returns::Receiver;
use crate::scene_tree::SceneTree;
use crate::scene_tree::flat::{Batch, DynamicState, GpuScene};
use crate::sweeper::{Pattern, Piece};
use caster::{Caster, Points, SETTINGS};

/// GPU part of a sweeper.
pub(crate) struct GpuEngine {
    caster: Caster,
    scene: GpuScene,
    batch: Batch,
    /// Queued pieces, followed by reusable entries.
    pieces: Vec<Waiting>,
    waiting: usize,
    /// Columns of the queued pieces.
    order: Vec<u32>,
    /// Columns of the piece sent separately.
    alone: Vec<u32>,
    params: Option<ShotParams>,
}

/// Parameters shared by all shots of a batch.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct ShotParams {
    pub(crate) receiver: Receiver,
    pub(crate) hidden: Option<u32>,
}

/// Queued piece, with the data that the CPU needs if the GPU is lost before the turn is complete.
struct Waiting {
    piece: Piece,
    dynamics: DynamicState,
}

impl ShotParams {
    fn words(&self) -> [u32; SETTINGS] {
        let mut words = [0; SETTINGS];
        words[0] = u32::from(self.hidden.is_some());
        words[1] = self.hidden.unwrap_or_default();
        words[2..].copy_from_slice(&self.receiver.words());
        words
    }
}

impl GpuEngine {
    pub(crate) fn new(gpu: &Arc<Gpu>, beams: &[[f32; 3]]) -> Self {
        Self {
            caster: Caster::new(gpu, beams),
            scene: GpuScene::default(),
            batch: Batch::default(),
            pieces: Vec::new(),
            waiting: 0,
            order: Vec::new(),
            alone: Vec::new(),
            params: None,
        }
    }

    /// Drops the queued pieces.
    pub(crate) fn forget_pieces(&mut self) {
        self.waiting = 0;
    }

    /// Number of queued columns.
    pub(crate) fn columns_waiting(&self) -> usize {
        if self.waiting > 0 { self.order.len() } else { 0 }
    }

    /// Returns true if a piece cannot be batched with the queued ones: other weather, hidden instance or static part.
    pub(crate) fn needs_flush(&self, tree: &SceneTree, params: &ShotParams) -> bool {
        self.waiting > 0 && (self.params.as_ref() != Some(params) || self.scene.is_outdated(tree))
    }

    /// Queues a piece that can be batched with the queued ones.
    pub(crate) fn add(&mut self, pattern: &Pattern, tree: &SceneTree, params: ShotParams, piece: &Piece) {
        if self.scene.is_outdated(tree) {
            self.scene.clear();
        }
        self.scene.add_missing(tree);
        if self.waiting == 0 {
            self.batch.begin(tree, &self.scene);
            self.order.clear();
            self.params = Some(params);
        }
        load(&mut self.batch, pattern, tree, &self.scene, piece);
        self.order.extend(piece.columns.clone());
        if self.pieces.len() == self.waiting {
            self.pieces.push(Waiting { piece: piece.clone(), dynamics: DynamicState::default() });
        }
        let waiting = &mut self.pieces[self.waiting];
        waiting.piece = piece.clone();
        tree.save_dynamics(&mut waiting.dynamics);
        self.waiting += 1;
    }

    /// Fires the queued pieces and appends their points.
    ///
    /// # Errors
    /// Reason of the GPU failure; nothing is appended then, and the pieces remain queued.
    pub(crate) fn flush(&mut self, pattern: &Pattern, out: &mut CloudMut<'_>) -> Result<(), String> {
        let Some(params) = self.params.filter(|_| self.waiting > 0) else { return Ok(()) };
        let Self { caster, scene, batch, order, .. } = self;
        let in_flight = caster.submit(scene, batch, params.words())?;
        caster.receive(in_flight, |points| add(pattern, order, points, out))?;
        self.waiting = 0;
        Ok(())
    }

    /// Sends a single piece.
    ///
    /// # Errors
    /// Reason of the GPU failure.
    pub(crate) fn send(
        &mut self,
        pattern: &Pattern,
        tree: &SceneTree,
        params: ShotParams,
        piece: &Piece,
    ) -> Result<InFlight, String> {
        self.forget_pieces();
        if self.scene.is_outdated(tree) {
            self.scene.clear();
        }
        self.scene.add_missing(tree);
        self.batch.begin(tree, &self.scene);
        load(&mut self.batch, pattern, tree, &self.scene, piece);
        self.caster.submit(&mut self.scene, &self.batch, params.words())
    }

    /// Waits for a piece sent by [`Self::send`] and appends its points.
    ///
    /// # Errors
    /// Reason of the GPU failure; nothing is appended then.
    pub(crate) fn receive(
        &mut self,
        pattern: &Pattern,
        in_flight: InFlight,
        columns: Range<u32>,
        out: &mut CloudMut<'_>,
    ) -> Result<(), String> {
        let Self { caster, alone, .. } = self;
        alone.clear();
        alone.extend(columns);
        caster.receive(in_flight, |points| add(pattern, alone, points, out))
    }

    /// Queued pieces with the moving instances of their scenes, and the parameters of their shots.
    pub(crate) fn into_pieces(mut self) -> (Option<ShotParams>, Vec<(Piece, DynamicState)>) {
        self.pieces.truncate(self.waiting);
        (self.params, self.pieces.into_iter().map(|Waiting { piece, dynamics }| (piece, dynamics)).collect())
    }
}

/// Adds a piece to a batch.
fn load(batch: &mut Batch, pattern: &Pattern, tree: &SceneTree, scene: &GpuScene, piece: &Piece) {
    let root = batch.add(tree.moving(), scene);
    for (column, pose) in piece.columns.clone().zip(pattern.column_poses(tree, piece)) {
        batch.add_column(&pose, root, column, pattern.azimuth(column));
    }
}

/// Appends points; `order` holds the columns of the batch.
fn add(pattern: &Pattern, order: &[u32], points: &Points<'_>, out: &mut CloudMut<'_>) {
    let [x, y, z, intensity, instance, what] = points.arrays();
    let new = *out.len..*out.len + x.len();
    for (to, from) in
        [(&mut out.x_m, x), (&mut out.y_m, y), (&mut out.z_m, z), (&mut out.intensity, intensity)]
    {
        to[new.clone()].copy_from_slice(bytemuck::cast_slice(from));
    }
    for (ring, &what) in out.ring[new.clone()].iter_mut().zip(what) {
        *ring = what as u16;
    }
    if let Some(truth) = &mut out.truth {
        truth.instance[new.clone()].copy_from_slice(instance);
        for (class, &what) in truth.class[new.clone()].iter_mut().zip(what) {
            *class = (what >> 16) as u8;
        }
    }
    let mut rest = &mut out.offset_s[new.clone()];
    for (&column, &count) in order.iter().zip(points.counts) {
        let (of_column, behind) = rest.split_at_mut(count as usize);
        of_column.fill(pattern.offset_s(column));
        rest = behind;
    }
    *out.len = new.end;
}

#[cfg(test)]
mod tests;
