//! The stack as a guest: stepped by a foreign world, which feeds the sensors and applies the commands.
//!
//! ```text
//! foreign world --feed--> [world, sensors] > tracker > ... > controller --advance_to--> commands --> foreign world
//! ```
//!
//! The graph is that of `swerve run`, but for the world and its sensors: their streams are inputs. Virtual time advances
//! when the caller says so, and every operator has its modelled run time, deadline and faults. So a world that waits for
//! the commands gets them at the instants at which a real stack would give them. Equal inputs give an equal digest.

mod commands;
mod facts;
mod inputs;
mod lights;
mod line;
mod scene;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::{Context as _, anyhow, bail, ensure};
use swerve_core::{Span, Time};
use swerve_flow::{
    ErasedPayload, Event, Header, Observer, Payload, PayloadType, PlaybackMessage, PlaybackPayload,
    PlaybackRecord, RunOptions, Session, Watched, cbor,
};
use swerve_geom::angle_between;
use swerve_log::Recorder;
use swerve_msg::truth::{EndReason, Surroundings, WorldState};
use swerve_msg::{EgoState, Obstacle, ObstacleList, Route};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::config::clock::Clock;
use swerve_stack::pipeline::Pipeline;
use swerve_text::did_you_mean;

use crate::drive::Outcome;
use crate::measured::Measured;
use crate::process::Processes;
use crate::recording::{Recording, run_start, set_up};

use commands::Tape;
use facts::facts;
use inputs::Inputs;

pub use commands::{Commanded, Commands};
pub use inputs::InputStream;
pub use line::{Line, scenario_on_map};
pub use scene::Referee;

/// Options of a stack in a foreign world.
#[derive(Clone, Debug)]
pub struct StackOptions {
    /// Seed of all random numbers; that of the configuration when absent.
    pub seed: Option<u64>,
    /// Number of threads; the result does not depend on it.
    pub threads: usize,
    /// File of the log (MCAP), which must not exist; no log when absent.
    pub log: Option<PathBuf>,
    /// Name of the scenario's file in the log.
    pub scenario_file: PathBuf,
    /// Draws the target speed from the seed, as `swerve run` does, in place of the configuration's `sim.draws`.
    pub draws: Option<bool>,
}

impl Default for StackOptions {
    fn default() -> Self {
        Self { seed: None, threads: 1, log: None, scenario_file: PathBuf::new(), draws: None }
    }
}

/// The stack in a foreign world: [`feed`](Self::feed) its inputs, [`advance_to`](Self::advance_to) an instant, apply the
/// command, and so on; then [`finish`](Self::finish).
///
/// Dropped without `finish`, it leaves a log that can be read up to its last instant.
pub struct Stack {
    session: Session<'static>,
    /// Worker processes; dropped after the session.
    _processes: Option<Processes>,
    inputs: Inputs,
    streams: Vec<(String, Watched)>,
    tape: Arc<Mutex<Tape>>,
    measured: Arc<Mutex<Measured>>,
    recording: Arc<Mutex<Option<Recording>>>,
    setup: Setup,
    scenario: Scenario,
    route: Route,
    referee: Referee,
    /// Instant that the caller advanced to; `None` before the first.
    now: Option<Time>,
    /// Last publication of a fed message.
    fed_until: Time,
    until: Time,
    /// True once a pose was fed: the first has to be on the road.
    is_placed: bool,
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Configuration of a stack without a world.
///
/// # Errors
/// If a key asks for another world, or for a clock that does not wait.
fn guest_setup(config: &Setup, options: &StackOptions) -> anyhow::Result<Setup> {
    let mut setup = config.clone();
    ensure!(
        setup.live.is_none() && setup.source.is_none(),
        "live: a vehicle is driven by `swerve live`: expected a configuration of `swerve run`"
    );
    ensure!(
        !setup.is_driven_over_ros2(),
        "ego.driver: the commands go to the foreign world: expected \"stack\""
    );
    ensure!(
        setup.clock.source == Clock::Virtual,
        "clock.source: a stack that a foreign world steps has its time: expected \"virtual\""
    );
    if setup.operator.contains_key("world") {
        bail!("operator.world: the world is the program that feeds the stack: expected no such table");
    }
    let usual = Setup::default().sim.dt_ms;
    ensure!(setup.sim.dt_ms == usual, "sim.dt_ms: the foreign world has its own step: expected no such key");
    setup.sim.guest = true;
    setup.sim.draws = options.draws.unwrap_or(setup.sim.draws);
    setup.seed = options.seed.unwrap_or(setup.seed);
    Ok(setup)
}

impl Stack {
    /// Creates the stack of a configuration, for the road, the target speed and the end of a scenario; nothing is executed
    /// yet. The scenario's actors exist only if they are fed. [`Line`] makes a scenario of a line.
    ///
    /// # Errors
    /// If a key asks for a world, a vehicle or the real clock, if the scenario has several egos, if the configuration
    /// requests something unavailable, or if the log cannot be created.
    pub fn new(config: &Setup, scenario: &Scenario, options: &StackOptions) -> anyhow::Result<Self> {
        Self::with_observers(config, scenario, options, |_, _| Vec::new())
    }

