//! The driving pipeline: thin operators around the pure algorithms, and the graph that joins them.

pub mod agent;
mod camera;
mod controller;
mod deadline;
mod events;
mod faulty;
pub(crate) mod gate;
mod lidar;
mod live;
mod monitor;
mod perception;
mod planner;
mod radar;
pub(crate) mod sensors;
mod stage;
#[cfg(test)]
mod tests;
mod world;

use std::collections::BTreeMap;

use anyhow::Context as _;
use swerve_core::{Span, Time};
use swerve_flow::{Graph, Policy, RuntimeModel, SourceHandle, Stream, Timer, every};
use swerve_msg::truth::WorldState;
use swerve_msg::{Command, EgoState, MotionCommand, PredictionList, Route, Supervision, Switch};
use swerve_scenario::{Scenario, sensor_phase};
use swerve_sim::sense::{LaneInvasionSensor, RedLightSensor, WheelOdometer};
use swerve_sim::{SimParams, Simulator};
use swerve_vehicle::VehicleParams;

use crate::config::Config;
use crate::config::camera::Output;
use crate::config::clock::Clock;
use crate::config::execution::{Runtime, parse_policy, span_ms};

use agent::Agent;
use faulty::faulty;
use stage::SharedStage;

pub use controller::controller;
pub(crate) use live::{Monitored, drive, live_gate, monitors};
pub use stage::{Rendered, StreamMemory};

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
    /// Where the images and point clouds of each stream lie.
    pub memory: BTreeMap<String, StreamMemory>,
    /// What moves it.
    pub clock: Clock,
    /// Who is to be told what becomes of the run's processes, under wall clock.
    pub supervisor: Option<SourceHandle<Supervision>>,
    /// How another stack drives, where one does.
    pub driver: Option<DriverInputs>,
    /// What cameras and lidars share, where there are any.
    stage: Option<SharedStage>,
}

/// What a stack outside says.
pub struct DriverInputs {
    /// What it asks of the vehicle.
    pub commands: SourceHandle<MotionCommand>,
    /// Whether it is to drive.
    pub switch: SourceHandle<Switch>,
}

/// The same, on streams.
type Driver = (Stream<MotionCommand>, Stream<Switch>);

impl Pipeline {
    /// Puts the pipeline of `config` around the world of `scenario`.
    ///
    /// # Errors
    /// When what the configuration asks for is not to be had.
    pub fn build(config: &Config, scenario: &Scenario) -> anyhow::Result<Self> {
        Self::build_for(config, scenario, None)
    }

    /// The same with an agent outside in the place of a part of the stack.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_for(config: &Config, scenario: &Scenario, agent: Option<&Agent>) -> anyhow::Result<Self> {
        let pipeline = Self::assemble(config, scenario, agent)?;
        if let Some(stage) = &pipeline.stage {
            let raised = stage::with(stage, |stage| stage.raise(config, &pipeline.scenario));
            raised.context("building the pipeline")?;
        }
        Ok(pipeline)
    }

    /// The same for who steps no camera and no lidar.
    ///
    /// # Errors
    /// As [`build`](Self::build).
    pub fn build_without_stage(config: &Config, scenario: &Scenario) -> anyhow::Result<Self> {
        Self::assemble(config, scenario, None)
    }

    fn assemble(config: &Config, scenario: &Scenario, agent: Option<&Agent>) -> anyhow::Result<Self> {
        let scenario = drawn(config, scenario);
        let vehicle = config.sim.vehicle.clone();
        let route = scenario.road.route();
        let mut graph = Graph::new();
        let clock = config.clock.source;
        let supervised = clock == Clock::Wall && !config.process.is_empty();
        let (processes, supervisor) = supervised.then(|| graph.source(SUPERVISOR)).unzip();
        let (driver, inputs) = config.is_driven_over_ros2().then(|| driver(&mut graph)).unzip();
        let outside = Outside { processes, driver, agent };
        let (memory, stage) =
            connect(&mut graph, config, &scenario, &route, outside).context("building the pipeline")?;
        configure(&mut graph, config)?;
        let until =
            last_step(Span::from_secs(scenario.end.timeout_s), Span::from_secs(config.sim.dt_ms * 1e-3));
        Ok(Self { graph, scenario, route, vehicle, until, memory, clock, supervisor, driver: inputs, stage })
    }

    /// Tells, once the pipeline has run, what computed its images, if it had any.
    pub(crate) fn rendered(&self) -> impl FnOnce() -> Option<Rendered> + use<> {
        let stage = self.stage.clone();
        move || stage.map(|stage| stage::rendered(&stage))
    }
}

