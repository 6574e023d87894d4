//! Interface of a vehicle in the simulator CARLA.

use swerve_control::safety_gate;
use swerve_msg::{Command, GateOutput};
use swerve_ros2::AnyMessage;
use swerve_ros2::convert::{SteeringGear, carla_control, carla_steering_from_ros};
use swerve_ros2::mapping::Role;
use swerve_stack::config::Config;
use swerve_vehicle::VehicleParams;

use super::{Facts, Outgoing, VehicleInterface};

/// Pedals, and the steering as a share of its largest angle. CARLA has no switch and no time-out: it applies a command
/// until the next one, so the car stays braked after the last command of a stop.
pub(super) struct Carla {
    gear: SteeringGear,
    vehicle: VehicleParams,
}

impl Carla {
    pub(super) fn new(config: &Config) -> Self {
        Self { gear: config.live.clone().unwrap_or_default().gear(), vehicle: config.sim.vehicle.clone() }
    }
}

impl VehicleInterface for Carla {
    fn needs(&self) -> &'static [Role] {
        &[Role::Velocity]
    }

    fn facts(&self, message: &AnyMessage) -> Facts {
        match message {
            AnyMessage::CarlaEgoVehicleStatus(status) => Facts {
                speed_mps: Some(f64::from(status.velocity)),
                steering_rad: Some(carla_steering_from_ros(&status.control, &self.gear)),
                ..Facts::default()
            },
            _ => Facts::default(),
        }
    }

    fn command(&mut self, gate: &GateOutput, outgoing: &mut Outgoing) {
        // A command without engagement would override another driver, such as the autopilot.
        if !gate.engaged {
            return;
        }
        let pedals = safety_gate::pedals(&self.vehicle, gate, outgoing.speed_mps);
        let steering_rad = gate.command.steering_rad;
        let command = Command { steering_rad, throttle: pedals.throttle, brake: pedals.brake };
        let control = carla_control(&command, &self.gear, outgoing.now, outgoing.epoch, "");
        outgoing.push(Role::Command, AnyMessage::CarlaEgoVehicleControl(control));
    }

    fn enable(&mut self, _: bool, _: &mut Outgoing) {}
}
