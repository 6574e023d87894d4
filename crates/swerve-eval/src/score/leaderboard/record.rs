//! The record of a route, from which all versions compute their scores.

use core::fmt;

use serde::{Deserialize, Serialize, Serializer};

use super::Version;

/// Number of infractions by kind, under the names of the Leaderboard's result files.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Counts {
    /// Collisions with pedestrians.
    pub collisions_pedestrian: u32,
    /// Collisions with vehicles, two-wheelers included.
    pub collisions_vehicle: u32,
    /// Collisions with static objects.
    pub collisions_layout: u32,
    /// Red lights run.
    pub red_light: u32,
    /// Stop signs run.
    pub stop_infraction: u32,
    /// Scenarios not passed within 240 s (2.x).
    pub scenario_timeouts: u32,
    /// Emergency vehicles that the ego did not let pass (2.x).
    pub yield_emergency_vehicle_infractions: u32,
    /// Deviations from the route: one ends it.
    pub route_dev: u32,
    /// Blocks of the ego: one ends the route.
    pub vehicle_blocked: u32,
    /// Timeouts of the route: one ends it.
    pub route_timeout: u32,
}

impl Counts {
    /// Counts of all kinds with their names, in the order of the result files.
    pub fn each(&self) -> [(&'static str, u32); 10] {
        [
            ("collisions_pedestrian", self.collisions_pedestrian),
            ("collisions_vehicle", self.collisions_vehicle),
            ("collisions_layout", self.collisions_layout),
            ("red_light", self.red_light),
            ("stop_infraction", self.stop_infraction),
            ("scenario_timeouts", self.scenario_timeouts),
            ("yield_emergency_vehicle_infractions", self.yield_emergency_vehicle_infractions),
            ("route_dev", self.route_dev),
            ("vehicle_blocked", self.vehicle_blocked),
            ("route_timeout", self.route_timeout),
        ]
    }
}

/// Facts about one route that was driven.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct RouteRecord {
    /// Length of the route, metres.
    pub route_length_m: f64,
    /// Route completion, percent; 100 means that the end was reached.
    pub route_completion: f64,
    /// Number of infractions by kind.
    pub counts: Counts,
    /// Share of the completed route that was driven outside its lanes, percent; an infraction if positive.
    pub outside_route_lanes_percent: f64,
    /// Mean speed of the ego in each completed section of the route, percent of that of the background traffic (2.x).
    pub min_speed_checkpoints_percent: Vec<f64>,
    /// Failure outside the drive, such as a crash of the agent.
    pub failure: Option<Failure>,
}

impl RouteRecord {
    /// Distance completed, kilometres.
    pub fn completed_km(&self) -> f64 {
        self.route_length_m / 1000.0 * self.route_completion / 100.0
    }

    /// Status of the route. With several reasons for a failure, the last one that the Leaderboard's code assigns: a
    /// block, a deviation, a timeout, a failure outside the drive.
    pub fn status(&self, version: Version) -> Status {
        if self.route_completion >= 100.0 {
            return match version.is_second() && self.infractions() == 0 {
                true => Status::Perfect,
                false => Status::Completed,
            };
        }
        let reasons = [
            (self.counts.vehicle_blocked, Failure::Blocked),
            (self.counts.route_dev, Failure::Deviated),
            (self.counts.route_timeout, Failure::TimedOut),
        ];
        let reason = reasons.into_iter().find(|(count, _)| *count > 0).map(|(_, reason)| reason);
        Status::Failed(reason.or(self.failure))
    }

    /// Number of infractions of all kinds (`num_infractions`).
    pub fn infractions(&self) -> usize {
        let counted: usize = self.counts.each().iter().map(|(_, count)| *count as usize).sum();
        let slow = self.min_speed_checkpoints_percent.iter().filter(|percent| **percent < 100.0).count();
        counted + slow + usize::from(self.outside_route_lanes_percent > 0.0)
    }
}

/// Reason for a failure, in the words of the result files.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Failure {
    /// The ego was slower than 0.1 m/s for 180 s.
    Blocked,
    /// The ego left the route.
    Deviated,
    /// The route took too long.
    TimedOut,
    /// The simulation crashed.
    SimulationCrashed,
    /// The agent asked for sensors that are not allowed.
    SensorsInvalid,
    /// The agent could not be set up.
    AgentNotSetUp,
    /// The agent crashed.
    AgentCrashed,
}

impl Failure {
    /// All reasons.
    pub const ALL: [Self; 7] = [
        Self::Blocked,
        Self::Deviated,
        Self::TimedOut,
        Self::SimulationCrashed,
        Self::SensorsInvalid,
        Self::AgentNotSetUp,
        Self::AgentCrashed,
    ];

    /// Text in the result files.
    pub fn text(self) -> &'static str {
        match self {
            Self::Blocked => "Agent got blocked",
            Self::Deviated => "Agent deviated from the route",
            Self::TimedOut => "Agent timed out",
            Self::SimulationCrashed => "Simulation crashed",
            Self::SensorsInvalid => "Agent's sensors were invalid",
            Self::AgentNotSetUp => "Agent couldn't be set up",
            Self::AgentCrashed => "Agent crashed",
        }
    }
}

/// Status of a route, or of several together; a better one is smaller.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Status {
    /// Completed without infraction (2.x only).
    Perfect,
    /// Completed.
    Completed,
    /// Not completed, with the reason if known.
    Failed(Option<Failure>),
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Perfect => f.write_str("Perfect"),
            Self::Completed => f.write_str("Completed"),
            Self::Failed(None) => f.write_str("Failed"),
            Self::Failed(Some(reason)) => write!(f, "Failed - {}", reason.text()),
        }
    }
}

impl Serialize for Status {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl Serialize for Failure {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.text())
    }
}
