//! One drive stepped by an agent, or by an agent for each ego.

use std::collections::BTreeMap;

use anyhow::{Context as _, bail, ensure};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use swerve_core::Time;
use swerve_drive::process::Processes;
use swerve_flow::{Reached, RunOptions, Session, Watched};
use swerve_geom::{FrenetPoint, angle_between};
use swerve_msg::truth::{EndReason, WorldState};
use swerve_msg::{EgoState, Route};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::pipeline::{Pipeline, Stack};
use swerve_vehicle::Shape;

use super::action::{Level, Wheel};
use super::observe::{Form, From};
use crate::convert::error;
use crate::numbers::{Numbers, image};
use crate::run::Inputs;

/// Ground-truth facts at each decision, in addition to the observations; for rewards.
pub(crate) const FACTS: [&str; 11] = [
    "time_s",
    "s_m",
    "d_m",
    "heading_error_rad",
    "speed_mps",
    "accel_mps2",
    "lateral_accel_mps2",
    "target_speed_mps",
    "collided",
    "left_road",
    "ended",
];

/// Maximum distance of the ego along the route between two updates, metres.
const REACH_M: f64 = 30.0;

/// Range of the route in a picture, metres to either side of the ego.
const SHOWN_M: i32 = 90;

/// Common inputs of all drives.
pub(crate) struct Task {
    config: Setup,
    scenario: Scenario,
    level: Level,
    observed: Vec<Observed>,
    /// Maximum number of rows of a list.
    rows: usize,
}

struct Observed {
    /// Name given by the user.
    name: String,
    /// Source stream.
    stream: String,
    form: Form,
    /// Shape and data type of an image.
    shape: Option<(Vec<usize>, &'static str)>,
}

impl Task {
    /// The task of these inputs, with the arguments of an environment.
    pub(crate) fn read(inputs: Inputs, level: &str, observe: &[String], rows: usize) -> PyResult<Self> {
        let level = Level::named(level).map_err(PyValueError::new_err)?;
        Self::new(inputs.config, inputs.scenario, level, observe, rows).map_err(error)
    }

    fn new(
        config: Setup,
        scenario: Scenario,
        level: Level,
        observe: &[String],
        rows: usize,
    ) -> anyhow::Result<Self> {
        let agents: Vec<_> = scenario.egos().iter().map(|_| level.agent().0).collect();
        let pipeline = Pipeline::build_for_each(&config, &scenario, &agents)?;
        let described = pipeline.graph.describe()?;
        let streams = described.operators.into_iter().flat_map(|o| o.outputs);
        let own = |(stream, of): (String, String)| Some((pipeline.names.own(&stream)?.to_owned(), of));
        let streams: BTreeMap<_, _> = streams.filter_map(own).collect();
        ensure!(streams.contains_key("world"), "the scenario has no world");
        let observed: anyhow::Result<_> =
            observe.iter().map(|name| observed(name, &streams, &config)).collect();
        ensure!((1..=1000).contains(&rows), "rows: expected 1 to 1000, found {rows}");
        Ok(Self { observed: observed?, config, scenario, level, rows })
    }

    /// Names of the egos, in the order of their identities.
    pub(crate) fn egos(&self) -> Vec<String> {
        self.scenario.egos().into_iter().map(|(_, name)| name.to_owned()).collect()
    }

    /// Observations in order: name, shape, data type, names of the numbers.
    pub(crate) fn observations(&self) -> Vec<(String, Vec<usize>, &'static str, Vec<String>)> {
        let of = |observed: &Observed| {
            let names = observed.form.names();
            let (shape, kind) = match &observed.shape {
                Some((shape, kind)) => (shape.clone(), *kind),
                None if observed.form.has_rows() => (vec![self.rows, names.len()], "<f4"),
                None => (vec![names.len()], "<f4"),
            };
            (observed.name.clone(), shape, kind, names)
        };
        self.observed.iter().map(of).collect()
    }

    /// Number of values of an observation, without images.
    pub(crate) fn numbers(&self) -> usize {
        let size = |observed: &Observed| {
            observed.form.names().len() * if observed.form.has_rows() { self.rows } else { 1 }
        };
        self.observed.iter().map(size).sum()
    }

