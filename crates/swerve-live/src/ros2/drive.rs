//! Commands of an external stack, from its topics to the safety gate.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use swerve_core::{Span, Time};
use swerve_flow::SourceHandle;
use swerve_msg::{GateMode, MotionCommand, StopCause, Switch, WireAlarm};
use swerve_ros2::AnyMessage;
use swerve_ros2::bridge::{EndpointId, Received};
use swerve_ros2::clock::{ClockOffset, ClockParams, StampVerdict};
use swerve_ros2::convert::{
    Epoch, SteeringGear, ackermann_from_ros, carla_steering_from_ros, control_from_ros,
};
use swerve_ros2::mapping::{Mapping, Purpose, Role};
use swerve_ros2::msg::autoware_vehicle_msgs::ControlModeReport;
use swerve_ros2::msg::builtin_interfaces as builtin;
use swerve_ros2::msg::ds_dbw_msgs::{BrakeCmd, SteeringCmd, ThrottleCmd, UlcCmd};
use swerve_ros2::transport::Transport;
use swerve_stack::config::live::EnableBy;
use swerve_stack::pipeline::Pipeline;
use swerve_vehicle::{Pedals, VehicleParams, accel_for_pedals};

use crate::engage::{Engagement, Situation};
use crate::intake::Request;
use crate::shared::lock;
use crate::time::TopicClock;

use super::writers::Writers;

/// Period of checking the switch.
const TICK: Duration = Duration::from_millis(20);
/// Messages processed before the switch is checked again, so that a flood does not delay it.
const AT_ONCE: usize = 256;
/// Largest age difference of separate steering and pedal messages that form one command.
const TOGETHER: Span = Span::from_ms(200);
/// Maximum time that a request to drive waits for usable commands.
const ENABLE_WITHIN: Span = Span::from_ms(5000);
/// Gain from speed error to acceleration for commands with a speed only, 1/s.
const SPEED_GAIN_PER_S: f64 = 2.0;

/// Inputs of the pipeline for an external stack.
pub(super) struct DriverInputs {
    /// Motion commands.
    pub(super) commands: SourceHandle<MotionCommand>,
    /// Enabling switch.
    pub(super) switch: SourceHandle<Switch>,
    /// Faults of the external stack.
    pub(super) alarms: SourceHandle<WireAlarm>,
}

impl DriverInputs {
    /// Takes the inputs of a pipeline that an external stack drives; `None` for any other.
    pub(super) fn take(pipeline: &mut Pipeline) -> Option<Self> {
        Some(Self {
            commands: pipeline.take_source_of()?,
            switch: pipeline.take_source_of()?,
            alarms: pipeline.take_source_of()?,
        })
    }
}

/// State of the car in the run, for the reader of commands.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moment {
    pub(super) now: Time,
    pub(super) speed_mps: f64,
    pub(super) mode: GateMode,
}

/// State shared between the engine's thread and the reader's.
pub(super) type Shared = Arc<Mutex<Moment>>;

/// Counts of the external stack's commands.
#[derive(Clone, Debug, Default)]
pub(super) struct ListenerReport {
    /// Commands passed to the gate.
    pub(super) commands: u64,
    /// Commands rejected for implausible stamps.
    pub(super) implausible: u64,
    /// Commands of other writers than the one that drove, by topic.
    pub(super) of_others: BTreeMap<EndpointId, u64>,
    /// Offset between the stack's clock and run time.
    pub(super) clock: Option<ClockOffset>,
}

/// Reads commands and requests until stopped.
pub(super) struct Listener {
    inputs: DriverInputs,
    shared: Shared,
    clock: TopicClock,
    engagement: Engagement,
    requests: Vec<Request>,
    /// Instant since which a request to drive has been waiting for commands.
    waits_since: Option<Time>,
    switch: Option<Switch>,
    wire: Wire,
    writers: Writers,
    alarm: WireAlarm,
    last: Option<Time>,
    report: ListenerReport,
}

impl Listener {
    pub(super) fn new(
        inputs: DriverInputs,
        vehicle: &VehicleParams,
        gear: SteeringGear,
        shared: Shared,
    ) -> Self {
        Self {
            inputs,
            shared,
            clock: TopicClock::new(ClockParams::default()),
            engagement: Engagement::new(EnableBy::Topic, ENABLE_WITHIN),
            requests: Vec::new(),
            waits_since: None,
            switch: None,
            wire: Wire { gear, ..Wire::new(vehicle) },
            writers: Writers::default(),
            alarm: WireAlarm::default(),
            last: None,
            report: ListenerReport::default(),
        }
    }

