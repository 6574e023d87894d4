//! Turns on a GPU: pieces of a turn wait until it is complete, go there together, and come back as points.

use core::ops::Range;
use std::sync::Arc;

use super::cloud::{CloudMut, Point};
use super::returns::Receiver;
use super::scene_tree::SceneTree;
use super::scene_tree::flat::{Moment, Resident, Salvo};
use super::sweep::{Firing, Sweeper};
use crate::gpu::Gpu;
use crate::gpu::lidar::{Caster, SEEN, SETTINGS, Words};

/// What a sweeper has on a GPU.
pub(super) struct Compute {
    caster: Caster,
    resident: Resident,
    salvo: Salvo,
    /// Pieces that wait, and memory of earlier ones behind them.
    pieces: Vec<Piece>,
    waiting: usize,
    /// The columns of these.
    order: Vec<u32>,
    under: Option<Under>,
}

/// What all shots of a salvo share.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Under {
    pub(super) receiver: Receiver,
    pub(super) hidden: Option<u32>,
}

/// Columns of one step of the world.
struct Piece {
    firing: Firing,
    columns: Range<u32>,
    /// What moved how: for the CPU, should the GPU be lost before the turn is complete.
    moment: Moment,
}

impl Under {
    fn words(&self) -> [u32; SETTINGS] {
        let mut words = [0; SETTINGS];
        words[0] = u32::from(self.hidden.is_some());
        words[1] = self.hidden.unwrap_or_default();
        words[2..].copy_from_slice(&self.receiver.words());
        words
    }
}

impl Compute {
    pub(super) fn new(gpu: &Arc<Gpu>, beams: &[[f32; 3]]) -> Self {
        Self {
            caster: Caster::new(gpu, beams),
            resident: Resident::default(),
            salvo: Salvo::default(),
            pieces: Vec::new(),
            waiting: 0,
            order: Vec::new(),
            under: None,
        }
    }

    /// Forgets the pieces that wait.
    pub(super) fn drop_pieces(&mut self) {
        self.waiting = 0;
    }

    /// Columns that wait.
    pub(super) fn columns_waiting(&self) -> usize {
        if self.waiting > 0 { self.order.len() } else { 0 }
    }

    /// Whether a piece cannot go with those that wait: other weather, another hidden instance, another ground.
    pub(super) fn is_apart(&self, tree: &SceneTree, under: &Under) -> bool {
        self.waiting > 0 && (self.under.as_ref() != Some(under) || self.resident.is_outdated(tree))
    }

    /// Adds a piece that can go with those that wait.
    pub(super) fn add(
        &mut self,
        sweeper: &Sweeper,
        tree: &SceneTree,
        under: Under,
        (firing, columns): (&Firing, &Range<u32>),
    ) {
        if self.resident.is_outdated(tree) {
            self.resident.clear();
        }
        self.resident.take_over(tree);
        if self.waiting == 0 {
            self.salvo.begin(tree, &self.resident);
            self.order.clear();
            self.under = Some(under);
        }
        let root = self.salvo.add(tree.moving(), &self.resident);
        self.order.extend(columns.clone());
        for column in columns.clone() {
            self.salvo.add_column(&sweeper.aim(tree, firing, column), root, column);
        }
        if self.pieces.len() == self.waiting {
            let moment = Moment::default();
            self.pieces.push(Piece { firing: *firing, columns: columns.clone(), moment });
        }
        let piece = &mut self.pieces[self.waiting];
        (piece.firing, piece.columns) = (*firing, columns.clone());
        tree.moment(&mut piece.moment);
        self.waiting += 1;
    }

    /// Fires the pieces that wait and adds their points.
    ///
    /// # Errors
    /// Why the GPU cannot; nothing is added then, and the pieces still wait.
    pub(super) fn flush(&mut self, sweeper: &Sweeper, out: &mut CloudMut<'_>) -> Result<(), String> {
        let Some(under) = self.under.filter(|_| self.waiting > 0) else { return Ok(()) };
        let Self { caster, resident, salvo, order, .. } = self;
        caster.cast(resident, salvo, under.words(), |returns| add(sweeper, order, returns, out))?;
        self.waiting = 0;
        Ok(())
    }

    /// Fires the pieces that wait on the CPU and adds their points.
    pub(super) fn fire_without(mut self, sweeper: &mut Sweeper, tree: &SceneTree, out: &mut CloudMut<'_>) {
        let Some(under) = self.under else { return };
        let mut past = tree.clone();
        for piece in self.pieces.drain(..self.waiting) {
            past.recall(&piece.moment);
            sweeper.fire_here(&past, (&piece.firing, &piece.columns), under.receiver, out);
        }
    }
}

/// Columns that one thread takes at a time.
const SHARE: usize = 128;

/// Adds the points of columns, by column and then by beam.
fn add(sweeper: &Sweeper, order: &[u32], returns: &[Words], out: &mut CloudMut<'_>) {
    let rings = sweeper.rings();
    let add_columns = |columns: &[u32], returns: &[Words], out: &mut CloudMut<'_>| {
        for (&column, returns) in columns.iter().zip(returns.chunks(rings)) {
            add_column(sweeper, column, returns, out);
        }
    };
    let Some(pool) = sweeper.pool() else { return add_columns(order, returns, out) };
    let shares = || order.chunks(SHARE).zip(returns.chunks(SHARE * rings));
    let mut counts: Vec<usize> = vec![0; order.len().div_ceil(SHARE)];
    // The place of a share is known when those before it are counted.
    pool.in_place_scope(|scope| {
        for (count, (_, returns)) in counts.iter_mut().zip(shares()) {
            scope.spawn(|_| *count = returns.iter().filter(|words| words[3] & SEEN != 0).count());
        }
    });
    let parts = out.deal(&mut counts);
    pool.in_place_scope(|scope| {
        for (mut part, (columns, returns)) in parts.into_iter().zip(shares()) {
            scope.spawn(move |_| add_columns(columns, returns, &mut part));
        }
    });
}

fn add_column(sweeper: &Sweeper, column: u32, returns: &[Words], out: &mut CloudMut<'_>) {
    let offset_s = sweeper.offset_s(column);
    let azimuth = sweeper.azimuth(column);
    for (ring, &[range, intensity, instance, class]) in returns.iter().enumerate() {
        if class & SEEN == 0 {
            continue;
        }
        let at_m = sweeper.point(ring, azimuth, f32::from_bits(range));
        let (intensity, class) = (f32::from_bits(intensity), class as u8);
        out.push(&Point { at_m, intensity, ring: ring as u16, offset_s, instance, class });
    }
}

#[cfg(test)]
mod tests;