/// Adds what another stack drives through.
fn driver(graph: &mut Graph) -> (Driver, DriverInputs) {
    let (commands, commands_in) = graph.source("commands");
    let (switch, switch_in) = graph.source("switch");
    ((commands, switch), DriverInputs { commands: commands_in, switch: switch_in })
}

/// Who else has a say in the graph.
struct Outside<'a> {
    processes: Option<Stream<Supervision>>,
    driver: Option<Driver>,
    agent: Option<&'a Agent>,
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
    if config.is_driven_over_ros2() {
        // Who drives is not there yet.
        scenario.ego.start_speed_mps = Some(0.0);
    }
    if config.sim.draws { scenario.drawn(config.seed) } else { scenario }
}

fn ms(ms: f64) -> Span {
    Span::from_secs(ms * 1e-3)
}

/// When a sensor's first tick is: drawn where the run draws at all.
fn phase(config: &Config, name: &str, period: Span) -> Span {
    match config.sim.draws {
        true => sensor_phase(config.seed, name, period, ms(config.sim.dt_ms)),
        false => Span::ZERO,
    }
}

fn timer(config: &Config, name: &str, period_ms: f64) -> Timer {
    every(ms(period_ms)).phase(phase(config, name, ms(period_ms)))
}

fn connect(
    graph: &mut Graph,
    config: &Config,
    scenario: &Scenario,
    route: &Route,
    Outside { processes, driver, agent }: Outside<'_>,
) -> anyhow::Result<Surroundings> {
    let sensing = &config.sensing;
    let dt = ms(config.sim.dt_ms);
    let timer = |name: &str, period_ms: f64| timer(config, name, period_ms);

    let params = SimParams { dt, vehicle: config.sim.vehicle.clone() };
    let simulator = Simulator::exact(scenario.clone(), &params)?;
    let command = graph.feedback::<Command>("command");
    let world = graph.add("world", world::World::new(simulator), (every(dt), command)).out();
    let sight = perception::sight(graph, config, timer("obstacles", sensing.period_ms), world)?;
    let seed = config.seed;
    let pose_sensor = sensors::Pose { params: sensing.pose, seed };
    let measured = graph.add("pose", pose_sensor, (timer("pose", sensing.pose_period_ms), world)).out();
    let pose = faulty(graph, config, "pose", measured)?;
    let imu = sensors::Inertial { params: sensing.imu, seed };
    let imu = graph.add("imu", imu, (timer("imu", sensing.imu_period_ms), world)).out();
    faulty(graph, config, "imu", imu)?;
    sense_motion_and_events(graph, config, scenario, world)?;
    let surroundings = sense_surroundings(graph, config, world)?;
    let commands = match driver {
        Some((wishes, switch)) => gate::before_world(graph, config, wishes, measured, Some(switch))?,
        None => match agent {
            Some(agent @ Agent::Command(seat)) => {
                perceive(graph, config, sight, pose)?;
                agent::commands(graph, config, seat, agent)?
            }
            _ => own_stack(graph, config, (scenario, route), (processes, agent), (sight, pose, measured))?,
        },
    };
    graph.connect(command, commands);
    Ok(surroundings)
}

/// From what is seen to what the car is told.
fn own_stack(
    graph: &mut Graph,
    config: &Config,
    (scenario, route): (&Scenario, &Route),
    (processes, agent): (Option<Stream<Supervision>>, Option<&Agent>),
    (sight, pose, measured): (perception::Sight, Stream<EgoState>, Stream<EgoState>),
) -> anyhow::Result<Stream<Command>> {
    let predictions = perceive(graph, config, sight, pose)?;
    let decided = match agent {
        Some(agent) => agent::plans(graph, config, agent, route, pose)?,
        None => None,
    };
    let plan = match decided {
        Some(plan) => plan,
        None => {
            let planner = planner::PlannerOperator::new(config, scenario, route)?;
            let deadline = deadline::set_deadlines(graph, config, (predictions, pose, route))?;
            let plan = planner::planner(graph, config, planner, (predictions, pose, deadline))?;
            faulty(graph, config, "planner", plan)?
        }
    };
    let driver = controller::Driver::new(config, route);
    let processes: Vec<_> = processes.into_iter().map(swerve_flow::Source::from).collect();
    let inputs = (every(ms(config.control.period_ms)), pose, plan, processes);
    if config.gate.enabled {
        let wishes = graph.add("controller", controller::MotionController(driver), inputs).out();
        let wishes = faulty(graph, config, "controller", wishes)?;
        gate::before_world(graph, config, wishes, measured, None)
    } else {
        let pedals = graph.add("controller", controller::PedalController(driver), inputs).out();
        faulty(graph, config, "controller", pedals)
    }
}

