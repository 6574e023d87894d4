//! One operator's turn in a sweep: execution.md, section 3, (a) to (f).

use swerve_core::{Span, Time};

use super::answer::{Answer, Ended, Finished, Missed, Step, snapshot};
use super::node::{Outcome, Ran, Run};
use super::{Engine, tell};
use crate::deadline::{Anchor, Length, Reaction};
use crate::decision::{Decision, DropReason};
use crate::observer::{Event, Miss, StepEnd};
use crate::operator::ErasedMiss;
use crate::policy::{Full, Policy};
use crate::report::RunError;
use crate::stream::Edge;

impl Engine<'_> {
    /// Executes everything that is due for the operator at the current instant.
    pub(super) fn turn(&mut self, rank: usize) {
        if self.nodes[rank].feed.is_some() {
            self.publish_feed(rank);
            self.nodes[rank].release_held(self.now);
            self.resources_touched(rank);
            return self.rearm(rank);
        }
        if self.nodes[rank].at_once
            && let Some(stamp) = self.nodes[rank].frame_at_once()
        {
            return self.turn_at_once(rank, stamp);
        }
        self.arrive(rank);
        loop {
            self.publish_due(rank);
            let reacted = self.handle_deadlines(rank);
            self.take_in(rank);
            let started = self.start_allowed(rank);
            // Only a reaction, or a step that has already ended, gives (a) to (d) more to do.
            if !(reacted || started && self.nodes[rank].has_more(self.now)) || self.failure.is_some() {
                break;
            }
        }
        if self.nodes[rank].uses.is_some() {
            self.nodes[rank].unsettled = true;
            self.resources_touched(rank);
        } else {
            self.bound_queue(rank);
            self.publish_watermark(rank);
        }
        self.rearm(rank);
    }

    /// A turn with a single step that takes no time: the result of [`turn`](Self::turn), on a shorter path.
    fn turn_at_once(&mut self, rank: usize, stamp: Time) {
        let node = &mut self.nodes[rank];
        node.at[0].fresh = 0;
        let watermark = node.at[0].watermark;
        if !self.step_at_once(rank, stamp, watermark) {
            // The frame of the step stays open.
            self.nodes[rank].open.push_back(super::node::Open { stamp, deadline: Time::MAX });
            return self.publish_watermark(rank);
        }
        for port in 0..self.nodes[rank].streams.len() {
            self.publish_risen(rank, port, watermark);
        }
    }

    /// Opens the frames of messages and ticks that became visible since the last turn.
    fn arrive(&mut self, rank: usize) {
        let now = self.now;
        for port in 0..self.nodes[rank].at.len() {
            let at = &mut self.nodes[rank].at[port];
            while at.pending.front().is_some_and(|(arrival, ..)| *arrival <= now) {
                let (_, msg, watermark) = at.pending.pop_front().expect("just seen");
                at.watermark = watermark;
                at.fresh += usize::from(msg.is_some());
                at.queue.extend(msg);
            }
            let fresh = core::mem::take(&mut at.fresh);
            let mut index = at.queue.len() - fresh;
            for _ in 0..fresh {
                let node = &mut self.nodes[rank];
                let stamp = node.at[port].queue[index].header.stamp;
                if stamp <= node.floor {
                    node.at[port].queue.remove(index);
                    self.drop_stamp(rank, stamp, DropReason::TooLate);
                } else {
                    index += 1;
                    self.open(rank, stamp);
                }
            }
        }
        for timer in 0..self.nodes[rank].timers.len() {
            let port = &mut self.nodes[rank].timers[timer];
            if port.next <= now && !port.ticking {
                port.ticking = true;
                let (stamp, period) = (port.next, port.timer.period);
                self.note_lateness(rank, stamp, period);
                self.open(rank, stamp);
            }
        }
    }

    /// Records the delay of a tick on the real clock.
    fn note_lateness(&mut self, rank: usize, due: Time, period: Span) {
        if let (Some(pace), Some(lateness)) = (&self.wall, &mut self.nodes[rank].lateness) {
            let late = (pace.now() - due).max(Span::ZERO);
            lateness.tick(late.ns().unsigned_abs(), late >= period);
        }
    }

    fn open(&mut self, rank: usize, stamp: Time) {
        if let Some(index) = self.nodes[rank].opening(stamp) {
            let deadline = match self.nodes[rank].deadline.map(|deadline| deadline.anchor) {
                Some(Anchor::Arrival) => self.deadline_from(rank, self.now),
                Some(Anchor::Stamp) => self.deadline_from(rank, stamp),
                Some(Anchor::Start) | None => Time::MAX,
            };
            let node = &mut self.nodes[rank];
            node.next_deadline = node.next_deadline.min(deadline);
            let open = super::node::Open { stamp, deadline };
            if index == node.open.len() {
                node.open.push_back(open);
            } else {
                node.open.insert(index, open);
            }
        }
    }

    /// Deadline counted from `anchor`, with the length at the current instant.
    pub(super) fn deadline_from(&self, rank: usize, anchor: Time) -> Time {
        let length = match self.nodes[rank].deadline.map(|deadline| deadline.length) {
            None => return Time::MAX,
            Some(Length::Static(length)) => length,
            Some(Length::Policy(edge, before)) => {
                let stream =
                    &self.streams[self.nodes[rank].policy_stream.expect("set where a policy is read")];
                let newest = stream.visible(self.now, matches!(edge, Edge::Feedback(_))).checked_sub(1);
                newest.map_or(before, |index| *stream.history[index].sent.clone().typed::<Span>().0)
            }
        };
        anchor.saturating_add(length)
    }

    /// (a) Publishes the results that are due, in stamp order.
    fn publish_due(&mut self, rank: usize) {
        let now = self.now;
        let mut waits = false;
        let mut index = 0;
        while let Some(run) = self.nodes[rank].running.get(index) {
            if run.end > now || !self.settle(rank, index) {
                let run = &self.nodes[rank].running[index];
                waits |= !run.resolved && !self.nodes[rank].policy.overtakes();
                index += 1;
                continue;
            }
            let node = &self.nodes[rank];
            let run = &node.running[index];
            let put_off = node.policy.comes_out(run.end, node.came_out) > now;
            if run.finished && (waits || put_off || run.left_to_reaction()) {
                waits |= !node.policy.overtakes();
                index += 1;
                continue;
            }
            let running = &mut self.nodes[rank].running;
            let run = if index == 0 { running.pop_front() } else { running.remove(index) };
            let mut run = run.expect("just seen");
            self.end_step(rank, &mut run);
            let silent = matches!(&run.outcome, Outcome::Here(ran) if ran.is_empty());
            if run.left_to_reaction() || ((waits || put_off) && !run.resolved && !silent) {
                waits |= !self.nodes[rank].policy.overtakes();
                self.nodes[rank].running.insert(index, run);
                index += 1;
            } else {
                index -= self.publish_result(rank, &mut run);
                self.nodes[rank].spare_reads = run.reads;
            }
        }
    }

    /// Publishes the result of a step that has ended and left the line; returns the number of older steps that left the
    /// line with it.
    fn publish_result(&mut self, rank: usize, run: &mut Run) -> usize {
        let Outcome::Here(ran) = &mut run.outcome else { return 0 };
        if run.resolved || ran.is_empty() {
            return 0;
        }
        self.nodes[rank].came_out = Some(self.now);
        // Steps before it in the line that are still running give up their stamps.
        let left = self.resolve_older(rank, run.stamp);
        let answer = Answer { stamp: run.stamp, reused_from: None, origin: run.origin, reads: &run.reads };
        self.publish(rank, &answer, &mut ran.outs);
        left
    }

    /// Answers at once for a step that takes no time and is alone in its operator.
    pub(super) fn publish_at_once(&mut self, rank: usize, mut run: Run) {
        self.end_step(rank, &mut run);
        self.publish_result(rank, &mut run);
        self.nodes[rank].spare_reads = run.reads;
    }

    /// Records that a step has reached its modelled end.
    fn end_step(&mut self, rank: usize, run: &mut Run) {
        if core::mem::replace(&mut run.finished, true) {
            return;
        }
        let node = &mut self.nodes[rank];
        let Outcome::Here(ran) = &mut run.outcome else { return };
        let keep = node.deadline.is_some_and(|deadline| deadline.reaction != Reaction::Skip);
        if keep && !ran.is_empty() && node.last.as_ref().is_none_or(|last| last.stamp < run.stamp) {
            let (stamp, origin) = (run.stamp, run.origin);
            node.last = Some(Finished { stamp, origin, reads: run.reads.clone(), outs: ran.outs.clone() });
        }
        let ended = Ended { stamp: run.stamp, start: run.start, end: run.end, late: run.resolved };
        self.note_end(rank, &ended, ran);
    }

    /// Counts a step that has reached its modelled end, and notifies the observers.
    #[inline]
    pub(super) fn note_end(&mut self, rank: usize, ended: &Ended, ran: &mut Ran) {
        let &Ended { stamp, start, end, late } = ended;
        let node = &mut self.nodes[rank];
        node.tally.ended += 1;
        node.tally.busy += end - start;
        node.tally.units += ran.units;
        if let Some(reason) = ran.unusual.take().and_then(|unusual| unusual.stop_run) {
            self.stop.get_or_insert(reason);
        }
        if self.observers.is_empty() {
            return;
        }
        let (units, host_ns) = (ran.units, ran.host_ns);
        let event = StepEnd { operator: &node.name, stamp, start, end, units, host_ns, late };
        tell(&mut self.observers, &Event::StepEnd(event));
    }

    /// Resolves stamps older than `stamp`, which is being answered; returns the number of running steps that left the
    /// line.
    fn resolve_older(&mut self, rank: usize, stamp: Time) -> usize {
        let mut left = 0;
        let mut index = 0;
        while let Some(run) = self.nodes[rank].running.get_mut(index) {
            if run.stamp >= stamp {
                break;
            }
            let (older, waits_only) = (run.stamp, run.finished);
            let newly = !core::mem::replace(&mut run.resolved, true);
            if newly && waits_only {
                self.nodes[rank].running.remove(index);
                left += 1;
            } else {
                index += 1;
            }
            if newly {
                self.drop_stamp(rank, older, DropReason::Overtaken);
            }
        }
        while self.nodes[rank].open.front().is_some_and(|open| open.stamp < stamp) {
            let older = self.nodes[rank].discard(0);
            self.drop_stamp(rank, older, DropReason::GivenUp);
        }
        left
    }

    /// (b) Handles the deadlines that have passed, in stamp order.
    fn handle_deadlines(&mut self, rank: usize) -> bool {
        let now = self.now;
        if now < self.nodes[rank].next_deadline {
            return false;
        }
        let mut changed = false;
        loop {
            let node = &self.nodes[rank];
            let late = |run: &Run| !run.resolved && run.deadline <= now;
            if let Some(index) = node.running.iter().position(late) {
                self.miss_running(rank, index);
            } else if let Some(index) = node.open.iter().position(|open| open.deadline <= now) {
                let open = self.nodes[rank].open[index];
                self.nodes[rank].discard(index);
                let missed = Missed { stamp: open.stamp, deadline: open.deadline, started: false };
                self.react(rank, &missed, Step::default());
            } else {
                return changed;
            }
            changed = true;
        }
    }

    fn miss_running(&mut self, rank: usize, index: usize) {
        let run = &mut self.nodes[rank].running[index];
        run.resolved = true;
        let missed = Missed { stamp: run.stamp, deadline: run.deadline, started: true };
        let origin = run.origin;
        if run.finished {
            // Its place is now free: it only waited for an older result or for this reaction.
            let mut run = self.nodes[rank].running.remove(index).expect("just seen");
            let offered = run.offered.take().map(|offered| snapshot(&offered));
            let Outcome::Here(ran) = run.outcome else { return };
            let step = if ran.is_empty() {
                Step { own: None, offered, origin, reads: run.reads }
            } else {
                let own = Finished { stamp: run.stamp, origin, reads: run.reads, outs: ran.outs };
                Step { own: Some(own), ..Step::default() }
            };
            return self.react(rank, &missed, step);
        }
        let offered = run.offered.clone();
        if offered.is_some() && self.wall.is_none() {
            // The offers of the step within its budget are a function of its inputs: wait until it was executed.
            self.wait_for(rank, index);
        }
        let reads = self.nodes[rank].running[index].reads.clone();
        let offered = offered.map(|offered| snapshot(&offered));
        self.react(rank, &missed, Step { own: None, offered, origin, reads });
    }

    /// Publishes the reaction to a missed deadline.
    fn react(&mut self, rank: usize, missed: &Missed, step: Step) {
        let reaction = self.nodes[rank].deadline.map_or(Reaction::Skip, |deadline| deadline.reaction);
        self.nodes[rank].tally.misses += 1;
        self.tell_miss(rank, missed, reaction, step.offered.as_ref().map_or(0, |(n, _)| *n));
        self.resolve_older(rank, missed.stamp);
        self.nodes[rank].floor = missed.stamp;
        let last = self.nodes[rank].last.take();
        match reaction {
            Reaction::Skip => {}
            Reaction::ReuseLast => {
                if let Some(mut own) = step.own {
                    let answer =
                        Answer { stamp: own.stamp, reused_from: None, origin: own.origin, reads: &own.reads };
                    self.publish(rank, &answer, &mut own.outs);
                } else if let Some(last) = &last {
                    let (reused_from, origin) = (Some(last.stamp), last.origin);
                    let answer = Answer { stamp: missed.stamp, reused_from, origin, reads: &last.reads };
                    self.publish(rank, &answer, &mut last.outs.clone());
                }
            }
            Reaction::OnDeadline => self.react_by_operator(rank, missed.stamp, step, last.as_ref()),
        }
        self.nodes[rank].last = last;
    }

    fn react_by_operator(&mut self, rank: usize, stamp: Time, step: Step, last: Option<&Finished>) {
        let offered = step.offered.filter(|(n, _)| *n > 0).map(|(_, outs)| outs);
        let miss = ErasedMiss {
            stamp,
            now: self.now,
            last: last.map(|last| (last.stamp, &last.outs)),
            offered: offered.as_ref(),
        };
        let mut outs = self.call_on_deadline(rank, &miss);
        // The answer derives from the running step if that offered something, else from the newest result.
        let (origin, reads) = match (&offered, last) {
            (Some(_), _) => (step.origin, &step.reads[..]),
            (None, Some(last)) => (last.origin, &last.reads[..]),
            (None, None) => (None, &[][..]),
        };
        if !outs.is_empty() {
            self.publish(rank, &Answer { stamp, reused_from: None, origin, reads }, &mut outs);
        }
    }

    fn tell_miss(&mut self, rank: usize, missed: &Missed, reaction: Reaction, offers: u64) {
        if self.observers.is_empty() {
            return;
        }
        let name = self.nodes[rank].name.clone();
        let &Missed { stamp, deadline, started } = missed;
        let at = self.now;
        self.tell(&Event::Miss(Miss { operator: &name, stamp, deadline, at, reaction, started }));
        self.decide(|| Decision::Deadline { operator: name.to_string(), stamp, at, offers });
    }

    /// (c) Takes in ticks and newly complete frames.
    fn take_in(&mut self, rank: usize) {
        let node = &mut self.nodes[rank];
        for port in &mut node.timers {
            if core::mem::take(&mut port.ticking) {
                port.next = port.next.saturating_add(port.timer.period);
                port.watermark = port.next.saturating_add(Span::from_ns(-1));
            }
        }
        if node.open.len() == node.complete {
            return;
        }
        let joined = node.joined();
        while node.open.get(node.complete).is_some_and(|open| open.stamp <= joined) {
            node.complete += 1;
        }
    }

    /// (d) Starts the steps that the busy policy allows. Steps that need a slot start after the sweep.
    fn start_allowed(&mut self, rank: usize) -> bool {
        let node = &self.nodes[rank];
        if node.complete == 0 || self.places(rank) == 0 {
            return false;
        }
        if node.uses.is_some() {
            return self.start_without_slot(rank);
        }
        let places = self.places(rank);
        self.start_some(rank, places);
        true
    }

    /// Number of steps that can start now. Under wall clock a heavy operator has one worker at a time.
    pub(super) fn places(&self, rank: usize) -> usize {
        let node = &self.nodes[rank];
        let free = node.free_places();
        if !(node.heavy && self.one_worker) {
            return free;
        }
        if node.running.iter().any(|run| run.end > self.now) { 0 } else { free.min(1) }
    }

    /// Starts up to `n` frames selected by the policy; frames that it passes over are dropped.
    pub(super) fn start_some(&mut self, rank: usize, n: usize) {
        let node = &self.nodes[rank];
        let starting = match node.policy {
            Policy::Queue { .. } => n.min(1),
            Policy::SkipToLatest | Policy::Pipelined { .. } => {
                let starting = n.min(node.complete);
                for _ in starting..node.complete {
                    let stamp = self.nodes[rank].discard(0);
                    self.drop_stamp(rank, stamp, DropReason::Skipped);
                }
                starting
            }
        };
        for _ in 0..starting {
            self.start(rank, starting == 1);
        }
    }

    /// (e) Drops the frames that the busy policy does not let wait.
    pub(super) fn bound_queue(&mut self, rank: usize) {
        loop {
            let node = &self.nodes[rank];
            if node.complete <= node.policy.waiting_max() {
                return;
            }
            let (index, reason) = match node.policy {
                Policy::SkipToLatest | Policy::Pipelined { .. } => (0, DropReason::Skipped),
                Policy::Queue { full: Full::DropOldest, .. } => (0, DropReason::QueueFull),
                Policy::Queue { full: Full::DropNewest, .. } => (node.complete - 1, DropReason::QueueFull),
                Policy::Queue { full: Full::Fail, .. } => {
                    let stamp = node.open[node.complete - 1].stamp;
                    self.failure = Some(RunError::QueueFull { operator: node.name.to_string(), stamp });
                    return;
                }
            };
            let stamp = self.nodes[rank].discard(index);
            self.drop_stamp(rank, stamp, reason);
        }
    }

    /// Determines the operator's next due instant.
    pub(super) fn rearm(&mut self, rank: usize) {
        let node = &mut self.nodes[rank];
        let mut due = Time::MAX;
        if let Some(feed) = &node.feed {
            due = feed.front().map_or(Time::MAX, |record| record.visible_at);
            due = due.min(node.held_change(self.now));
        }
        for port in &node.timers {
            due = due.min(port.next);
        }
        for port in &node.at {
            due = port.pending.front().map_or(due, |(arrival, ..)| due.min(*arrival));
        }
        for run in &node.running {
            if !run.finished {
                due = due.min(run.end);
            } else if !run.resolved {
                // It was put off; if it waits for an older step, the end of that step is due earlier.
                let out = node.policy.comes_out(run.end, node.came_out);
                due = if out > self.now { due.min(out) } else { due };
            }
        }
        if node.deadline.is_some() {
            let running = node.running.iter().filter(|run| !run.resolved).map(|run| run.deadline);
            let least = running.fold(Time::MAX, Time::min);
            node.next_deadline = node.open.iter().fold(least, |least, open| least.min(open.deadline));
            due = due.min(node.next_deadline);
        }
        self.due.set(rank, due);
    }
}
