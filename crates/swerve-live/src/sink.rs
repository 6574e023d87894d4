//! Who talks to the vehicle: says what the gate lets through, and stops the car where the gate has fallen silent.
//!
//! It is a thread of its own, because the engine may stand still or end by a panic: then nobody else is left. What it
//! does by itself is a controlled stop, commanded until the car stands or the time for that is over, and never the last
//! command for ever. If the whole process dies, the one that speaks DDS does the same (`orphan.rs`).

use core::time::Duration;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex};

use swerve_control::safety_gate::GateParams;
use swerve_core::{Span, Time};
use swerve_msg::{GateMode, GateOutput, MotionCommand, StopCause};
use swerve_ros2::convert::Epoch;
use swerve_ros2::msg::autoware_vehicle_msgs::ControlModeReport;

use super::intake::lock;
use super::orphan::Legacy;
use super::vehicle::{Car, Outgoing, VehicleInterface};
use super::wire::{HostClock, Sent, Wire};

/// Without a word from the gate for so long the car is stopped from here.
const SILENCE_MAX: Span = Span::from_ms(150);
/// After so long it is not given back to the gate.
const GIVEN_UP: Span = Span::from_ms(500);
/// Between two commands that are made here.
const PERIOD: Duration = Duration::from_millis(20);
/// Slower than this is standing, m/s.
const STANDSTILL_MPS: f64 = 0.1;
/// How long a car that stands is held before it is released.
const HOLD: Span = Span::from_ms(500);
/// How often a vehicle is told that it is released, at least: a message may get lost.
const RELEASES_MIN: u32 = 3;
/// And at most, one each [`PERIOD`]: three seconds, in which a vehicle that says whether it listens has to say no.
const RELEASES_MAX: u32 = 150;
/// How long the vehicle's service may take to answer.
const ANSWER_MAX: Duration = Duration::from_millis(100);

/// The time that a controlled stop from this speed takes at most: half as long again as it should, and a reserve.
pub(super) fn stop_takes(speed_mps: f64, stop: &GateParams) -> Span {
    Span::from_secs((1.5 * speed_mps.abs() / stop.stop_decel_mps2).min(600.0) + 3.0)
}

/// An order to the sink.
#[derive(Clone, Copy, Debug)]
pub enum Order {
    /// Say this.
    Gate(GateOutput),
    /// Ask the vehicle to listen.
    Ask,
}

/// Counts of what the sink did.
#[derive(Clone, Copy, PartialEq, Debug, Default, serde::Serialize)]
pub struct SinkReport {
    /// Messages that were sent.
    pub sent: u64,
    /// Messages that could not be sent; those that the mapping has no topic for are not counted.
    pub not_sent: u64,
    /// Outputs of the gate that newer ones replaced before they were said.
    pub skipped: u64,
    /// How often the gate fell silent while the car was driven.
    pub silences: u64,
    /// Commands of stops that were made here.
    pub stop_commands: u64,
    /// Whether the car stood when it was released; none where it was not driven at the end.
    pub stood_at_end: Option<bool>,
    /// Whether the car said that it listens no longer; none where it says nothing of that.
    pub released: Option<bool>,
}

/// The parts of a sink.
pub struct Sink<'a> {
    /// How messages go.
    pub wire: &'a dyn Wire,
    /// How the vehicle is talked to.
    pub interface: Box<dyn VehicleInterface>,
    /// The state of the vehicle.
    pub car: Arc<Mutex<Car>>,
    /// The time of the run.
    pub clock: HostClock,
    /// Which instant of ROS's clock the run's time zero is.
    pub epoch: Epoch,
    /// Drive of a stop.
    pub stop: GateParams,
    /// How long a stop may take.
    pub stop_max: Span,
    /// Whether the vehicle has a service for its control mode.
    pub has_mode_service: bool,
    /// Whether we ask the vehicle ourselves; else a person has done that on its own topic.
    pub says_enable: bool,
    /// Set where the gate slept for too long to be given the car back: the switch is to be released.
    pub gave_up: Arc<AtomicBool>,
}

/// The sink's state between two orders.
struct State {
    last: GateOutput,
    heard: Time,
    /// Since when the car is stopped from here.
    stopping: Option<Time>,
    report: SinkReport,
}

