//! Vehicle interfaces: reports, and commands in the vehicle's own message types.
//!
//! A [`VehicleInterface`] is all that a new vehicle needs in Rust: the interpretation of its messages, and the
//! conversion of the gate's output. Topics and types are in a table of the mapping.

mod autoware;
mod carla;
mod dataspeed;
mod plain;
mod raptor;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use swerve_core::Time;
use swerve_msg::{GateOutput, VehicleReport};
use swerve_ros2::convert::{Epoch, ackermann_to_ros, control_to_ros};
use swerve_ros2::mapping::{Role, Vehicle};
use swerve_ros2::{AnyMessage, Kind};
use swerve_stack::config::Config;

/// State of the vehicle reported by one message.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Facts {
    /// Speed along the heading, m/s.
    pub speed_mps: Option<f64>,
    /// Angle of the front road wheels, radians; positive to the left.
    pub steering_rad: Option<f64>,
    /// Yaw rate, rad/s.
    pub yaw_rate_radps: Option<f64>,
    /// True if the driver acts, or the vehicle is in manual mode.
    pub driver: Option<bool>,
    /// True if the vehicle accepts commands.
    pub listens: Option<bool>,
}

/// Outgoing messages to the vehicle.
#[derive(Debug)]
pub struct Outgoing {
    /// The present instant.
    pub now: Time,
    /// Instant of the host's clock at run time zero.
    pub epoch: Epoch,
    /// Reported speed of the vehicle, m/s.
    pub speed_mps: f64,
    /// True while the vehicle is asked to accept commands: some accept only with commands that already arrive.
    pub asks: bool,
    /// Messages by the role of their topic.
    pub messages: Vec<(Role, AnyMessage)>,
}

impl Outgoing {
    /// Creates an empty list.
    pub fn new(now: Time, epoch: Epoch, speed_mps: f64) -> Self {
        Self { now, epoch, speed_mps, asks: false, messages: Vec::new() }
    }

    /// Adds a message on the topic of a role; it is dropped if the mapping has no such topic.
    pub fn push(&mut self, role: Role, message: AnyMessage) {
        self.messages.push((role, message));
    }
}

/// Interface of a vehicle: its reports and its commands.
pub trait VehicleInterface: Send {
    /// Roles of the topics required to know the state of the vehicle.
    fn needs(&self) -> &'static [Role];

    /// State of the vehicle reported by a message.
    fn facts(&self, message: &AnyMessage) -> Facts;

    /// Converts the output of the gate to messages; called at the gate's rate, also in manual mode. Then messages that
    /// the vehicle may follow are sent only while it is asked to accept commands; they hold its measured state.
    fn command(&mut self, gate: &GateOutput, outgoing: &mut Outgoing);

    /// Asks the vehicle to accept commands, or to stop doing so.
    fn enable(&mut self, on: bool, outgoing: &mut Outgoing);
}

/// Interface of the vehicle named by the mapping.
pub fn interface(vehicle: Vehicle, config: &Config) -> Box<dyn VehicleInterface> {
    match vehicle {
        Vehicle::Autoware => Box::new(autoware::Autoware::new(config)),
        Vehicle::Dataspeed => Box::new(dataspeed::DataspeedInterface::new(config)),
        Vehicle::Raptor => Box::new(raptor::RaptorInterface::new(config)),
        Vehicle::Carla => Box::new(carla::Carla::new(config)),
        Vehicle::Plain => Box::new(plain::Plain::new(config)),
    }
}

/// Topic for commands of motion, without the pedals and steering wheel of a maker.
struct MotionTopic {
    kind: Kind,
    /// Name of the frame at the centre of the rear axle.
    base_link: String,
}

impl MotionTopic {
    /// The topic `command` of a configuration, if it has one.
    fn of(config: &Config) -> Option<Self> {
        let mapping = config.ros2_mapping().ok()?;
        let kind = mapping.with_role(Role::Command).next()?.kind;
        Some(Self { kind, base_link: mapping.base_frame })
    }

    /// Adds the command of the gate while it is engaged or the vehicle is asked to accept commands.
    /// `AckermannDriveStamped` cannot express that the stack does not drive: it is sent only while the gate is engaged.
    fn push(&self, gate: &GateOutput, outgoing: &mut Outgoing) {
        if !gate.engaged && !outgoing.asks {
            return;
        }
        let motion = gate.motion();
        let message = match self.kind {
            Kind::AckermannDriveStamped if gate.engaged => {
                AnyMessage::AckermannDriveStamped(ackermann_to_ros(&motion, outgoing.epoch, &self.base_link))
            }
            Kind::Control => AnyMessage::Control(control_to_ros(&motion, outgoing.epoch)),
            _ => return,
        };
        outgoing.push(Role::Command, message);
    }
}

/// State of the vehicle, combined from all its reports.
#[derive(Clone, Debug, Default)]
pub struct Car {
    /// Speed along the heading, m/s.
    pub speed_mps: Option<f64>,
    /// Angle of the front road wheels, radians; positive to the left.
    pub steering_rad: Option<f64>,
    /// Yaw rate, rad/s.
    pub yaw_rate_radps: Option<f64>,
    /// True if the vehicle accepts commands; `None` if it does not report that.
    pub listens: Option<bool>,
    /// Driver activity by reporting message type.
    drivers: BTreeMap<Kind, bool>,
    /// Latest stamp of each required topic.
    heard: BTreeMap<Role, Time>,
}

impl Car {
    /// Updates the state from a message on the topic of `role` with the stamp `stamp`.
    pub fn hear(&mut self, role: Role, kind: Kind, stamp: Time, facts: Facts) {
        self.heard.insert(role, stamp);
        self.speed_mps = facts.speed_mps.or(self.speed_mps);
        self.steering_rad = facts.steering_rad.or(self.steering_rad);
        self.yaw_rate_radps = facts.yaw_rate_radps.or(self.yaw_rate_radps);
        self.listens = facts.listens.or(self.listens);
        if let Some(driver) = facts.driver {
            self.drivers.insert(kind, driver);
        }
    }

    /// Returns true if any message reports that the driver acts.
    pub fn driver(&self) -> bool {
        self.drivers.values().any(|acts| *acts)
    }

    /// Report for the gate, with the oldest stamp of its parts; `None` until all required topics were heard.
    ///
    /// Activity of the driver is included as soon as it is known.
    pub fn report(&self, needs: &[Role]) -> Option<VehicleReport> {
        let heard: Option<Vec<Time>> = needs.iter().map(|role| self.heard.get(role).copied()).collect();
        let oldest = heard.and_then(|heard| heard.into_iter().min());
        let whole = oldest.zip(self.speed_mps);
        if whole.is_none() && !self.driver() {
            return None;
        }
        let (stamp, speed_mps) = whole.unwrap_or_default();
        let steering_rad = self.steering_rad.unwrap_or(0.0);
        Some(VehicleReport { stamp, speed_mps, steering_rad, driver_active: self.driver() })
    }

    /// Required topics that were not heard since `since`.
    pub fn silent<'a>(&'a self, needs: &'a [Role], since: Time) -> impl Iterator<Item = Role> + 'a {
        needs.iter().copied().filter(move |role| self.heard.get(role).is_none_or(|at| *at < since))
    }
}
