//! Chains on Swerve's engine, in virtual time with run times of zero: as in the workspace's `engine` benchmark.

use swerve_benches::now;
use swerve_core::{Span, Time};
use swerve_flow::{At, Context, Event, Every, Graph, Operator, Port, RunOptions, every, run_virtual};

use crate::{Small, changed, check, see};

struct Source(u64);
impl Operator for Source {
    type In = Every;
    type Out = Port<Small>;
    fn step(&mut self, _: &mut Context<'_>, _: &Every, out: &mut Port<Small>) {
        out.send([self.0; 8]);
        self.0 += 1;
    }
}

/// Makes 64 bytes from its 64 bytes of input: allocated, and part of the run's digest.
pub struct Change;
impl Operator for Change {
    type In = At<Small>;
    type Out = Port<Small>;
    fn step(&mut self, _: &mut Context<'_>, input: &At<Small>, out: &mut Port<Small>) {
        if let Some(message) = input.get() {
            out.send(changed(message));
        }
    }
}

/// Passes its input on without a copy.
pub struct Through;
impl Operator for Through {
    type In = At<Small>;
    type Out = Port<Small>;
    fn step(&mut self, _: &mut Context<'_>, input: &At<Small>, out: &mut Port<Small>) {
        if let Some(message) = input.get() {
            out.pass_on(message);
        }
    }
}

struct Sink;
impl Operator for Sink {
    type In = At<Small>;
    type Out = ();
    fn step(&mut self, _: &mut Context<'_>, input: &At<Small>, (): &mut ()) {
        if let Some(message) = input.get() {
            see(message);
        }
    }
}

/// Nanoseconds per frame of a source, `hops` operators, which add `added` in total, and a sink.
pub fn frame_ns<O>(hop: impl Fn() -> O, hops: usize, added: usize) -> f64
where
    O: Operator<In = At<Small>, Out = Port<Small>>,
{
    const FRAMES: u64 = 100_000;
    let mut graph = Graph::new();
    let mut stream = graph.add("source", Source(0), every(Span::from_us(1))).out();
    for k in 0..hops {
        stream = graph.add(format!("hop{k}"), hop(), stream).out();
    }
    graph.add("sink", Sink, stream).out();
    let until = Time::from_ns(1000 * (FRAMES as i64 - 1));
    let began = now();
    // With an observer, as in production.
    let mut events = 0_u64;
    let mut observer = |_: &Event<'_>| events += 1;
    run_virtual(graph, &RunOptions::until(until), vec![&mut observer]).expect("a sound graph");
    let ns = began.elapsed().as_nanos() as f64;
    check(FRAMES, added);
    ns / FRAMES as f64
}
