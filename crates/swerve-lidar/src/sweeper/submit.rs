//! Asynchronous firing: columns are submitted now and collected later.

use core::ops::Range;

use super::submitted::{OnGpu, Progress, Submitted};
use super::{FireError, Fired, Firing, Piece, Sweeper};
use crate::cloud::{Cloud, CloudMut};
use crate::gpu::{InFlight, ShotParams};
use crate::returns::Receiver;
use crate::scene_tree::SceneTree;
use crate::scene_tree::flat::DynamicState;

impl Sweeper {
    /// Submits the columns of one step; [`Self::collect`] returns their points. A GPU thus casts the rays of one call
    /// while the points of an earlier one are collected; two submissions in flight suffice.
    ///
    /// The points are those of [`Self::begin_turn`] with this turn and [`Self::fire`]. Queued pieces of an incomplete
    /// turn of the latter are dropped. On the CPU the rays are cast immediately.
    ///
    /// # Errors
    /// As for [`Self::fire`]; nothing is submitted then.
    pub fn submit(&mut self, turn: u64, tree: &SceneTree, firing: &Firing) -> Result<Fired, FireError> {
        let piece = Piece::new(&self.pattern, firing)?;
        let fired = piece.fired(self.pattern.spec.columns);
        let receiver = Receiver::new(&self.pattern.spec, tree.weather(), turn);
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

    /// Waits for the columns submitted first, and appends their points; returns `None` if there are none in flight.
    ///
    /// `tree` is used by the CPU if the GPU is lost: its static part must be the same as at submission; the moving
    /// instances were saved.
    ///
    /// # Errors
    /// Arrays without room: nothing is appended then, and the columns can still be collected.
    pub fn collect(
        &mut self,
        tree: &SceneTree,
        out: &mut CloudMut<'_>,
    ) -> Result<Option<Range<u32>>, FireError> {
        let Some(first) = self.submitted.front() else { return Ok(None) };
        out.check(first.piece.columns.len() * self.pattern.beams.len())?;
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
            match gpu.receive(&self.pattern, in_flight, piece.columns.clone(), out) {
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

    /// Sends columns to the GPU; `None` without a working GPU.
    fn send(&mut self, tree: &SceneTree, piece: &Piece, receiver: Receiver) -> Option<InFlight> {
        let mut gpu = self.gpu.take()?;
        let params = ShotParams { receiver, hidden: piece.firing.hidden_instance };
        match gpu.send(&self.pattern, tree, params, piece) {
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

    /// Casts the rays on the CPU and stores the points.
    fn cast_now(&mut self, tree: &SceneTree, piece: &Piece, receiver: Receiver) -> Cloud {
        let mut cloud = self.spare.pop().unwrap_or_else(|| Cloud::new(&self.pattern.spec, true));
        cloud.len = 0;
        self.fire_on_cpu(tree, piece, receiver, &mut cloud.as_mut());
        cloud
    }
}
