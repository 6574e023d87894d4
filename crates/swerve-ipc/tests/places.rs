//! Two processes that read an image read the same memory: the same file in the shared-memory folder, at the same
//! offset, at whatever addresses. This test has a custom `main`: started with `worker`, it is the other process.
#![expect(clippy::unwrap_used, reason = "a failed test says where")]

use std::process::Command;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_flow::{
    At, Context, Event, Every, Graph, Observer, Operator, Port, RunOptions, Window, every, run_virtual,
};
use swerve_ipc::{OnLoss, Traffic, WorkerPool, WorkerSetup, WorkerSpec, work};
use swerve_msg::block::Memory;
use swerve_msg::{Encoding, Image, Pixels};

/// Mapping of bytes in memory: the mapped file and the offset in it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
struct Mapping {
    file: String,
    inode: String,
    offset: u64,
}

/// Looks up the mapping that contains `bytes`.
fn place(bytes: &[u8]) -> Mapping {
    let at = bytes.as_ptr() as u64;
    let hex = |text: &str| u64::from_str_radix(text, 16).unwrap();
    for line in std::fs::read_to_string("/proc/self/maps").unwrap().lines() {
        let mut words = line.split_whitespace();
        let (begin, end) = words.next().unwrap().split_once('-').unwrap();
        if !(hex(begin)..hex(end)).contains(&at) {
            continue;
        }
        let [_, offset, _, inode] = [(); 4].map(|()| words.next().unwrap());
        let file = words.next().unwrap_or_default().to_owned();
        return Mapping { file, inode: inode.to_owned(), offset: hex(offset) + at - hex(begin) };
    }
    panic!("no memory is mapped at {at:x}");
}

fn pixels(image: &Image) -> &[u8] {
    image.pixels.bytes()
}

/// Result of the reader: the places of its images, newest last, and the sum of all bytes.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
struct Received {
    places: Vec<Mapping>,
    sum: u64,
}

struct Camera {
    memory: Option<Box<dyn Memory>>,
}

impl Operator for Camera {
    type In = Every;
    type Out = Port<Image>;

    fn step(&mut self, cx: &mut Context<'_>, _: &Every, out: &mut Port<Image>) {
        let mut image = Image::in_memory(self.memory.as_deref(), 320, 240, Encoding::Rgb8);
        image.stamp = cx.stamp();
        let Pixels::Rgb8(bytes) = &mut image.pixels else { return };
        let seed = cx.rng().bits() >> 32;
        bytes.iter_mut().zip(seed..).for_each(|(byte, n)| *byte = (n.wrapping_mul(n) >> 3) as u8);
        image.seal().unwrap();
        out.forward(Arc::new(image));
    }
}

/// Reads the image of its frame.
struct Newest;

impl Operator for Newest {
    type In = At<Image>;
    type Out = Port<Received>;

    fn step(&mut self, _: &mut Context<'_>, image: &At<Image>, out: &mut Port<Received>) {
        let Some(image) = image.get() else { return };
        let sum = pixels(image).iter().map(|byte| u64::from(*byte)).sum();
        out.send(Received { places: vec![place(pixels(image))], sum });
    }
}

/// Reads the last ten images, more than a worker keeps.
struct LastTen;

impl Operator for LastTen {
    type In = (Every, Window<Image, 10>);
    type Out = Port<u64>;

    fn step(&mut self, _: &mut Context<'_>, (_, images): &Self::In, out: &mut Port<u64>) {
        let bytes = images.get().iter().flat_map(|image| pixels(image));
        out.send(bytes.fold(0, |sum: u64, byte| sum.wrapping_mul(31).wrapping_add(u64::from(*byte))));
    }
}

fn graph(memory: Option<Box<dyn Memory>>, readers: &[String]) -> Graph {
    let mut graph = Graph::new();
    let images = graph.add("camera", Camera { memory }, every(Span::from_ms(10))).out();
    for reader in readers {
        if reader == "newest" {
            graph.add("newest", Newest, images).out();
        } else {
            graph.add("last_ten", LastTen, (every(Span::from_ms(100)), images)).out();
        }
    }
    graph
}

#[derive(Default)]
struct Log {
    written: Vec<Mapping>,
    seen: Vec<Received>,
    sums: Vec<u64>,
    last_ten: Vec<u64>,
}

