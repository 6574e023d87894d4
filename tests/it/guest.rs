//! The stack as a guest: the simulated car as a foreign world, bad input, logs.

mod bad;
mod lines;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use swerve_core::{Span, Time};
use swerve_drive::{Commands, Outcome, Stack, StackOptions, drive, read_scenario};
use swerve_eval::Metrics;
use swerve_flow::{Event, Reached, RunOptions, Session};
use swerve_log::Log;
use swerve_msg::{EgoState, GateMode, GateOutput, ObstacleList, Plan, StopCause};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::agent::{Agent, Seat};
use swerve_stack::pipeline::Pipeline;

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

fn scenario(name: &str) -> Scenario {
    read_scenario(Path::new(name)).unwrap()
}

fn config(sets: &[&str]) -> Setup {
    let sets: Vec<String> = sets.iter().map(|set| (*set).to_owned()).collect();
    Setup::load(None, &swerve_text::parse_assignments(&sets).unwrap()).unwrap()
}

/// Name of a stream and the bytes of one message.
type Sent = (String, Vec<u8>);

/// A simulated car and its sensors, for a stack outside of it.
struct Simulated {
    session: Session<'static>,
    seat: Seat<swerve_msg::Command>,
    heard: Arc<Mutex<Vec<Sent>>>,
}

impl Simulated {
    /// The world of a configuration, with the streams that a stack reads.
    fn new(config: &Setup, scenario: &Scenario, stack: &Stack) -> Self {
        let seat = Seat::default();
        let agent = Agent::Command(seat.clone());
        let pipeline = Pipeline::build_for(config, scenario, &agent).unwrap();
        let options = RunOptions::until(pipeline.until).seed(config.seed);
        let mut session = Session::new(pipeline.graph, &options, Vec::new()).unwrap();
        session.hold_before(&agent.operator(config).unwrap()).unwrap();
        let inputs: BTreeSet<String> = stack.inputs().map(|input| input.name.clone()).collect();
        let heard = Arc::new(Mutex::new(Vec::new()));
        let kept = heard.clone();
        session.observe(Box::new(move |event: &Event<'_>| {
            if let Event::Publication(publication) = event
                && let Some(payload) = publication.payload
                && inputs.contains(publication.stream)
            {
                let mut bytes = Vec::new();
                payload.to_cbor(&mut bytes);
                lock(&kept).push((publication.stream.to_owned(), bytes));
            }
        }));
        Self { session, seat, heard }
    }

    /// Steps both to the next control tick; `None` at the end of the world.
    fn step(&mut self, stack: &mut Stack) -> Option<Commands> {
        let reached = self.session.advance();
        for (stream, message) in lock(&self.heard).drain(..) {
            stack.feed_cbor(&stream, &message).unwrap();
        }
        let commands = stack.advance_to(self.session.now()).unwrap();
        if let Some(newest) = commands.newest {
            self.seat.set(newest.command);
        }
        (reached == Reached::Held).then_some(commands)
    }
}

/// A drive with the stack outside of the simulator.
fn guest(config: &Setup, scenario: &Scenario, options: &StackOptions) -> Outcome {
    let mut stack = Stack::new(config, scenario, options).unwrap();
    let mut world = Simulated::new(config, scenario, &stack);
    while world.step(&mut stack).is_some() {}
    stack.finish().unwrap()
}

/// Metrics without those of the steps of world and sensors, which a guest does not take.
fn of_stack(mut metrics: Metrics) -> Metrics {
    let outside = ["world", "obstacles", "pose", "imu", "lights"];
    metrics.operators.retain(|operator| !outside.contains(&operator.operator.as_str()));
    metrics
}

#[test]
fn guest_in_the_simulators_world_has_the_digest_of_a_run() {
    for (name, sets) in [
        ("person_behind_truck", &[][..]),
        ("person_behind_truck", &["operator.planner.runtime={ fixed_ms = 180 }", "seed=3"]),
        ("person_crossing", &["operator.tracker.runtime={ normal_ms = [30, 8] }"]),
        ("car_behind_truck", &["fault.late={ stream = \"obstacles\", delay_ms = 60 }"]),
        (
            "person_crossing",
            &[
                "perception.detector=efficientdet-d3@v100",
                "execution.model=static_deadlines",
                "execution.planner_ms=60",
            ],
        ),
    ] {
        let (config, scenario) = (config(sets), scenario(name));
        let run = drive(&config, &scenario).unwrap();
        let guest = guest(&config, &scenario, &StackOptions::default());
        assert_eq!(guest.digest, run.digest, "{name} {sets:?}");
        assert_eq!(of_stack(guest.metrics), of_stack(run.metrics), "{name} {sets:?}");
        assert_eq!(guest.road_margin_m, run.road_margin_m, "{name} {sets:?}");
    }
}

#[test]
fn guest_repeats_itself_on_any_number_of_threads() {
    let (config, scenario) = (config(&["planning.planner=rrt_star"]), scenario("person_crossing"));
    let on = |threads| guest(&config, &scenario, &StackOptions { threads, ..StackOptions::default() }).digest;
    let once = on(1);
    assert_eq!(once, on(1));
    assert_eq!(once, on(2));
    let other = StackOptions { seed: Some(9), ..StackOptions::default() };
    let mut other_config = config.clone();
    other_config.seed = 9;
    assert_eq!(
        guest(&other_config, &scenario, &other).digest,
        drive(&other_config, &scenario).unwrap().digest
    );
}