impl Sink<'_> {
    /// Does what is ordered until nobody orders any more; then stops the car, if it is driven, and releases it.
    pub fn run(mut self, orders: &Receiver<Order>) -> SinkReport {
        let mut state = State {
            last: GateOutput::default(),
            heard: self.clock.now(),
            stopping: None,
            report: SinkReport::default(),
        };
        loop {
            match orders.recv_timeout(PERIOD) {
                Ok(order) => self.obey(order, orders, &mut state),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.watch(&mut state);
        }
        self.conclude(&mut state);
        state.report
    }

    /// Stops the vehicle in the place of a sink that has died after this command, and releases it.
    pub(crate) fn take_over(mut self, last: GateOutput) -> SinkReport {
        let (heard, report) = (self.clock.now(), SinkReport::default());
        let mut state = State { last, heard, stopping: None, report };
        self.conclude(&mut state);
        state.report
    }

    fn obey(&mut self, order: Order, orders: &Receiver<Order>, state: &mut State) {
        let mut newest = None;
        for order in std::iter::once(order).chain(orders.try_iter()) {
            match order {
                Order::Ask => self.ask(true, state),
                Order::Gate(output) => state.report.skipped += u64::from(newest.replace(output).is_some()),
            }
        }
        let Some(output) = newest else { return };
        let now = self.clock.now();
        let given_up = state.stopping.is_some_and(|since| now - since > GIVEN_UP);
        if given_up && output.mode == GateMode::Driving {
            // A gate that slept that long does not drive on by itself: the stop goes on until somebody lets go of the
            // switch.
            return self.gave_up.store(true, Ordering::Relaxed);
        }
        (state.last, state.heard, state.stopping) = (output, now, None);
        self.command(&output, state);
    }

    /// Stops the car where the gate has fallen silent.
    fn watch(&mut self, state: &mut State) {
        let now = self.clock.now();
        if !state.last.engaged || now - state.heard <= SILENCE_MAX {
            return;
        }
        if state.stopping.is_none() {
            state.report.silences += 1;
            state.stopping = Some(now);
        }
        self.brake(state, now);
    }

    /// One command of a stop that nobody asked for.
    fn brake(&mut self, state: &mut State, now: Time) {
        if lock(&self.car).driver() {
            // The driver wins, here too.
            state.last.engaged = false;
            return;
        }
        let GateParams { stop_decel_mps2, jerk_max_mps3, .. } = self.stop;
        let before = state.last.command;
        let change = jerk_max_mps3 * PERIOD.as_secs_f64();
        // Who asked for hard braking last may have had a reason: a stop never brakes less.
        let accel_before = before.accel_mps2.min(0.0);
        let accel_mps2 = (-stop_decel_mps2).min(accel_before).max(accel_before - change);
        state.last.mode = GateMode::Stopping(StopCause::CommandTimeout);
        state.last.command = MotionCommand { stamp: now, speed_mps: 0.0, accel_mps2, ..before };
        state.last.heartbeat = state.last.heartbeat.wrapping_add(1);
        state.report.stop_commands += 1;
        let output = state.last;
        self.command(&output, state);
    }

    /// Brings the car to a standstill, if it is driven, and gives it back.
    fn conclude(&mut self, state: &mut State) {
        let begin = self.clock.now();
        let speed_mps = lock(&self.car).speed_mps.unwrap_or(f64::INFINITY);
        let limit = stop_takes(speed_mps, &self.stop).min(self.stop_max);
        let mut stands_since = None;
        while state.last.engaged {
            let now = self.clock.now();
            let stands = lock(&self.car).speed_mps.is_some_and(|speed| speed.abs() < STANDSTILL_MPS);
            stands_since = if stands { stands_since.or(Some(now)) } else { None };
            let held = stands_since.is_some_and(|since: Time| now - since >= HOLD);
            if held || now - begin >= limit {
                state.report.stood_at_end = Some(held);
                break;
            }
            self.brake(state, now);
            std::thread::park_timeout(PERIOD);
        }
        if state.report.stood_at_end == Some(false) {
            // Released, it would roll on. Without commands the vehicle's own time-out brakes it.
            state.report.released = Some(false);
            return;
        }
        self.release(state);
    }

    /// Gives the car back, again and again until it says that it listens no longer: the transport ends with this
    /// program, and with it every message that nobody has taken yet.
    fn release(&mut self, state: &mut State) {
        state.last.engaged = false;
        state.last.mode = GateMode::Manual;
        for said in 1..=RELEASES_MAX {
            let output = state.last;
            self.command(&output, state);
            self.ask(false, state);
            std::thread::park_timeout(PERIOD);
            state.report.released = lock(&self.car).listens.map(|listens| !listens);
            if said >= RELEASES_MIN && state.report.released != Some(false) {
                return;
            }
        }
    }

    fn command(&mut self, output: &GateOutput, state: &mut State) {
        let mut outgoing = self.outgoing();
        self.interface.command(output, &mut outgoing);
        self.send(outgoing, state);
        self.wire.leave(&Legacy { last: *output, stop: self.stop });
    }

    fn ask(&mut self, on: bool, state: &mut State) {
        if self.says_enable || !on {
            let mut outgoing = self.outgoing();
            self.interface.enable(on, &mut outgoing);
            self.send(outgoing, state);
        }
        if self.has_mode_service {
            let mode = if on { ControlModeReport::AUTONOMOUS } else { ControlModeReport::MANUAL };
            // Nobody is driven while this is asked; what the vehicle answers shows in its reports.
            let _ = self.wire.ask_mode(mode, ANSWER_MAX);
        }
    }

    fn outgoing(&self) -> Outgoing {
        let speed_mps = lock(&self.car).speed_mps.unwrap_or(0.0);
        Outgoing::new(self.clock.now(), self.epoch, speed_mps)
    }

    fn send(&self, outgoing: Outgoing, state: &mut State) {
        for (role, message) in outgoing.messages {
            match self.wire.send(role, message) {
                Sent::Done => state.report.sent += 1,
                Sent::Failed => state.report.not_sent += 1,
                Sent::NoTopic => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU32;
    use std::sync::mpsc;

    use swerve_ros2::bridge::TopicStatistics;
    use swerve_ros2::mapping::{Role, Vehicle};
    use swerve_ros2::{AnyMessage, Kind};

    use super::super::vehicle::{self, Facts};
    use super::super::wire::Taken;
    use super::*;
    use swerve_stack::config::Config;

    /// A wire to a car that stands, which loses the first messages that release it.
    struct Lossy {
        car: Arc<Mutex<Car>>,
        lost: AtomicU32,
        releases: AtomicU32,
    }

    impl Wire for Lossy {
        fn wait(&self, _: Duration) -> bool {
            false
        }

        fn take(&self) -> Option<Taken<'_>> {
            None
        }

        fn send(&self, _: Role, message: AnyMessage) -> Sent {
            if matches!(message, AnyMessage::Engage(engage) if !engage.engage)
                && self.releases.fetch_add(1, Ordering::Relaxed) >= self.lost.load(Ordering::Relaxed)
            {
                let mut car = lock(&self.car);
                car.listens = car.listens.map(|_| false);
            }
            Sent::Done
        }

        fn ask_mode(&self, _: u8, _: Duration) -> Result<bool, String> {
            Ok(true)
        }

        fn statistics(&self) -> Vec<TopicStatistics> {
            Vec::new()
        }
    }

    /// How often a car is told that it is released, and whether it said so, where it loses the first `lost` of that.
    fn released(listens: Option<bool>, lost: u32) -> (u32, Option<bool>) {
        let mut car = Car::default();
        let stands = Facts { speed_mps: Some(0.0), listens, ..Facts::default() };
        car.hear(Role::ControlMode, Kind::ControlModeReport, Time::ZERO, stands);
        let car = Arc::new(Mutex::new(car));
        let wire = Lossy { car: car.clone(), lost: lost.into(), releases: 0.into() };
        let clock = HostClock::start();
        let sink = Sink {
            wire: &wire,
            interface: vehicle::interface(Vehicle::Autoware, &Config::default()),
            car,
            clock,
            epoch: Epoch { ns: clock.epoch_ns() },
            stop: GateParams::default(),
            stop_max: Span::from_secs(20.0),
            has_mode_service: false,
            says_enable: true,
            gave_up: Arc::default(),
        };
        let (orders, received) = mpsc::channel();
        drop(orders);
        let report = sink.run(&received);
        (wire.releases.into_inner(), report.released)
    }

    #[test]
    fn a_car_is_told_that_it_is_released_until_it_says_so() {
        assert_eq!(released(Some(true), 0), (RELEASES_MIN, Some(true)));
        assert_eq!(released(Some(true), 20), (21, Some(true)));
        assert_eq!(released(Some(true), u32::MAX), (RELEASES_MAX, Some(false)), "not for ever");
        assert_eq!(released(None, 0), (RELEASES_MIN, None), "one that says nothing of it");
    }
}