    pub(super) fn run(mut self, bridge: &Transport, mapping: &Mapping, stop: &AtomicBool) -> ListenerReport {
        while !stop.load(Ordering::Relaxed) {
            bridge.wait(TICK);
            for (id, received) in std::iter::from_fn(|| bridge.take_any()).take(AT_ONCE) {
                let Some(topic) = mapping.topic(&bridge.endpoints()[id.0].name) else { continue };
                if topic.role.purpose() != Purpose::Motion || self.writers.hear(id, received.writer) {
                    self.take(topic.role, &received.message);
                } else {
                    self.tell_second_writer(&topic.topic, &received);
                }
            }
            // Only Autoware vehicles have the service.
            let modes = bridge.take_modes().into_iter();
            self.requests.extend(modes.map(|mode| Request::Drive(mode == ControlModeReport::AUTONOMOUS)));
            for what in bridge.take_losses() {
                self.tell(&what);
                self.raise(StopCause::TransportLost, what);
            }
            self.advance_switch();
        }
        self.report.clock = self.clock.offset();
        self.report.of_others = self.writers.into_refused();
        self.report
    }

    /// Makes the gate stop the car: commands arrive from a second writer.
    fn tell_second_writer(&mut self, topic: &str, received: &Received) {
        if self.alarm.cause.is_some() {
            return;
        }
        let what = format!(
            "commands on {topic} of a second writer, {}: they are refused and the car is stopped; let go of the switch \
             and press it to drive by one of the two",
            received.writer
        );
        self.tell(&what);
        self.raise(StopCause::SecondWriter, what);
    }

    /// Makes the gate stop the car: the age of commands cannot be judged after their clock was set.
    fn tell_set_clock(&mut self) {
        if self.alarm.cause.is_some() {
            return;
        }
        let what = "the clock that stamps the commands was set: they are refused and the car is stopped; let go of the \
                    switch and press it to drive by the new time";
        self.tell(what);
        self.raise(StopCause::ClockJump, what.to_owned());
    }

    /// Makes the gate stop the car, unless it does so already or the switch is off.
    fn raise(&mut self, cause: StopCause, what: String) {
        if self.alarm.cause.is_none() && self.switch.is_some_and(|switch| switch.enable) {
            self.say(WireAlarm { cause: Some(cause), what });
        }
    }

    fn tell(&self, what: &str) {
        let at_s = lock(&self.shared).now.as_secs();
        eprintln!("{at_s:7.2} s  {what}");
    }

    fn say(&mut self, alarm: WireAlarm) {
        self.alarm = alarm;
        // Fails only after the end of the run.
        let _over = self.inputs.alarms.send_now(self.alarm.clone());
    }

    fn advance_switch(&mut self) {
        let Moment { now, mode, .. } = *lock(&self.shared);
        let ready = self.last.is_some_and(|last| now - last < TOGETHER);
        let mut requests = std::mem::take(&mut self.requests);
        // A request to drive and the first commands may arrive in any order.
        if requests.contains(&Request::Drive(false)) {
            self.waits_since = None;
        } else if !ready && requests.contains(&Request::Drive(true)) {
            self.waits_since = Some(now);
            requests.retain(|request| *request != Request::Drive(true));
        } else if ready && self.waits_since.take().is_some_and(|since| now - since < ENABLE_WITHIN) {
            requests.push(Request::Drive(true));
        }
        let at = Situation { now, ready, listens: None, driver: false, mode, misplaced: None };
        let action = self.engagement.step(&requests, &at);
        // Pressing the switch selects the writers that drive.
        self.writers.pin(action.switch.enable);
        self.clock.hold(action.switch.enable);
        if !action.switch.enable && self.alarm.cause.is_some() {
            self.say(WireAlarm::default());
        }
        if self.switch.replace(action.switch) != Some(action.switch) {
            // Fails only after the end of the run.
            let _over = self.inputs.switch.send_now(action.switch);
        }
    }

