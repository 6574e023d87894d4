//! Shared resources: their steps start after the last turn of the instant, so that none starves.

use super::Engine;

impl Engine<'_> {
    /// Records that a user of the operator's resource had a turn.
    pub(super) fn resources_touched(&mut self, rank: usize) {
        if let Some(id) = self.nodes[rank].uses {
            self.resources[id].touched = true;
        }
    }

    /// Starts the next frame if its step is known to need no slot.
    pub(super) fn start_without_slot(&mut self, rank: usize) -> bool {
        let node = &self.nodes[rank];
        let frame = self.next_frame(rank);
        if !self.takes_no_time(rank, node.open[frame].stamp) {
            return false;
        }
        self.start_next(rank);
        true
    }

    /// Index of the next complete frame, by the number of free places regardless of the number of slots.
    fn next_frame(&self, rank: usize) -> usize {
        let (node, places) = (&self.nodes[rank], self.places(rank));
        match node.policy {
            crate::Policy::Queue { .. } => 0,
            crate::Policy::SkipToLatest | crate::Policy::Pipelined { .. } => {
                node.complete - places.min(node.complete)
            }
        }
    }

    /// Starts the frames that have a slot, in order of (instant since which they could have started, rank); then bounds
    /// the queues of all users, of whatever resource, and publishes their watermarks, in rank order.
    pub(super) fn share_resources(&mut self) {
        if !self.resources.iter().any(|resource| resource.touched) {
            return;
        }
        let mut ranks: Vec<usize> = Vec::new();
        for resource in &mut self.resources {
            resource.touched = false;
            ranks.extend(&resource.users);
        }
        ranks.sort_unstable();
        for &rank in &ranks {
            self.note_eligible(rank);
        }
        while let Some(rank) = self.next_to_start(&ranks) {
            self.start_next(rank);
            if self.failure.is_some() {
                return;
            }
            self.nodes[rank].unsettled = true;
            self.note_eligible(rank);
        }
        for rank in ranks {
            if core::mem::take(&mut self.nodes[rank].unsettled) {
                self.bound_queue(rank);
                self.rearm(rank);
            }
            // Includes users that had no turn: a publication of an earlier user may raise their watermark.
            self.publish_watermark(rank);
        }
    }

    fn note_eligible(&mut self, rank: usize) {
        let (now, places) = (self.now, self.places(rank));
        let node = &mut self.nodes[rank];
        if node.complete > 0 && places > 0 {
            node.since.get_or_insert(now);
        } else {
            node.since = None;
        }
    }

    /// Rank of the operator that starts next.
    fn next_to_start(&self, ranks: &[usize]) -> Option<usize> {
        let eligible = ranks.iter().filter_map(|rank| {
            let node = &self.nodes[*rank];
            (self.free_slots(node.uses?) > 0).then_some((node.since?, *rank))
        });
        eligible.min().map(|(_, rank)| rank)
    }

    fn free_slots(&self, id: usize) -> usize {
        let resource = &self.resources[id];
        let held = |rank: &usize| {
            let node = &self.nodes[*rank];
            let running = node.running.iter().filter(|run| run.slot && run.end > self.now).count();
            running + node.held_now(self.now)
        };
        resource.slots.saturating_sub(resource.users.iter().map(held).sum())
    }

    /// Starts the oldest of the frames for which there are places. Older frames are dropped; newer ones wait for their
    /// turn, or for a slot.
    fn start_next(&mut self, rank: usize) {
        for _ in 0..self.next_frame(rank) {
            let stamp = self.nodes[rank].discard(0);
            self.drop_stamp(rank, stamp, crate::decision::DropReason::Skipped);
        }
        self.start(rank, false);
    }
}
