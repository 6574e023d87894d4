//! The last step before a vehicle: what may reach its actuators.
//!
//! A [`SafetyGate`] is called at a fixed rate with the newest command of the stack, the newest report of the
//! vehicle, the switch that a person holds, and the emergency stop. What it returns is finite, within limits and
//! within rates, whatever it was given. It is a state machine:
//!
//! ```text
//!            rising edge of `enable`, all well
//!   Manual ------------------------------------> Driving
//!     ^                                             |
//!     | driver takes over: from everywhere,         | no command for 0.5 s, no report for 0.5 s, `enable` released
//!     | latched until `enable` falls and rises      v
//!     +------------------------------------- Stopping ----> Holding (standstill)
//!                                                ^             |
//!                    emergency: from Driving,    |             | rising edge of `enable`, all well
//!                    harder, never undone        +             v
//!                    before standstill                      Driving
//! ```
//!
//! The rules are those of Autoware's `vehicle_cmd_gate` and of drive-by-wire kits: an outdated command is a stop,
//! not the last command for ever; the driver always wins; enabling is an act, not a state.
//!
//! Pure: the instant is an input.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_within};
use swerve_core::{Span, Time};
use swerve_geom::math;
use swerve_msg::{GateMode, GateOutput, MotionCommand, Refusal, Refusals, StopCause, VehicleReport};
use swerve_vehicle::VehicleParams;

/// Longest step that rates are applied over: a gate that was not called for long does not leap.
const STEP_MAX: Span = Span::from_ms(100);

/// Slower than this is standing, m/s.
const STANDSTILL_MPS: f64 = 0.1;

/// A car that is faster than its command wants it by more than this is not accelerated, m/s.
const TOO_FAST_MPS: f64 = 2.0;

/// Limits and times of a [`SafetyGate`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GateParams {
    /// A command older than this is none, seconds (Autoware: 0.5).
    pub command_timeout_s: f64,
    /// A report of the vehicle older than this is none, seconds.
    pub report_timeout_s: f64,
    /// The same numbers under new stamps for longer than this, while the car moves, are no command, seconds; 0 for no
    /// bound. A controller that measures never says the same for long, as ours does not; what is known to say only what it
    /// wants, such as a constant speed along a straight lane, may.
    pub repeat_max_s: f64,
    /// A command is refused whose newest sensor frame is older than this, seconds; 0 for no bound. What follows a plan
    /// of long ago is new itself, and blind.
    pub origin_timeout_s: f64,
    /// How far the stamp of a command may be ahead of now, seconds: clocks differ a little.
    pub ahead_max_s: f64,
    /// Largest angle of the front road wheels, radians.
    pub steering_max_rad: f64,
    /// Largest rate of that angle, rad/s.
    pub steering_rate_max_radps: f64,
    /// Largest lateral acceleration of a car without slip, m/s²: limits the angle at speed (Autoware: 4 to 5).
    pub lateral_accel_max_mps2: f64,
    /// Distance between the axles, metres.
    pub wheelbase_m: f64,
    /// Highest speed, m/s (Autoware: 25).
    pub speed_max_mps: f64,
    /// Highest speed backwards, m/s (positive); 0 for none.
    pub reverse_max_mps: f64,
    /// Largest acceleration, m/s².
    pub accel_max_mps2: f64,
    /// Largest deceleration that the stack may ask for, m/s² (positive).
    pub decel_max_mps2: f64,
    /// Largest rate at which the acceleration changes while driving, m/s³.
    pub jerk_max_mps3: f64,
    /// Deceleration of a controlled stop, m/s² (positive; Autoware: 1.5).
    pub stop_decel_mps2: f64,
    /// Deceleration of an emergency stop, m/s² (positive).
    pub emergency_decel_mps2: f64,
    /// Deceleration that is asked for at standstill, so that the car stays where it is, m/s² (positive).
    pub hold_decel_mps2: f64,
}