#[test]
fn commands_become_visible_after_the_run_times_of_the_stack() {
    let (config, scenario) = (
        config(&[
            "operator.controller.runtime={ fixed_ms = 4 }",
            "operator.controller.delay_ms=3",
            "sim.draws=false",
        ]),
        scenario("lane"),
    );
    let mut stack = Stack::new(&config, &scenario, &StackOptions::default()).unwrap();
    let mut world = Simulated::new(&config, &scenario, &stack);
    for _ in 0..20 {
        world.step(&mut stack).unwrap();
    }
    let now = stack.now();
    let visible = |at: Span, stack: &mut Stack| stack.advance_to(now + at).unwrap().new.len();
    assert_eq!(visible(Span::from_ms(6), &mut stack), 0);
    assert_eq!(visible(Span::from_ms(7), &mut stack), 1, "4 ms of run time and 3 ms on the way");
    let (header, plan) = stack.newest::<Plan>("planner").unwrap().unwrap();
    assert!(header.visible_at <= stack.now() && !plan.points.is_empty());
    let (_, pose) = stack.newest::<EgoState>("pose").unwrap().unwrap();
    assert!(pose.stamp <= now);
}

#[test]
fn inputs_have_types_readers_and_latencies() {
    let config = config(&["camera.front={}", "log.sensors=[\"front\"]", "camera.front.transfer_ms=20"]);
    let stack = Stack::new(&config, &scenario("lane"), &StackOptions::default()).unwrap();
    let of = |name: &str| stack.inputs().find(|input| input.name == name).cloned().unwrap();
    assert_eq!(of("obstacles").payload.name(), "ObstacleList");
    assert!(of("obstacles").readers.contains(&"tracker".to_owned()));
    assert_eq!(of("world").payload.name(), "WorldState");
    assert!(of("world").readers.is_empty(), "{:?}", of("world"));
    assert_eq!(of("front.rgb").payload.name(), "Image");
    assert!(of("front.rgb").latency >= Span::from_ms(20));
    assert!(stack.streams().any(|stream| stream == "controller"));
}

#[test]
fn gate_stops_the_car_if_inputs_stop() {
    let (mut config, scenario) = (config(&["sim.draws=false"]), scenario("lane"));
    let world = config.clone();
    config.gate.enabled = true;
    let mut stack = Stack::new(&config, &scenario, &StackOptions::default()).unwrap();
    let mut world = Simulated::new(&world, &scenario, &stack);
    let mode = |stack: &Stack| stack.newest::<GateOutput>("gate").unwrap().unwrap().1.mode;
    while stack.now() < Time::from_ms(2000) {
        world.step(&mut stack).unwrap();
    }
    assert_eq!(mode(&stack), GateMode::Driving);
    let stopped = stack.advance_to(Time::from_ms(3000)).unwrap();
    let causes = [StopCause::ReportTimeout, StopCause::CommandTimeout];
    assert!(
        matches!(mode(&stack), GateMode::Stopping(cause) | GateMode::Holding(cause) if causes.contains(&cause)),
        "{:?}",
        mode(&stack)
    );
    let command = stopped.newest.unwrap().command;
    assert!(command.brake > 0.0 && command.throttle == 0.0, "{command:?}");
}

#[test]
fn log_of_a_guest_is_whole_after_finish_and_readable_without() {
    let folder = tempfile::tempdir().unwrap();
    let (config, scenario) = (config(&[]), scenario("person_crossing"));
    let options =
        |name: &str| StackOptions { log: Some(folder.path().join(name)), ..StackOptions::default() };
    let outcome = guest(&config, &scenario, &options("whole.mcap"));
    let log = Log::read(&folder.path().join("whole.mcap")).unwrap();
    assert_eq!(log.end.as_ref().and_then(swerve_log::RunEnd::whole_digest), Some(outcome.digest));
    assert!(log.start.config.contains("guest = true"));
    assert!(outcome.metrics.verdict.is_success());

    let mut stack = Stack::new(&config, &scenario, &options("part.mcap")).unwrap();
    let mut world = Simulated::new(&config, &scenario, &stack);
    while stack.now() < Time::from_ms(1500) {
        world.step(&mut stack).unwrap();
    }
    drop(stack);
    let (log, damage) = Log::salvage_where(&folder.path().join("part.mcap"), |_| true).unwrap();
    assert!(damage.is_some() || log.end.is_none());
    let poses = log.publications("pose").filter_map(|record| record.decode::<EgoState>().ok()).count();
    assert!(poses > 100, "{poses}");
    let lists = log.publications("obstacles").filter_map(|record| record.decode::<ObstacleList>().ok());
    assert!(lists.count() > 20);
    let again = Stack::new(&config, &scenario, &options("part.mcap")).err().unwrap();
    assert!(format!("{again:#}").contains("part.mcap"), "{again:#}");
}
