//! Turns on a GPU: pieces of a turn wait until it is complete, go there together, and come back as points.

use core::ops::Range;
use std::sync::Arc;

use super::cloud::CloudMut;
use super::returns::Receiver;
use super::scene_tree::SceneTree;
use super::scene_tree::flat::{Moment, Resident, Salvo};
use super::sweep::{Firing, Sweeper};
use crate::gpu::Gpu;
use crate::gpu::lidar::{Caster, Flight, Points, SETTINGS};

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
    /// The columns of one that went alone.
    landing: Vec<u32>,
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
            landing: Vec::new(),
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
        load(&mut self.salvo, (sweeper, tree), &self.resident, (firing, columns));
        self.order.extend(columns.clone());
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
        let flight = caster.send(resident, salvo, under.words())?;
        caster.fetch(flight, |points| add(sweeper, order, points, out))?;
        self.waiting = 0;
        Ok(())
    }

    /// Sends a piece alone.
    ///
    /// # Errors
    /// Why the GPU cannot.
    pub(super) fn launch(
        &mut self,
        sweeper: &Sweeper,
        tree: &SceneTree,
        under: Under,
        (firing, columns): (&Firing, &Range<u32>),
    ) -> Result<Flight, String> {
        self.drop_pieces();
        if self.resident.is_outdated(tree) {
            self.resident.clear();
        }
        self.resident.take_over(tree);
        self.salvo.begin(tree, &self.resident);
        load(&mut self.salvo, (sweeper, tree), &self.resident, (firing, columns));
        self.caster.send(&mut self.resident, &self.salvo, under.words())
    }

    /// Waits for a piece that went alone and adds its points.
    ///
    /// # Errors
    /// Why the GPU cannot; nothing is added then.
    pub(super) fn land(
        &mut self,
        sweeper: &Sweeper,
        (flight, columns): (Flight, Range<u32>),
        out: &mut CloudMut<'_>,
    ) -> Result<(), String> {
        let Self { caster, landing, .. } = self;
        landing.clear();
        landing.extend(columns);
        caster.fetch(flight, |points| add(sweeper, landing, points, out))
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

/// Adds a piece to a salvo.
fn load(
    salvo: &mut Salvo,
    (sweeper, tree): (&Sweeper, &SceneTree),
    resident: &Resident,
    (firing, columns): (&Firing, &Range<u32>),
) {
    let root = salvo.add(tree.moving(), resident);
    for (column, aim) in columns.clone().zip(sweeper.aims(tree, firing, columns.clone())) {
        salvo.add_column(&aim, root, (column, sweeper.azimuth(column)));
    }
}

/// Adds points; `order` has the columns of the salvo.
fn add(sweeper: &Sweeper, order: &[u32], points: &Points<'_>, out: &mut CloudMut<'_>) {
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
        of_column.fill(sweeper.offset_s(column));
        rest = behind;
    }
    *out.len = new.end;
}

#[cfg(test)]
mod tests;