impl Default for GateParams {
    fn default() -> Self {
        Self {
            command_timeout_s: 0.5,
            report_timeout_s: 0.5,
            repeat_max_s: 0.0,
            origin_timeout_s: 0.0,
            ahead_max_s: 0.1,
            steering_max_rad: 0.61,
            steering_rate_max_radps: 0.7,
            lateral_accel_max_mps2: 5.0,
            wheelbase_m: 2.85,
            speed_max_mps: 25.0,
            reverse_max_mps: 0.0,
            accel_max_mps2: 3.0,
            decel_max_mps2: 8.0,
            jerk_max_mps3: 40.0,
            stop_decel_mps2: 1.5,
            emergency_decel_mps2: 5.0,
            hold_decel_mps2: 1.5,
        }
    }
}

impl GateParams {
    /// Those of a car whose own numbers are known.
    ///
    /// A gate is no second planner: its limits stand where the car itself ends, so that what a sound stack asks for
    /// in an emergency passes, and only what no sound stack asks for is cut. Angle, its rate and the brakes are the
    /// actuators' own (full brakes as fast as they build up); a tyre holds about 1 g to the side; comfort is not
    /// the gate's. A stop without a stack is blind, so it is a firm one: 3 m/s² (UN R157 allows a minimal risk
    /// manoeuvre 4); an emergency stop is the most that a plan may ask for.
    pub fn new(vehicle: &VehicleParams) -> Self {
        let brakes_mps2 =
            vehicle.brakes.torque_max_nm / (vehicle.wheel.radius_m * vehicle.effective_mass_kg());
        let limits = &vehicle.limits;
        let build_up_s = vehicle.brakes.build_up_s.max(0.02);
        Self {
            repeat_max_s: 1.0,
            origin_timeout_s: 1.0,
            steering_max_rad: limits.steering_max_rad,
            steering_rate_max_radps: limits.steering_rate_max_radps,
            lateral_accel_max_mps2: swerve_vehicle::GRAVITY_MPS2,
            wheelbase_m: vehicle.shape.wheelbase_m,
            accel_max_mps2: limits.accel_max_mps2,
            decel_max_mps2: brakes_mps2.min(20.0),
            jerk_max_mps3: (brakes_mps2 / build_up_s).min(1000.0),
            stop_decel_mps2: 3.0,
            emergency_decel_mps2: limits.brake_max_mps2,
            ..Self::default()
        }
    }
}

impl GateParams {
    /// Whether all of them are finite and of a plausible size.
    ///
    /// # Errors
    /// The first that is not.
    pub fn validate(&self) -> Result<(), ParamError> {
        let checks = [
            ("command_timeout_s", self.command_timeout_s, 0.01, 10.0),
            ("report_timeout_s", self.report_timeout_s, 0.01, 10.0),
            ("repeat_max_s", self.repeat_max_s, 0.0, 60.0),
            ("origin_timeout_s", self.origin_timeout_s, 0.0, 60.0),
            ("ahead_max_s", self.ahead_max_s, 0.0, 10.0),
            ("steering_max_rad", self.steering_max_rad, 0.01, 1.5),
            ("steering_rate_max_radps", self.steering_rate_max_radps, 0.01, 10.0),
            ("lateral_accel_max_mps2", self.lateral_accel_max_mps2, 0.1, 30.0),
            ("wheelbase_m", self.wheelbase_m, 0.1, 20.0),
            ("speed_max_mps", self.speed_max_mps, 0.1, 150.0),
            ("reverse_max_mps", self.reverse_max_mps, 0.0, 20.0),
            ("accel_max_mps2", self.accel_max_mps2, 0.1, 20.0),
            ("decel_max_mps2", self.decel_max_mps2, 0.1, 20.0),
            ("jerk_max_mps3", self.jerk_max_mps3, 0.1, 1000.0),
            ("stop_decel_mps2", self.stop_decel_mps2, 0.1, 20.0),
            ("emergency_decel_mps2", self.emergency_decel_mps2, 0.1, 20.0),
            ("hold_decel_mps2", self.hold_decel_mps2, 0.0, 20.0),
        ];
        checks.into_iter().try_for_each(|(key, value, min, max)| require_within(key, value, [min, max]))
    }
}

