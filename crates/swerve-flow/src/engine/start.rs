//! Starting a step: its inputs, its run time, and where it is executed.

use core::panic::AssertUnwindSafe;
use std::panic::catch_unwind;
use std::sync::{Arc, Mutex};

use swerve_core::{Span, Time};

use super::answer::{Answer, Ended};
use super::node::{Outcome, PortRef, Ran, Run, run};
use super::pool::Job;
use super::{Engine, Event, tell};
use crate::deadline::{Anchor, Reaction};
use crate::decision::{Decided, Decision};
use crate::graph::newest;
use crate::host::Begin;
use crate::input::{Show, Slot};
use crate::message::Msg;
use crate::observer::{Reads, StepStart};
use crate::operator::{Cut, ErasedMiss, Meter, Offered, Task, said};
use crate::promise::Workers;
use crate::report::RunError;
use crate::runtime::{Draw, RuntimeModel};
use crate::sent::Outs;

/// Maximum number of an operator's steps with unkept promises.
const PROMISED_MAX: usize = 4;

impl Engine<'_> {
    /// Starts the step of the oldest complete frame; `alone` if no other one starts in this pass of the turn.
    pub(super) fn start(&mut self, rank: usize, alone: bool) {
        let now = self.now;
        self.wait_for_body(rank);
        let anchor = self.nodes[rank].deadline.map(|deadline| deadline.anchor);
        let node = &mut self.nodes[rank];
        let open = node.open.pop_front().expect("the caller saw a complete frame");
        node.complete -= 1;
        node.since = None;
        let stamp = open.stamp;
        let deadline = match anchor {
            Some(Anchor::Start) => self.deadline_from(rank, now),
            _ => open.deadline,
        };
        let Some((origin, reads)) = self.read(rank, stamp) else { return };
        let decided = self.replay.as_ref().and_then(|replay| replay.step(&self.nodes[rank].name, stamp));
        let draw = self.draw(rank, stamp, decided);
        self.nodes[rank].tally.steps += 1;
        self.tell_start(rank, stamp, deadline, &reads);

        let meter = Meter { units: 0, cut: self.cut(rank, deadline, decided) };
        let offered = meter.cut.as_ref().and_then(|cut| cut.offered.clone());
        let due = (deadline < Time::MAX).then_some(deadline);
        let workers = None;
        let mut task =
            Task { now, stamp, deadline: due, seed: self.seed, rng: None, meter, workers, unusual: None };
        let (least_end, known) = match draw {
            Draw::Known(span) | Draw::Unrecorded(span) => (now.saturating_add(span), true),
            Draw::Work(base) => (now.saturating_add(base).min(deadline), false),
            Draw::Measured => (now, false),
        };
        let wall = self.wall.is_some();
        let node = &mut self.nodes[rank];
        node.next_deadline = node.next_deadline.min(deadline);
        let away = node.heavy && (least_end > now || wall) && self.pool.is_some();
        // Under wall clock a worker reports the end.
        let end = if away && wall { Time::MAX } else { least_end };
        let settled = known && (!wall || least_end == now) || (away && wall);
        let (finished, resolved, slot) = (false, false, node.uses.is_some());
        let mut run = Run {
            stamp,
            start: now,
            end,
            settled,
            least_end,
            draw,
            deadline,
            finished,
            resolved,
            slot,
            origin,
            reads,
            offered,
            outcome: Outcome::Here(Ran::default()),
        };
        if decided.is_some_and(|decided| decided.restarted)
            && let Some(spare) = self.nodes[rank].spares.pop_front()
        {
            self.nodes[rank].body = Some(spare);
        }
        if decided.is_some_and(|decided| decided.lost) {
            // It had no result in the run that is repeated.
        } else if away {
            run.outcome = self.send_away(rank, task);
            return self.nodes[rank].running.push_back(run);
        } else if let Outcome::Here(ran) = &mut run.outcome {
            self.run_here(rank, &mut task, ran);
        }
        self.settle_ran(rank, &mut run);
        let node = &self.nodes[rank];
        let out_now = run.end == now && node.policy.comes_out(now, node.came_out) == now;
        if alone && out_now && node.running.is_empty() && self.failure.is_none() {
            return self.publish_at_once(rank, run);
        }
        self.nodes[rank].running.push_back(run);
    }

    /// Executes a single step that takes no time, for a frame that is not open, and publishes its answer with this
    /// watermark. Returns true if the frame is done.
    pub(super) fn step_at_once(&mut self, rank: usize, stamp: Time, watermark: Time) -> bool {
        let Some((origin, reads)) = self.read(rank, stamp) else { return true };
        let now = self.now;
        self.nodes[rank].tally.steps += 1;
        self.tell_start(rank, stamp, Time::MAX, &reads);
        let mut task = Task::new(now, stamp, self.seed);
        let mut ran = Ran::default();
        self.run_here(rank, &mut task, &mut ran);
        if !self.went_well(rank, stamp, &mut ran) {
            return false;
        }
        self.note_end(rank, &Ended { stamp, start: now, end: now, late: false }, &mut ran);
        if !ran.is_empty() {
            self.nodes[rank].floor = stamp;
            let answer = Answer { stamp, reused_from: None, origin, reads: &reads };
            self.publish_with(rank, watermark, &answer, &mut ran.outs);
        }
        self.nodes[rank].spare_reads = reads;
        true
    }

    /// Fills the slots with the step's inputs and returns their origin and stamps; `None` if an input was promised and
    /// not made, which ends the run.
    #[inline]
    fn read(&mut self, rank: usize, stamp: Time) -> Option<(Option<Time>, Vec<Option<Time>>)> {
        // Without a pool there are no promises.
        if self.pool.is_none() {
            return Some(self.fill_slots(rank, stamp));
        }
        self.keep_up(rank);
        let read = self.fill_slots(rank, stamp);
        self.wait_for_promised(rank);
        self.failure.is_none().then_some(read)
    }

    /// Fills the slots with the step's inputs and returns their origin and stamps.
    fn fill_slots(&mut self, rank: usize, stamp: Time) -> (Option<Time>, Vec<Option<Time>>) {
        let observed = !self.observers.is_empty();
        let now = self.now;
        let node = &mut self.nodes[rank];
        let mut reads = core::mem::take(&mut node.spare_reads);
        reads.clear();
        if observed {
            reads.reserve_exact(node.reads.len());
        }
        let mut origin = None;
        for (slot, port) in node.slots.iter_mut().zip(&node.order) {
            let header = match *port {
                PortRef::At(port) => match node.at[port].take(stamp) {
                    Some(msg) => {
                        let header = msg.header;
                        *slot = Slot::Message(msg);
                        Some(header)
                    }
                    None => {
                        *slot = Slot::Empty;
                        None
                    }
                },
                PortRef::Timer(port) => {
                    let timer = &node.timers[port];
                    let since = stamp - timer.timer.phase;
                    let only = node.order.len() == node.latest.len() + 1;
                    let ticks = only || (since.ns() >= 0 && since.ns() % timer.timer.period.ns() == 0);
                    *slot = if ticks { Slot::Tick } else { Slot::Empty };
                    continue;
                }
                PortRef::Latest(port) => {
                    let port = &mut node.latest[port];
                    let stream = &self.streams[port.stream];
                    let visible = stream.visible(now, port.feedback);
                    let newest = visible.checked_sub(1).map(|index| &stream.history[index]);
                    let number = newest.map(|msg| msg.header.seq);
                    let is_read = core::mem::replace(&mut port.read, number) == number;
                    *slot = match (newest, port.show) {
                        (None, _) => Slot::Empty,
                        (Some(_), Show::Unread) if is_read => Slot::Empty,
                        (Some(msg), Show::Newest | Show::Unread) => Slot::Message(msg.clone()),
                        (Some(_), Show::Window) => {
                            let first = visible.saturating_sub(port.depth);
                            Slot::Window(stream.history.range(first..visible).cloned().collect())
                        }
                    };
                    newest.map(|msg| msg.header)
                }
            };
            origin = newest(origin, header.and_then(|header| header.origin));
            if observed {
                reads.push(header.map(|header| header.stamp));
            }
        }
        let origin = if node.origin { Some(stamp) } else { origin };
        (origin, reads)
    }

    /// Waits until all inputs of the next step are made: work in the pool must not wait for other work in the pool.
    fn wait_for_promised(&mut self, rank: usize) {
        let is_broken = |msg: &Msg| msg.sent.promised().is_some_and(|promised| promised.wait().is_err());
        let broken = |slot: &Slot| match slot {
            Slot::Message(msg) if is_broken(msg) => msg.sent.promised().cloned(),
            Slot::Window(all) => {
                all.iter().find(|msg| is_broken(msg)).and_then(|msg| msg.sent.promised().cloned())
            }
            _ => None,
        };
        if let Some(promised) = self.nodes[rank].slots.iter().find_map(broken) {
            self.note_broken(&promised);
        }
    }

    /// Waits until the older promises of an operator are kept, so that the number of unkept ones stays bounded.
    fn keep_up(&mut self, rank: usize) {
        while self.nodes[rank].promised.len() >= PROMISED_MAX {
            if let Some(oldest) = self.nodes[rank].promised.pop_front().and_then(|oldest| oldest.upgrade()) {
                let _made = oldest.wait();
            }
        }
    }

    fn draw(&mut self, rank: usize, stamp: Time, decided: Option<Decided>) -> Draw {
        let node = &mut self.nodes[rank];
        if let Some(span) = decided.and_then(|decided| decided.run_time) {
            return Draw::Known(span);
        }
        let draw = node.runtime.draw(self.seed, &node.name, stamp, node.tally.steps);
        let instant = !node.heavy && matches!(draw, Draw::Known(Span::ZERO) | Draw::Unrecorded(Span::ZERO));
        if self.one_worker && self.wall.is_none() && !instant {
            // It was still running at the end of the run that is repeated.
            return Draw::Known(Span::MAX);
        }
        node.tally.unrecorded += u64::from(matches!(draw, Draw::Unrecorded(_)));
        draw
    }

    /// True if the next step is known to take no time, so that it needs no slot.
    pub(super) fn takes_no_time(&self, rank: usize, stamp: Time) -> bool {
        let node = &self.nodes[rank];
        let decided = self.replay.as_ref().and_then(|replay| replay.step(&node.name, stamp));
        let draw = match decided.and_then(|decided| decided.run_time) {
            Some(span) => Draw::Known(span),
            None => node.runtime.draw(self.seed, &node.name, stamp, node.tally.steps),
        };
        matches!(draw, Draw::Known(Span::ZERO) | Draw::Unrecorded(Span::ZERO))
    }

    /// Limits that cut the step short, if there are any.
    fn cut(&self, rank: usize, deadline: Time, decided: Option<Decided>) -> Option<Box<Cut>> {
        if deadline == Time::MAX {
            return None;
        }
        let node = &self.nodes[rank];
        let mut cut = match (decided, &self.wall, &node.runtime) {
            (Some(decided), ..) => {
                Cut { limit: decided.stop_at, offers_max: decided.offers, ..Cut::default() }
            }
            (None, Some(wall), _) => Cut { time_is_out: Some(wall.alarm(deadline)), ..Cut::default() },
            (None, None, model @ RuntimeModel::Work { .. }) => {
                Cut { limit: Some(model.units_within(deadline - self.now)), ..Cut::default() }
            }
            (None, None, _) => return None,
        };
        let reaction = node.deadline.map(|deadline| deadline.reaction);
        cut.offered = (reaction == Some(Reaction::OnDeadline)).then(offered);
        Some(Box::new(cut))
    }

    #[inline]
    fn run_here(&mut self, rank: usize, task: &mut Task, ran: &mut Ran) {
        let has_workers = self.pool.is_some();
        let workers = if has_workers { self.workers() } else { None };
        let node = &mut self.nodes[rank];
        let is_measured = matches!(node.runtime, RuntimeModel::Measured { .. });
        // Work that a step passes to other threads is not part of its measured time.
        if let Some(pool) = workers.filter(|_| !is_measured) {
            task.workers = Some(Workers { pool, operator: node.name.clone() });
        }
        let is_timed = self.host_time || is_measured || self.wall.is_some();
        let begin = is_timed.then(Begin::now);
        let body = node.body.as_mut().expect("the operator is not away");
        run(&mut **body, &node.name, task, &mut node.slots, begin, ran);
        if has_workers && task.workers.is_some() {
            node.promised.extend(ran.outs.iter().find_map(|(_, sent)| sent.promised().map(Arc::downgrade)));
        }
    }

    fn send_away(&mut self, rank: usize, task: Task) -> Outcome {
        let node = &mut self.nodes[rank];
        let empty = node.slots.iter().map(|_| Slot::Empty).collect();
        let slots = core::mem::replace(&mut node.slots, empty);
        let body = node.body.take().expect("the operator is not away");
        let pool = self.pool.as_mut().expect("the caller saw it");
        Outcome::Away(pool.submit(Job { rank, name: node.name.clone(), body, task, slots }))
    }

    /// Ensures that the step at `index` was executed and its end is exact; returns true if the end has been reached.
    pub(super) fn settle(&mut self, rank: usize, index: usize) -> bool {
        self.wait_for(rank, index);
        self.nodes[rank].running.get(index).is_some_and(|run| run.end <= self.now) && self.failure.is_none()
    }

    /// Waits until the worker that has the step is done with it.
    pub(super) fn wait_for(&mut self, rank: usize, index: usize) {
        let Outcome::Away(ticket) = self.nodes[rank].running[index].outcome else { return };
        let done = self.pool.as_mut().expect("a worker has the step").wait(ticket);
        self.nodes[rank].body = Some(done.body);
        let mut run = self.nodes[rank].running.remove(index).expect("just seen");
        run.outcome = Outcome::Here(done.ran);
        self.settle_ran(rank, &mut run);
        self.nodes[rank].running.insert(index, run);
    }

    /// Waits until the operator's state is back from the worker that executes its previous step.
    fn wait_for_body(&mut self, rank: usize) {
        if self.nodes[rank].body.is_some() {
            return;
        }
        let away = |run: &Run| matches!(run.outcome, Outcome::Away(_));
        if let Some(index) = self.nodes[rank].running.iter().position(away) {
            self.wait_for(rank, index);
        }
    }

    /// Determines the end of a step that was executed, and records if it failed.
    fn settle_ran(&mut self, rank: usize, run: &mut Run) {
        let Outcome::Here(ran) = &mut run.outcome else { return };
        if !self.went_well(rank, run.stamp, ran) {
            return;
        }
        if let (Some(units), Some(_)) = (ran.stopped_at, &self.wall) {
            let (operator, stamp) = (self.nodes[rank].name.clone(), run.stamp);
            self.decide(|| Decision::Stop { operator: operator.to_string(), stamp, units });
        }
        let node = &self.nodes[rank];
        if run.settled {
            return;
        }
        run.settled = true;
        if self.wall.is_some() {
            let host =
                run.start.saturating_add(Span::from_ns(i64::try_from(ran.host_ns).unwrap_or(i64::MAX)));
            let modelled = run.start.saturating_add(node.runtime.measured(ran.host_ns));
            run.end = run.least_end.max(host).max(modelled);
            let (operator, stamp, run_time) = (node.name.clone(), run.stamp, run.end - run.start);
            return self.decide(|| Decision::RunTime { operator: operator.to_string(), stamp, run_time });
        }
        match run.draw {
            Draw::Known(_) | Draw::Unrecorded(_) => {}
            Draw::Work(_) => {
                run.end = run.start.saturating_add(node.runtime.worked(ran.units));
                if ran.stopped_at.is_some() && !ran.went_on {
                    // A step that stops when requested ends in time; if it sends nothing, it ends at its deadline,
                    // whose reaction has its offers.
                    run.end = if ran.is_empty() { run.deadline } else { run.end.min(run.deadline) };
                }
            }
            Draw::Measured => {
                run.end = run.start.saturating_add(node.runtime.measured(ran.host_ns));
                let (operator, stamp) = (node.name.to_string(), run.stamp);
                let run_time = run.end - run.start;
                self.tell(&Event::Decision(&Decision::RunTime { operator, stamp, run_time }));
            }
        }
    }

    /// Records a panic or the loss of a step; returns true if the run goes on.
    #[inline(always)]
    fn went_well(&mut self, rank: usize, stamp: Time, ran: &mut Ran) -> bool {
        if let Some(message) = ran.panic.take() {
            let operator = self.nodes[rank].name.to_string();
            self.failure = Some(RunError::Panic { operator, message: message.into() });
            return false;
        }
        let Some(unusual) = &mut ran.unusual else { return true };
        let (restarted, lost) = (core::mem::take(&mut unusual.restarted), unusual.lost.take());
        self.came_from_away(rank, stamp, restarted, lost)
    }

    /// Records the outcome of a step in another process; returns true if the run goes on.
    fn came_from_away(&mut self, rank: usize, stamp: Time, restarted: bool, lost: Option<String>) -> bool {
        let operator = self.nodes[rank].name.to_string();
        if restarted {
            let operator = operator.clone();
            self.decide(|| Decision::Restarted { operator, stamp });
        }
        let Some(why) = lost else { return true };
        if self.wall.is_some() {
            self.decide(|| Decision::Lost { operator, stamp, why });
            return true;
        }
        self.failure = Some(RunError::Lost { operator, why });
        false
    }

    fn tell_start(&mut self, rank: usize, stamp: Time, deadline: Time, reads: &[Option<Time>]) {
        if self.observers.is_empty() {
            return;
        }
        let node = &self.nodes[rank];
        let deadline = (deadline < Time::MAX).then_some(deadline);
        let reads = Reads { names: &node.reads, stamps: reads };
        let start = StepStart { operator: &node.name, stamp, at: self.now, deadline, reads };
        tell(&mut self.observers, &Event::StepStart(start));
    }

    /// Calls the operator's reaction; a panic ends the run.
    pub(super) fn call_on_deadline(&mut self, rank: usize, miss: &ErasedMiss<'_>) -> Outs {
        let mut outs = Outs::default();
        if let Some(react) = self.nodes[rank].on_deadline
            && let Err(panic) = catch_unwind(AssertUnwindSafe(|| react(miss, &mut outs)))
        {
            let operator = self.nodes[rank].name.to_string();
            self.failure = Some(RunError::Panic { operator, message: said(&*panic) });
            outs = Outs::default();
        }
        outs
    }
}

fn offered() -> Offered {
    Arc::new(Mutex::new((0, Outs::default())))
}
