//! Engine functions for runs that are stepped by a caller: holding before an operator's turn, keeping the newest
//! messages of a stream.

use swerve_core::Time;

use super::Engine;
use super::node::{AtPort, Node};
use crate::message::Msg;
use crate::report::RunError;

impl Node {
    /// True if a frame opens in the operator's turn at `now`.
    pub(super) fn opens_frame(&self, now: Time) -> bool {
        let comes = |port: &AtPort| {
            let mut arrives = port.pending.iter().take_while(|(arrival, ..)| *arrival <= now);
            port.fresh > 0 || arrives.any(|(_, message, _)| message.is_some())
        };
        self.at.iter().any(comes) || self.timers.iter().any(|port| port.next <= now && !port.ticking)
    }
}

impl Engine<'_> {
    /// Rank of the operator of this name.
    pub(crate) fn rank(&self, operator: &str) -> Option<usize> {
        self.nodes.iter().position(|node| &*node.name == operator)
    }

    /// Keeps the newest messages of the stream of this name, whether or not it has readers; returns its index.
    pub(crate) fn keep(&mut self, stream: &str, depth: usize) -> Option<usize> {
        let id = self.streams.iter().position(|state| &*state.name == stream)?;
        self.streams[id].depth = self.streams[id].depth.max(depth);
        Some(id)
    }

    /// Kept messages of a stream that a reader would receive now, oldest first.
    pub(crate) fn seen(&self, stream: usize) -> impl DoubleEndedIterator<Item = &Msg> {
        let stream = &self.streams[stream];
        stream.history.iter().take(stream.visible(self.now, false))
    }

    /// Error of the run, if it failed.
    pub(crate) fn failure(&self) -> Option<&RunError> {
        self.failure.as_ref()
    }

    /// Takes the turn of the operator of rank `held`, after those of sources that received reports meanwhile.
    pub(crate) fn take_held_turn(&mut self, held: usize) {
        while let Some(rank) = self.ready.pop() {
            self.turn(rank);
            if rank == held || self.failure.is_some() {
                return;
            }
        }
    }
}