/// Input of the gate at one instant: always the newest of each, new or not.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct GateInput {
    /// The instant.
    pub now: Time,
    /// The newest command of the stack.
    pub command: Option<MotionCommand>,
    /// The newest sensor frame that this command derives from, where that is known.
    pub origin: Option<Time>,
    /// The newest report of the vehicle.
    pub report: Option<VehicleReport>,
    /// Whether a person wants the stack to drive: its rising edge enables.
    pub enable: bool,
    /// Whether the car is to be stopped at once.
    pub emergency: bool,
    /// Why the car is to be stopped whatever the command says: who hears commands found something wrong.
    pub alarm: Option<StopCause>,
}

/// The state machine: see the module's page.
#[derive(Clone, Debug)]
pub struct SafetyGate {
    params: GateParams,
    mode: GateMode,
    /// The newest command that was not refused.
    command: Option<MotionCommand>,
    /// Stamp of the first command since when they say the same.
    same_since: Time,
    /// The command given last, to count a refusal once.
    given: Option<MotionCommand>,
    given_refusal: Option<Refusal>,
    report: Option<VehicleReport>,
    /// Angle and acceleration sent last.
    sent: Option<(f64, f64)>,
    enable_before: bool,
    now: Option<Time>,
    heartbeat: u16,
    refusals: Refusals,
}

