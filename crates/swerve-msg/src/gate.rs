use serde::{Deserialize, Serialize};
use swerve_core::Time;

use crate::MotionCommand;

/// What the vehicle says of itself.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct VehicleReport {
    /// Instant that it describes.
    pub stamp: Time,
    /// Speed along the heading, m/s; negative in reverse.
    pub speed_mps: f64,
    /// Angle of the front road wheels, radians; positive to the left.
    pub steering_rad: f64,
    /// Whether the driver steers, brakes or accelerates, or the vehicle is in manual mode.
    pub driver_active: bool,
}

/// The switch that a person holds.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Switch {
    /// Whether the stack is to drive: its rising edge enables.
    pub enable: bool,
    /// Whether the car is to be stopped at once.
    pub emergency: bool,
}

/// What is wrong with the wire between a vehicle and who drives it. Said whenever that changes.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct WireAlarm {
    /// Why the car is to be stopped; none where all is well, or somebody has let go of the switch since.
    pub cause: Option<StopCause>,
    /// What happened, in words.
    pub what: String,
}

/// What the safety gate does.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GateMode {
    /// The driver drives, nothing is commanded.
    #[default]
    Manual,
    /// The stack drives.
    Driving,
    /// The car is brought to a standstill.
    Stopping(StopCause),
    /// The car stands and is held.
    Holding(StopCause),
}

impl GateMode {
    /// Whether the brake brings the car to a standstill or keeps it there.
    pub fn brakes(self) -> bool {
        matches!(self, Self::Stopping(_) | Self::Holding(_))
    }
}

/// Longitudinal part of a command that may reach a vehicle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Longitudinal {
    /// Acceleration along the heading, m/s²: by either pedal.
    Accel(f64),
    /// Deceleration by the brake alone, m/s², within 0 and [`GateOutput::DECEL_MAX_MPS2`]. A brake acts against the
    /// motion of the wheels and holds wheels that stand, so no measured speed is needed to apply it.
    Brake(f64),
}

/// Why the car is stopped.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopCause {
    /// No sound command for too long.
    CommandTimeout,
    /// No sound report of the vehicle for too long.
    ReportTimeout,
    /// The person let go of the switch.
    Released,
    /// The emergency stop.
    Emergency,
    /// Commands come, and say the same for too long.
    CommandFrozen,
    /// Commands come from somebody else than from who drove.
    SecondWriter,
    /// The clock that stamps the commands was set.
    ClockJump,
    /// The process that carries commands and reports is gone.
    TransportLost,
    /// Localization reports that the pose is lost.
    PoseLost,
    /// The pose does not move as the wheels do.
    PoseImplausible,
}

impl StopCause {
    /// In words.
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
        }
    }
}

/// Why a command was refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// A number of it is none.
    NotFinite,
    /// It is older than the one before it.
    OutOfOrder,
    /// It is too old.
    Stale,
    /// It is from the future.
    Ahead,
}

/// How often commands were refused, by reason.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Refusals {
    /// A number of it is none.
    pub not_finite: u64,
    /// It is older than the one before it.
    pub out_of_order: u64,
    /// It is too old.
    pub stale: u64,
    /// It is from the future.
    pub ahead: u64,
}

impl Refusals {
    /// How many in all.
    pub fn total(&self) -> u64 {
        self.not_finite + self.out_of_order + self.stale + self.ahead
    }
}

/// What the safety gate lets through to the vehicle.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct GateOutput {
    /// What the gate does.
    pub mode: GateMode,
    /// Whether the vehicle is to follow the command; without it the driver drives.
    pub engaged: bool,
    /// Finite, within limits and rates.
    pub command: MotionCommand,
    /// Grows by one with each call, and wraps after 65535.
    pub heartbeat: u16,
    /// Why the command given was refused, if it was.
    pub refused: Option<Refusal>,
    /// How often commands were refused so far.
    pub refusals: Refusals,
    /// Whether the command had to be changed to be within limits or rates.
    pub limited: bool,
}

impl GateOutput {
    /// Largest deceleration of a stop, m/s².
    pub const DECEL_MAX_MPS2: f64 = 20.0;

    /// Longitudinal part of the command. While the car is stopped or held this is always [`Longitudinal::Brake`],
    /// whatever `command` holds; a number that is not finite is the largest deceleration.
    ///
    /// Every consumer that works pedals reads this and not `command`.
    pub fn longitudinal(&self) -> Longitudinal {
        let accel_mps2 = self.command.accel_mps2;
        match (self.mode.brakes(), accel_mps2.is_finite()) {
            (false, _) => Longitudinal::Accel(accel_mps2),
            (true, true) => Longitudinal::Brake(accel_mps2.abs().min(Self::DECEL_MAX_MPS2)),
            (true, false) => Longitudinal::Brake(Self::DECEL_MAX_MPS2),
        }
    }

    /// The command for a vehicle with a speed or acceleration controller of its own. While the car is stopped or held,
    /// the speed is 0 and the acceleration is not above 0, whatever `command` holds.
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
    fn a_stop_is_a_brake_whatever_the_command_holds() {
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
