//! Autoware's vehicle interface.

use swerve_msg::{GateMode, GateOutput, StopCause};
use swerve_ros2::AnyMessage;
use swerve_ros2::convert::driver_active;
use swerve_ros2::mapping::Role;
use swerve_ros2::msg::autoware_vehicle_msgs::{
    Engage, GearCommand, GearReport, HazardLightsCommand, TurnIndicatorsCommand,
};
use swerve_stack::config::Config;

use super::{Facts, MotionTopic, Outgoing, VehicleInterface};

/// Autoware's vehicle interface: angle of the road wheels, speed and acceleration.
pub(super) struct Autoware {
    commands: Option<MotionTopic>,
    engaged_before: bool,
}

impl Autoware {
    pub(super) fn new(config: &Config) -> Self {
        Self { commands: MotionTopic::of(config), engaged_before: false }
    }
}

/// State that a report of Autoware's types contains.
pub(super) fn facts(message: &AnyMessage) -> Facts {
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

const OFF: u8 = 1;
const ON: u8 = 2;

impl VehicleInterface for Autoware {
    fn needs(&self) -> &'static [Role] {
        &[Role::Velocity, Role::Steering, Role::ControlMode]
    }

    fn facts(&self, message: &AnyMessage) -> Facts {
        facts(message)
    }

    fn command(&mut self, gate: &GateOutput, outgoing: &mut Outgoing) {
        let stamp = outgoing.epoch.stamp(outgoing.now);
        let engaged_before = core::mem::replace(&mut self.engaged_before, gate.engaged);
        if let Some(topic) = &self.commands {
            topic.push(gate, outgoing);
        }
        // The gear and the lights of a car in manual mode are the driver's; those of a stop are turned off once.
        if !gate.engaged && !engaged_before {
            return;
        }
        if gate.engaged {
            let gear = GearCommand { stamp, command: GearReport::DRIVE };
            outgoing.push(Role::GearCommand, AnyMessage::GearCommand(gear));
        }
        let indicators = TurnIndicatorsCommand { stamp, command: OFF };
        outgoing.push(Role::TurnIndicatorsCommand, AnyMessage::TurnIndicatorsCommand(indicators));
        // Hazard lights are on during a stop that was not requested.
        let warns = match gate.mode {
            GateMode::Stopping(cause) | GateMode::Holding(cause) => cause != StopCause::Released,
            GateMode::Manual | GateMode::Driving => false,
        };
        let hazard = HazardLightsCommand { stamp, command: if warns { ON } else { OFF } };
        outgoing.push(Role::HazardLightsCommand, AnyMessage::HazardLightsCommand(hazard));
    }

    fn enable(&mut self, on: bool, outgoing: &mut Outgoing) {
        let engage = Engage { stamp: outgoing.epoch.stamp(outgoing.now), engage: on };
        outgoing.push(Role::Enable, AnyMessage::Engage(engage));
    }
}
