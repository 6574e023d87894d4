//! Safety gate: the last check of commands before a vehicle's actuators.
//!
//! A [`SafetyGate`] is called at a fixed rate with the latest command of the stack, the latest report of the vehicle,
//! the driver's enable switch, and the emergency stop. Its output is finite, within limits and within rates for any
//! input. It is a state machine:
//!
//! ```text
//!            rising edge of `enable`, all well
//!   Manual ------------------------------------> Driving
//!     ^                                             | no command for 0.5 s, no report for 0.5 s, `enable` released,
//!     | driver takes over: from everywhere,         | pose lost, or moving otherwise than the wheels,
//!     |                                             | vehicle does not follow its commands
//!     | latched until `enable` falls and rises      v
//!     +------------------------------------- Stopping ----> Holding (standstill)
//!                                                ^             |
//!                    emergency: from Driving,    |             | rising edge of `enable`, all well
//!                    harder, never undone        +             v
//!                    before standstill                      Driving
//! ```
//!
//! In `Stopping` and `Holding` the output is a deceleration by the brake ([`Longitudinal::Brake`]), a function of the
//! mode, the previous output, and the deceleration planned before the stop. It is independent of reports, including
//! their sign, noise or absence.
//!
//! The rules are those of Autoware's `vehicle_cmd_gate` and of drive-by-wire kits: an outdated command leads to a stop
//! instead of being repeated; the driver always has priority; enabling is an event, not a state.
//!
//! The gate is pure: the instant is an input.

mod follow;
mod params;
mod pose_check;
mod standstill;
mod stop_path;

use swerve_core::param::ParamError;
use swerve_core::{Span, Time};
use swerve_geom::math;
use swerve_msg::{
    EgoState, GateMode, GateOutput, Longitudinal, MotionCommand, Plan, PoseMode, PoseQuality, Refusal,
    Refusals, StopCause, VehicleReport,
};
use swerve_vehicle::{Pedals, VehicleParams, brake_for_decel, pedals_for_accel};

use follow::FollowCheck;
pub use params::GateParams;
use pose_check::PoseCheck;
use standstill::Standstill;
use stop_path::StopPath;

/// Longest time step for rate limits: after a long interval between calls the output does not jump.
const STEP_MAX: Span = Span::from_ms(100);

/// A localizer that restarts reports a lost pose for a moment: the pose counts as lost only after this time, seconds.
const LOST_MAX_S: f64 = 0.15;

/// Tolerance on the largest reverse speed, for a car that rolls backwards, m/s.
const REVERSE_MARGIN_MPS: f64 = 0.1;

/// A car faster than its command by more than this is not accelerated, m/s.
const TOO_FAST_MPS: f64 = 2.0;

/// Input of the gate at one instant: the latest value of each, new or not.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct GateInput<'a> {
    /// The current instant.
    pub now: Time,
    /// The latest command of the stack.
    pub command: Option<MotionCommand>,
    /// Stamp of the latest sensor frame from which this command derives, if known.
    pub origin: Option<Time>,
    /// The latest report of the vehicle.
    pub report: Option<VehicleReport>,
    /// Enable switch: its rising edge enables driving.
    pub enable: bool,
    /// Emergency stop requested.
    pub emergency: bool,
    /// Reason for a stop regardless of the command, reported by the receiver of commands.
    pub alarm: Option<StopCause>,
    /// The latest quality of the pose, if localization reports one.
    pub quality: Option<PoseQuality>,
    /// The latest pose used by the stack.
    pub pose: Option<EgoState>,
    /// The latest plan: the path of a stop that begins now.
    pub plan: Option<&'a Plan>,
}

/// State machine of the safety gate; see the module documentation.
#[derive(Clone, Debug)]
pub struct SafetyGate {
    params: GateParams,
    mode: GateMode,
    /// The latest accepted command.
    command: Option<MotionCommand>,
    /// Stamp of the first of the latest commands with equal values.
    same_since: Time,
    /// The last input command, so that a refusal is counted once.
    given: Option<MotionCommand>,
    given_refusal: Option<Refusal>,
    report: Option<VehicleReport>,
    standstill: Standstill,
    pose: PoseCheck,
    stop_path: Option<StopPath>,
    follow: FollowCheck,
    /// Stamp of the latest quality with a pose that is not lost.
    pose_known: Time,
    /// Angle and acceleration of the last output.
    sent: Option<(f64, f64)>,
    enable_before: bool,
    now: Option<Time>,
    heartbeat: u16,
    refusals: Refusals,
}

