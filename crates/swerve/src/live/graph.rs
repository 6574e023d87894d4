//! The graph that drives a vehicle: sources in the place of the simulated world's sensors, the gate at its end.
//!
//! ```text
//!  objects > obstacles > tracker > predictor > planner > controller > fresh > gate -> (who talks to the vehicle)
//!  pose ------------------------------------------^--------^                   ^
//!  vehicle, switch ------------------------------------------------------------+
//!  imu, gnss, cameras, lidars > monitors
//! ```

use std::collections::BTreeMap;

use anyhow::Context as _;
use swerve_core::{Span, Time};
use swerve_flow::{At, Context, Every, Graph, Latest, Operator, Port, SendError, SourceHandle, every};
use swerve_msg::{
    EgoState, Gnss, Image, Imu, MotionCommand, Obstacle, ObstacleList, Plan, PointCloud, Route, Switch,
    VehicleReport,
};
use swerve_scenario::Scenario;

use super::feed::TopicState;
use super::intake::{Arrived, Input, names};
use crate::config::Config;
use crate::config::live::LiveConfig;
use crate::pipeline::{self, Monitored};

/// A graph to be fed with what a vehicle says.
pub struct LiveGraph {
    /// The graph; its operator `gate` says what goes to the vehicle.
    pub graph: Graph,
    /// The handles that feed it.
    pub inputs: Inputs,
    /// Where to go and what ground may be used.
    pub route: Route,
}

/// The sources' handles: under wall clock they feed the graph. When they are gone its streams are closed.
pub struct Inputs {
    pose: SourceHandle<EgoState>,
    objects: SourceHandle<ObstacleList>,
    imu: SourceHandle<Imu>,
    gnss: SourceHandle<Gnss>,
    report: SourceHandle<VehicleReport>,
    switch: SourceHandle<Switch>,
    topics: SourceHandle<Vec<TopicState>>,
    images: BTreeMap<String, SourceHandle<Image>>,
    clouds: BTreeMap<String, SourceHandle<PointCloud>>,
}

impl Inputs {
    /// Hands something to its source.
    ///
    /// # Errors
    /// The run is over, or the engine does not keep up.
    pub fn send(&self, arrived: Arrived) -> Result<(), SendError> {
        let Arrived { stamp, input, .. } = arrived;
        match input {
            Input::Pose(x) => self.pose.send(stamp, x),
            Input::Objects(x) => self.objects.send(stamp, x),
            Input::Imu(x) => self.imu.send(stamp, x),
            Input::Gnss(x) => self.gnss.send(stamp, x),
            Input::Report(x) => self.report.send(stamp, x),
            Input::Switch(x) => self.switch.send(stamp, x),
            Input::Topics(x) => self.topics.send(stamp, x),
            Input::Image(name, x) => self.images.get(&name).map_or(Ok(()), |source| source.send(stamp, x)),
            Input::Cloud(name, x) => self.clouds.get(&name).map_or(Ok(()), |source| source.send(stamp, x)),
        }
    }

    /// The names of all sources.
    pub fn sources(&self) -> impl Iterator<Item = &str> {
        let fixed = [
            names::POSE,
            names::OBJECTS,
            names::IMU,
            names::GNSS,
            names::REPORT,
            names::SWITCH,
            names::TOPICS,
        ];
        fixed
            .into_iter()
            .chain(self.images.keys().map(String::as_str))
            .chain(self.clouds.keys().map(String::as_str))
    }
}

