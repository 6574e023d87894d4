//! Interface without drive-by-wire.

use swerve_msg::GateOutput;
use swerve_ros2::AnyMessage;
use swerve_ros2::mapping::Role;

use super::{Facts, Outgoing, VehicleInterface};

/// No drive-by-wire: the stack observes, and publishes its plans.
pub(super) struct Plain;

impl VehicleInterface for Plain {
    fn needs(&self) -> &'static [Role] {
        &[Role::Odometry]
    }

    fn facts(&self, message: &AnyMessage) -> Facts {
        match message {
            AnyMessage::Odometry(odometry) => {
                let twist = &odometry.twist.twist;
                Facts {
                    speed_mps: Some(twist.linear.x),
                    yaw_rate_radps: Some(twist.angular.z),
                    ..Facts::default()
                }
            }
            _ => Facts::default(),
        }
    }

    fn command(&mut self, _: &GateOutput, _: &mut Outgoing) {}

    fn enable(&mut self, _: bool, _: &mut Outgoing) {}
}
