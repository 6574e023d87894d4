//! Wall clock: the same sweep, at instants given by the real clock, the sources and the workers.

use std::sync::Arc;

use swerve_core::{Span, Time};

use crate::alarm::Pace;
use crate::decision::Decision;
use crate::engine::Engine;
use crate::graph::Graph;
use crate::inbox::{Inbox, Wake};
use crate::observer::Observer;
use crate::options::RunOptions;
use crate::report::{EndReason, RunError, RunReport};
use crate::simulated_time::SimulatedTime;

/// Runs a graph against the real clock. Its sources are fed through their handles; steps of heavy operators run on
/// worker threads, all others on this one.
///
/// A step takes its actual duration, and at least the run time of its model; a step without run time that is not heavy
/// takes zero time. Observers receive everything that the inputs do not determine as [`Decision`]s, with which
/// [`run_replay`](crate::run_replay) repeats the run.
///
/// # Errors
/// As for [`run_virtual`](crate::run_virtual), and if the system cannot start a worker thread.
pub fn run_wall(
    graph: Graph,
    options: &RunOptions,
    observers: Vec<&mut dyn Observer>,
) -> Result<RunReport, RunError> {
    run_by(graph, options, observers, Pace::begin())
}

/// As [`run_wall`], against simulated time that another program publishes, instead of the real clock.
///
/// A step takes the simulated time that passes while it is executed: none while the clock stands still. Instants are
/// executed as soon as the clock reaches or passes them, several at once if it advances in large increments.
///
/// # Errors
/// As for [`run_wall`].
pub fn run_paced(
    graph: Graph,
    options: &RunOptions,
    observers: Vec<&mut dyn Observer>,
    clock: &SimulatedTime,
) -> Result<RunReport, RunError> {
    clock.wakes(graph.inbox.clone());
    run_by(graph, options, observers, Pace::Simulated(clock.clone()))
}

fn run_by(
    graph: Graph,
    options: &RunOptions,
    observers: Vec<&mut dyn Observer>,
    pace: Pace,
) -> Result<RunReport, RunError> {
    let inbox = graph.inbox.clone();
    let bell = inbox.clone();
    let doorbell = Arc::new(move || bell.ring());
    let mut engine = Engine::new(graph, options, None, observers, Some((pace.clone(), doorbell as _)))?;
    engine.decide(|| Decision::Begin { wall_clock: true });
    let end = pursue(&mut engine, options.until.unwrap_or(Time::MAX), &pace, &inbox);
    inbox.close();
    let at = engine.now();
    engine.decide(|| Decision::End { at });
    engine.finish(end)
}

fn pursue(engine: &mut Engine<'_>, until: Time, pace: &Pace, inbox: &Inbox) -> EndReason {
    engine.wake_all();
    engine.sweep(Time::ZERO);
    while !engine.is_over() {
        let due = engine.next_due();
        if due == Time::MAX && engine.is_idle() {
            return EndReason::Idle;
        }
        // The run lasts until its end has passed on the real clock as well.
        let limit = due.min(until.saturating_add(Span::from_ns(1)));
        match inbox.wait(pace, limit) {
            Wake::Stop => return EndReason::Interrupted,
            Wake::Due if due > until => return EndReason::Until,
            Wake::Due => engine.sweep(due),
            Wake::Reports(arrivals, at) => {
                // Two sweeps never share an instant, so that a replay settles each in one sweep.
                let now = at.max(engine.now().saturating_add(Span::from_ns(1)));
                engine.take_reports(arrivals, now);
                engine.sweep(now);
            }
        }
    }
    EndReason::Until
}