    fn take(&mut self, role: Role, message: &AnyMessage) {
        let Moment { now, speed_mps, .. } = *lock(&self.shared);
        match (role, message) {
            (Role::Enable, AnyMessage::Engage(engage)) => self.requests.push(Request::Drive(engage.engage)),
            (Role::Enable, AnyMessage::RaptorGlobalEnableCmd(all)) => {
                self.requests.push(Request::Drive(all.global_enable));
            }
            (Role::Enable, AnyMessage::Empty(_)) => self.requests.push(Request::Drive(true)),
            (Role::Disable, AnyMessage::Empty(_)) => self.requests.push(Request::Drive(false)),
            (_, AnyMessage::Control(control)) => {
                let mut command = control_from_ros(control, Epoch::default());
                if !control.longitudinal.is_defined_acceleration {
                    command.accel_mps2 = SPEED_GAIN_PER_S * (command.speed_mps - speed_mps);
                }
                self.send(now, Some(control.stamp), command);
            }
            (_, AnyMessage::AckermannDriveStamped(command)) => {
                let stamp = command.header.stamp;
                self.send(now, Some(stamp), ackermann_from_ros(command, Epoch::default()));
            }
            (_, message) => {
                if let Some((stamp, command)) = self.wire.take(message, now, speed_mps) {
                    self.send(now, stamp, command);
                }
            }
        }
    }

    /// Passes a command to the gate, with its stamp converted to run time.
    fn send(&mut self, now: Time, stamp: Option<builtin::Time>, command: MotionCommand) {
        let stamp = match stamp.map(|stamp| self.clock.time(stamp.ns(), now, 0)) {
            None => self.clock.unstamped(now),
            Some(Ok(stamp)) => stamp,
            Some(Err(verdict)) => {
                self.report.implausible += 1;
                if verdict == StampVerdict::JumpRefused {
                    self.tell_set_clock();
                }
                return;
            }
        };
        self.report.commands += 1;
        self.last = Some(now);
        // Fails only after the end of the run.
        let _over = self.inputs.commands.send(stamp, MotionCommand { stamp, ..command });
    }
}

/// Drive-by-wire commands: steering, and a speed or pedals, in separate messages.
struct Wire {
    vehicle: VehicleParams,
    gear: SteeringGear,
    /// Newest value of each kind, with its instant of arrival.
    accel_mps2: Option<(Time, f64)>,
    throttle: Option<(Time, f64)>,
    brake: Option<(Time, f64)>,
    speed_mps: f64,
}

impl Wire {
    fn new(vehicle: &VehicleParams) -> Self {
        Self {
            vehicle: vehicle.clone(),
            gear: SteeringGear::default(),
            accel_mps2: None,
            throttle: None,
            brake: None,
            speed_mps: 0.0,
        }
    }

    /// Returns a command if `message` is a steering command and a recent speed or pedal command exists. Ignores
    /// commands that are not enabled.
    fn take(
        &mut self,
        message: &AnyMessage,
        now: Time,
        speed_mps: f64,
    ) -> Option<(Option<builtin::Time>, MotionCommand)> {
        let percent = |x: f32| Some((now, 0.01 * f64::from(x)));
        if let AnyMessage::CarlaEgoVehicleControl(control) = message {
            let pedals = Pedals { throttle: f64::from(control.throttle), brake: f64::from(control.brake) };
            let accel_mps2 = accel_for_pedals(&self.vehicle, speed_mps, pedals);
            let steering_rad = carla_steering_from_ros(control, &self.gear);
            let command = MotionCommand { stamp: now, steering_rad, speed_mps, accel_mps2 };
            return Some((Some(control.header.stamp), command));
        }
        let (stamp, wheel_deg) = match message {
            AnyMessage::DataspeedSteeringCmd(cmd) if cmd.enable && cmd.cmd_type == SteeringCmd::CMD_ANGLE => {
                (Some(cmd.header.stamp), cmd.cmd)
            }
            AnyMessage::RaptorSteeringCmd(cmd) if cmd.enable => (None, cmd.angle_cmd),
            AnyMessage::DataspeedUlcCmd(cmd) if cmd.enable && cmd.cmd_type == UlcCmd::CMD_VELOCITY => {
                self.speed_mps = f64::from(cmd.cmd);
                let wanted = SPEED_GAIN_PER_S * (self.speed_mps - speed_mps);
                let (slower, faster) = (f64::from(cmd.limit_decel).abs(), f64::from(cmd.limit_accel).abs());
                self.accel_mps2 = Some((now, wanted.clamp(-slower, faster)));
                return None;
            }
            AnyMessage::DataspeedThrottleCmd(cmd)
                if cmd.enable && cmd.cmd_type == ThrottleCmd::CMD_PERCENT =>
            {
                self.throttle = percent(cmd.cmd);
                return None;
            }
            AnyMessage::DataspeedBrakeCmd(cmd) if cmd.enable && cmd.cmd_type == BrakeCmd::CMD_PERCENT => {
                self.brake = percent(cmd.cmd);
                return None;
            }
            AnyMessage::RaptorAcceleratorPedalCmd(cmd) if cmd.enable => {
                self.throttle = percent(cmd.pedal_cmd);
                return None;
            }
            AnyMessage::RaptorBrakeCmd(cmd) if cmd.enable => {
                self.brake = percent(cmd.pedal_cmd);
                return None;
            }
            _ => return None,
        };
        let lately = |said: Option<(Time, f64)>| said.filter(|(at, _)| now - *at < TOGETHER).map(|(_, x)| x);
        let pedals = || {
            // Either pedal may be missing, but not both.
            let (throttle, brake) = (lately(self.throttle), lately(self.brake));
            throttle.or(brake)?;
            let pedals = Pedals { throttle: throttle.unwrap_or(0.0), brake: brake.unwrap_or(0.0) };
            Some(accel_for_pedals(&self.vehicle, speed_mps, pedals))
        };
        let accel_mps2 = lately(self.accel_mps2).or_else(pedals)?;
        let steering_rad = self.gear.steering_rad(f64::from(wheel_deg));
        let command = MotionCommand { stamp: now, steering_rad, speed_mps: self.speed_mps, accel_mps2 };
        Some((stamp, command))
    }
}

