//! Columns on their way: sent now, collected later.

use core::ops::Range;

use super::{FireError, Fired, Firing, Piece, Sweeper};
use crate::cloud::{Cloud, CloudMut};
use crate::gpu::{InFlight, ShotParams};
use crate::returns::Receiver;
use crate::scene_tree::SceneTree;
use crate::scene_tree::flat::DynamicState;

/// Columns on their way.
pub(super) struct Submitted {
    piece: Piece,
    progress: Progress,
}

/// How far they are.
enum Progress {
    /// The rays are on a GPU.
    OnGpu(Box<OnGpu>),
    /// The points are here.
    Done(Cloud),
}

/// Rays on a GPU, with what the CPU needs should it be lost.
struct OnGpu {
    in_flight: InFlight,
    dynamics: DynamicState,
    receiver: Receiver,
}

impl Sweeper {
    /// Sends the columns of one step on their way; [`Self::collect`] gives their points. So a GPU casts the rays of
    /// one call while the points of an earlier one are taken over; two on their way at a time are enough for that.
    ///
    /// The points are those of [`Self::begin_turn`] with this turn and [`Self::fire`]. Pieces of a turn of the latter
    /// that are not complete are forgotten. On the CPU the rays are cast at once.
    ///
    /// # Errors
    /// As [`Self::fire`]; nothing is on its way then.
    pub fn submit(&mut self, turn: u64, tree: &SceneTree, firing: &Firing) -> Result<Fired, FireError> {
        let piece = Piece::new(self, firing)?;
        let fired = piece.fired(self.spec.columns);
        let receiver = Receiver::new(&self.spec, tree.weather(), turn);
        let in_flight = if piece.columns.is_empty() { None } else { self.send(tree, &piece, receiver) };
        let progress = match in_flight {
            None => Progress::Done(self.cast_now(tree, &piece, receiver)),
            Some(in_flight) => {
                let mut dynamics = DynamicState::default();
                tree.save_dynamics(&mut dynamics);
                Progress::OnGpu(Box::new(OnGpu { in_flight, dynamics, receiver }))
            }
        };
        self.submitted.push_back(Submitted { piece, progress });
        Ok(fired)
    }

    /// Waits for the columns that were submitted first, and adds their points; `None` if none are on their way.
    ///
    /// `tree` is for the CPU, should the GPU be lost: what never moves has to be as it was when they were submitted;
    /// what moves is remembered.
    ///
    /// # Errors
    /// Arrays without room: nothing is added then, and the columns are still on their way.
    pub fn collect(
        &mut self,
        tree: &SceneTree,
        out: &mut CloudMut<'_>,
    ) -> Result<Option<Range<u32>>, FireError> {
        let Some(first) = self.submitted.front() else { return Ok(None) };
        out.check(first.piece.columns.len() * self.beams.len())?;
        let Some(Submitted { piece, progress }) = self.submitted.pop_front() else { return Ok(None) };
        let OnGpu { in_flight, dynamics, receiver } = match progress {
            Progress::OnGpu(on_gpu) => *on_gpu,
            Progress::Done(cloud) => {
                out.append(&cloud);
                self.spare.push(cloud);
                return Ok(Some(piece.columns));
            }
        };
        if let Some(mut gpu) = self.gpu.take() {
            match gpu.receive(self, in_flight, piece.columns.clone(), out) {
                Ok(()) => {
                    self.gpu = Some(gpu);
                    return Ok(Some(piece.columns));
                }
                Err(why) => self.fallback = Some(why),
            }
        }
        let mut past = tree.clone();
        past.restore_dynamics(&dynamics);
        self.fire_on_cpu(&past, &piece, receiver, out);
        Ok(Some(piece.columns))
    }

    /// Sends columns to the GPU; `None` if there is none, or none any more.
    fn send(&mut self, tree: &SceneTree, piece: &Piece, receiver: Receiver) -> Option<InFlight> {
        let mut gpu = self.gpu.take()?;
        let params = ShotParams { receiver, hidden: piece.firing.hidden_instance };
        match gpu.send(self, tree, params, piece) {
            Ok(in_flight) => {
                self.gpu = Some(gpu);
                Some(in_flight)
            }
            Err(why) => {
                self.fallback = Some(why);
                None
            }
        }
    }

    /// Casts the rays on the CPU and keeps the points.
    fn cast_now(&mut self, tree: &SceneTree, piece: &Piece, receiver: Receiver) -> Cloud {
        let mut cloud = self.spare.pop().unwrap_or_else(|| Cloud::new(&self.spec, true));
        cloud.len = 0;
        self.fire_on_cpu(tree, piece, receiver, &mut cloud.as_mut());
        cloud
    }
}
