//! Drives with a safety gate before the car.

use std::path::Path;

use swerve::replay::replay;
use swerve_core::{Span, Time};
use swerve_drive::{Outcome, drive_pipeline, read_scenario, run_start};
use swerve_eval::Verdict;
use swerve_flow::{Event, Observer};
use swerve_log::{Log, Recorder};
use swerve_msg::truth::WorldState;
use swerve_msg::{Command, GateMode, GateOutput, Refusals, StopCause};
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;
use swerve_text::{Document, parse_assignment};

use crate::common;

const SCENARIO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenarios/person_behind_truck.toml");
/// A successful drive: from 10 m/s to a stop before the person, who stays there.
const BASE: &str = "[ego]\nspeed_mps = 10\n[planning]\ncollision = \"may_stop\"\n[control]\ncontroller = \"stanley\"\n[gate]\nenabled = true\n";

/// Outputs of the gate, commands to the car, and its speed.
#[derive(Default)]
struct Recorded {
    gate: Vec<(Time, GateOutput)>,
    pedals: Vec<Command>,
    speeds_mps: Vec<(Time, f64)>,
}

impl Observer for Recorded {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(gate) = payload.downcast_ref::<GateOutput>() {
            self.gate.push((publication.visible_at, *gate));
        } else if let Some(command) = payload.downcast_ref::<Command>() {
            self.pedals.push(*command);
        } else if let Some(world) = payload.downcast_ref::<WorldState>() {
            self.speeds_mps.push((world.stamp, world.ego.state.speed_mps));
        }
    }
}

impl Recorded {
    fn speed_mps(&self, at: Time) -> f64 {
        self.speeds_mps.iter().rfind(|(stamp, _)| *stamp <= at).unwrap().1
    }

    /// Last speed and mode.
    fn end(&self) -> (f64, GateMode) {
        (self.speeds_mps.last().unwrap().1, self.gate.last().unwrap().1.mode)
    }

    /// Start of a mode.
    fn begins(&self, mode: GateMode) -> Time {
        self.gate.iter().find(|(_, gate)| gate.mode == mode).expect("it comes to that").0
    }
}

fn config(sets: &[&str]) -> Setup {
    let sets = common::sets(sets);
    Setup::from_document(&Document::parse("test", BASE).unwrap(), &sets).unwrap()
}

fn drive(sets: &[&str]) -> (Recorded, Outcome) {
    let mut seen = Recorded::default();
    let outcome = drive_observed(&config(sets), &mut [&mut seen]);
    (seen, outcome)
}

fn drive_observed(config: &Setup, observers: &mut [&mut dyn Observer]) -> Outcome {
    let mut pipeline = Pipeline::build(config, &read_scenario(Path::new(SCENARIO)).unwrap()).unwrap();
    pipeline.until = pipeline.until.min(Time::from_ms(31_000));
    drive_pipeline(pipeline, config.seed, 1, observers).unwrap()
}

/// A fault from 2 s on.
fn fault(stream: &str, what: &str) -> String {
    format!("fault.f={{ stream = \"{stream}\", {what}, from_ms = 2000 }}")
}

#[test]
fn drive_without_faults_is_unchanged_by_the_gate() {
    let (_, without) = drive(&["gate.enabled=false"]);
    let (seen, with) = drive(&[]);
    assert_eq!((&without.metrics.gate, without.metrics.verdict), (&None, Verdict::Stopped));
    assert_eq!(with.metrics.verdict, Verdict::Stopped);
    let distances = [&without, &with].map(|of| of.metrics.min_distance_m.unwrap());
    assert!((distances[0] - distances[1]).abs() < 0.05, "{distances:?}");
    let responses = [&without, &with].map(|of| of.metrics.response.unwrap().p50_ms);
    assert_eq!(responses[0], responses[1], "the gate takes no time");
    let gate = with.metrics.gate.unwrap();
    assert!(gate.manual_s < 0.03 && gate.stops.is_empty() && gate.end == GateMode::Driving, "{gate:?}");
    assert_eq!(gate.refused, Refusals::default());
    // The first output is manual, the second driving: the switch was pressed in between.
    assert_eq!(seen.gate[0].1.mode, GateMode::Manual);
    assert!((seen.speed_mps(Time::from_ms(100)) - 10.0).abs() < 0.3, "nobody brakes at the start");
    let beats = seen.gate.windows(2).all(|w| w[1].1.heartbeat == w[0].1.heartbeat.wrapping_add(1));
    assert!(beats && seen.gate.windows(2).all(|w| w[1].0 - w[0].0 == Span::from_ms(10)));
}