impl LiveGraph {
    /// The graph of a configuration with `[live]`, along the road of `scenario`.
    pub fn build(config: &Config, scenario: &Scenario) -> anyhow::Result<Self> {
        let live = config.live.clone().context("the configuration has no `[live]`")?;
        let route = scenario.road.route();
        let mut scenario = scenario.clone();
        if let Some(speed) = config.ego.speed_mps {
            scenario.ego.target_speed_mps = speed;
        }
        let mut graph = Graph::new();
        let graph_of = &mut graph;
        let (pose, pose_in) = graph_of.source::<EgoState>(names::POSE);
        let (objects, objects_in) = graph_of.source::<ObstacleList>(names::OBJECTS);
        let (_, imu) = graph_of.source::<Imu>(names::IMU);
        let (_, gnss) = graph_of.source::<Gnss>(names::GNSS);
        let (report, report_in) = graph_of.source::<VehicleReport>(names::REPORT);
        let (switch, switch_in) = graph_of.source::<Switch>(names::SWITCH);
        let (_, topics) = graph_of.source::<Vec<TopicState>>(names::TOPICS);
        let (mut images, mut clouds) = (BTreeMap::new(), BTreeMap::new());
        for name in config.camera.keys() {
            let (stream, handle) = graph_of.source::<Image>(name);
            pipeline::monitors(graph_of, config, name, Monitored::Image(stream));
            images.insert(name.clone(), handle);
        }
        for name in config.lidar.keys() {
            let (stream, handle) = graph_of.source::<PointCloud>(name);
            pipeline::monitors(graph_of, config, name, Monitored::Cloud(stream));
            clouds.insert(name.clone(), handle);
        }
        let period = |ms: f64| every(Span::from_secs(ms * 1e-3));
        let surroundings = Surroundings::new(&live);
        let obstacles =
            graph_of.add("obstacles", surroundings, (period(config.sensing.period_ms), objects)).out();
        let (plan, commands) = pipeline::drive(graph_of, config, &scenario, &route, (obstacles, pose))?;
        let fresh = FreshCommands { timeout: Span::from_secs(live.plan_timeout_s), last: Time::MIN };
        let commands = graph_of.add("fresh", fresh, (commands, plan)).out();
        pipeline::live_gate(graph_of, config, commands, report, switch)?;
        pipeline::configure(graph_of, config)?;
        let inputs = Inputs {
            pose: pose_in,
            objects: objects_in,
            imu,
            gnss,
            report: report_in,
            switch: switch_in,
            topics,
            images,
            clouds,
        };
        Ok(Self { graph, inputs, route })
    }
}

/// The surroundings of the ego at regular instants: the objects that others see, moved on by their velocities.
///
/// None are there as long as none were ever reported. Once there were, their silence is no empty road: nothing is
/// said, so that no plan is made, and without plans the gate stops the car.
struct Surroundings {
    timeout: Span,
}

impl Surroundings {
    fn new(live: &LiveConfig) -> Self {
        Self { timeout: Span::from_secs(live.objects_timeout_s) }
    }
}

impl Operator for Surroundings {
    type In = (Every, Latest<ObstacleList>);
    type Out = Port<ObstacleList>;

    fn step(&mut self, cx: &mut Context<'_>, (_, objects): &Self::In, out: &mut Self::Out) {
        let stamp = cx.stamp();
        let Some(objects) = objects.get() else {
            return out.send(ObstacleList { stamp, obstacles: Vec::new() });
        };
        let age = stamp - objects.stamp;
        if age > self.timeout {
            return;
        }
        let moved = |obstacle: &Obstacle| {
            let point = obstacle.pose.point() + obstacle.velocity_mps * age.as_secs();
            let mut obstacle = obstacle.clone();
            (obstacle.pose.x_m, obstacle.pose.y_m) = (point.x_m, point.y_m);
            obstacle
        };
        out.send(ObstacleList { stamp, obstacles: objects.obstacles.iter().map(moved).collect() });
    }
}

/// Lets commands pass that are made from a new state and a plan that is not too old. For the gate behind it the
/// others are silence.
struct FreshCommands {
    timeout: Span,
    last: Time,
}

impl Operator for FreshCommands {
    type In = (At<MotionCommand>, Latest<Plan>);
    type Out = Port<MotionCommand>;

    fn step(&mut self, cx: &mut Context<'_>, (command, plan): &Self::In, out: &mut Self::Out) {
        let (Some(command), Some(plan)) = (command.get(), plan.get()) else { return };
        if command.stamp > self.last && cx.now() - plan.stamp <= self.timeout {
            self.last = command.stamp;
            out.forward(command.shared());
        }
    }
}
