//! Cost of a control step of the stack in a foreign world, against the same steps in a run.

use std::hint::black_box;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use swerve_benches::now;
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

/// The steps of a whole run, with the simulated world, as `swerve run` measures it.
fn run() -> Duration {
    let mut pipeline = Pipeline::build(&setup(), &scenario()).expect("it can be built");
    pipeline.until = UNTIL;
    let start = now();
    black_box(swerve_drive::drive_pipeline(pipeline, 1, 1, &mut []).expect("it runs"));
    start.elapsed()
}

/// The steps of the same stack without the world, whose messages are played back.
fn played(messages: &Messages) -> Duration {
    let mut setup = setup();
    setup.sim.guest = true;
    let mut pipeline = Pipeline::build(&setup, &scenario()).expect("it can be built");
    for operator in pipeline.fed.clone() {
        let of = messages.iter().filter(|(_, stream, _)| *stream == operator);
        let records = of.map(|(at, _, message)| message.clone().record(*at));
        pipeline.graph.playback(&operator, records.collect()).expect("they are of that operator");
    }
    let start = now();
    black_box(run_virtual(pipeline.graph, &RunOptions::until(UNTIL).seed(1), Vec::new()).expect("it runs"));
    start.elapsed()
}

/// The steps of the stack in a foreign world: messages fed and commands taken at every control step.
fn guest(messages: &Messages) -> Duration {
    let mut stack = Stack::new(&setup(), &scenario(), &StackOptions::default()).expect("it can be built");
    let mut next = messages.clone().into_iter().peekable();
    let start = now();
    for step in 0..=UNTIL.ns() / 1_000_000 / STEP_MS {
        let now = Time::from_ms(step * STEP_MS);
        while let Some((_, stream, message)) = next.next_if(|(at, ..)| *at <= now) {
            message.feed(&mut stack, &stream).expect("it fits");
        }
        black_box(stack.advance_to(now).expect("it runs"));
    }
    let took = start.elapsed();
    drop(stack);
    took
}

fn bench(criterion: &mut Criterion) {
    let messages = messages();
    let mut group = criterion.benchmark_group("100 control steps of the truth pipeline");
    group.sample_size(20);
    let of = |steps: u64, one: &dyn Fn() -> Duration| (0..steps).map(|_| one()).sum::<Duration>();
    group.bench_function("in a run", |b| b.iter_custom(|steps| of(steps, &run)));
    group.bench_function("played back, without a world", |b| {
        b.iter_custom(|steps| of(steps, &|| played(&messages)))
    });
    group.bench_function("as a guest", |b| b.iter_custom(|steps| of(steps, &|| guest(&messages))));
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
