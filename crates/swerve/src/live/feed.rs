//! The thread between the transport and the graph: takes messages in, works the switch, tells how it goes.

use core::time::Duration;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};

use serde::{Deserialize, Serialize};
use swerve_control::safety_gate::GateParams;
use swerve_core::{Span, Time};
use swerve_flow::{SendError, StopHandle};
use swerve_geom::FrenetPoint;
use swerve_msg::{GateMode, Route, Switch};
use swerve_ros2::mapping::Role;

use super::engage::{Engagement, Situation};
use super::graph::Inputs;
use super::intake::{Arrived, Input, Intake, Wish, lock};
use super::sink::{Order, stop_takes};
use super::watch::Lamp;
use super::wire::{HostClock, Wire};

/// The thread wakes at least this often.
const WAKE: Duration = Duration::from_millis(10);
/// Between two lines of progress, and two reports on the topics in the log.
const TELL_EVERY: Span = Span::from_ms(1000);
/// A topic that was not heard for so long is silent.
const SILENT: Span = Span::from_ms(500);
/// The car stands for so long before the run is ended.
const HELD: Span = Span::from_ms(500);
/// Messages taken in before the switch is looked at again: a flood does not keep it waiting.
const AT_ONCE: usize = 256;

/// What the log holds of a topic, once a second.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct TopicState {
    /// What it is called here.
    pub topic: String,
    /// Messages that came so far.
    pub received: u64,
    /// Messages that were used.
    pub used: u64,
    /// Host's clock minus the stamps' clock, as far as it is known.
    pub offset: Option<Span>,
    /// What is not known of that.
    pub spread: Option<Span>,
}

/// What is said to the person while it drives.
pub trait Teller: Send {
    /// The line of progress, each second.
    fn progress(&mut self, line: &str);
    /// Something happened.
    fn note(&mut self, at: Time, what: &str);
}

/// What other threads want of this one.
#[derive(Default)]
pub struct Wanted {
    /// How often somebody pressed Ctrl-C.
    pub interrupts: AtomicUsize,
    /// The engine runs no longer.
    pub run_over: AtomicBool,
    /// The sink has done its work, too.
    pub done: AtomicBool,
    /// The gate slept for too long: the switch is to be released.
    pub gave_up: Arc<AtomicBool>,
}

/// What the thread is made of.
pub struct Feed<'a> {
    /// How messages come.
    pub wire: &'a dyn Wire,
    /// What they mean.
    pub intake: Intake,
    /// Where they go.
    pub inputs: Inputs,
    /// The time of the run.
    pub clock: HostClock,
    /// The switch.
    pub engagement: Engagement,
    /// What the graph says of the drive.
    pub lamp: Arc<Mutex<Lamp>>,
    /// Who talks to the vehicle.
    pub orders: Option<Sender<Order>>,
    /// Ends the run.
    pub stop: StopHandle,
    /// When the drive is to end.
    pub until: Option<Time>,
    /// Where it is to end.
    pub goal: (Route, f64),
    /// How long the stop at the end may take, and how it is driven.
    pub stop_max: (Span, GateParams),
    /// What others want.
    pub wanted: &'a Wanted,
    /// Who tells the person.
    pub teller: Box<dyn Teller>,
}

/// What the thread comes to.
pub struct Fed {
    /// What it knows of the topics.
    pub intake: Intake,
    /// Messages that the engine did not take because it does not keep up.
    pub not_taken: u64,
    /// Why the drive was ended.
    pub why: &'static str,
    /// Whether all that is needed was ever there at once.
    pub was_ready: bool,
}

/// How far the end has come.
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
    told: Option<Time>,
    switch: Option<Switch>,
    last_switch: Time,
    was_ready: bool,
    mode: GateMode,
    behind: bool,
}

