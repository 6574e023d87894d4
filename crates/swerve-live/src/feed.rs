//! Feed thread between the transport and the graph: receives messages, operates the switch, reports progress.

use core::time::Duration;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};

use swerve_control::safety_gate::GateParams;
use swerve_core::{Span, Time};
use swerve_flow::{SendError, StopHandle};
use swerve_msg::{GateMode, Route, StopCause, Switch, WireAlarm};
use swerve_report::progress::LiveLine;
use swerve_ros2::AnyMessage;
use swerve_ros2::mapping::Role;

use super::engage::{Engagement, Situation};
use super::graph::Inputs;
pub use super::input::TopicState;
use super::input::{Arrived, Input};
use super::intake::{Intake, Request, TopicSummary};
use super::notices::Notices;
use super::placement::Misplaced;
use super::reason::{mode_words, stop_reason};
use super::shared::lock;
use super::simulated::{ClockEvent, DriveClock};
use super::sink::{Order, stop_takes};
use super::watch::DriveStatus;
use super::wire::{Taken, Wire};

/// Longest sleep of the thread.
const WAKE: Duration = Duration::from_millis(10);
/// Period of progress lines, and of topic reports in the log.
const REPORT_EVERY: Span = Span::from_ms(1000);
/// A topic not heard for this long is silent.
const SILENT: Span = Span::from_ms(500);
/// Standstill time before the run is ended.
const HELD: Span = Span::from_ms(500);
/// Messages processed before the switch is checked again, so that a flood does not delay it.
const AT_ONCE: usize = 256;

/// Reports progress to the user during a drive.
pub trait StatusSink: Send {
    /// Reports the line of progress, once a second.
    fn progress(&mut self, line: &str);
    /// Reports an event.
    fn note(&mut self, at: Time, what: &str);
}

impl StatusSink for LiveLine {
    fn progress(&mut self, line: &str) {
        Self::progress(self, line);
    }

    fn note(&mut self, at: Time, what: &str) {
        Self::note(self, at.as_secs(), what);
    }
}

/// Flags that the threads of a drive use to signal each other.
#[derive(Default)]
pub struct ControlFlags {
    /// Ctrl-C was pressed.
    pub interrupted: AtomicBool,
    /// The engine has ended.
    pub run_over: AtomicBool,
    /// The sink has ended, too.
    pub done: AtomicBool,
    /// The gate was silent for too long: the switch must be released.
    pub gave_up: Arc<AtomicBool>,
}

/// Goal of a drive.
pub struct Goal {
    /// Route that is followed.
    pub route: Route,
    /// Position of the goal along the route, metres.
    pub s_m: f64,
}

/// Components of the feed thread.
pub struct Feed<'a> {
    /// Transport of the messages.
    pub wire: &'a dyn Wire,
    /// Conversion of messages to inputs of the graph.
    pub intake: Intake,
    /// Inputs of the graph.
    pub inputs: Inputs,
    /// Roles of the topics that provide the ego's position.
    pub located_by: &'static [Role],
    /// Time of the run.
    pub clock: DriveClock,
    /// State machine of the switch.
    pub engagement: Engagement,
    /// Status of the drive, as published by the graph.
    pub status: Arc<Mutex<DriveStatus>>,
    /// Channel to the sink.
    pub orders: Option<Sender<Order>>,
    /// Handle to end the run.
    pub stop: StopHandle,
    /// Instant at which the drive ends, if limited.
    pub until: Option<Time>,
    /// Position at which the drive ends.
    pub goal: Goal,
    /// Maximum duration of the stop at the end.
    pub stop_max: Span,
    /// Parameters of that stop.
    pub stop_params: GateParams,
    /// Flags of the other threads.
    pub flags: &'a ControlFlags,
    /// Receiver of progress reports.
    pub status_sink: Box<dyn StatusSink>,
    /// Notices of topics, monitors and road users.
    pub notices: Notices,
}

