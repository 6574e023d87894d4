//! Commands and state of the safety gate between the stack and a vehicle.

use serde::{Deserialize, Serialize};
use swerve_core::Time;

use crate::MotionCommand;

/// State that the vehicle reports.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct VehicleReport {
    /// Instant of the measurement.
    pub stamp: Time,
    /// Speed along the heading, m/s; negative in reverse.
    pub speed_mps: f64,
    /// Angle of the front road wheels, radians; positive to the left.
    pub steering_rad: f64,
    /// True if the driver steers, brakes or accelerates, or the vehicle is in manual mode.
    pub driver_active: bool,
}

/// State of the enabling switch, which a person holds.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Switch {
    /// True if the stack should drive; a rising edge enables it.
    pub enable: bool,
    /// True to stop the car at once.
    pub emergency: bool,
}

/// Fault of the link between the vehicle and the process that commands it. Published on every change.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct WireAlarm {
    /// Cause for which the car must be stopped; `None` without a fault, or once the switch has been released since.
    pub cause: Option<StopCause>,
    /// Description of the fault.
    pub what: String,
}

/// Mode of the safety gate.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GateMode {
    /// The driver drives; the gate sends no commands.
    #[default]
    Manual,
    /// The stack drives.
    Driving,
    /// The gate brings the car to a standstill.
    Stopping(StopCause),
    /// The gate holds the stationary car.
    Holding(StopCause),
}

impl GateMode {
    /// Returns true if the gate brakes the car to a standstill or holds it.
    pub fn brakes(self) -> bool {
        matches!(self, Self::Stopping(_) | Self::Holding(_))
    }
}

/// Longitudinal part of a command to a vehicle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Longitudinal {
    /// Acceleration along the heading, m/s²: by either pedal.
    Accel(f64),
    /// Deceleration by the brake alone, m/s², within 0 and [`GateOutput::DECEL_MAX_MPS2`]. The brake acts against
    /// the motion of the wheels and holds stationary wheels, so it needs no measured speed.
    Brake(f64),
}

/// Cause of a stop.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopCause {
    /// No valid command for too long.
    CommandTimeout,
    /// No valid vehicle report for too long.
    ReportTimeout,
    /// The enabling switch was released.
    Released,
    /// The emergency stop.
    Emergency,
    /// Commands arrive but have been identical for too long.
    CommandFrozen,
    /// Commands arrive from a publisher other than the one that was driving.
    SecondWriter,
    /// The clock that stamps the commands was set.
    ClockJump,
    /// The process that transports commands and reports is gone.
    TransportLost,
    /// Localization reports that the pose is lost.
    PoseLost,
    /// The motion of the pose does not match the wheels.
    PoseImplausible,
    /// The reported steering angle does not follow the commands.
    SteeringDeviation,
    /// The reported speed does not follow the commanded acceleration or braking.
    AccelDeviation,
    /// The reported speed is above the permitted one.
    SpeedExcess,
}

impl StopCause {
    /// Description in words.
    pub fn words(self) -> &'static str {
        match self {
            Self::CommandTimeout => "no sound command",
            Self::ReportTimeout => "no sound report of the vehicle",
            Self::Released => "the switch was released",
            Self::Emergency => "emergency stop",
            Self::CommandFrozen => "the command is frozen",
            Self::SecondWriter => "commands of a second writer",
            Self::ClockJump => "the clock of the commands was set",
            Self::TransportLost => "the transport was lost",
            Self::PoseLost => "the pose is lost",
            Self::PoseImplausible => "the pose does not move as the wheels do",
            Self::SteeringDeviation => "the steering does not follow its commands",
            Self::AccelDeviation => "the vehicle does not accelerate or brake as commanded",
            Self::SpeedExcess => "the vehicle is faster than permitted",
        }
    }
}

/// Reason for rejecting a command.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// A value is not finite.
    NotFinite,
    /// Older than the previous command.
    OutOfOrder,
    /// Too old.
    Stale,
    /// Stamped in the future.
    Ahead,
}

/// Number of rejected commands by reason.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Refusals {
    /// A value is not finite.
    pub not_finite: u64,
    /// Older than the previous command.
    pub out_of_order: u64,
    /// Too old.
    pub stale: u64,
    /// Stamped in the future.
    pub ahead: u64,
}

impl Refusals {
    /// Sum over all reasons.
    pub fn total(&self) -> u64 {
        self.not_finite + self.out_of_order + self.stale + self.ahead
    }
}

/// Output of the safety gate to the vehicle.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct GateOutput {
    /// Mode of the gate.
    pub mode: GateMode,
    /// True if the vehicle should follow the command; otherwise the driver drives.
    pub engaged: bool,
    /// The command: finite, within limits and rates.
    pub command: MotionCommand,
    /// Counter that increases by one with each call and wraps after 65535.
    pub heartbeat: u16,
    /// Reason for rejecting the input command; `None` if it was accepted.
    pub refused: Option<Refusal>,
    /// Number of rejected commands so far.
    pub refusals: Refusals,
    /// True if the command was limited in value or rate.
    pub limited: bool,
}

impl GateOutput {
    /// Largest deceleration of a stop, m/s².
    pub const DECEL_MAX_MPS2: f64 = 20.0;

    /// Longitudinal part of the command. While the car is stopped or held it is always [`Longitudinal::Brake`],
    /// regardless of `command`; a non-finite value becomes the largest deceleration.
    ///
    /// Consumers that actuate pedals must use this instead of `command`.
    pub fn longitudinal(&self) -> Longitudinal {
        let accel_mps2 = self.command.accel_mps2;
        match (self.mode.brakes(), accel_mps2.is_finite()) {
            (false, _) => Longitudinal::Accel(accel_mps2),
            (true, true) => Longitudinal::Brake(accel_mps2.abs().min(Self::DECEL_MAX_MPS2)),
            (true, false) => Longitudinal::Brake(Self::DECEL_MAX_MPS2),
        }
    }

    /// Command for a vehicle with its own speed or acceleration controller. While the car is stopped or held, the
    /// speed is 0 and the acceleration at most 0, regardless of `command`.
    pub fn motion(&self) -> MotionCommand {
        match self.longitudinal() {
            Longitudinal::Accel(_) => self.command,
            Longitudinal::Brake(decel) => {
                MotionCommand { speed_mps: 0.0, accel_mps2: 0.0 - decel, ..self.command }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gate_output_brakes_in_a_stop_whatever_the_command_holds() {
        let brakes = [GateMode::Stopping(StopCause::Emergency), GateMode::Holding(StopCause::Released)];
        for mode in brakes {
            for (accel_mps2, decel) in [
                (-3.0, 3.0),
                (3.0, 3.0),
                (0.0, 0.0),
                (1e9, 20.0),
                (f64::NAN, 20.0),
                (f64::NEG_INFINITY, 20.0),
            ] {
                let command = MotionCommand { speed_mps: 9.0, accel_mps2, ..MotionCommand::default() };
                let output = GateOutput { mode, command, ..GateOutput::default() };
                assert_eq!(output.longitudinal(), Longitudinal::Brake(decel), "{accel_mps2}");
                assert_eq!((output.motion().speed_mps, output.motion().accel_mps2), (0.0, -decel));
            }
        }
        for mode in [GateMode::Manual, GateMode::Driving] {
            let command = MotionCommand { speed_mps: 9.0, accel_mps2: 1.0, ..MotionCommand::default() };
            let output = GateOutput { mode, command, ..GateOutput::default() };
            assert_eq!((output.longitudinal(), output.motion()), (Longitudinal::Accel(1.0), command));
        }
    }
}