/// From what is seen to what is going to happen.
fn perceive(
    graph: &mut Graph,
    config: &Config,
    sight: perception::Sight,
    pose: Stream<EgoState>,
) -> anyhow::Result<Stream<PredictionList>> {
    let tracks = perception::tracks(graph, config, sight, pose)?;
    let tracks = faulty(graph, config, "tracker", tracks)?;
    let predictions = graph.add("predictor", perception::Predictor::new(config), (tracks,)).out();
    faulty(graph, config, "predictor", predictions)
}

/// Sensors of the ego's own motion, and of what happens to it, that run only where they are asked for.
fn sense_motion_and_events(
    graph: &mut Graph,
    config: &Config,
    scenario: &Scenario,
    world: Stream<WorldState>,
) -> anyhow::Result<()> {
    let (sensing, seed, vehicle) = (&config.sensing, config.seed, &config.sim.vehicle);
    if config.runs("gnss") {
        let gnss = sensors::Satellite { params: sensing.gnss, seed };
        let gnss = graph.add("gnss", gnss, (timer(config, "gnss", sensing.gnss_period_ms), world)).out();
        faulty(graph, config, "gnss", gnss)?;
    }
    if config.runs("odometry") {
        let odometer = WheelOdometer::new(sensing.odometry, vehicle, "odometry", seed);
        let odometry = sensors::Odometry { odometer, vehicle: vehicle.clone() };
        let ticks = timer(config, "odometry", sensing.odometry_period_ms);
        let odometry = graph.add("odometry", odometry, (ticks, world)).out();
        faulty(graph, config, "odometry", odometry)?;
    }
    if config.runs("collisions") {
        graph.add("collisions", events::Collisions, (world,)).out();
    }
    if config.runs("lane_invasions") {
        let sensor = LaneInvasionSensor::new(&scenario.road, vehicle.shape);
        graph.add("lane_invasions", events::Lines(sensor), (world,)).out();
    }
    if config.runs("red_lights") {
        let sensor = RedLightSensor::new(&scenario.road, vehicle.shape);
        graph.add("red_lights", events::RedLights(sensor), (world,)).out();
    }
    Ok(())
}

/// Where the images and point clouds of each stream lie, and what makes them.
type Surroundings = (BTreeMap<String, StreamMemory>, Option<SharedStage>);

/// Cameras, radars and lidars, each where it is asked for.
fn sense_surroundings(
    graph: &mut Graph,
    config: &Config,
    world: Stream<WorldState>,
) -> anyhow::Result<Surroundings> {
    let mut memories = BTreeMap::new();
    for (name, radar) in config.radar.iter().filter(|(name, _)| config.runs(name)) {
        let wrong = |faults| anyhow::anyhow!("radar.{name}: {faults:?}");
        let operator = radar::RadarOperator {
            radar: radar.radar(&config.sim.vehicle).map_err(wrong)?,
            seed: config.seed,
        };
        let node = graph.add(name, operator, (timer(config, name, radar.period_ms()), world));
        let (scan, _) = node.origin().outputs(&["scan", "truth"]).out();
        faulty(graph, config, &format!("{name}.scan"), scan)?;
    }
    let cameras: Vec<_> = config.camera.iter().filter(|(name, _)| config.runs(name)).collect();
    let lidars: Vec<_> = config.lidar.iter().filter(|(name, _)| config.runs(name)).collect();
    if cameras.is_empty() && lidars.is_empty() {
        return Ok((memories, None));
    }
    let mut memory = |name: &str, output: &str| {
        // Those of a point cloud: x, y, z, intensity, ring, time.
        let memory = StreamMemory::new(if output == "points" { 6 } else { 1 });
        memories.insert(format!("{name}.{output}"), memory.clone());
        memory
    };
    let stage = stage::Stage::empty();
    for (name, camera) in cameras {
        let memory = Output::ALL.map(|output| memory(name, output.name()));
        let operator = camera::CameraOperator::new((name, camera), config, stage.clone(), memory)?;
        let node = graph.add(name, operator, (timer(config, name, camera.period_ms), world));
        let names = Output::ALL.map(Output::name);
        let (rgb, depth, semantic, instance) = node.origin().outputs(&names).out();
        let mut seen = [rgb, depth, semantic, instance];
        for (output, image) in names.into_iter().zip(&mut seen) {
            *image = faulty(graph, config, &format!("{name}.{output}"), *image)?;
        }
        let [rgb, depth, semantic, instance] = seen;
        for (name, monitor) in config.monitor.iter().filter(|(_, monitor)| monitor.sensor == **name) {
            let watched = match monitor.output {
                Output::Rgb => rgb,
                Output::Depth => depth,
                Output::Semantic => semantic,
                Output::Instance => instance,
            };
            graph.add(name, monitor::ImageMonitor::default(), (watched,)).out();
        }
    }
    for (name, lidar) in lidars {
        let outputs = ["points", "truth"];
        let memory = outputs.map(|output| memory(name, output));
        let operator = lidar::LidarOperator::new((name, lidar), config, stage.clone(), memory)?;
        let (points, _) = graph.add(name, operator, (world,)).origin().outputs(&outputs).out();
        let points = faulty(graph, config, &format!("{name}.points"), points)?;
        for (name, _) in config.monitor.iter().filter(|(_, monitor)| monitor.sensor == **name) {
            graph.add(name, monitor::CloudMonitor::default(), (points,)).out();
        }
    }
    Ok((memories, Some(stage)))
}