/// Result of the feed thread.
pub struct FeedReport {
    /// The intake, with its counts by topic.
    pub intake: Intake,
    /// Number of messages dropped because the engine does not keep up.
    pub not_taken: u64,
    /// Reason for the end of the drive.
    pub why: &'static str,
    /// True if all required topics were ever present at the same time.
    pub was_ready: bool,
    /// Failure of simulated time that ended the drive.
    pub clock_failure: Option<String>,
    /// Stops with the instant of their detection and their reason in words, in order.
    pub reasons: Vec<(Time, StopCause, String)>,
}

/// State of ending the drive.
struct End {
    why: &'static str,
    since: Time,
    speed_mps: f64,
    stands_since: Option<Time>,
    stopped: bool,
}

struct Memory {
    out: Vec<Arrived>,
    not_taken: u64,
    end: Option<End>,
    reported: Option<Time>,
    switch: Option<Switch>,
    last_switch: Time,
    alarm: WireAlarm,
    last_alarm: Time,
    was_ready: bool,
    mode: GateMode,
    behind: bool,
    clock_failure: Option<String>,
    reasons: Vec<(Time, StopCause, String)>,
}

impl<'a> Feed<'a> {
    /// Runs until all threads are done.
    pub fn run(mut self) -> FeedReport {
        let mut memory = Memory {
            out: Vec::new(),
            not_taken: 0,
            end: None,
            reported: None,
            switch: None,
            last_switch: Time::ZERO,
            alarm: WireAlarm::default(),
            last_alarm: Time::ZERO,
            was_ready: false,
            mode: GateMode::Manual,
            behind: false,
            clock_failure: None,
            reasons: Vec::new(),
        };
        let mut early = Vec::new();
        while !self.flags.done.load(Ordering::Acquire) {
            self.wire.wait(WAKE);
            if self.flags.run_over.load(Ordering::Acquire) {
                // No more orders: the sink ends.
                self.orders = None;
            }
            early = self.receive(early, &mut memory.out);
            self.watch_the_clock(&mut memory);
            self.hand_on(&mut memory);
            self.watch_the_wire(&mut memory);
            self.work_the_switch(&mut memory);
            self.look_for_the_end(&mut memory);
            self.report(&mut memory);
        }
        let why = memory.end.map_or("the run ended by itself", |end| end.why);
        let Memory { not_taken, was_ready, clock_failure, reasons, .. } = memory;
        FeedReport { intake: self.intake, not_taken, why, was_ready, clock_failure, reasons }
    }

