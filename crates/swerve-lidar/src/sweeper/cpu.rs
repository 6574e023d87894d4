//! Ray casting on the CPU, eight columns at a time.

use core::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use rayon::prelude::*;
use wide::f32x8;

use super::{Firing, Pattern, Piece, Shot, Sweeper, Threads};
use crate::bvh::LANES;
use crate::cloud::{CloudMut, Point};
use crate::returns::Receiver;
use crate::scene_tree::{RayMemory, SceneTree};

impl Sweeper {
    /// Fires columns on the CPU and appends their points.
    pub(crate) fn fire_on_cpu(
        &mut self,
        tree: &SceneTree,
        piece: &Piece,
        receiver: Receiver,
        out: &mut CloudMut<'_>,
    ) {
        let (columns, beams) = (&piece.columns, self.pattern.beams.len());
        let count = columns.len() * beams;
        if self.shots.len() < count {
            self.shots.resize(count, Shot::default());
        }
        let mut shots = std::mem::take(&mut self.shots);
        let caster = ColumnCaster { pattern: &self.pattern, tree, firing: &piece.firing, receiver };
        let first = columns.start;
        let group = |(k, shots): (usize, &mut [Shot])| caster.group(first + (k * LANES) as u32, shots);
        let chunk = LANES * beams;
        match &self.threads {
            Threads::Callers if rayon::current_thread_index().is_some() => {
                shots[..count].par_chunks_mut(chunk).enumerate().for_each(group);
            }
            Threads::Own(pool) => {
                // The caller's thread takes groups too; late threads find fewer left.
                let groups = Mutex::new(shots[..count].chunks_mut(chunk).enumerate());
                let next = || groups.lock().unwrap_or_else(PoisonError::into_inner).next();
                let work = || std::iter::from_fn(next).for_each(group);
                pool.in_place_scope(|scope| {
                    (0..pool.current_num_threads()).for_each(|_| scope.spawn(|_| work()));
                    work();
                });
            }
            _ => shots[..count].chunks_mut(chunk).enumerate().for_each(group),
        }
        self.push(columns.clone(), &shots, out);
        self.shots = shots;
    }

    /// Fires the pieces of a turn, each in the scene of its step, and appends their points.
    pub(super) fn cast_turn(
        &self,
        turn: u64,
        steps: &[(Arc<SceneTree>, Firing)],
        pieces: &[Piece],
        out: &mut CloudMut<'_>,
    ) {
        let beams = self.pattern.beams.len();
        let mut shots = vec![Shot::default(); self.pattern.points_max()];
        let (mut rest, mut groups) = (&mut shots[..], Vec::new());
        for ((tree, firing), piece) in steps.iter().zip(pieces) {
            let receiver = Receiver::new(&self.pattern.spec, tree.weather(), turn);
            let (own, others) = core::mem::take(&mut rest).split_at_mut(piece.columns.len() * beams);
            rest = others;
            groups.extend(own.chunks_mut(LANES * beams).enumerate().map(|(k, shots)| {
                let caster = ColumnCaster { pattern: &self.pattern, tree, firing, receiver };
                (caster, piece.columns.start + (k * LANES) as u32, shots)
            }));
        }
        let cast = |(caster, first, shots): (ColumnCaster<'_>, u32, &mut [Shot])| caster.group(first, shots);
        match &self.threads {
            Threads::Callers if rayon::current_thread_index().is_some() => {
                groups.into_par_iter().for_each(cast);
            }
            Threads::Own(pool) => pool.install(|| groups.into_par_iter().for_each(cast)),
            _ => groups.into_iter().for_each(cast),
        }
        let mut from = 0;
        for piece in pieces {
            self.push(piece.columns.clone(), &shots[from..], out);
            from += piece.columns.len() * beams;
        }
    }

    /// Appends the points of columns; `shots` holds their beams.
    fn push(&self, columns: Range<u32>, shots: &[Shot], out: &mut CloudMut<'_>) {
        for (column, shots) in columns.zip(shots.chunks(self.pattern.beams.len())) {
            let offset_s = self.pattern.offset_s(column);
            for (ring, shot) in shots.iter().enumerate().filter(|(_, shot)| shot.is_seen) {
                let Shot { at_m, intensity, instance, class, .. } = *shot;
                out.push(&Point { at_m, intensity, ring: ring as u16, offset_s, instance, class });
            }
        }
    }
}

/// Casts the rays of one piece of a turn.
struct ColumnCaster<'a> {
    pattern: &'a Pattern,
    tree: &'a SceneTree,
    firing: &'a Firing,
    receiver: Receiver,
}

impl ColumnCaster<'_> {
    /// Fires up to eight columns starting at `first`; `shots` holds the beams of each.
    fn group(&self, first: u32, shots: &mut [Shot]) {
        let beams = self.pattern.beams.len();
        let count = shots.len() / beams;
        let (mut origin, mut matrix) = ([[0.0_f32; LANES]; 3], [[[0.0_f32; LANES]; 3]; 3]);
        // Unused lanes have the direction of the last column but a negative range.
        let mut range = [-1.0; LANES];
        let mut azimuths = [[0.0_f32; 2]; LANES];
        for lane in 0..LANES {
            let column = first + lane.min(count - 1) as u32;
            if lane < count {
                range[lane] = self.receiver.range_max();
            }
            azimuths[lane] = self.pattern.azimuth(column);
            let pose = self.pattern.column_pose(self.tree, self.firing, column);
            for axis in 0..3 {
                origin[axis][lane] = pose.origin[axis];
                for (lanes, part) in matrix[axis].iter_mut().zip(pose.matrix[axis]) {
                    lanes[lane] = part;
                }
            }
        }
        let origin = origin.map(f32x8::new);
        let matrix = matrix.map(|row| row.map(f32x8::new));
        let range = f32x8::new(range);
        let mut memory = RayMemory::default();
        for (ring, &[x, y, z]) in self.pattern.beams.iter().enumerate() {
            let along =
                |[a, b, c]: [f32x8; 3]| a * f32x8::splat(x) + b * f32x8::splat(y) + c * f32x8::splat(z);
            let directions = [along(matrix[0]), along(matrix[1]), along(matrix[2])];
            let hits = self.tree.first_of_packet(
                &mut memory,
                origin,
                directions,
                range,
                self.firing.hidden_instance,
            );
            let [dx, dy, dz] = directions.map(|d| d.to_array());
            for lane in 0..count {
                let number = (first + lane as u32) * beams as u32 + ring as u32;
                let seen = hits[lane].and_then(|hit| {
                    let back = self.receiver.detect(&hit, [dx[lane], dy[lane], dz[lane]], number)?;
                    let at_m = self.pattern.point(ring, azimuths[lane], back.range_m);
                    let (instance, class) = (hit.instance_id, hit.class as u8);
                    Some(Shot { at_m, intensity: back.intensity, instance, class, is_seen: true })
                });
                shots[lane * beams + ring] = seen.unwrap_or_default();
            }
        }
    }
}