#[test]
fn graph_without_a_gate_has_no_gate_operators() {
    let scenario = read_scenario(Path::new(SCENARIO)).unwrap();
    let operators = |set: &str| -> Vec<String> {
        let graph = Pipeline::build(&config(&[set]), &scenario).unwrap().graph;
        graph.describe().unwrap().operators.iter().map(|operator| operator.name.to_string()).collect()
    };
    let (with, without) = (operators("gate.enabled=true"), operators("gate.enabled=false"));
    let of_gate: Vec<&String> = with.iter().filter(|name| !without.contains(name)).collect();
    assert_eq!(of_gate, ["report", "switch", "gate", "pedals"]);
    assert!(without.iter().all(|name| with.contains(name)));
}

#[test]
fn car_is_stopped_and_held_when_commands_cease() {
    let timeout = StopCause::CommandTimeout;
    for what in ["drop = true", "nan = true", "delay_ms = 600"] {
        let (seen, outcome) = drive(&[&fault("controller", what)]);
        let stops = seen.begins(GateMode::Stopping(timeout));
        assert!(stops > Time::from_ms(2490) && stops <= Time::from_ms(2520), "{what}: at {stops:?}");
        let (speed_mps, mode) = seen.end();
        assert_eq!(mode, GateMode::Holding(timeout), "{what}");
        assert!(speed_mps.abs() < 0.01, "{what}: {speed_mps}");
        // 10 m/s at 3 m/s², with the pedals' lag.
        let stopped_s = (seen.begins(GateMode::Holding(timeout)) - stops).as_secs();
        assert!((3.2..3.7).contains(&stopped_s), "{what}: {stopped_s}");
        assert!(outcome.metrics.impact.is_none());
    }
    // Without a gate the car continues with the last command forever.
    let (_, outcome) = drive(&["gate.enabled=false", &fault("controller", "drop = true")]);
    assert_eq!(outcome.metrics.verdict, Verdict::Collision);
}

#[test]
fn nan_commands_never_reach_the_car() {
    let (seen, outcome) = drive(&[&fault("controller", "nan = true, probability = 0.5")]);
    assert!(seen.pedals.iter().all(Command::is_finite));
    let gate = outcome.metrics.gate.unwrap();
    assert!(gate.refused.not_finite > 500 && gate.stops.is_empty(), "{gate:?}");
    assert_eq!(outcome.metrics.verdict, Verdict::Stopped, "every other command is enough");
    for stream in ["pose", "planner", "report"] {
        let (seen, _) = drive(&[&fault(stream, "nan = true")]);
        assert!(seen.pedals.iter().all(Command::is_finite), "{stream}");
        assert!(seen.end().0.abs() < 0.01, "{stream}: it stands");
    }
}

#[test]
fn commands_without_poses_are_too_old_at_any_rate() {
    for what in ["drop = true", "delay_ms = 700"] {
        let (seen, outcome) = drive(&[&fault("pose", what)]);
        assert_eq!(seen.end().1, GateMode::Holding(StopCause::CommandTimeout), "{what}");
        assert!(outcome.metrics.impact.is_none());
    }
}

#[test]
fn stack_without_new_observations_is_stopped_before_its_plan_ends() {
    // The last plan lasts 5 s; commands along it are new and in order.
    for stream in ["obstacles", "tracker", "planner"] {
        let (seen, outcome) = drive(&[&fault(stream, "drop = true")]);
        let stops = seen.begins(GateMode::Stopping(StopCause::CommandTimeout));
        assert!(stops > Time::from_ms(3300) && stops < Time::from_ms(3600), "{stream}: {stops:?}");
        assert!(outcome.metrics.impact.is_none() && seen.end().0.abs() < 0.01, "{stream}");
    }
}

