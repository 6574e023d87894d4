//! Graph that drives a vehicle: sources instead of simulated sensors, and the gate at its end.
//!
//! ```text
//! objects > obstacles > tracker > predictor > planner > controller > fresh > gate -> (sink)
//! pose, or a localizer --------------------------^--------^                   ^
//! vehicle, switch ------------------------------------------------------------+
//! imu, gnss, cameras, lidars > monitors
//! ```

use std::collections::BTreeMap;

use anyhow::Context as _;
use swerve_flow::{Payload, SendError, SourceHandle};
use swerve_msg::{EgoState, Gnss, Image, Imu, ObstacleList, PointCloud, Switch, VehicleReport, WireAlarm};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;

use super::input::{Arrived, Input, TopicState, names};

/// A graph with inputs for the data of a vehicle.
pub struct LiveGraph {
    /// The pipeline; its operator `gate` publishes the commands for the vehicle.
    pub pipeline: Pipeline,
    /// Inputs of the graph.
    pub inputs: Inputs,
}

/// Handles of the sources, which feed the graph under wall clock. Dropping them closes its streams.
pub struct Inputs {
    /// `None` if a localizer estimates the pose.
    pose: Option<SourceHandle<EgoState>>,
    objects: SourceHandle<ObstacleList>,
    imu: SourceHandle<Imu>,
    gnss: SourceHandle<Gnss>,
    report: SourceHandle<VehicleReport>,
    switch: SourceHandle<Switch>,
    /// `None` for a recorded drive.
    wire: Option<SourceHandle<WireAlarm>>,
    topics: SourceHandle<Vec<TopicState>>,
    images: BTreeMap<String, SourceHandle<Image>>,
    clouds: BTreeMap<String, SourceHandle<PointCloud>>,
}

impl Inputs {
    /// Passes an input to its source.
    ///
    /// # Errors
    /// If the run has ended or the engine does not keep up.
    pub fn send(&self, arrived: Arrived) -> Result<(), SendError> {
        let Arrived { stamp, input, .. } = arrived;
        match input {
            Input::Pose(x) => self.pose.as_ref().map_or(Ok(()), |source| source.send(stamp, x)),
            Input::Objects(x) => self.objects.send(stamp, x),
            Input::Imu(x) => self.imu.send(stamp, x),
            Input::Gnss(x) => self.gnss.send(stamp, x),
            Input::Report(x) => self.report.send(stamp, x),
            Input::Switch(x) => self.switch.send(stamp, x),
            Input::Wire(x) => self.wire.as_ref().map_or(Ok(()), |source| source.send(stamp, x)),
            Input::Topics(x) => self.topics.send(stamp, x),
            Input::Image(name, x) => self.images.get(&name).map_or(Ok(()), |source| source.send(stamp, x)),
            Input::Cloud(name, x) => self.clouds.get(&name).map_or(Ok(()), |source| source.send(stamp, x)),
        }
    }
}

impl LiveGraph {
    /// Builds the graph of a configuration with `[live]`, along the road of `scenario`.
    ///
    /// # Errors
    /// If the configuration requests something unavailable.
    pub fn build(config: &Setup, scenario: &Scenario) -> anyhow::Result<Self> {
        anyhow::ensure!(config.live.is_some(), "the configuration has no `[live]`");
        let mut pipeline = Pipeline::build(config, scenario)?;
        // The states of the topics have no reader in the graph; they are for the log.
        let (_, topics) = pipeline.graph.source::<Vec<TopicState>>(names::TOPICS);
        let named = |names: Vec<&String>| -> Vec<String> { names.into_iter().cloned().collect() };
        let inputs = Inputs {
            pose: match config.localization.estimates() {
                true => None,
                false => Some(input(&mut pipeline, names::POSE)?),
            },
            objects: input(&mut pipeline, names::OBJECTS)?,
            imu: input(&mut pipeline, names::IMU)?,
            gnss: input(&mut pipeline, names::GNSS)?,
            report: input(&mut pipeline, names::REPORT)?,
            switch: input(&mut pipeline, names::SWITCH)?,
            wire: pipeline.take_source(names::WIRE),
            topics,
            images: inputs(&mut pipeline, named(config.camera.keys().collect()))?,
            clouds: inputs(&mut pipeline, named(config.lidar.keys().collect()))?,
        };
        Ok(Self { pipeline, inputs })
    }
}

/// Handle of a source of the graph.
fn input<T: Payload>(pipeline: &mut Pipeline, name: &str) -> anyhow::Result<SourceHandle<T>> {
    pipeline.take_source(name).with_context(|| {
        format!(
            "operator.{name}: the vehicle publishes this: expected the built-in operator that receives it"
        )
    })
}

/// Handles of the sources of one kind, by name.
fn inputs<T: Payload>(
    pipeline: &mut Pipeline,
    names: Vec<String>,
) -> anyhow::Result<BTreeMap<String, SourceHandle<T>>> {
    names.into_iter().map(|name| input(pipeline, &name).map(|handle| (name, handle))).collect()
}
