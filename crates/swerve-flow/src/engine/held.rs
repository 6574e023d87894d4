//! Engine functions for runs that are stepped by a caller: holding before an operator's turn, keeping the newest
//! messages of a stream.

use swerve_core::Time;

use super::Engine;
use super::node::{AtPort, Node};
use crate::message::Msg;
use crate::observer::{Observer, Watcher};
use crate::playback::PlaybackRecord;
use crate::report::RunError;
use crate::session::FeedError;

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

    /// Ends the run after the current sweep; the first reason counts.
    pub(crate) fn stop(&mut self, reason: &str) {
        self.stop.get_or_insert_with(|| reason.to_owned());
    }

    /// Adds an observer that the engine owns.
    pub(crate) fn observe(&mut self, observer: Box<dyn Observer>) {
        self.host_time |= observer.wants_host_time();
        self.observers.push(Watcher::Owned(observer));
    }

    /// True if the operator publishes records.
    pub(crate) fn is_feed(&self, rank: usize) -> bool {
        self.nodes[rank].feed.is_some()
    }

    /// Adds a record to a feed, for a later instant.
    pub(crate) fn feed(&mut self, rank: usize, mut record: PlaybackRecord) -> Result<(), FeedError> {
        let node = &mut self.nodes[rank];
        let (Some(id), Some(feed)) = (node.streams.get(record.port), &mut node.feed) else {
            return Err(FeedError::Type(format!("`{}` has no output {}", node.name, record.port)));
        };
        let stream = &self.streams[*id];
        record.take_in(&stream.payload).map_err(|(_, reason)| FeedError::Type(reason))?;
        let place = feed.partition_point(|queued| queued.visible_at <= record.visible_at);
        let is_beside = |queued: &&PlaybackRecord| queued.port == record.port;
        let before = feed.range(..place).rev().find(is_beside);
        let watermark = before.map_or(stream.watermark, |queued| queued.watermark);
        let mut later = feed.range(place..).filter(is_beside);
        let next = later.find_map(|queued| queued.message.as_ref()).map(|message| message.stamp);
        if let Some(before) = next.filter(|next| *next <= record.watermark) {
            return Err(FeedError::NotBefore { stamp: record.watermark, before });
        }
        match &mut record.message {
            Some(message) if message.stamp <= watermark => {
                return Err(FeedError::NotAfter { stamp: message.stamp, after: watermark });
            }
            Some(message) => message.origin = node.origin.then_some(message.stamp),
            None if record.watermark <= watermark => return Ok(()),
            None => {}
        }
        let is_now = record.visible_at <= self.now;
        feed.insert(place, record);
        if is_now {
            self.ready.insert(rank);
        }
        self.rearm(rank);
        Ok(())
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