#[test]
fn hanging_controller_is_detected_by_repeated_commands() {
    // With new stamps only the repetition distinguishes it from a live one.
    let hangs = fault("controller", "freeze_ms = 60000");
    let (seen, outcome) = drive(&[&hangs]);
    let stops = seen.begins(GateMode::Stopping(StopCause::CommandFrozen));
    assert!(stops > Time::from_ms(2990) && stops < Time::from_ms(3030), "{stops:?}");
    assert!(outcome.metrics.impact.is_none());
    let (_, outcome) = drive(&[&hangs, "gate.params.repeat_max_s=0"]);
    assert_eq!(outcome.metrics.verdict, Verdict::Collision, "it drives on as it did at 2 s");
    // Shorter hangs are tolerated.
    let (_, outcome) = drive(&[&fault("controller", "freeze_ms = 300, probability = 0.005")]);
    assert!(outcome.metrics.gate.unwrap().stops.is_empty());
}

#[test]
fn enable_switch_is_obeyed() {
    let stop = |set: &str, cause| {
        let (seen, outcome) = drive(&[set]);
        assert_eq!(seen.begins(GateMode::Stopping(cause)), Time::from_ms(2000));
        assert_eq!(seen.end().1, GateMode::Holding(cause));
        assert!(seen.end().0.abs() < 0.01 && outcome.metrics.impact.is_none());
        (seen.begins(GateMode::Holding(cause)) - Time::from_ms(2000)).as_secs()
    };
    let released_s = stop("gate.release_at_ms=2000", StopCause::Released);
    let emergency_s = stop("gate.emergency_at_ms=2000", StopCause::Emergency);
    assert!(emergency_s < 0.6 * released_s && emergency_s > 1.1, "{emergency_s} {released_s}");
    // Until the switch is pressed the driver holds the speed.
    let (seen, _) = drive(&["gate.enable_at_ms=1500"]);
    assert_eq!(seen.begins(GateMode::Driving), Time::from_ms(1500));
    assert!((seen.speed_mps(Time::from_ms(1500)) - 10.0).abs() < 0.1);
}

#[test]
fn failed_press_is_repeated() {
    let (seen, outcome) = drive(&["fault.f={ stream = \"controller\", nan = true, until_ms = 500 }"]);
    let driving = seen.begins(GateMode::Driving);
    assert!(driving > Time::from_ms(500) && driving <= Time::from_ms(540), "{driving:?}");
    assert_eq!(outcome.metrics.verdict, Verdict::Stopped);
    // Also if the gate's output is late.
    let (seen, outcome) = drive(&["operator.gate.runtime={ fixed_ms = 8 }", "operator.gate.delay_ms=20"]);
    assert!(seen.begins(GateMode::Driving) <= Time::from_ms(60), "{:?}", outcome.metrics.gate);
    assert!(outcome.metrics.gate.unwrap().stops.is_empty());
}

#[test]
fn silent_vehicle_is_stopped() {
    let (seen, _) = drive(&[&fault("report", "drop = true")]);
    // Without reports standstill cannot be detected.
    assert_eq!(seen.end().1, GateMode::Stopping(StopCause::ReportTimeout));
    assert!(seen.end().0.abs() < 0.01);
}

#[test]
fn gate_drive_replays_bit_for_bit_from_above_and_from_the_gate() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let config = config(&[&fault("controller", "jitter_ms = 400, until_ms = 4000")]);
    let file = Path::new(SCENARIO);
    let start = run_start(&config, &read_scenario(file).unwrap(), file);
    let mut recorder = Recorder::create(&path, &start).unwrap();
    drive_observed(&config, &mut [&mut recorder]);
    recorder.finish().unwrap();
    let log = Log::read(&path).unwrap();
    for from in ["tracker", "controller", "gate"] {
        let cut = from;
        assert!(replay(&log, cut, &[], 1).unwrap().is_same(), "from {from}");
    }
    let harder = parse_assignment("gate.params.accel_max_mps2=0.1").unwrap();
    let cut = "gate";
    assert!(!replay(&log, cut, &[harder], 1).unwrap().is_same());
}
