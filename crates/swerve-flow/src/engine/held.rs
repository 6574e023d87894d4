//! What a run that is stepped from outside asks of the engine: to hold before an operator's turn, to keep the newest
//! message of a stream.

use swerve_core::Time;

use super::Engine;
use super::node::{AtPort, Node};
use crate::message::Msg;
use crate::report::RunError;

impl Node {
    /// Whether a frame opens in the operator's turn at `now`.
    pub(super) fn opens_frame(&self, now: Time) -> bool {
        let comes = |port: &AtPort| {
            let mut arrives = port.pending.iter().take_while(|(arrival, ..)| *arrival <= now);
            port.fresh > 0 || arrives.any(|(_, message, _)| message.is_some())
        };
        self.at.iter().any(comes) || self.timers.iter().any(|port| port.next <= now && !port.ticking)
    }
}

impl Engine<'_> {
    /// The rank of the operator of this name.
    pub(crate) fn rank(&self, operator: &str) -> Option<usize> {
        self.nodes.iter().position(|node| &*node.name == operator)
    }

    /// Has the newest messages of the stream of this name kept, whoever reads it; gives its place.
    pub(crate) fn keep(&mut self, stream: &str, depth: usize) -> Option<usize> {
        let id = self.streams.iter().position(|state| &*state.name == stream)?;
        self.streams[id].depth = self.streams[id].depth.max(depth);
        Some(id)
    }

    /// What is kept of a stream and a reader would see now, oldest first.
    pub(crate) fn seen(&self, stream: usize) -> impl DoubleEndedIterator<Item = &Msg> {
        let stream = &self.streams[stream];
        stream.history.iter().take(stream.visible(self.now, false))
    }

    /// Why the run failed, if it did.
    pub(crate) fn failure(&self) -> Option<&RunError> {
        self.failure.as_ref()
    }

    /// Takes the turn of the operator of rank `held`, behind those of sources that were reported to meanwhile.
    pub(crate) fn take_held_turn(&mut self, held: usize) {
        while let Some(rank) = self.ready.pop() {
            self.turn(rank);
            if rank == held || self.failure.is_some() {
                return;
            }
        }
    }
}