    /// Converts waiting messages. Returns those that have overtaken the message of simulated time, for the next round.
    fn receive(&mut self, mut early: Vec<Taken<'a>>, out: &mut Vec<Arrived>) -> Vec<Taken<'a>> {
        let wire = self.wire;
        let is_full = early.len() >= AT_ONCE;
        for taken in std::iter::from_fn(|| wire.take()).take(AT_ONCE) {
            if let (AnyMessage::Clock(message), Some(clock)) = (&taken.message, self.clock.simulated()) {
                clock.hear(message);
            }
            early.push(taken);
        }
        early.retain(|taken| {
            if !is_full && self.clock.is_early(taken.message.stamp()) {
                return true;
            }
            let now = self.clock.at_host(taken.received_ns);
            self.intake.take(taken.name, &taken.message, now, out);
            false
        });
        early
    }

    /// Ends the drive if simulated time has failed: no instant follows at which the engine could stop the car, so the
    /// sink does.
    fn watch_the_clock(&mut self, memory: &mut Memory) {
        let Some(event) = self.clock.simulated().and_then(|clock| clock.check()) else { return };
        let now = self.clock.now();
        match event {
            ClockEvent::Note(what) => self.status_sink.note(now, &what),
            ClockEvent::Failed(what) if memory.clock_failure.is_none() => {
                self.status_sink.note(now, &what);
                memory.clock_failure = Some(what);
                memory.end = Some(End::new("simulated time failed", now, &self.status));
                self.intake.ignore_stamps();
                self.engagement.end();
                self.stop.stop();
            }
            ClockEvent::Failed(_) => {}
        }
    }

    fn hand_on(&mut self, memory: &mut Memory) {
        for arrived in memory.out.drain(..) {
            memory.not_taken += u64::from(self.inputs.send(arrived) == Err(SendError::Full));
        }
        if memory.not_taken > 0 && !memory.behind {
            memory.behind = true;
            self.status_sink.note(self.clock.now(), "the engine does not keep up: messages are dropped");
        }
    }

    /// Makes the gate stop the car after a loss of the transport, until the switch is released.
    fn watch_the_wire(&mut self, memory: &mut Memory) {
        let is_on = memory.switch.is_some_and(|switch| switch.enable);
        let mut alarm = if is_on { memory.alarm.clone() } else { WireAlarm::default() };
        for what in self.wire.take_losses() {
            self.status_sink.note(self.clock.now(), &what);
            if is_on && alarm.cause.is_none() {
                alarm = WireAlarm { cause: Some(StopCause::TransportLost), what };
            }
        }
        if alarm == memory.alarm {
            return;
        }
        memory.alarm = alarm.clone();
        let stamp = self.clock.now().max(memory.last_alarm.saturating_add(Span::from_ns(1)));
        memory.last_alarm = stamp;
        let arrived = Arrived { at: stamp, stamp, input: Input::Wire(alarm) };
        memory.not_taken += u64::from(self.inputs.send(arrived) == Err(SendError::Full));
    }

    fn silent(&self, now: Time) -> Vec<Role> {
        let car = self.intake.car();
        let since = Time::from_ns(now.ns().saturating_sub(SILENT.ns()));
        let needs = self.intake.needs();
        let mut silent: Vec<Role> = lock(&car).silent(needs, since).collect();
        let is_heard = |wanted: Role| {
            self.intake.tallies().any(|TopicSummary { role, tally, .. }| {
                role == wanted && tally.heard.is_some_and(|heard| heard >= since)
            })
        };
        for role in self.located_by {
            if !is_heard(*role) && !silent.contains(role) {
                silent.push(*role);
            }
        }
        silent
    }

    fn work_the_switch(&mut self, memory: &mut Memory) {
        let now = self.clock.now();
        let mut requests = self.intake.requests();
        if self.flags.gave_up.swap(false, Ordering::Relaxed) {
            self.status_sink.note(now, "the gate fell silent: the car is stopped");
            requests.push(Request::Drive(false));
        }
        let ready = self.silent(now).is_empty();
        memory.was_ready |= ready;
        let (listens, driver) = {
            let car = self.intake.car();
            let car = lock(&car);
            (car.listens, car.driver())
        };
        let DriveStatus { mode, pose, .. } = *lock(&self.status);
        let misplaced = pose.and_then(|pose| Misplaced::of(&self.goal.route, pose));
        let situation = Situation { now, ready, listens, driver, mode, misplaced };
        let action = self.engagement.step(&requests, &situation);
        if let Some(note) = &action.note {
            self.status_sink.note(now, note);
        }
        if action.ask {
            // Fails only if the sink has ended; then there is no vehicle to ask.
            let _ = self.orders.as_ref().map(|orders| orders.send(Order::Ask));
        }
        if mode != memory.mode {
            self.note_mode(mode, memory);
        }
        if memory.switch != Some(action.switch) {
            memory.switch = Some(action.switch);
            let stamp = now.max(memory.last_switch.saturating_add(Span::from_ns(1)));
            memory.last_switch = stamp;
            let arrived = Arrived { at: stamp, stamp, input: Input::Switch(action.switch) };
            memory.not_taken += u64::from(self.inputs.send(arrived) == Err(SendError::Full));
        }
    }

    /// Reports a new mode of the gate, with the reason of a stop.
    fn note_mode(&mut self, mode: GateMode, memory: &mut Memory) {
        let now = self.clock.now();
        let status = *lock(&self.status);
        if let GateMode::Stopping(cause) = mode {
            let end = memory.end.as_ref().map(|end| end.why);
            let reason = stop_reason(cause, end, self.intake.tallies(), &status, now);
            memory.reasons.push((now, cause, reason));
        }
        memory.mode = mode;
        self.status_sink.note(now, &mode_words(mode, memory.reason(mode)));
        // A line of progress from before the change would be misleading.
        memory.reported = None;
    }

    fn look_for_the_end(&mut self, memory: &mut Memory) {
        let now = self.clock.now();
        let interrupted = self.flags.interrupted.load(Ordering::Relaxed);
        if memory.end.is_none() {
            let why = if interrupted {
                Some("it was interrupted")
            } else {
                self.until.filter(|until| now >= *until).map(|_| "the time limit was reached")
            };
            let why = why.or_else(|| self.is_there(memory.mode).then_some("the goal is reached"));
            memory.end = why.map(|why| End::new(why, now, &self.status));
        }
        let Some(end) = &mut memory.end else { return };
        self.engagement.end();
        // The car is at rest, or not under our control, or does not come to rest.
        let rests = matches!(memory.mode, GateMode::Manual | GateMode::Holding(_));
        end.stands_since = if rests { end.stands_since.or(Some(now)) } else { None };
        let rested = end.stands_since.is_some_and(|since| now - since >= HELD);
        let limit = stop_takes(end.speed_mps, &self.stop_params).min(self.stop_max);
        if !end.stopped && (rested || now - end.since >= limit) {
            end.stopped = true;
            self.stop.stop();
        }
    }

    /// Returns true if the stack has driven to the goal.
    fn is_there(&self, mode: GateMode) -> bool {
        let pose = lock(&self.status).pose.filter(|_| mode == GateMode::Driving);
        pose.is_some_and(|pose| self.goal.route.project(pose.point()).s_m >= self.goal.s_m)
    }

    fn report(&mut self, memory: &mut Memory) {
        let now = self.clock.now();
        if memory.reported.is_some_and(|before| now - before < REPORT_EVERY) {
            return;
        }
        memory.reported = Some(now);
        let state = |TopicSummary { name, tally, clock, .. }: TopicSummary<'_>| {
            let known = clock.offset();
            TopicState {
                topic: name.to_owned(),
                received: tally.received,
                used: tally.used,
                offset: known.map(|known| known.offset),
                spread: known.map(|known| known.spread),
            }
        };
        let states: Vec<TopicState> =
            self.intake.tallies().filter(|topic| topic.tally.received > 0).map(state).collect();
        let since = Time::from_ns(now.ns().saturating_sub(SILENT.ns()));
        let alive = self
            .intake
            .tallies()
            .filter(|topic| topic.tally.heard.is_some_and(|heard| heard >= since))
            .count();
        let arrived = Arrived { at: now, stamp: now, input: Input::Topics(states) };
        memory.not_taken += u64::from(self.inputs.send(arrived) == Err(SendError::Full));
        let silent = self.silent(now);
        let status = *lock(&self.status);
        let mut line = format!(
            "{:6.1} s  {:5.2} m/s  {}  {alive} topics",
            now.as_secs(),
            // Without the sign of a speed that rounds to zero.
            (status.speed_mps * 100.0).round() / 100.0 + 0.0,
            mode_words(status.mode, memory.reason(status.mode))
        );
        if !silent.is_empty() {
            line += &format!("  waiting for {}", listed(&silent));
        }
        self.status_sink.progress(&line);
        let is_driving = status.mode == GateMode::Driving;
        for notice in self.notices.each_second(now, is_driving, &self.intake, self.wire) {
            self.status_sink.note(now, &notice);
        }
    }
}

impl Memory {
    /// Reason of the stop in this mode, in words.
    fn reason(&self, mode: GateMode) -> Option<&str> {
        let (GateMode::Stopping(cause) | GateMode::Holding(cause)) = mode else { return None };
        let (_, last, reason) = self.reasons.last()?;
        (*last == cause).then_some(reason)
    }
}

impl End {
    fn new(why: &'static str, since: Time, status: &Mutex<DriveStatus>) -> Self {
        let speed_mps = lock(status).speed_mps;
        Self { why, since, speed_mps, stands_since: None, stopped: false }
    }
}

/// Comma-separated names of roles.
pub(super) fn listed(roles: &[Role]) -> String {
    roles.iter().map(|role| role.name()).collect::<Vec<_>>().join(", ")
}