    /// As [`new`](Self::new), with observers for the run that are made of its configuration and pipeline.
    ///
    /// # Errors
    /// As there.
    pub fn with_observers(
        config: &Setup,
        scenario: &Scenario,
        options: &StackOptions,
        observers: impl FnOnce(&Setup, &Pipeline) -> Vec<Box<dyn Observer>>,
    ) -> anyhow::Result<Self> {
        let setup = guest_setup(config, options)?;
        ensure!(scenario.other_egos.is_empty(), "the scenario has several egos: a stack drives one");
        let mut pipeline = Pipeline::build(&setup, scenario)?;
        inputs::check(&setup, &pipeline)?;
        let recording = options.log.as_deref().map(|log| record(log, &setup, scenario, options, &pipeline));
        let recording = recording.transpose()?;
        let processes = Processes::start_needed(&setup, &mut pipeline)?;
        let measured = Measured::new(&pipeline, &pipeline.stack())?;
        let described = pipeline.graph.describe()?;
        let tape = Tape::new(&pipeline, &described)?;
        let observers = observers(&setup, &pipeline);
        let Pipeline { graph, assembly, scenario, route, until, fed, vehicle, .. } = pipeline;
        let run = RunOptions::until(until).seed(setup.seed).threads(options.threads.max(1));
        let mut session = Session::new(graph, &run, Vec::new())?;
        let inputs = Inputs::new((&setup, &assembly, &fed), &described, &session);
        let names = described.operators.iter().flat_map(|operator| &operator.outputs).map(|(name, _)| name);
        let streams = names.filter_map(|name| Some((name.clone(), session.watch(name, 1)?))).collect();
        let stack = Self {
            session,
            _processes: processes,
            inputs,
            streams,
            tape: Arc::new(Mutex::new(tape)),
            measured: Arc::new(Mutex::new(measured)),
            recording: Arc::new(Mutex::new(recording)),
            setup,
            scenario,
            route,
            referee: Referee::new(vehicle.shape),
            now: None,
            fed_until: Time::ZERO,
            until,
            is_placed: false,
        };
        Ok(stack.observed(observers))
    }