    pub(crate) fn actions(&self) -> Vec<(f64, f64, String)> {
        self.level.numbers(&self.config)
    }

    pub(crate) fn actions_len(&self) -> usize {
        self.actions().len()
    }

    pub(crate) fn period_s(&self) -> f64 {
        self.level.agent().0.period(&self.config).as_secs()
    }
}

/// Observation of a stream of this name.
fn observed(name: &str, streams: &BTreeMap<String, String>, config: &Setup) -> anyhow::Result<Observed> {
    if name == "route" {
        return Ok(Observed { name: name.into(), stream: "pose".into(), form: Form::Route, shape: None });
    }
    let Some(type_name) = streams.get(name) else {
        let known: Vec<&str> = streams.keys().map(String::as_str).chain(["route"]).collect();
        let near = swerve_text::nearest(name, known.iter().copied());
        let hint = near.map_or_else(|| known.join(", "), |near| format!("did you mean `{near}`?"));
        bail!("observe: unknown stream `{name}` ({hint})");
    };
    let form = Form::of(type_name)
        .with_context(|| format!("observe: messages of `{name}` ({type_name}) have no form as numbers"))?;
    let shape = match form {
        Form::Image => Some(image_shape(name, config)?),
        _ => None,
    };
    Ok(Observed { name: name.into(), stream: name.into(), form, shape })
}

/// Shape of a camera's images, and their data type in NumPy's notation.
fn image_shape(stream: &str, config: &Setup) -> anyhow::Result<(Vec<usize>, &'static str)> {
    let (camera, output) =
        stream.rsplit_once('.').with_context(|| format!("`{stream}` is not a camera's"))?;
    let camera = config.camera.get(camera).with_context(|| format!("`{stream}` is not a camera's"))?;
    let (rows, columns) = (camera.height_px as usize, camera.width_px as usize);
    Ok(match output {
        "rgb" => (vec![rows, columns, 3], "|u1"),
        "depth" => (vec![rows, columns], "<f4"),
        "semantic" => (vec![rows, columns], "|u1"),
        _ => (vec![rows, columns], "<u4"),
    })
}

/// A drive in progress.
pub(crate) struct Drive {
    session: Session<'static>,
    /// Worker processes of the drive; dropped after the session.
    _processes: Option<Processes>,
    until: Time,
    egos: Vec<DrivenEgo>,
    /// True if no decision follows.
    over: bool,
}

/// An ego, and the agent that drives it.
struct DrivenEgo {
    wheel: Wheel,
    route: Route,
    target_speed_mps: f64,
    world: Watched,
    pose: Watched,
    watched: Vec<Watched>,
    /// Latest ego state reported by localization.
    ego: EgoState,
    truth: EgoState,
    place: FrenetPoint,
    shape: Shape,
    collided: bool,
    left_road: bool,
    ended: Option<EndReason>,
}

impl Drive {
    /// Starts a drive and runs it to its first decision.
    pub(crate) fn begin(task: &Task, seed: i64) -> anyhow::Result<Self> {
        let mut config = task.config.clone();
        config.seed = seed.unsigned_abs();
        let (agents, wheels): (Vec<_>, Vec<_>) =
            task.scenario.egos().iter().map(|_| task.level.agent()).unzip();
        let mut pipeline = Pipeline::build_for_each(&config, &task.scenario, &agents)?;
        let processes = Processes::start_needed(&config, &mut pipeline)?;
        let of_stack = |stack: Stack<'_>| {
            (stack.names.clone(), stack.route.clone(), stack.scenario.ego.target_speed_mps)
        };
        let stacks: Vec<_> = pipeline.stacks().into_iter().map(of_stack).collect();
        let Pipeline { graph, until, vehicle, .. } = pipeline;
        let options = RunOptions::until(until).seed(config.seed);
        let mut session = Session::new(graph, &options, Vec::new())?;
        // The turns of the other agents at this instant follow.
        session.hold_before(&agents[0].operator(&config)?)?;
        let steps = (agents[0].period(&config).as_secs() * 1e3 / config.sim.dt_ms).ceil() as usize;
        let egos = wheels.into_iter().zip(stacks).map(|(wheel, (names, route, target_speed_mps))| {
            let mut watch = |own: &str, depth: usize| {
                let name = names.stream(own);
                session.watch(&name, depth).with_context(|| format!("there is no stream `{name}`"))
            };
            let (world, pose) = (watch("world", steps + 1)?, watch("pose", 1)?);
            let watched: anyhow::Result<_> =
                task.observed.iter().map(|observed| watch(&observed.stream, 1)).collect();
            Ok(DrivenEgo {
                wheel,
                route,
                target_speed_mps,
                world,
                pose,
                watched: watched?,
                ego: EgoState::default(),
                truth: EgoState { stamp: Time::from_ns(-1), ..EgoState::default() },
                place: FrenetPoint::default(),
                shape: vehicle.shape,
                collided: false,
                left_road: false,
                ended: None,
            })
        });
        let egos: anyhow::Result<_> = egos.collect();
        let mut drive = Self { egos: egos?, session, _processes: processes, until, over: false };
        drive.go_on()?;
        Ok(drive)
    }

