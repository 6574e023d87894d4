//! Interface of vehicles without the messages of a drive-by-wire system.

use swerve_msg::GateOutput;
use swerve_ros2::AnyMessage;
use swerve_ros2::mapping::Role;
use swerve_stack::config::Config;

use super::{Facts, MotionTopic, Outgoing, VehicleInterface, autoware};

/// Without a topic for commands, the stack observes, and publishes its plans. With one, it drives: the odometry gives the
/// speed, and reports have Autoware's types.
pub(super) struct Plain {
    commands: Option<MotionTopic>,
}

impl Plain {
    pub(super) fn new(config: &Config) -> Self {
        Self { commands: MotionTopic::of(config) }
    }
}

impl VehicleInterface for Plain {
    fn needs(&self) -> &'static [Role] {
        match self.commands {
            Some(_) => &[Role::Odometry, Role::Steering],
            None => &[Role::Odometry],
        }
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
            report => autoware::facts(report),
        }
    }

    fn command(&mut self, gate: &GateOutput, outgoing: &mut Outgoing) {
        if let Some(topic) = self.commands.as_ref().filter(|_| gate.engaged) {
            topic.push(gate, outgoing);
        }
    }

    fn enable(&mut self, _: bool, _: &mut Outgoing) {}
}
