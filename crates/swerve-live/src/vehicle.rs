//! Interfaces of vehicles: their reports, and commands in their words.
//!
//! A [`VehicleInterface`] is the whole of what a new vehicle needs in Rust: which of its messages says what, and how
//! the gate's output is said to it. Topics and types are a table of the mapping.

mod autoware;
mod dataspeed;
mod plain;
mod raptor;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use swerve_core::Time;
use swerve_msg::{GateOutput, VehicleReport};
use swerve_ros2::convert::Epoch;
use swerve_ros2::mapping::{Role, Vehicle};
use swerve_ros2::{AnyMessage, Kind};
use swerve_stack::config::Config;

/// Facts of the vehicle that one message reports.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Facts {
    /// Speed along the heading, m/s.
    pub speed_mps: Option<f64>,
    /// Angle of the front road wheels, radians.
    pub steering_rad: Option<f64>,
    /// Yaw rate, rad/s.
    pub yaw_rate_radps: Option<f64>,
    /// Whether the driver acts, or drives.
    pub driver: Option<bool>,
    /// Whether the vehicle listens to commands.
    pub listens: Option<bool>,
}

/// Messages on their way to the vehicle.
#[derive(Debug)]
pub struct Outgoing {
    /// The present instant.
    pub now: Time,
    /// Which instant of the host's clock the run's time zero is.
    pub epoch: Epoch,
    /// The vehicle's speed as it reports it, m/s.
    pub speed_mps: f64,
    /// By the role of their topic.
    pub messages: Vec<(Role, AnyMessage)>,
}

impl Outgoing {
    /// With nothing said yet.
    pub fn new(now: Time, epoch: Epoch, speed_mps: f64) -> Self {
        Self { now, epoch, speed_mps, messages: Vec::new() }
    }

    /// Says something on the topic of a role; it is left out where the mapping has none.
    pub fn push(&mut self, role: Role, message: AnyMessage) {
        self.messages.push((role, message));
    }
}

/// A vehicle's interface: what it says, and what it is told.
pub trait VehicleInterface: Send {
    /// The topics without which too little is known of the vehicle to drive it.
    fn needs(&self) -> &'static [Role];

    /// The facts that a message reports of the vehicle.
    fn facts(&self, message: &AnyMessage) -> Facts;

    /// Says to the vehicle what the gate lets through; called at the gate's rate, in manual mode too.
    fn command(&mut self, gate: &GateOutput, outgoing: &mut Outgoing);

    /// Asks the vehicle to listen to commands, or to listen no longer.
    fn enable(&mut self, on: bool, outgoing: &mut Outgoing);
}

/// The interface of the vehicle that the mapping names.
pub fn interface(vehicle: Vehicle, config: &Config) -> Box<dyn VehicleInterface> {
    match vehicle {
        Vehicle::Autoware => Box::new(autoware::Autoware),
        Vehicle::Dataspeed => Box::new(dataspeed::DataspeedInterface::new(config)),
        Vehicle::Raptor => Box::new(raptor::RaptorInterface::new(config)),
        Vehicle::Plain => Box::new(plain::Plain),
    }
}

/// The state of the vehicle, from all its reports.
#[derive(Clone, Debug, Default)]
pub struct Car {
    /// Speed along the heading, m/s.
    pub speed_mps: Option<f64>,
    /// Angle of the front road wheels, radians.
    pub steering_rad: Option<f64>,
    /// Yaw rate, rad/s.
    pub yaw_rate_radps: Option<f64>,
    /// Whether the vehicle listens to commands; `None` where it does not say.
    pub listens: Option<bool>,
    /// Who says that the driver acts.
    drivers: BTreeMap<Kind, bool>,
    /// When each topic that is needed was heard last.
    heard: BTreeMap<Role, Time>,
}

impl Car {
    /// Takes in what a message on the topic of `role` says, which describes the instant `stamp`.
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

    /// Whether anybody says that the driver acts.
    pub fn driver(&self) -> bool {
        self.drivers.values().any(|acts| *acts)
    }

    /// The report for the gate, as old as the oldest of what it is made from; none before all was heard.
    ///
    /// That the driver acts is reported as soon as it is known.
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

    /// The topics that are needed and were not heard since `since`.
    pub fn silent<'a>(&'a self, needs: &'a [Role], since: Time) -> impl Iterator<Item = Role> + 'a {
        needs.iter().copied().filter(move |role| self.heard.get(role).is_none_or(|at| *at < since))
    }
}