/// Run times, policies, deadlines, resources and delays, by operator name.
pub(crate) fn configure(graph: &mut Graph, config: &Config) -> anyhow::Result<()> {
    let wrong = |name: &str, message: String| anyhow::anyhow!("operator.{name}: {message}");
    let resources: Vec<_> =
        config.resource.iter().map(|(name, r)| (name.as_str(), graph.resource(name, r.slots))).collect();
    for name in config.operators() {
        let operator = config.operator.get(name).cloned().unwrap_or_default();
        let Ok(mut node) = graph.operator(name) else { continue };
        let on_its_way = OnItsWay::of(config, name);
        node = node.runtime(match &on_its_way {
            Some(way) if operator.runtime.is_none() => RuntimeModel::Fixed(way.after),
            _ => runtime(config, name).map_err(|m| wrong(name, m))?,
        });
        if let Some(policy) = &operator.policy {
            node = node.policy(parse_policy(policy).map_err(|m| wrong(name, m))?);
        } else if let Some(way) = &on_its_way {
            node = node.policy(Policy::Pipelined { places: way.frames, overtaking: false });
        }
        if let Some(deadline) = &operator.deadline {
            node = node.deadline(deadline.deadline().map_err(|m| wrong(name, m))?);
        }
        if let Some((_, resource)) = resources.iter().find(|(r, _)| Some(*r) == operator.uses.as_deref()) {
            node = node.uses(*resource);
        }
        let added_ms = if name == "planner" { config.planning.added_latency_ms } else { 0.0 };
        let delay = span_ms(operator.delay_ms + added_ms).map_err(|m| wrong(name, m))?;
        let later = on_its_way.filter(|_| operator.runtime.is_some()).map_or(Span::ZERO, |way| way.after);
        node = node.delay(delay + later);
        let _configured = if is_heavy(config, name) { node.heavy() } else { node };
    }
    Ok(())
}

/// The source of what becomes of the run's processes.
pub const SUPERVISOR: &str = "supervisor";

/// Whether an operator's steps are worth a worker thread. Against the real clock those that look at images are
/// too, so that nobody waits for them; in virtual time it shows in no result.
fn is_heavy(config: &Config, name: &str) -> bool {
    let looks = || config.camera.contains_key(name) || config.lidar.contains_key(name);
    let watches = || config.monitor.contains_key(name);
    name == "planner"
        || config.process_of(name).is_some()
        || (config.clock.source == Clock::Wall && (looks() || watches()))
}

/// What a sensor saw, between its stamp and its readers: run time of its operator, which therefore has several
/// frames under way. Where `[operator.NAME]` gives a run time, that comes before it.
struct OnItsWay {
    after: Span,
    frames: usize,
}

impl OnItsWay {
    fn of(config: &Config, name: &str) -> Option<Self> {
        let (timing, period) = config.sensor_timing(name)?;
        let (after, frames) = (timing.visible_after(), timing.in_flight(period));
        (after > Span::ZERO).then_some(Self { after, frames })
    }
}

/// What the configuration says of an operator's run time: its own entry, or the planner's cost, or the emulated
/// detector's published time, or zero.
fn runtime(config: &Config, name: &str) -> Result<RuntimeModel, String> {
    if let Some(runtime) = config.operator.get(name).and_then(|o| o.runtime.as_ref()) {
        return runtime.model();
    }
    match name {
        // On a vehicle the planner takes as long as it takes.
        "planner" if config.live.is_some() && config.clock.source == Clock::Wall => Ok(RuntimeModel::Zero),
        "planner" if config.planning.ladder.is_some() => Ok(deadline::on_ladder()),
        "detector" if config.perception.ladder => Ok(deadline::on_ladder()),
        "planner" => config.planning.cost_of_chosen().map_or(Ok(RuntimeModel::Zero), Runtime::model),
        "detector" => span_ms(config.detector_ms().unwrap_or(0.0)).map(RuntimeModel::Fixed),
        _ => Ok(RuntimeModel::Zero),
    }
}
