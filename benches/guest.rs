//! Cost of a control step of the stack in a foreign world, against the same steps in a run.

use std::hint::black_box;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use criterion::{Criterion, criterion_group};
use swerve_benches::{Goal, Rows, Sample, busy_ms, is_asked_to_measure, now};
use swerve_core::Time;
use swerve_drive::{Stack, StackOptions};
use swerve_flow::{Event, PlaybackRecord, RunOptions, Sent, run_virtual};
use swerve_msg::truth::WorldState;
use swerve_msg::{EgoState, Imu, ObstacleList};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;

/// End of the 100 control steps.
const UNTIL: Time = Time::from_ms(1000);
/// Time between two control steps, ms.
const STEP_MS: i64 = 10;

fn scenario() -> Scenario {
    swerve_drive::read_scenario("person_behind_truck".as_ref()).expect("it is built in")
}

fn setup() -> Setup {
    Setup::default()
}

/// Messages of the world and its sensors in a run, by instant: the stream, and the message.
type Messages = Vec<(Time, String, Message)>;

/// A message that the stack is fed with.
#[derive(Clone)]
enum Message {
    World(Box<WorldState>),
    Pose(EgoState),
    Obstacles(ObstacleList),
    Imu(Imu),
}

impl Message {
    /// The message of a stream of the truth pipeline; `None` for other types.
    fn of(sent: &Sent) -> Option<Self> {
        let world = || sent.downcast_ref().cloned().map(Box::new).map(Self::World);
        let pose = || sent.downcast_ref().copied().map(Self::Pose);
        let obstacles = || sent.downcast_ref().cloned().map(Self::Obstacles);
        world().or_else(pose).or_else(obstacles).or_else(|| sent.downcast_ref().copied().map(Self::Imu))
    }

    fn feed(self, stack: &mut Stack, stream: &str) -> anyhow::Result<()> {
        match self {
            Self::World(message) => stack.feed(stream, *message),
            Self::Pose(message) => stack.feed(stream, message),
            Self::Obstacles(message) => stack.feed(stream, message),
            Self::Imu(message) => stack.feed(stream, message),
        }
    }

    fn record(self, at: Time) -> PlaybackRecord {
        match self {
            Self::World(message) => PlaybackRecord::message(at, at, *message),
            Self::Pose(message) => PlaybackRecord::message(at, at, message),
            Self::Obstacles(message) => PlaybackRecord::message(at, at, message),
            Self::Imu(message) => PlaybackRecord::message(at, at, message),
        }
    }
}

fn messages() -> Messages {
    let (setup, scenario) = (setup(), scenario());
    let stack = Stack::new(&setup, &scenario, &StackOptions::default()).expect("it can be built");
    let inputs: Vec<String> = stack.inputs().map(|input| input.name.clone()).collect();
    let heard = Arc::new(Mutex::new(Messages::new()));
    let kept = heard.clone();
    let mut keeper = move |event: &Event<'_>| {
        if let Event::Publication(p) = event
            && let Some(message) = p.payload.and_then(Message::of)
            && inputs.iter().any(|input| input == p.stream)
        {
            kept.lock().expect("one thread").push((p.visible_at, p.stream.to_owned(), message));
        }
    };
    let pipeline = Pipeline::build(&setup, &scenario).expect("it can be built");
    run_virtual(pipeline.graph, &RunOptions::until(UNTIL).seed(setup.seed), vec![&mut keeper])
        .expect("it runs");
    core::mem::take(&mut *heard.lock().expect("one thread"))
}

/// A clock: milliseconds since any instant.
type Clock<'a> = &'a dyn Fn() -> f64;

/// Milliseconds by a clock of a number of whole runs, with the simulated world, as `swerve run` measures them.
fn run(count: u64, clock: Clock<'_>) -> f64 {
    let built: Vec<Pipeline> = (0..count)
        .map(|_| {
            let mut pipeline = Pipeline::build(&setup(), &scenario()).expect("it can be built");
            pipeline.until = UNTIL;
            pipeline
        })
        .collect();
    let start = clock();
    for pipeline in built {
        black_box(swerve_drive::drive_pipeline(pipeline, 1, 1, &mut []).expect("it runs"));
    }
    clock() - start
}