    /// Passes the decisions of all egos, one after the other, and continues to the next decision or the end. An ego whose
    /// scenario is over stops.
    pub(crate) fn step(&mut self, task: &Task, action: &[f64]) -> anyhow::Result<()> {
        ensure!(
            action.iter().all(|number| number.is_finite()),
            "an action of the level {:?} has a number that is not finite: {action:?}",
            task.level
        );
        for (ego, numbers) in self.egos.iter().zip(action.chunks(task.actions_len())) {
            match ego.ended {
                None => ego.wheel.take(numbers, &ego.ego),
                Some(_) => ego.wheel.stop(&ego.ego),
            }
        }
        self.go_on()
    }

    fn go_on(&mut self) -> anyhow::Result<()> {
        self.over = self.session.advance() == Reached::End;
        if let Some(failure) = self.session.failure() {
            bail!("{failure}");
        }
        let Self { egos, session, .. } = self;
        egos.iter_mut().for_each(|ego| ego.look(session));
        Ok(())
    }

    /// True if the drive is over for all egos.
    pub(crate) fn is_over(&self) -> bool {
        self.has_stopped() || self.egos.iter().all(|ego| ego.ended.is_some())
    }

    /// True if the run is over, of whatever egos.
    fn has_stopped(&self) -> bool {
        self.over || self.session.now() >= self.until
    }

    /// Reason for the end of the drive of an ego, by its place among the egos.
    pub(crate) fn ended(&self, ego: usize) -> Option<&'static str> {
        match self.egos.get(ego)?.ended {
            Some(EndReason::Goal) => Some("goal"),
            Some(EndReason::Stopped) => Some("stopped"),
            Some(EndReason::Collision) => Some("collision"),
            Some(EndReason::Timeout) => Some("timeout"),
            None => self.has_stopped().then_some("timeout"),
        }
    }

    /// Current observations of all egos, without images.
    pub(crate) fn observe(&self, task: &Task, numbers: &mut Vec<f32>) {
        self.egos.iter().for_each(|ego| ego.observe(task, &self.session, numbers));
    }

    /// Newest image of a stream of an ego.
    pub(crate) fn image(&self, task: &Task, ego: usize, stream: &str) -> Option<Numbers> {
        let index = task.observed.iter().position(|observed| observed.name == stream)?;
        image(self.session.newest(self.egos.get(ego)?.watched[index])?.1)
    }

    /// True surroundings of an ego for a picture: kind, pose of the middle, length and width of each body, the ego's first;
    /// points of the route around the ego, with the distances to its left and right border.
    pub(crate) fn scene(&self, ego: usize) -> (Vec<[f64; 6]>, Vec<[f64; 5]>) {
        self.egos.get(ego).map(|ego| ego.scene(&self.session)).unwrap_or_default()
    }

    /// Ground-truth facts: for each ego as many numbers as [`FACTS`] has names.
    pub(crate) fn facts(&self, facts: &mut Vec<f64>) {
        self.egos.iter().for_each(|ego| ego.facts(self.has_stopped(), facts));
    }
}

