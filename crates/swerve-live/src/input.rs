//! Inputs of the graph.

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_flow::PlaybackRecord;
use swerve_msg::{EgoState, Gnss, Image, Imu, ObstacleList, PointCloud, Switch, VehicleReport, WireAlarm};

/// Message of a topic, converted to an input of the graph.
#[derive(Clone, PartialEq, Debug)]
pub enum Input {
    /// Pose of the ego.
    Pose(EgoState),
    /// Surrounding objects from external perception.
    Objects(ObstacleList),
    /// Inertial measurement.
    Imu(Imu),
    /// A satellite fix.
    Gnss(Gnss),
    /// Image of the named camera.
    Image(String, Image),
    /// Point cloud of the named lidar.
    Cloud(String, PointCloud),
    /// Report of the vehicle.
    Report(VehicleReport),
    /// State of the enabling switch.
    Switch(Switch),
    /// Fault of the transport.
    Wire(WireAlarm),
    /// States of the topics, for the log.
    Topics(Vec<TopicState>),
}

/// Names of the graph's sources, except cameras and lidars, which are named after their topics.
pub mod names {
    /// [`super::Input::Pose`].
    pub const POSE: &str = "pose";
    /// [`super::Input::Objects`].
    pub const OBJECTS: &str = "objects";
    /// [`super::Input::Imu`].
    pub const IMU: &str = "imu";
    /// [`super::Input::Gnss`].
    pub const GNSS: &str = "gnss";
    /// [`super::Input::Report`].
    pub const REPORT: &str = "vehicle";
    /// [`super::Input::Switch`].
    pub const SWITCH: &str = "switch";
    /// [`super::Input::Wire`].
    pub const WIRE: &str = "wire";
    /// [`super::Input::Topics`].
    pub const TOPICS: &str = "topics";
}

/// An input for the graph.
#[derive(Clone, PartialEq, Debug)]
pub struct Arrived {
    /// Instant of arrival.
    pub at: Time,
    /// Instant that it describes, later than the previous one of its stream.
    pub stamp: Time,
    /// Content.
    pub input: Input,
}

impl Arrived {
    /// Name of its source.
    pub fn source(&self) -> &str {
        match &self.input {
            Input::Pose(_) => names::POSE,
            Input::Objects(_) => names::OBJECTS,
            Input::Imu(_) => names::IMU,
            Input::Gnss(_) => names::GNSS,
            Input::Image(name, _) | Input::Cloud(name, _) => name,
            Input::Report(_) => names::REPORT,
            Input::Switch(_) => names::SWITCH,
            Input::Wire(_) => names::WIRE,
            Input::Topics(_) => names::TOPICS,
        }
    }

    /// Converts it for [`swerve_flow::Graph::playback`] of the source, which feeds a run in virtual time.
    pub fn record(self) -> PlaybackRecord {
        let Self { at, stamp, input } = self;
        match input {
            Input::Pose(x) => PlaybackRecord::message(at, stamp, x),
            Input::Objects(x) => PlaybackRecord::message(at, stamp, x),
            Input::Imu(x) => PlaybackRecord::message(at, stamp, x),
            Input::Gnss(x) => PlaybackRecord::message(at, stamp, x),
            Input::Image(_, x) => PlaybackRecord::message(at, stamp, x),
            Input::Cloud(_, x) => PlaybackRecord::message(at, stamp, x),
            Input::Report(x) => PlaybackRecord::message(at, stamp, x),
            Input::Switch(x) => PlaybackRecord::message(at, stamp, x),
            Input::Wire(x) => PlaybackRecord::message(at, stamp, x),
            Input::Topics(x) => PlaybackRecord::message(at, stamp, x),
        }
    }
}

/// State of a topic, logged once a second.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct TopicState {
    /// Name of the topic in the mapping.
    pub topic: String,
    /// Number of messages received so far.
    pub received: u64,
    /// Number of messages used so far.
    pub used: u64,
    /// Host clock minus stamp clock, if known.
    pub offset: Option<Span>,
    /// Uncertainty of the offset.
    pub spread: Option<Span>,
}
