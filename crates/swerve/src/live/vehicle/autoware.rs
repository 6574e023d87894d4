use swerve_msg::{GateMode, GateOutput, StopCause};
use swerve_ros2::AnyMessage;
use swerve_ros2::convert::{control_to_ros, driver_active};
use swerve_ros2::mapping::Role;
use swerve_ros2::msg::autoware_vehicle_msgs::{
    Engage, GearCommand, GearReport, HazardLightsCommand, TurnIndicatorsCommand,
};

use super::{Facts, Telling, VehicleInterface};

/// Autoware's vehicle interface: angle of the road wheels, speed and acceleration.
pub(super) struct Autoware;

const OFF: u8 = 1;
const ON: u8 = 2;

impl VehicleInterface for Autoware {
    fn needs(&self) -> &'static [Role] {
        &[Role::Velocity, Role::Steering, Role::ControlMode]
    }

    fn facts(&self, message: &AnyMessage) -> Facts {
        let mut facts = Facts { driver: driver_active(message), ..Facts::default() };
        facts.listens = facts.driver.map(|driver| !driver);
        match message {
            AnyMessage::VelocityReport(report) => {
                facts.speed_mps = Some(f64::from(report.longitudinal_velocity));
                facts.yaw_rate_radps = Some(f64::from(report.heading_rate));
            }
            AnyMessage::SteeringReport(report) => {
                facts.steering_rad = Some(f64::from(report.steering_tire_angle));
            }
            _ => {}
        }
        facts
    }

    fn command(&mut self, gate: &GateOutput, telling: &mut Telling) {
        let stamp = telling.epoch.stamp(telling.now);
        telling.say(Role::Command, AnyMessage::Control(control_to_ros(&gate.command, telling.epoch)));
        let gear = if gate.engaged { GearReport::DRIVE } else { GearReport::NONE };
        telling.say(Role::GearCommand, AnyMessage::GearCommand(GearCommand { stamp, command: gear }));
        let indicators = TurnIndicatorsCommand { stamp, command: OFF };
        telling.say(Role::TurnIndicatorsCommand, AnyMessage::TurnIndicatorsCommand(indicators));
        // Who stops without having been asked to, warns.
        let warns = match gate.mode {
            GateMode::Stopping(cause) | GateMode::Holding(cause) => cause != StopCause::Released,
            GateMode::Manual | GateMode::Driving => false,
        };
        let hazard = HazardLightsCommand { stamp, command: if warns { ON } else { OFF } };
        telling.say(Role::HazardLightsCommand, AnyMessage::HazardLightsCommand(hazard));
    }

    fn enable(&mut self, on: bool, telling: &mut Telling) {
        let engage = Engage { stamp: telling.epoch.stamp(telling.now), engage: on };
        telling.say(Role::Enable, AnyMessage::Engage(engage));
    }
}