impl Observer for Log {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(image) = payload.downcast_ref::<Image>() {
            self.written.push(place(pixels(image)));
            self.sums.push(pixels(image).iter().map(|byte| u64::from(*byte)).sum());
        }
        self.seen.extend(payload.downcast_ref::<Received>().cloned());
        self.last_ten.extend(payload.downcast_ref::<u64>());
    }
}

fn run(operator: &str) -> (Log, Traffic, String) {
    let operators = vec![operator.to_owned()];
    let mut pool = WorkerPool::new().unwrap();
    let memory = pool.lend("camera", 1).unwrap();
    let spec = WorkerSpec {
        process: "reader".into(),
        operators: operators.clone(),
        payload: Vec::new(),
        streams: vec!["camera".into()],
        on_loss: OnLoss::Stop,
        spin: Duration::ZERO,
        reply_within: Duration::from_secs(20),
        command: Box::new(|| {
            let mut command = Command::new(std::env::current_exe().unwrap());
            command.arg("worker");
            command
        }),
    };
    pool.start(spec, Arc::new(|_| {})).unwrap();
    pool.wait_ready(Duration::from_secs(20)).unwrap();
    let mut graph = graph(Some(memory), &operators);
    let _there = graph.operator(operator).unwrap().remote(pool.endpoint("reader").unwrap());
    let mut log = Log::default();
    run_virtual(graph, &RunOptions::until(Time::from_ms(600)), vec![&mut log]).unwrap();
    (log, pool.traffic(), format!("/dev/shm/{}", pool.prefix()))
}

fn one_memory_is_read_by_both() {
    let (log, traffic, prefix) = run("newest");
    let seen: Vec<Mapping> = log.seen.iter().flat_map(|seen| seen.places.clone()).collect();
    assert_eq!(log.written.len(), 61);
    assert_eq!(seen, log.written, "the same file, inode and offset at both ends");
    assert!(seen.iter().all(|place| place.file.starts_with(&prefix)), "{:?}", seen[0]);
    assert_eq!(log.seen.iter().map(|seen| seen.sum).collect::<Vec<_>>(), log.sums);
    assert_eq!((traffic.copied, traffic.in_place, traffic.calls), (0, 61, 61));
}

fn what_a_worker_has_no_more_is_sent_as_a_copy_and_counted() {
    let mut here = Log::default();
    run_virtual(graph(None, &["last_ten".into()]), &RunOptions::until(Time::from_ms(600)), vec![&mut here])
        .unwrap();
    let (there, traffic, _) = run("last_ten");
    assert_eq!(there.last_ten, here.last_ten);
    assert!(traffic.copied >= 5 * 10 * 320 * 240 * 3, "{traffic:?}");
}

fn who_is_waited_for_is_told_once_then_given_up() {
    let mut pool = WorkerPool::new().unwrap();
    let spec = WorkerSpec {
        process: "sleeper".into(),
        operators: vec!["newest".into()],
        payload: Vec::new(),
        streams: Vec::new(),
        on_loss: OnLoss::Stop,
        spin: Duration::ZERO,
        reply_within: Duration::from_secs(20),
        command: Box::new(|| {
            let mut command = Command::new("sleep");
            command.arg("100");
            command
        }),
    };
    pool.start(spec, Arc::new(|_| {})).unwrap();
    let told = std::cell::RefCell::new(Vec::new());
    let tell = |process: &str| told.borrow_mut().push(process.to_owned());
    let [within, told_after] = [300, 50].map(Duration::from_millis);
    let error = pool.wait_ready_telling(within, told_after, &tell).unwrap_err();
    assert_eq!(*told.borrow(), ["sleeper"]);
    assert_eq!(error.to_string(), "process `sleeper` did not say in time that it is ready");
}

fn main() {
    if std::env::args().nth(1).as_deref() == Some("worker") {
        let setup = WorkerSetup::read(std::io::stdin().lock()).unwrap();
        let worker = graph(None, &setup.operators).into_worker(&setup.operators).unwrap();
        return work(&setup, worker).unwrap();
    }
    one_memory_is_read_by_both();
    what_a_worker_has_no_more_is_sent_as_a_copy_and_counted();
    who_is_waited_for_is_told_once_then_given_up();
}
