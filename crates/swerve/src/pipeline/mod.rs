//! The driving pipeline: thin operators around the pure algorithms, and the graph that joins them.

mod controller;
mod perception;
mod planner;
mod sensors;
mod world;

use anyhow::Context as _;
use swerve_core::{Span, Time};
use swerve_flow::{Graph, RuntimeModel, every};
use swerve_msg::{Command, Route};
use swerve_scenario::{Scenario, sensor_phase};
use swerve_sim::{SimParams, Simulator};
use swerve_vehicle::VehicleParams;

use crate::config::execution::{parse_policy, span_ms};
use crate::config::{Config, OPERATORS};

pub use controller::controller;

/// A pipeline ready to run.
pub struct Pipeline {
    /// The graph.
    pub graph: Graph,
    /// The scenario as the seed varies it.
    pub scenario: Scenario,
    /// Where to go and what ground may be used.
    pub route: Route,
    /// The ego vehicle.
    pub vehicle: VehicleParams,
    /// When the scenario is over at the latest.
    pub until: Time,
}

impl Pipeline {
    /// Puts the pipeline of `config` around the world of `scenario`.
    pub fn build(config: &Config, scenario: &Scenario) -> anyhow::Result<Self> {
        let scenario = drawn(config, scenario);
        let vehicle = config.sim.vehicle.clone();
        let route = scenario.road.route();
        let mut graph = Graph::new();
        connect(&mut graph, config, &scenario, &route).context("building the pipeline")?;
        configure(&mut graph, config)?;
        let until =
            last_step(Span::from_secs(scenario.end.timeout_s), Span::from_secs(config.sim.dt_ms * 1e-3));
        Ok(Self { graph, scenario, route, vehicle, until })
    }
}

/// The first step of the world at which the scenario's time is over.
fn last_step(timeout: Span, dt: Span) -> Time {
    let steps = (timeout.ns() + dt.ns() - 1) / dt.ns();
    Time::from_ns(steps * dt.ns())
}

/// The scenario under the configuration's speed, as its seed varies it.
pub(crate) fn drawn(config: &Config, scenario: &Scenario) -> Scenario {
    let mut scenario = scenario.clone();
    if let Some(speed) = config.ego.speed_mps {
        scenario.ego.target_speed_mps = speed;
    }
    if config.sim.draws { scenario.drawn(config.seed) } else { scenario }
}

fn connect(graph: &mut Graph, config: &Config, scenario: &Scenario, route: &Route) -> anyhow::Result<()> {
    let ms = |ms: f64| Span::from_secs(ms * 1e-3);
    let dt = ms(config.sim.dt_ms);
    let sensing = &config.sensing;
    let phase = |name: &str, period: Span| match config.sim.draws {
        true => sensor_phase(config.seed, name, period, dt),
        false => Span::ZERO,
    };
    let timer = |name: &str, period_ms: f64| every(ms(period_ms)).phase(phase(name, ms(period_ms)));

    let params = SimParams { dt, vehicle: config.sim.vehicle.clone() };
    let simulator = Simulator::exact(scenario.clone(), &params)?;
    let command = graph.feedback::<Command>("command");
    let world = graph.add("world", world::World::new(simulator), (every(dt), command)).out();
    let obstacles = graph
        .add("obstacles", sensors::Obstacles::new(config), (timer("obstacles", sensing.period_ms), world))
        .origin()
        .out();
    let seed = config.seed;
    let pose_sensor = sensors::Pose { params: sensing.pose, seed };
    let pose = graph.add("pose", pose_sensor, (timer("pose", sensing.pose_period_ms), world)).out();
    let imu = sensors::Inertial { params: sensing.imu, seed };
    graph.add("imu", imu, (timer("imu", sensing.imu_period_ms), world)).out();
    if config.log.sensors.iter().any(|s| s == "gnss") {
        let gnss = sensors::Satellite { params: sensing.gnss, seed };
        graph.add("gnss", gnss, (timer("gnss", sensing.gnss_period_ms), world)).out();
    }
    let tracks = graph.add("tracker", perception::Tracker::new(config), (obstacles,)).out();
    let predictions = graph.add("predictor", perception::Predictor::new(config), (tracks,)).out();
    let planner = planner::PlannerOperator::new(config, scenario, route)?;
    let plan = graph.add("planner", planner, (predictions, pose)).out();
    let controller = controller::ControllerOperator::new(config, route);
    let commands =
        graph.add("controller", controller, (every(ms(config.control.period_ms)), pose, plan)).out();
    graph.connect(command, commands);
    Ok(())
}

/// Run times, policies, deadlines, resources and delays, by operator name.
fn configure(graph: &mut Graph, config: &Config) -> anyhow::Result<()> {
    let wrong = |name: &str, message: String| anyhow::anyhow!("operator.{name}: {message}");
    let resources: Vec<_> =
        config.resource.iter().map(|(name, r)| (name.as_str(), graph.resource(name, r.slots))).collect();
    for name in OPERATORS {
        let operator = config.operator.get(name).cloned().unwrap_or_default();
        let Ok(mut node) = graph.operator(name) else { continue };
        node = node.runtime(runtime(config, name).map_err(|m| wrong(name, m))?);
        if let Some(policy) = &operator.policy {
            node = node.policy(parse_policy(policy).map_err(|m| wrong(name, m))?);
        }
        if let Some(deadline) = &operator.deadline {
            node = node.deadline(deadline.deadline().map_err(|m| wrong(name, m))?);
        }
        if let Some((_, resource)) = resources.iter().find(|(r, _)| Some(*r) == operator.uses.as_deref()) {
            node = node.uses(*resource);
        }
        let added_ms = if name == "planner" { config.planning.added_latency_ms } else { 0.0 };
        node = node.delay(span_ms(operator.delay_ms + added_ms).map_err(|m| wrong(name, m))?);
        let _configured = if name == "planner" { node.heavy() } else { node };
    }
    Ok(())
}

/// What the configuration says of an operator's run time: its own entry, or the planner's cost, or zero.
fn runtime(config: &Config, name: &str) -> Result<RuntimeModel, String> {
    if let Some(runtime) = config.operator.get(name).and_then(|o| o.runtime.as_ref()) {
        return runtime.model();
    }
    match config.planning.cost_of_chosen().filter(|_| name == "planner") {
        Some(cost) => cost.model(),
        None => Ok(RuntimeModel::Zero),
    }
}