impl DrivenEgo {
    /// Updates the world state and the localized ego state.
    fn look(&mut self, session: &Session<'_>) {
        let first = self.truth.stamp < Time::ZERO;
        for (header, payload) in session.recent(self.world) {
            let Some(world) = (**payload).as_any().downcast_ref::<WorldState>() else { continue };
            if header.stamp <= self.truth.stamp {
                continue;
            }
            self.truth = world.ego.state;
            self.collided |= world.collisions_of_ego().next().is_some();
            self.left_road |= !world.infractions.is_empty();
            self.ended = self.ended.or(world.ended);
        }
        let point = self.truth.pose.point();
        self.place = match first {
            true => self.route.project(point),
            false => self.route.project_near(point, self.place.s_m, REACH_M),
        };
        let pose = session.newest(self.pose).and_then(|(_, p)| (**p).as_any().downcast_ref::<EgoState>());
        // Before the first measurement the agent knows the same pose as the car at its start.
        self.ego = pose.copied().unwrap_or(self.truth);
    }

    fn observe(&self, task: &Task, session: &Session<'_>, numbers: &mut Vec<f32>) {
        let (ego, route) = (&self.ego, &self.route);
        let from = From { ego, ahead: ego.pose.direction(), route, rows: task.rows };
        for (observed, stream) in task.observed.iter().zip(&self.watched) {
            let newest = session.newest(*stream).map(|(_, payload)| payload);
            from.numbers(observed.form, newest, numbers);
        }
    }

    fn scene(&self, session: &Session<'_>) -> (Vec<[f64; 6]>, Vec<[f64; 5]>) {
        let center = self.shape.footprint(self.truth.pose).center;
        let size = (self.shape.length_m, self.shape.width_m);
        let mut bodies = vec![[-1.0, center.x_m, center.y_m, center.heading_rad, size.0, size.1]];
        let world = session.newest(self.world);
        let world = world.and_then(|(_, payload)| (**payload).as_any().downcast_ref::<WorldState>());
        bodies.extend(world.into_iter().flat_map(|world| &world.actors).map(|actor| {
            let (pose, extent) = (actor.pose, actor.extent);
            let kind = f64::from(actor.kind as u8);
            [kind, pose.x_m, pose.y_m, pose.heading_rad, extent.length_m, extent.width_m]
        }));
        let around = (-SHOWN_M..=SHOWN_M).map(|k| (self.place.s_m + f64::from(k)).max(0.0));
        let points = around.filter(|s_m| *s_m <= self.route.line().length()).map(|s_m| {
            let pose = self.route.line().at(s_m).pose;
            [pose.x_m, pose.y_m, pose.heading_rad, self.route.left_m(s_m), self.route.right_m(s_m)]
        });
        (bodies, points.collect())
    }

    /// Facts; `has_stopped` if the run is over.
    fn facts(&self, has_stopped: bool, facts: &mut Vec<f64>) {
        let on_line = self.route.line().at(self.place.s_m);
        let flag = |yes: bool| f64::from(u8::from(yes));
        let ended = match self.ended {
            None if has_stopped => 4.0,
            None => 0.0,
            Some(EndReason::Goal) => 1.0,
            Some(EndReason::Stopped) => 2.0,
            Some(EndReason::Collision) => 3.0,
            Some(EndReason::Timeout) => 4.0,
        };
        let truth = &self.truth;
        let all: [f64; FACTS.len()] = [
            truth.stamp.as_secs(),
            self.place.s_m,
            self.place.d_m,
            angle_between(on_line.pose.heading_rad, truth.pose.heading_rad),
            truth.speed_mps,
            truth.accel_mps2,
            truth.lateral_accel_mps2,
            self.target_speed_mps,
            flag(self.collided),
            flag(self.left_road),
            ended,
        ];
        facts.extend(all);
    }
}
