//! Shared resources: their steps start after the last turn of the instant, so that none starves.

use super::Engine;

/// A resource during a run.
pub(crate) struct ResourceState {
    pub(crate) slots: usize,
    /// The operators that use it, by rank.
    pub(crate) users: Vec<usize>,
    /// A user had a turn in this sweep.
    pub(crate) touched: bool,
}

impl Engine<'_> {
    /// Notes that a user of the operator's resource had a turn.
    pub(super) fn resources_touched(&mut self, rank: usize) {
        if let Some(id) = self.nodes[rank].uses {
            self.resources[id].touched = true;
        }
    }

    /// Starts, of the frames that may start, those that are known to need no slot.
    pub(super) fn start_without_slot(&mut self, rank: usize) -> bool {
        let node = &self.nodes[rank];
        let frame = self.next_frame(rank, node.free_places());
        if !self.takes_no_time(rank, node.open[frame].stamp) {
            return false;
        }
        self.start_one_of(rank, self.nodes[rank].free_places());
        true
    }

    /// Which of the complete frames is next when at most `n` may start.
    fn next_frame(&self, rank: usize, n: usize) -> usize {
        let node = &self.nodes[rank];
        match node.policy {
            crate::Policy::Queue { .. } => 0,
            crate::Policy::SkipToLatest | crate::Policy::Pipelined { .. } => {
                node.complete - n.min(node.complete)
            }
        }
    }

    /// Starts what has a slot, in order of (instant since which it could have started, rank); then bounds the
    /// queues of all users that had a turn, and publishes their watermarks.
    pub(super) fn share_resources(&mut self) {
        if !self.resources.iter().any(|resource| resource.touched) {
            return;
        }
        let mut ranks: Vec<usize> = Vec::new();
        for resource in &mut self.resources {
            if core::mem::take(&mut resource.touched) {
                ranks.extend(&resource.users);
            }
        }
        ranks.sort_unstable();
        for &rank in &ranks {
            self.note_eligible(rank);
        }
        while let Some((rank, slots)) = self.next_to_start(&ranks) {
            let n = slots.min(self.nodes[rank].free_places());
            self.start_one_of(rank, n);
            if self.failure.is_some() {
                return;
            }
            self.nodes[rank].unsettled = true;
            self.note_eligible(rank);
        }
        for rank in ranks {
            if core::mem::take(&mut self.nodes[rank].unsettled) {
                self.bound_queue(rank);
                self.publish_watermark(rank);
                self.rearm(rank);
            }
        }
    }

    fn note_eligible(&mut self, rank: usize) {
        let now = self.now;
        let node = &mut self.nodes[rank];
        if node.complete > 0 && node.free_places() > 0 {
            node.since.get_or_insert(now);
        } else {
            node.since = None;
        }
    }

    /// Who starts next, and how many slots are free there.
    fn next_to_start(&self, ranks: &[usize]) -> Option<(usize, usize)> {
        let eligible = ranks.iter().filter_map(|rank| {
            let node = &self.nodes[*rank];
            let slots = self.free_slots(node.uses?);
            (slots > 0).then_some((node.since?, *rank, slots))
        });
        eligible.min().map(|(_, rank, slots)| (rank, slots))
    }

    fn free_slots(&self, id: usize) -> usize {
        let resource = &self.resources[id];
        let runs = resource.users.iter().flat_map(|rank| &self.nodes[*rank].running);
        resource.slots.saturating_sub(runs.filter(|run| run.slot && run.end > self.now).count())
    }

    /// Starts the oldest of the frames that would start if `n` could; those before it are dropped.
    fn start_one_of(&mut self, rank: usize, n: usize) {
        for _ in 0..self.next_frame(rank, n) {
            let stamp = self.nodes[rank].discard(0);
            self.drop_stamp(rank, stamp, crate::observer::DropReason::Skipped);
        }
        self.start(rank);
    }
}
