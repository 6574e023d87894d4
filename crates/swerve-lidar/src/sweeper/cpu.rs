//! Rays on the CPU, eight columns at a time.

use std::sync::{Mutex, PoisonError};

use wide::f32x8;

use super::{Firing, Piece, Shot, Sweeper};
use crate::bvh::LANES;
use crate::cloud::{CloudMut, Point};
use crate::returns::Receiver;
use crate::scene_tree::{RayMemory, SceneTree};

impl Sweeper {
    /// Fires columns on the CPU and adds their points.
    pub(crate) fn fire_on_cpu(
        &mut self,
        tree: &SceneTree,
        piece: &Piece,
        receiver: Receiver,
        out: &mut CloudMut<'_>,
    ) {
        let (columns, beams) = (&piece.columns, self.beams.len());
        let count = columns.len() * beams;
        if self.shots.len() < count {
            self.shots.resize(count, Shot::default());
        }
        let mut shots = std::mem::take(&mut self.shots);
        let caster = ColumnCaster { sweeper: self, tree, firing: &piece.firing, receiver };
        let first = columns.start;
        let group = |(k, shots): (usize, &mut [Shot])| caster.group(first + (k * LANES) as u32, shots);
        let chunk = LANES * beams;
        match &self.pool {
            Some(pool) => {
                // The caller's thread takes groups like the others: late threads just find fewer left.
                let groups = Mutex::new(shots[..count].chunks_mut(chunk).enumerate());
                let next = || groups.lock().unwrap_or_else(PoisonError::into_inner).next();
                let work = || std::iter::from_fn(next).for_each(group);
                pool.in_place_scope(|scope| {
                    (0..pool.current_num_threads()).for_each(|_| scope.spawn(|_| work()));
                    work();
                });
            }
            None => shots[..count].chunks_mut(chunk).enumerate().for_each(group),
        }
        for (column, shots) in columns.clone().zip(shots.chunks(beams)) {
            let offset_s = self.offset_s(column);
            for (ring, shot) in shots.iter().enumerate().filter(|(_, shot)| shot.is_seen) {
                let Shot { at_m, intensity, instance, class, .. } = *shot;
                out.push(&Point { at_m, intensity, ring: ring as u16, offset_s, instance, class });
            }
        }
        self.shots = shots;
    }
}

/// Casts the rays of one piece of a turn.
struct ColumnCaster<'a> {
    sweeper: &'a Sweeper,
    tree: &'a SceneTree,
    firing: &'a Firing,
    receiver: Receiver,
}

impl ColumnCaster<'_> {
    /// Fires up to eight columns from `first` on; `shots` has the beams of each.
    fn group(&self, first: u32, shots: &mut [Shot]) {
        let beams = self.sweeper.beams.len();
        let count = shots.len() / beams;
        let (mut origin, mut matrix) = ([[0.0_f32; LANES]; 3], [[[0.0_f32; LANES]; 3]; 3]);
        // Lanes without a column look where the last one does, but reach nothing.
        let mut range = [-1.0; LANES];
        let mut azimuths = [[0.0_f32; 2]; LANES];
        for lane in 0..LANES {
            let column = first + lane.min(count - 1) as u32;
            if lane < count {
                range[lane] = self.receiver.range_max();
            }
            azimuths[lane] = self.sweeper.azimuth(column);
            let pose = self.sweeper.column_pose(self.tree, self.firing, column);
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
        for (ring, &[x, y, z]) in self.sweeper.beams.iter().enumerate() {
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
                    let at_m = self.sweeper.point(ring, azimuths[lane], back.range_m);
                    let (instance, class) = (hit.instance_id, hit.class as u8);
                    Some(Shot { at_m, intensity: back.intensity, instance, class, is_seen: true })
                });
                shots[lane * beams + ring] = seen.unwrap_or_default();
            }
        }
    }
}