impl Feed<'_> {
    /// Feeds until it is told that all is done.
    pub fn run(mut self) -> Fed {
        let mut memory = Memory {
            out: Vec::new(),
            not_taken: 0,
            end: None,
            told: None,
            switch: None,
            last_switch: Time::ZERO,
            was_ready: false,
            mode: GateMode::Manual,
            behind: false,
        };
        while !self.wanted.done.load(Ordering::Acquire) {
            self.wire.wait(WAKE);
            if self.wanted.run_over.load(Ordering::Acquire) {
                // Nobody orders any more: the sink gets to know.
                self.orders = None;
            }
            for _ in 0..AT_ONCE {
                let Some(taken) = self.wire.take() else { break };
                let now = self.clock.of_host(taken.received_ns);
                self.intake.take(taken.name, &taken.message, now, &mut memory.out);
            }
            self.hand_on(&mut memory);
            self.work_the_switch(&mut memory);
            self.look_for_the_end(&mut memory);
            self.tell(&mut memory);
        }
        let why = memory.end.map_or("the run ended by itself", |end| end.why);
        Fed { intake: self.intake, not_taken: memory.not_taken, why, was_ready: memory.was_ready }
    }

    fn hand_on(&mut self, memory: &mut Memory) {
        for arrived in memory.out.drain(..) {
            if let Input::Pose(ego) = &arrived.input
                && memory.end.is_none()
                && memory.mode == GateMode::Driving
            {
                let FrenetPoint { s_m, .. } = self.goal.0.project(ego.pose.point());
                if s_m >= self.goal.1 {
                    memory.end = Some(End::new("the goal is reached", self.clock.now(), &self.lamp));
                }
            }
            memory.not_taken += u64::from(self.inputs.send(arrived) == Err(SendError::Full));
        }
        if memory.not_taken > 0 && !memory.behind {
            memory.behind = true;
            self.teller.note(self.clock.now(), "the engine does not keep up: messages are dropped");
        }
    }

    fn silent(&self, now: Time) -> Vec<Role> {
        let car = self.intake.car();
        let since = Time::from_ns(now.ns().saturating_sub(SILENT.ns()));
        let needs = self.intake.needs();
        let mut silent: Vec<Role> = lock(&car).silent(needs, since).collect();
        let pose = self.intake.tallies().any(|(_, role, tally, _)| {
            role == Role::Odometry && tally.heard.is_some_and(|heard| heard >= since)
        });
        if !pose && !silent.contains(&Role::Odometry) {
            silent.push(Role::Odometry);
        }
        silent
    }

    fn work_the_switch(&mut self, memory: &mut Memory) {
        let now = self.clock.now();
        let mut wishes = self.intake.wishes();
        if self.wanted.gave_up.swap(false, Ordering::Relaxed) {
            self.teller.note(now, "the gate fell silent: the car is stopped");
            wishes.push(Wish::Drive(false));
        }
        let ready = self.silent(now).is_empty();
        memory.was_ready |= ready;
        let (listens, driver) = {
            let car = self.intake.car();
            let car = lock(&car);
            (car.listens, car.driver())
        };
        let mode = lock(&self.lamp).mode;
        let deed = self.engagement.step(&wishes, &Situation { now, ready, listens, driver, mode });
        if let Some(note) = deed.note {
            self.teller.note(now, note);
        }
        if deed.ask {
            // It fails where the sink is gone, and then there is nobody to be asked.
            let _ = self.orders.as_ref().map(|orders| orders.send(Order::Ask));
        }
        if mode != memory.mode {
            self.teller.note(now, &mode_words(mode));
            memory.mode = mode;
        }
        if memory.switch != Some(deed.switch) {
            memory.switch = Some(deed.switch);
            let stamp = now.max(memory.last_switch.saturating_add(Span::from_ns(1)));
            memory.last_switch = stamp;
            let arrived = Arrived { at: stamp, stamp, input: Input::Switch(deed.switch) };
            memory.not_taken += u64::from(self.inputs.send(arrived) == Err(SendError::Full));
        }
    }

    fn look_for_the_end(&mut self, memory: &mut Memory) {
        let now = self.clock.now();
        let interrupts = self.wanted.interrupts.load(Ordering::Relaxed);
        if memory.end.is_none() {
            let why = if interrupts > 0 {
                Some("it was interrupted")
            } else {
                self.until.filter(|until| now >= *until).map(|_| "the time is over")
            };
            memory.end = why.map(|why| End::new(why, now, &self.lamp));
        }
        let Some(end) = &mut memory.end else { return };
        self.engagement.end();
        // The car is at rest, or not ours, or it does not come to rest.
        let rests = matches!(memory.mode, GateMode::Manual | GateMode::Holding(_));
        end.stands_since = if rests { end.stands_since.or(Some(now)) } else { None };
        let rested = end.stands_since.is_some_and(|since| now - since >= HELD);
        let (stop_max, params) = &self.stop_max;
        let limit = stop_takes(end.speed_mps, params).min(*stop_max);
        if !end.stopped && (rested || interrupts > 1 || now - end.since >= limit) {
            end.stopped = true;
            self.stop.stop();
        }
    }

    fn tell(&mut self, memory: &mut Memory) {
        let now = self.clock.now();
        if memory.told.is_some_and(|told| now - told < TELL_EVERY) {
            return;
        }
        memory.told = Some(now);
        let state =
            |(name, _, tally, clock): (&str, Role, &super::intake::TopicTally, &super::time::TopicClock)| {
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
            self.intake.tallies().filter(|(_, _, tally, _)| tally.received > 0).map(state).collect();
        let since = Time::from_ns(now.ns().saturating_sub(SILENT.ns()));
        let alive = self
            .intake
            .tallies()
            .filter(|(_, _, tally, _)| tally.heard.is_some_and(|heard| heard >= since))
            .count();
        let arrived = Arrived { at: now, stamp: now, input: Input::Topics(states) };
        memory.not_taken += u64::from(self.inputs.send(arrived) == Err(SendError::Full));
        let silent = self.silent(now);
        let lamp = *lock(&self.lamp);
        let mut line = format!(
            "{:6.1} s  {:5.2} m/s  {}  {alive} topics",
            now.as_secs(),
            lamp.speed_mps,
            mode_words(lamp.mode)
        );
        if !silent.is_empty() {
            line += &format!("  waiting for {}", listed(&silent));
        }
        self.teller.progress(&line);
    }
}

impl End {
    fn new(why: &'static str, since: Time, lamp: &Mutex<Lamp>) -> Self {
        let speed_mps = lock(lamp).speed_mps;
        Self { why, since, speed_mps, stands_since: None, stopped: false }
    }
}

/// The names of roles, with commas.
pub(super) fn listed(roles: &[Role]) -> String {
    roles.iter().map(|role| role.name()).collect::<Vec<_>>().join(", ")
}

/// A mode in words.
pub(super) fn mode_words(mode: GateMode) -> String {
    match mode {
        GateMode::Manual => "manual".into(),
        GateMode::Driving => "driving".into(),
        GateMode::Stopping(cause) => format!("stopping: {}", cause.words()),
        GateMode::Holding(cause) => format!("holding: {}", cause.words()),
    }
}
