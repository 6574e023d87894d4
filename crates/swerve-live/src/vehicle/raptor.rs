use swerve_control::safety_gate;
use swerve_msg::{Command, GateOutput};
use swerve_ros2::AnyMessage;
use swerve_ros2::convert::{Raptor, driver_active, raptor_speed_from_ros};
use swerve_ros2::mapping::Role;
use swerve_ros2::msg::raptor_dbw_msgs::{Gear, GearCmd, GlobalEnableCmd};
use swerve_stack::config::Config;
use swerve_vehicle::VehicleParams;

use super::{Facts, Outgoing, VehicleInterface};

const DRIVE: u8 = 4;

/// New Eagle's Raptor: angle of the steering wheel and pedals, each with a counter that shows that we live.
pub(super) struct RaptorInterface {
    raptor: Raptor,
    vehicle: VehicleParams,
    counter: u32,
}

impl RaptorInterface {
    pub(super) fn new(config: &Config) -> Self {
        let gear = config.live.clone().unwrap_or_default().gear();
        Self { raptor: Raptor { gear }, vehicle: config.sim.vehicle.clone(), counter: 0 }
    }
}

impl VehicleInterface for RaptorInterface {
    fn needs(&self) -> &'static [Role] {
        &[Role::Miscellaneous, Role::Steering, Role::Brake]
    }

    fn facts(&self, message: &AnyMessage) -> Facts {
        let mut facts = Facts { driver: driver_active(message), ..Facts::default() };
        match message {
            AnyMessage::RaptorMiscReport(report) => facts.speed_mps = Some(raptor_speed_from_ros(report)),
            AnyMessage::RaptorSteeringReport(report) => {
                let wheel_deg = f64::from(report.steering_wheel_angle);
                facts.steering_rad = Some(self.raptor.gear.steering_rad(wheel_deg));
                facts.listens = Some(report.enabled);
            }
            _ => {}
        }
        facts
    }

    fn command(&mut self, gate: &GateOutput, outgoing: &mut Outgoing) {
        let (enable, counter) = (gate.engaged, u32::from(gate.heartbeat));
        let steering = self.raptor.steering(gate.command.steering_rad, enable, counter);
        let pedals = safety_gate::pedals(&self.vehicle, gate, outgoing.speed_mps);
        let command = Command { steering_rad: 0.0, throttle: pedals.throttle, brake: pedals.brake };
        let (accelerator, brake) = self.raptor.pedals(&command, enable, counter);
        outgoing.push(Role::SteeringCommand, AnyMessage::RaptorSteeringCmd(steering));
        outgoing.push(Role::ThrottleCommand, AnyMessage::RaptorAcceleratorPedalCmd(accelerator));
        outgoing.push(Role::BrakeCommand, AnyMessage::RaptorBrakeCmd(brake));
        let gear = GearCmd { cmd: Gear { gear: DRIVE }, enable, rolling_counter: (counter % 256) as u8 };
        outgoing.push(Role::GearCommand, AnyMessage::RaptorGearCmd(gear));
    }

    fn enable(&mut self, on: bool, outgoing: &mut Outgoing) {
        self.counter = self.counter.wrapping_add(1);
        let rolling_counter = (self.counter % 256) as u8;
        let switch = GlobalEnableCmd { global_enable: on, rolling_counter, ..GlobalEnableCmd::default() };
        outgoing.push(Role::Enable, AnyMessage::RaptorGlobalEnableCmd(switch));
    }
}
