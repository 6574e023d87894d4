//! Dataspeed's drive-by-wire interface.

use swerve_control::safety_gate;
use swerve_msg::{Command, GateMode, GateOutput};
use swerve_ros2::AnyMessage;
use swerve_ros2::convert::{
    AccelLimits, Dataspeed, SteeringGear, dataspeed_speed_from_ros, dataspeed_steering_from_ros,
    driver_active,
};
use swerve_ros2::mapping::Role;
use swerve_ros2::msg::std_msgs::Empty;
use swerve_stack::config::Config;
use swerve_stack::config::live::Longitudinal;
use swerve_vehicle::VehicleParams;

use super::{Facts, Outgoing, VehicleInterface};

/// Minimum acceleration limit of the vehicle's controller, m/s²: it needs some to keep a speed.
const LIMIT_MIN_MPS2: f64 = 1.0;
/// Preview time of the speed command, seconds: the command is the speed reached after it at the wanted
/// acceleration, because the controller responds to a speed error.
const PREVIEW_S: f64 = 0.5;

/// Dataspeed's drive-by-wire: steering wheel angle, and a speed or the pedals.
pub(super) struct DataspeedInterface {
    gear: SteeringGear,
    longitudinal: Longitudinal,
    vehicle: VehicleParams,
    engaged_before: bool,
}

impl DataspeedInterface {
    pub(super) fn new(config: &Config) -> Self {
        let live = config.live.clone().unwrap_or_default();
        let (gear, vehicle) = (live.gear(), config.sim.vehicle.clone());
        Self { gear, longitudinal: live.longitudinal, vehicle, engaged_before: false }
    }
}

impl VehicleInterface for DataspeedInterface {
    fn needs(&self) -> &'static [Role] {
        // Steering and brake reports each include overrides at the other actuators.
        &[Role::Velocity, Role::Steering, Role::Brake]
    }

    fn facts(&self, message: &AnyMessage) -> Facts {
        let mut facts = Facts { driver: driver_active(message), ..Facts::default() };
        match message {
            AnyMessage::DataspeedVehicleVelocity(report) => {
                facts.speed_mps = dataspeed_speed_from_ros(report).ok();
            }
            AnyMessage::DataspeedSteeringReport(report) => {
                facts.steering_rad = dataspeed_steering_from_ros(report, &self.gear).ok();
                facts.listens = Some(report.enabled);
            }
            _ => {}
        }
        facts
    }

    fn command(&mut self, gate: &GateOutput, outgoing: &mut Outgoing) {
        let car = Dataspeed { gear: self.gear, epoch: outgoing.epoch };
        let (enable, clear) = (gate.engaged, gate.engaged && !self.engaged_before);
        self.engaged_before = gate.engaged;
        let steering = car.steering(outgoing.now, gate.command.steering_rad, enable, clear);
        outgoing.push(Role::SteeringCommand, AnyMessage::DataspeedSteeringCmd(steering));
        let mut motion = gate.motion();
        match self.longitudinal {
            Longitudinal::Speed => {
                // A stop commands zero speed, because the reported speed may be outdated.
                if gate.mode == GateMode::Driving {
                    motion.speed_mps = (outgoing.speed_mps + PREVIEW_S * motion.accel_mps2).max(0.0);
                }
                let limits = AccelLimits {
                    accel_mps2: motion.accel_mps2.max(LIMIT_MIN_MPS2),
                    decel_mps2: (-motion.accel_mps2).max(LIMIT_MIN_MPS2),
                };
                let speed = car.speed(&motion, limits, enable, clear);
                outgoing.push(Role::SpeedCommand, AnyMessage::DataspeedUlcCmd(speed));
            }
            Longitudinal::Pedals => {
                let pedals = safety_gate::pedals(&self.vehicle, gate, outgoing.speed_mps);
                let command = Command { steering_rad: 0.0, throttle: pedals.throttle, brake: pedals.brake };
                let (throttle, brake) = car.pedals(outgoing.now, &command, enable, clear);
                outgoing.push(Role::ThrottleCommand, AnyMessage::DataspeedThrottleCmd(throttle));
                outgoing.push(Role::BrakeCommand, AnyMessage::DataspeedBrakeCmd(brake));
            }
        }
    }

    fn enable(&mut self, on: bool, outgoing: &mut Outgoing) {
        let role = if on { Role::Enable } else { Role::Disable };
        outgoing.push(role, AnyMessage::Empty(Empty::default()));
    }
}
