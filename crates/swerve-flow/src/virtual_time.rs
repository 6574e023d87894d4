//! Virtual time: the clock jumps from one due instant to the next.

use swerve_core::Time;

use crate::decision::Replay;
use crate::engine::Engine;
use crate::graph::Graph;
use crate::inbox::Inbox;
use crate::observer::Observer;
use crate::options::RunOptions;
use crate::report::{EndReason, RunError, RunReport};

/// Runs a graph in virtual time. The result is a function of the graph and the seed alone, unless the run is stopped by
/// its [`StopHandle`](crate::StopHandle).
///
/// # Errors
/// If the graph has an error, an operator panics, or a queue with policy `fail` overflows; observers have received all
/// events before it.
pub fn run_virtual(
    graph: Graph,
    options: &RunOptions,
    observers: Vec<&mut dyn Observer>,
) -> Result<RunReport, RunError> {
    let inbox = graph.inbox.clone();
    run(Engine::new(graph, options, None, observers, None)?, options.until, &inbox)
}

/// Repeats a wall-clock run in virtual time: run times, stops and offers follow its decision records. Its sources have
/// to be replaced by their recorded publications ([`Graph::playback`]).
///
/// # Errors
/// As for [`run_virtual`].
pub fn run_replay(
    graph: Graph,
    options: &RunOptions,
    replay: Replay,
    observers: Vec<&mut dyn Observer>,
) -> Result<RunReport, RunError> {
    let until = replay.end().or(options.until);
    let inbox = graph.inbox.clone();
    run(Engine::new(graph, options, Some(replay), observers, None)?, until, &inbox)
}

fn run(engine: Engine<'_>, until: Option<Time>, inbox: &Inbox) -> Result<RunReport, RunError> {
    let until = until.unwrap_or(Time::MAX);
    match engine.workers() {
        Some(pool) => pool.install(|| go_on(engine, until, inbox)),
        None => go_on(engine, until, inbox),
    }
}

fn go_on(mut engine: Engine<'_>, until: Time, inbox: &Inbox) -> Result<RunReport, RunError> {
    engine.wake_all();
    engine.sweep(Time::ZERO);
    while !engine.is_over() {
        if inbox.is_stopped() {
            return engine.finish(EndReason::Interrupted);
        }
        let next = engine.next_due();
        if next == Time::MAX {
            return engine.finish(EndReason::Idle);
        }
        if next > until {
            return engine.finish(EndReason::Until);
        }
        engine.sweep(next);
    }
    engine.finish(EndReason::Until)
}