impl SafetyGate {
    /// In manual mode. The switch has to be seen released once before it can enable.
    ///
    /// # Errors
    /// A parameter that makes no gate.
    pub fn new(params: GateParams) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self {
            params,
            mode: GateMode::Manual,
            command: None,
            same_since: Time::ZERO,
            given: None,
            given_refusal: None,
            report: None,
            sent: None,
            enable_before: true,
            now: None,
            heartbeat: 0,
            refusals: Refusals::default(),
        })
    }

    /// How often commands were refused so far.
    pub fn refusals(&self) -> Refusals {
        self.refusals
    }

    /// The command that may reach the vehicle now.
    pub fn step(&mut self, input: &GateInput) -> GateOutput {
        // Time that runs backwards is time that stands: nothing gets younger by it.
        let now = self.now.map_or(input.now, |before| before.max(input.now));
        let dt_s = self.now.map_or(Span::ZERO, |before| (now - before).min(STEP_MAX)).as_secs();
        self.now = Some(now);
        let refused = self.take_command(input, now);
        self.take_report(input.report, now);
        self.mode = self.next_mode(input, now);
        self.enable_before = input.enable;
        self.heartbeat = self.heartbeat.wrapping_add(1);
        let (command, limited) = self.output(now, dt_s);
        let engaged = self.mode != GateMode::Manual;
        GateOutput {
            mode: self.mode,
            engaged,
            command,
            heartbeat: self.heartbeat,
            refused,
            refusals: self.refusals,
            limited,
        }
    }

    fn take_command(&mut self, input: &GateInput, now: Time) -> Option<Refusal> {
        let command = input.command?;
        if self.given.is_some_and(|before| same(&before, &command)) {
            return self.given_refusal;
        }
        let refusal = self.judge(&command, input.origin, now);
        match refusal {
            None => {
                let says_the_same =
                    |before: MotionCommand| same(&MotionCommand { stamp: command.stamp, ..before }, &command);
                if !self.command.is_some_and(says_the_same) {
                    self.same_since = command.stamp;
                }
                self.command = Some(command);
            }
            Some(Refusal::NotFinite) => self.refusals.not_finite += 1,
            Some(Refusal::OutOfOrder) => self.refusals.out_of_order += 1,
            Some(Refusal::Stale) => self.refusals.stale += 1,
            Some(Refusal::Ahead) => self.refusals.ahead += 1,
        }
        (self.given, self.given_refusal) = (Some(command), refusal);
        refusal
    }

    fn judge(&self, command: &MotionCommand, origin: Option<Time>, now: Time) -> Option<Refusal> {
        let numbers = [command.steering_rad, command.speed_mps, command.accel_mps2];
        if !numbers.iter().all(|number| number.is_finite()) {
            return Some(Refusal::NotFinite);
        }
        // Two of one stamp are in order: several come of one state where the control is faster than its measurements.
        if self.command.is_some_and(|before| command.stamp < before.stamp) {
            return Some(Refusal::OutOfOrder);
        }
        if command.stamp > now.saturating_add(Span::from_secs(self.params.ahead_max_s)) {
            return Some(Refusal::Ahead);
        }
        let bound_s = self.params.origin_timeout_s;
        let is_blind = bound_s > 0.0 && origin.is_some_and(|frame| !is_fresh(frame, now, bound_s));
        let is_old = !is_fresh(command.stamp, now, self.params.command_timeout_s);
        (is_blind || is_old).then_some(Refusal::Stale)
    }

    /// A report that is not finite, from the future or older than the one before it is none; but that the driver is
    /// active is believed of every report.
    fn take_report(&mut self, given: Option<VehicleReport>, now: Time) {
        let Some(report) = given else { return };
        let finite = report.speed_mps.is_finite() && report.steering_rad.is_finite();
        let ahead = report.stamp > now.saturating_add(Span::from_secs(self.params.ahead_max_s));
        let older = self.report.is_some_and(|before| report.stamp < before.stamp);
        if finite && !ahead && !older {
            self.report = Some(report);
        }
    }

    fn next_mode(&self, input: &GateInput, now: Time) -> GateMode {
        let driver = input.report.is_some_and(|report| report.driver_active);
        if driver {
            return GateMode::Manual;
        }
        let command = self.command.is_some_and(|c| is_fresh(c.stamp, now, self.params.command_timeout_s));
        let report = self.report.is_some_and(|r| is_fresh(r.stamp, now, self.params.report_timeout_s));
        let rising = input.enable && !self.enable_before;
        let hangs = self.hangs(now);
        let fault = match () {
            () if input.emergency => Some(StopCause::Emergency),
            () if input.alarm.is_some() => input.alarm,
            () if !report => Some(StopCause::ReportTimeout),
            () if !command => Some(StopCause::CommandTimeout),
            () if hangs => Some(StopCause::CommandFrozen),
            () => None,
        };
        let may_start = rising && fault.is_none();
        match self.mode {
            GateMode::Manual if may_start => GateMode::Driving,
            GateMode::Manual => GateMode::Manual,
            GateMode::Driving => {
                let fault = fault.or((!input.enable).then_some(StopCause::Released));
                fault.map_or(GateMode::Driving, GateMode::Stopping)
            }
            GateMode::Stopping(cause) if report && self.stands() => {
                GateMode::Holding(if input.emergency { StopCause::Emergency } else { cause })
            }
            GateMode::Stopping(_) if input.emergency => GateMode::Stopping(StopCause::Emergency),
            GateMode::Stopping(cause) => GateMode::Stopping(cause),
            GateMode::Holding(_) if may_start => GateMode::Driving,
            // It rolls: brake it again.
            GateMode::Holding(cause) if report && !self.stands() => GateMode::Stopping(cause),
            GateMode::Holding(cause) => GateMode::Holding(cause),
        }
    }

    /// Whether commands come that say the same for too long.
    fn hangs(&self, now: Time) -> bool {
        let most_s = self.params.repeat_max_s;
        most_s > 0.0 && !self.stands() && !is_fresh(self.same_since, now, most_s)
    }

    fn stands(&self) -> bool {
        self.report.is_some_and(|report| report.speed_mps.abs() < STANDSTILL_MPS)
    }

    fn output(&mut self, now: Time, dt_s: f64) -> (MotionCommand, bool) {
        let p = &self.params;
        let speed_mps = self.report.map_or(0.0, |report| report.speed_mps);
        let measured_rad = self.report.map_or(0.0, |report| report.steering_rad);
        let measured_rad = measured_rad.clamp(-p.steering_max_rad, p.steering_max_rad);
        if self.mode == GateMode::Manual {
            self.sent = None;
            let speed_mps = speed_mps.clamp(-p.reverse_max_mps, p.speed_max_mps);
            return (
                MotionCommand { stamp: now, steering_rad: measured_rad, speed_mps, accel_mps2: 0.0 },
                false,
            );
        }
        let (steering_before, accel_before) = self.sent.unwrap_or((measured_rad, 0.0));
        // Against the way that it rolls; forwards where it stands.
        let back = if speed_mps < -STANDSTILL_MPS { -1.0 } else { 1.0 };
        let stop = |decel: f64| MotionCommand {
            stamp: now,
            steering_rad: steering_before,
            speed_mps: 0.0,
            accel_mps2: -back * decel,
        };
        let (wish, decel_max, jerk_max) = match self.mode {
            GateMode::Driving => {
                let wish = self.command.expect("driving needs a command that is not too old");
                (wish, p.decel_max_mps2, Some(p.jerk_max_mps3))
            }
            GateMode::Holding(_) => (stop(p.hold_decel_mps2), p.hold_decel_mps2, None),
            GateMode::Stopping(StopCause::Emergency) => {
                (stop(p.emergency_decel_mps2), p.emergency_decel_mps2, None)
            }
            // Who asked for hard braking last may have had a reason: a stop never brakes less.
            _ => (stop(p.stop_decel_mps2.max(-back * accel_before)), p.decel_max_mps2, Some(p.jerk_max_mps3)),
        };
        let bend_max = p.lateral_accel_max_mps2 * p.wheelbase_m / (speed_mps * speed_mps).max(1e-3);
        let most_rad = p.steering_max_rad.min(math::atan(bend_max));
        let turn = p.steering_rate_max_radps * dt_s;
        let wanted_rad = wish.steering_rad.clamp(-most_rad, most_rad);
        let steering_rad = wanted_rad.clamp(steering_before - turn, steering_before + turn);

        let wanted_mps = wish.speed_mps.clamp(-p.reverse_max_mps, p.speed_max_mps);
        // Faster than allowed, it does not get faster still, whatever is asked for.
        // Nor where the command itself wants it slower: an old command under new stamps is held by that.
        let too_fast = speed_mps > p.speed_max_mps.min(wanted_mps.max(0.0) + TOO_FAST_MPS)
            || speed_mps < -p.reverse_max_mps - STANDSTILL_MPS;
        let accel_max = if too_fast { 0.0 } else { p.accel_max_mps2 };
        let (least, most) = if back > 0.0 { (-decel_max, accel_max) } else { (-accel_max, decel_max) };
        let mut accel_mps2 = wish.accel_mps2.clamp(least, most);
        if let Some(jerk_max) = jerk_max {
            // Back within limits is reached even where that is a leap.
            let change = jerk_max * dt_s;
            accel_mps2 = accel_mps2.clamp(accel_before - change, accel_before + change).clamp(least, most);
        }
        self.sent = Some((steering_rad, accel_mps2));
        let command = MotionCommand { stamp: now, steering_rad, speed_mps: wanted_mps, accel_mps2 };
        let limited = !same(&MotionCommand { stamp: wish.stamp, ..command }, &wish);
        (command, limited)
    }
}

/// Equal, not-a-number included.
fn same(a: &MotionCommand, b: &MotionCommand) -> bool {
    let bits = |c: &MotionCommand| [c.steering_rad, c.speed_mps, c.accel_mps2].map(f64::to_bits);
    a.stamp == b.stamp && bits(a) == bits(b)
}

fn is_fresh(stamp: Time, now: Time, timeout_s: f64) -> bool {
    stamp.saturating_add(Span::from_secs(timeout_s)) >= now
}

#[cfg(test)]
mod tests;