    /// Passes the events of the run to its observers, in the order of `swerve run`.
    fn observed(mut self, others: Vec<Box<dyn Observer>>) -> Self {
        let (measured, recording, tape) = (self.measured.clone(), self.recording.clone(), self.tape.clone());
        self.session.observe(Box::new(move |event: &Event<'_>| lock(&measured).event(event)));
        self.session.observe(Box::new(move |event: &Event<'_>| {
            if let Some(recording) = &mut *lock(&recording) {
                recording.event(event);
            }
        }));
        self.session.observe(Box::new(move |event: &Event<'_>| lock(&tape).event(event)));
        others.into_iter().for_each(|observer| self.session.observe(observer));
        self
    }

    /// Streams that the foreign world feeds, by name.
    pub fn inputs(&self) -> impl Iterator<Item = &InputStream> {
        self.inputs.iter().map(|input| &input.stream)
    }

    /// Names of all streams, in the order of the graph.
    pub fn streams(&self) -> impl Iterator<Item = &str> {
        self.streams.iter().map(|(name, _)| name.as_str())
    }

    /// Configuration of the run, with its seed and `sim.guest`.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Scenario with the seed's variations.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Route that the stack starts with.
    pub fn route(&self) -> &Route {
        &self.route
    }

    /// Instant that the stack was advanced to; zero before the first.
    pub fn now(&self) -> Time {
        self.now.unwrap_or(Time::ZERO)
    }

    /// Last instant that it can be advanced to: the end of the scenario's time.
    pub fn until(&self) -> Time {
        self.until
    }

    /// Feeds a message of an input. The stack gets it at the message's stamp, or later by the configured latency of the
    /// sensor and `operator.NAME.delay_ms`. Messages are fed before the stack is advanced to their stamps.
    ///
    /// # Errors
    /// If there is no such input, if the message is of another type, has a number that is not finite or no stamp, if its
    /// stamp is not after the instant advanced to and the stamps fed before, or if the first pose is off the road.
    pub fn feed<T: Payload>(&mut self, stream: &str, message: T) -> anyhow::Result<()> {
        let input = self.inputs.named(stream)?;
        let found = PayloadType::of::<T>();
        ensure!(
            input.stream.payload == found,
            "`{stream}`: expected messages of type {}, found {found}",
            input.stream.payload
        );
        let mut bytes = Vec::new();
        cbor::write(&message, &mut bytes);
        self.feed_payload(stream, &bytes, PlaybackPayload::value(message))
    }

    /// As [`feed`](Self::feed), for a message in CBOR, as in logs.
    ///
    /// # Errors
    /// As there, or if the bytes are not a message of the stream's type.
    pub fn feed_cbor(&mut self, stream: &str, message: &[u8]) -> anyhow::Result<()> {
        self.feed_payload(stream, message, PlaybackPayload::cbor(message))
    }

    fn feed_payload(&mut self, stream: &str, bytes: &[u8], payload: PlaybackPayload) -> anyhow::Result<()> {
        let input = self.inputs.named(stream)?;
        let expected = input.stream.payload;
        let facts =
            facts(bytes).with_context(|| format!("`{stream}`: expected a message of type {expected}"))?;
        if let Some((key, number)) = facts.not_finite {
            bail!("`{stream}`: {key} is {number}: expected a finite number");
        }
        let stamp = facts
            .stamp
            .with_context(|| format!("`{stream}`: expected a message of type {expected}, with a stamp"))?;
        ensure!(stamp >= Time::ZERO, "`{stream}`: stamp {stamp}: expected zero or more");
        let visible_at = stamp.saturating_add(input.stream.latency);
        if let Some(now) = self.now.filter(|now| visible_at <= *now) {
            bail!(
                "`{stream}`: stamp {stamp}: the stack has advanced to {now}; expected the messages of an instant before \
                 advancing to it"
            );
        }
        let is_pose = expected == PayloadType::of::<EgoState>();
        if is_pose && !self.is_placed {
            let ego: EgoState = cbor::read(bytes).map_err(|error| anyhow!("`{stream}`: {error}"))?;
            check_start(stream, &ego, &self.route)?;
        }
        let (source, port) = (input.source, input.port);
        let message = PlaybackMessage { stamp, reused_from: None, origin: None, payload };
        let record = PlaybackRecord { port, visible_at, pass: 0, watermark: stamp, message: Some(message) };
        self.session.feed(source, record).with_context(|| format!("`{stream}`"))?;
        self.is_placed |= is_pose;
        self.fed_until = self.fed_until.max(visible_at);
        Ok(())
    }

    /// Feeds a world without sensors: the ego and everybody else as they are at the ego's stamp. The stack gets them as the
    /// first inputs of [`EgoState`], [`ObstacleList`] and [`Surroundings`]; the log and the metrics get [`WorldState`] on
    /// the stream `world`, with the collisions of the ego, the road that it leaves, and the end of the scenario. Returns
    /// the reason for the end, if the scenario is over.
    ///
    /// # Errors
    /// As [`feed`](Self::feed), or if the obstacles are not ordered by identity, each once, from 1 on.
    pub fn feed_scene(
        &mut self,
        ego: EgoState,
        obstacles: Vec<Obstacle>,
    ) -> anyhow::Result<Option<EndReason>> {
        scene::check(&obstacles)?;
        let name = |input: &inputs::Input| input.stream.name.clone();
        let pose = self.inputs.first_of::<EgoState>().map(name);
        let list = self.inputs.first_of::<ObstacleList>().map(name);
        let seen = self.inputs.first_of::<Surroundings>().map(name);
        let world = self.inputs.first_of::<WorldState>().map(name);
        // The pose first: a scene that is refused leaves no trace.
        if let Some(pose) = pose {
            self.feed(&pose, ego)?;
        }
        let state = self.referee.state(ego, &obstacles, (&self.scenario, &self.route));
        let ended = state.ended;
        if let Some(world) = world {
            self.feed(&world, state)?;
        }
        if let Some(seen) = seen {
            let (stamp, ego, obstacles) = (ego.stamp, ego.pose, obstacles.clone());
            self.feed(&seen, Surroundings { stamp, ego, obstacles })?;
        }
        if let Some(list) = list {
            self.feed(&list, ObstacleList { stamp: ego.stamp, obstacles })?;
        }
        Ok(ended)
    }

    /// Advances to an instant: all that is due up to and including it is executed. Messages with stamps up to the instant
    /// have to be fed before.
    ///
    /// # Errors
    /// If the instant is before the last one or after the end, if an operator fails, or if the log cannot be written.
    pub fn advance_to(&mut self, instant: Time) -> anyhow::Result<Commands> {
        let (now, until) = (self.now(), self.until);
        ensure!(instant >= now, "advance to {instant}: time goes back, the stack is at {now}");
        ensure!(instant <= until, "advance to {instant}: the scenario ends at {until} (end.timeout_s)");
        self.complete_inputs(instant)?;
        self.session.advance_to(instant);
        if self.session.is_stopped() {
            return Err(self.why_stopped());
        }
        self.now = Some(instant);
        Ok(lock(&self.tape).up_to(instant))
    }

    /// Reason why the run cannot go on.
    fn why_stopped(&self) -> anyhow::Error {
        if let Some(failure) = self.session.failure() {
            return anyhow!("{failure}");
        }
        let written = lock(&self.recording).take().map(Recording::finish).transpose();
        written.map_or_else(anyhow::Error::from, |_| anyhow!("the run ended at {}", self.session.now()))
    }

    /// States that the inputs which an operator joins have no further messages up to an instant.
    fn complete_inputs(&mut self, instant: Time) -> anyhow::Result<()> {
        for input in self.inputs.iter().filter(|input| input.is_joined) {
            let watermark = instant + (Span::ZERO - input.stream.latency);
            let record = PlaybackRecord { port: input.port, ..PlaybackRecord::bare(instant, watermark) };
            if self.now.is_none_or(|now| now < instant) {
                self.session.feed(input.source, record)?;
            }
        }
        Ok(())
    }

    /// Newest message of any stream, as a reader of it sees it at the last event; `None` before the first.
    ///
    /// # Errors
    /// If there is no such stream, or its messages are of another type.
    pub fn newest<T: Payload>(&self, stream: &str) -> anyhow::Result<Option<(&Header, &T)>> {
        let Some((header, payload)) = self.newest_any(stream)? else { return Ok(None) };
        let found = payload.type_name();
        let message = payload.as_any().downcast_ref();
        let message = message.with_context(|| {
            format!("`{stream}`: found messages of type {found}, not {}", PayloadType::of::<T>())
        })?;
        Ok(Some((header, message)))
    }

    /// As [`newest`](Self::newest), for messages of any type.
    ///
    /// # Errors
    /// If there is no such stream.
    pub fn newest_any(&self, stream: &str) -> anyhow::Result<Option<(&Header, &dyn ErasedPayload)>> {
        let watched = self.streams.iter().find(|(name, _)| name == stream).map(|(_, watched)| *watched);
        let watched = watched.with_context(|| {
            let near = did_you_mean(stream, self.streams());
            let known: Vec<&str> = self.streams().collect();
            format!("unknown stream `{stream}`, expected one of {}{near}", known.join(", "))
        })?;
        Ok(self.session.newest(watched).map(|(header, payload)| (header, &**payload)))
    }

    /// Advances to the last message that was fed, ends the run and completes the log. The verdict follows from the states
    /// fed to the stream `world`; without them it is `unfinished`.
    ///
    /// # Errors
    /// If an operator failed, or the log cannot be written.
    pub fn finish(mut self) -> anyhow::Result<Outcome> {
        if self.fed_until > self.now() && self.fed_until <= self.until && !self.session.is_stopped() {
            self.advance_to(self.fed_until)?;
        }
        self.session.stop("the foreign world ended the run");
        let report = self.session.finish();
        let recorded = lock(&self.recording).take().map(Recording::finish).transpose();
        let report = report?;
        recorded?;
        let measured = &*lock(&self.measured);
        Ok(Outcome {
            ego: self.scenario.ego_name,
            metrics: measured.metrics(),
            digest: report.digest,
            road_margin_m: measured.road_margin_m,
            report,
            rendered: None,
            rungs: measured.rungs.clone(),
            others: Vec::new(),
        })
    }
}

/// Starts the log of a run.
fn record(
    log: &Path,
    setup: &Setup,
    scenario: &Scenario,
    options: &StackOptions,
    pipeline: &Pipeline,
) -> anyhow::Result<Recording> {
    let start = run_start(setup, scenario, &options.scenario_file);
    let mut recorder = Recorder::create(log, &start)?;
    set_up(&mut recorder, setup, pipeline);
    Ok(Recording::new(recorder, pipeline.clock, pipeline.graph.stop_handle()))
}

/// Distance before the begin and beyond the end of the route at which a start still belongs to it, metres.
const BEYOND_ENDS_M: f64 = 20.0;

/// Refuses an ego that starts off the road, or against it.
fn check_start(stream: &str, ego: &EgoState, route: &Route) -> anyhow::Result<()> {
    let place = route.project(ego.pose.point());
    let (left_m, right_m, length_m) =
        (route.left_m(place.s_m), route.right_m(place.s_m), route.line().length());
    let beside_m = (place.d_m - left_m).max(-right_m - place.d_m);
    let beyond_m = (-place.s_m).max(place.s_m - length_m) - BEYOND_ENDS_M;
    let (x_m, y_m) = (ego.pose.x_m, ego.pose.y_m);
    ensure!(
        beside_m <= 0.0 && beyond_m <= 0.0,
        "`{stream}`: the ego starts at ({x_m:.1}, {y_m:.1}) m, {:.1} m off the road: expected a place on the route, which \
         begins at ({:.1}, {:.1}) m",
        beside_m.max(beyond_m + BEYOND_ENDS_M),
        route.line().at(0.0).pose.x_m,
        route.line().at(0.0).pose.y_m
    );
    let off_rad = angle_between(route.line().at(place.s_m).pose.heading_rad, ego.pose.heading_rad).abs();
    ensure!(
        off_rad <= core::f64::consts::FRAC_PI_2,
        "`{stream}`: the ego starts with heading {:.2} rad, {off_rad:.2} rad off the route: is the y axis to the left, and \
         positive heading too?",
        ego.pose.heading_rad
    );
    Ok(())
}