impl SafetyGate {
    /// Creates a gate in manual mode. The switch has to be seen released once before it can enable.
    ///
    /// # Errors
    /// If a parameter is out of range.
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
            standstill: Standstill::default(),
            pose: PoseCheck::default(),
            stop_path: None,
            follow: FollowCheck::default(),
            pose_known: Time::MIN,
            sent: None,
            enable_before: true,
            now: None,
            heartbeat: 0,
            refusals: Refusals::default(),
        })
    }

    /// Numbers of refused commands so far.
    pub fn refusals(&self) -> Refusals {
        self.refusals
    }

    /// Command to the vehicle at this instant.
    pub fn step(&mut self, input: &GateInput<'_>) -> GateOutput {
        // If time runs backwards, it counts as standing still: nothing becomes younger.
        let now = self.now.map_or(input.now, |before| before.max(input.now));
        let dt_s = self.now.map_or(Span::ZERO, |before| (now - before).min(STEP_MAX)).as_secs();
        self.now = Some(now);
        let refused = self.take_command(input, now);
        self.take_report(input.report, now);
        if let Some(quality) = input.quality.filter(|quality| quality.mode != PoseMode::Lost) {
            self.pose_known = quality.stamp;
        }
        if let Some(pose) = &input.pose {
            self.pose.take_pose(pose, input.quality.as_ref(), &self.params);
        }
        let mode = self.next_mode(input, now);
        if self.mode == GateMode::Driving && mode.brakes() {
            self.stop_path = StopPath::new(input.plan, &self.pose);
        }
        self.mode = mode;
        self.enable_before = input.enable;
        self.heartbeat = self.heartbeat.wrapping_add(1);
        let (command, limited) = self.output(now, dt_s);
        if self.mode == GateMode::Driving {
            self.follow.take_command(now, command.steering_rad, command.accel_mps2, &self.params);
        } else {
            self.follow.clear();
        }
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

    fn take_command(&mut self, input: &GateInput<'_>, now: Time) -> Option<Refusal> {
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
        // Equal stamps are in order: a controller faster than its measurements sends several commands per state.
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

    /// Takes a report unless it is not finite, from the future or older than the previous one; an active driver is
    /// accepted from every report.
    fn take_report(&mut self, given: Option<VehicleReport>, now: Time) {
        let Some(report) = given else { return };
        let finite = report.speed_mps.is_finite() && report.steering_rad.is_finite();
        let ahead = report.stamp > now.saturating_add(Span::from_secs(self.params.ahead_max_s));
        let older = self.report.is_some_and(|before| report.stamp < before.stamp);
        if finite && !ahead && !older {
            self.report = Some(report);
            self.standstill.take(&report);
            let decel_mps2 = self.sent.map_or(0.0, |(_, accel_mps2)| -accel_mps2);
            self.pose.take_report(&report, decel_mps2, &self.params);
            self.follow.take_report(&report, &self.params);
        }
    }

    fn next_mode(&self, input: &GateInput<'_>, now: Time) -> GateMode {
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
            () if self.is_lost(input, now) => Some(StopCause::PoseLost),
            () if self.pose.is_implausible() => Some(StopCause::PoseImplausible),
            () if self.follow.fault().is_some() => self.follow.fault(),
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
            GateMode::Stopping(cause) if report && self.standstill.stands() => {
                GateMode::Holding(if input.emergency { StopCause::Emergency } else { cause })
            }
            GateMode::Stopping(_) if input.emergency => GateMode::Stopping(StopCause::Emergency),
            GateMode::Stopping(cause) => GateMode::Stopping(cause),
            GateMode::Holding(_) if may_start => GateMode::Driving,
            // The car rolls: brake again.
            GateMode::Holding(cause) if report && !self.standstill.stands() => GateMode::Stopping(cause),
            GateMode::Holding(cause) => GateMode::Holding(cause),
        }
    }

    /// Returns true if localization has reported a lost pose for longer than a moment.
    fn is_lost(&self, input: &GateInput<'_>, now: Time) -> bool {
        let lost = input.quality.is_some_and(|quality| quality.mode == PoseMode::Lost);
        lost && !is_fresh(self.pose_known, now, LOST_MAX_S)
    }

    /// Returns true if commands have repeated the same values for too long.
    fn hangs(&self, now: Time) -> bool {
        let most_s = self.params.repeat_max_s;
        most_s > 0.0 && !self.standstill.stands() && !is_fresh(self.same_since, now, most_s)
    }

    fn output(&mut self, now: Time, dt_s: f64) -> (MotionCommand, bool) {
        let p = &self.params;
        let VehicleReport { speed_mps, steering_rad, .. } = self.report.unwrap_or_default();
        let measured_rad = steering_rad.clamp(-p.steering_max_rad, p.steering_max_rad);
        let before = self.sent.unwrap_or((measured_rad, 0.0));
        let (command, limited) = match (self.mode, self.command) {
            (GateMode::Driving, Some(wish)) => {
                let command = self.drive(&wish, before, speed_mps, dt_s);
                let limited = !same(&MotionCommand { stamp: wish.stamp, ..command }, &wish);
                (MotionCommand { stamp: now, ..command }, limited)
            }
            (GateMode::Stopping(_) | GateMode::Holding(_), _) => self.brake(now, before, dt_s),
            // Driving always has a command: without one it would have timed out.
            (GateMode::Manual | GateMode::Driving, _) => {
                self.sent = None;
                let speed_mps = speed_mps.clamp(-p.reverse_max_mps, p.speed_max_mps);
                let steering_rad = measured_rad;
                return (MotionCommand { stamp: now, steering_rad, speed_mps, accel_mps2: 0.0 }, false);
            }
        };
        self.sent = Some((command.steering_rad, command.accel_mps2));
        (command, limited)
    }

    /// Command of a stop, and true while the deceleration is still building up. The deceleration is a function of the
    /// mode, the previous output and the last plan, not of any measurement: the speed is 0, the acceleration is never
    /// above 0. The wheels follow the path of the stop; they are held without a path, and at standstill.
    fn brake(
        &self,
        now: Time,
        (steering_before, accel_before): (f64, f64),
        dt_s: f64,
    ) -> (MotionCommand, bool) {
        let p = &self.params;
        let path = self.stop_path.as_ref().filter(|_| !self.standstill.stands());
        let steering_rad =
            path.and_then(|path| path.steering_rad(&self.pose, now, -accel_before, p.wheelbase_m));
        let steering_rad = match steering_rad {
            Some(wanted_rad) => self.steered(wanted_rad, steering_before, dt_s),
            None => steering_before,
        };
        // Harder braking in the previous output or in the plan may have had a reason: a stop never brakes less.
        let before = (-accel_before).max(0.0);
        let planned = path.map_or(0.0, |path| path.planned_mps2(now).min(p.decel_max_mps2));
        let asked = before.max(planned);
        let built_up = before + p.jerk_max_mps3 * dt_s;
        let (wanted, most) = match self.mode {
            GateMode::Holding(_) => (p.hold_decel_mps2, p.hold_decel_mps2),
            GateMode::Stopping(StopCause::Emergency) => {
                (p.emergency_decel_mps2.max(asked), p.emergency_decel_mps2.max(built_up))
            }
            _ => (p.stop_decel_mps2.max(asked), built_up),
        };
        let decel = wanted.min(most);
        (MotionCommand { stamp: now, steering_rad, speed_mps: 0.0, accel_mps2: 0.0 - decel }, decel < wanted)
    }

    /// A steering angle within the limit at the reported speed and within the rate, radians.
    fn steered(&self, wanted_rad: f64, before_rad: f64, dt_s: f64) -> f64 {
        let p = &self.params;
        let speed_mps = self.report.map_or(0.0, |report| report.speed_mps);
        let bend_max = p.lateral_accel_max_mps2 * p.wheelbase_m / (speed_mps * speed_mps).max(1e-3);
        let most_rad = p.steering_max_rad.min(math::atan(bend_max));
        let turn = p.steering_rate_max_radps * dt_s;
        wanted_rad.clamp(-most_rad, most_rad).clamp(before_rad - turn, before_rad + turn)
    }

    /// The stack's command, within limits and rates.
    fn drive(
        &self,
        wish: &MotionCommand,
        (steering_before, accel_before): (f64, f64),
        speed_mps: f64,
        dt_s: f64,
    ) -> MotionCommand {
        let p = &self.params;
        let steering_rad = self.steered(wish.steering_rad, steering_before, dt_s);
        let wanted_mps = wish.speed_mps.clamp(-p.reverse_max_mps, p.speed_max_mps);
        // Above the allowed speed the car is not accelerated further, whatever the command.
        // The same applies above the command's own speed, which bounds the effect of an old command under new stamps.
        let too_fast = speed_mps > p.speed_max_mps.min(wanted_mps.max(0.0) + TOO_FAST_MPS)
            || speed_mps < -p.reverse_max_mps - REVERSE_MARGIN_MPS;
        let most = if too_fast { 0.0 } else { p.accel_max_mps2 };
        let change = p.jerk_max_mps3 * dt_s;
        // The limits take precedence over the rate, even if that is a jump.
        let accel_mps2 = wish.accel_mps2.clamp(-p.decel_max_mps2, most);
        let accel_mps2 =
            accel_mps2.clamp(accel_before - change, accel_before + change).clamp(-p.decel_max_mps2, most);
        MotionCommand { stamp: wish.stamp, steering_rad, speed_mps: wanted_mps, accel_mps2 }
    }
}

/// Pedals of `vehicle` for an output of the gate, at a measured speed. While the car is stopped or held, these are the
/// brake alone, and the measured speed has no effect.
pub fn pedals(vehicle: &VehicleParams, output: &GateOutput, speed_mps: f64) -> Pedals {
    match output.longitudinal() {
        Longitudinal::Accel(accel_mps2) => pedals_for_accel(vehicle, speed_mps, accel_mps2),
        Longitudinal::Brake(decel_mps2) => brake_for_decel(vehicle, decel_mps2),
    }
}

/// Returns true if the commands are equal, treating NaN as equal to itself.
fn same(a: &MotionCommand, b: &MotionCommand) -> bool {
    let bits = |c: &MotionCommand| [c.steering_rad, c.speed_mps, c.accel_mps2].map(f64::to_bits);
    a.stamp == b.stamp && bits(a) == bits(b)
}

fn is_fresh(stamp: Time, now: Time, timeout_s: f64) -> bool {
    stamp.saturating_add(Span::from_secs(timeout_s)) >= now
}

#[cfg(test)]
mod properties;
#[cfg(test)]
mod tests;