#[cfg(test)]
mod tests {
    use swerve_msg::Command;
    use swerve_ros2::convert::{AccelLimits, Dataspeed, Raptor};
    use swerve_vehicle::pedals_for_accel;

    use super::*;

    fn at(ms: i64) -> Time {
        Time::from_ms(ms)
    }

    #[test]
    fn wire_combines_steering_and_speed_while_both_are_recent() {
        let mut wire = Wire::new(&VehicleParams::default());
        let car = Dataspeed::default();
        let steering = AnyMessage::DataspeedSteeringCmd(car.steering(at(10), 0.1, true, false));
        assert!(wire.take(&steering, at(10), 5.0).is_none(), "nothing was said of speed");
        let limits = AccelLimits { accel_mps2: 1.5, decel_mps2: 3.0 };
        let faster = MotionCommand { speed_mps: 9.0, ..MotionCommand::default() };
        let speed = AnyMessage::DataspeedUlcCmd(car.speed(&faster, limits, true, false));
        assert!(wire.take(&speed, at(20), 5.0).is_none());
        let (_, command) = wire.take(&steering, at(30), 5.0).unwrap();
        assert!((command.steering_rad - 0.1).abs() < 1e-6 && command.accel_mps2 == 1.5, "{command:?}");
        assert!(wire.take(&steering, at(20 + TOGETHER.ns() / 1_000_000), 5.0).is_none(), "the speed is old");
        let off = AnyMessage::DataspeedSteeringCmd(car.steering(at(30), 0.1, false, false));
        assert!(wire.take(&off, at(30), 5.0).is_none(), "not enabled");
    }

    #[test]
    fn wire_converts_pedals_to_acceleration() {
        let vehicle = VehicleParams::default();
        for accel_mps2 in [1.0, -3.0] {
            let mut wire = Wire::new(&vehicle);
            let pedals = pedals_for_accel(&vehicle, 8.0, accel_mps2);
            let command = Command { steering_rad: 0.0, throttle: pedals.throttle, brake: pedals.brake };
            let car = Raptor::default();
            let (throttle, brake) = car.pedals(&command, true, 1);
            assert!(wire.take(&AnyMessage::RaptorAcceleratorPedalCmd(throttle), at(0), 8.0).is_none());
            assert!(wire.take(&AnyMessage::RaptorBrakeCmd(brake), at(0), 8.0).is_none());
            let steering = AnyMessage::RaptorSteeringCmd(car.steering(-0.2, true, 1));
            let (_, command) = wire.take(&steering, at(5), 8.0).unwrap();
            assert!(
                (command.accel_mps2 - accel_mps2).abs() < 1e-3 && (command.steering_rad + 0.2).abs() < 1e-6
            );
        }
    }
}