/// As [`run`], of the same stack without the world, whose messages are played back.
fn played(count: u64, clock: Clock<'_>, messages: &Messages) -> f64 {
    let mut setup = setup();
    setup.sim.guest = true;
    let built: Vec<Pipeline> = (0..count)
        .map(|_| {
            let mut pipeline = Pipeline::build(&setup, &scenario()).expect("it can be built");
            for operator in pipeline.fed.clone() {
                let of = messages.iter().filter(|(_, stream, _)| *stream == operator);
                let records = of.map(|(at, _, message)| message.clone().record(*at));
                pipeline.graph.playback(&operator, records.collect()).expect("they are of that operator");
            }
            pipeline
        })
        .collect();
    let start = clock();
    for pipeline in built {
        let options = RunOptions::until(UNTIL).seed(1);
        black_box(run_virtual(pipeline.graph, &options, Vec::new()).expect("it runs"));
    }
    clock() - start
}

/// As [`run`], of the stack in a foreign world: messages fed and commands taken at every control step.
fn guest(count: u64, clock: Clock<'_>, messages: &Messages) -> f64 {
    let one = || Stack::new(&setup(), &scenario(), &StackOptions::default()).expect("it can be built");
    let built: Vec<(Stack, Messages)> = (0..count).map(|_| (one(), messages.clone())).collect();
    let start = clock();
    for (mut stack, messages) in built {
        let mut next = messages.into_iter().peekable();
        for step in 0..=UNTIL.ns() / 1_000_000 / STEP_MS {
            let now = Time::from_ms(step * STEP_MS);
            while let Some((_, stream, message)) = next.next_if(|(at, ..)| *at <= now) {
                message.feed(&mut stack, &stream).expect("it fits");
            }
            black_box(stack.advance_to(now).expect("it runs"));
        }
    }
    clock() - start
}

fn bench(criterion: &mut Criterion) {
    let messages = messages();
    let begin = now();
    let wall = || begin.elapsed().as_secs_f64() * 1e3;
    let of = |ms: f64| Duration::from_secs_f64(ms * 1e-3);
    let mut group = criterion.benchmark_group("100 control steps of the truth pipeline");
    group.sample_size(20);
    group.bench_function("in a run", |b| b.iter_custom(|count| of(run(count, &wall))));
    group.bench_function("played back, without a world", |b| {
        b.iter_custom(|count| of(played(count, &wall, &messages)))
    });
    group.bench_function("as a guest", |b| b.iter_custom(|count| of(guest(count, &wall, &messages))));
    group.finish();
}

/// Rounds in which the cost of a guest is compared with that of a run.
const ROUNDS: usize = 15;
/// Times of 100 steps in a round, each way.
const IN_A_ROUND: u64 = 20;

/// The cost of a guest relative to a run, by processor time: other programs do not count.
fn rows() {
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "guest");
    let what = "100 control steps as a guest, relative to a run";
    if busy_ms().is_none() {
        rows.skipped(what, "processor time is not reported");
        return rows.finish();
    }
    let messages = messages();
    let clock = || busy_ms().unwrap_or_default();
    let round = |_| [run(IN_A_ROUND, &clock), guest(IN_A_ROUND, &clock, &messages)];
    let rounds: Vec<[f64; 2]> = (0..ROUNDS).map(round).collect();
    let each = |of: &dyn Fn(&[f64; 2]) -> f64| Sample::new(rounds.iter().map(of).collect());
    let per_run = IN_A_ROUND as f64;
    for (name, index) in [("in a run", 0), ("as a guest", 1)] {
        let ms = each(&|round| round[index] / per_run);
        rows.row(&format!("100 control steps {name}"), ms.median(), &ms.text(2, "ms"), Goal::None);
    }
    let ratio = each(&|[run, guest]| guest / run);
    rows.row(what, ratio.median(), &ratio.text(2, "times"), Goal::Most(1.3));
    rows.finish();
}

criterion_group!(benches, bench);

fn main() {
    benches();
    Criterion::default().configure_from_args().final_summary();
    if is_asked_to_measure() {
        rows();
    }
}
