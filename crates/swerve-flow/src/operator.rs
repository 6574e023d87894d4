//! Operators: the computations of a graph.

use core::any::Any;
use core::panic::AssertUnwindSafe;
use std::panic::catch_unwind;
use std::sync::{Arc, Mutex, PoisonError};

use swerve_core::{Rng, Time};

use crate::alarm::Alarm;
use crate::input::{Inputs, Slot, Slots};
use crate::output::{Outputs, Port};
use crate::payload::Payload;
use crate::promise::Workers;
use crate::sent::{Outs, Sent};

/// A component with state, whose step computes outputs from inputs.
///
/// A step reads no clock, no file and no global: it depends on its inputs, its state and its context alone, so the same
/// run always has the same result.
pub trait Operator: Send + 'static {
    /// Input ports: [`At`](crate::At), [`Latest`](crate::Latest), [`Window`](crate::Window), [`Every`](crate::Every),
    /// tuples and `Vec`s of them.
    type In: Inputs;
    /// Output ports: `()`, a [`Port`] or a tuple of ports.
    type Out: Outputs;

    /// Answers one frame.
    fn step(&mut self, cx: &mut Context<'_>, input: &Self::In, out: &mut Self::Out);

    /// Answers a stamp whose deadline was missed, if the reaction is [`OnDeadline`](crate::Reaction::OnDeadline). The
    /// function has no access to the operator's state, which a step may be using at this moment.
    fn on_deadline(miss: &Miss<Self::Out>, out: &mut Self::Out) {
        let _ = (miss, out);
    }
}

/// Inputs of a deadline's reaction.
pub struct Miss<O: Outputs> {
    /// Stamp to be answered.
    pub stamp: Time,
    /// Current instant.
    pub now: Time,
    /// Stamp of the newest finished result.
    pub last_stamp: Option<Time>,
    /// Newest finished result, by port.
    pub last: O::Values,
    /// Last values offered by the running step, by port.
    pub offered: O::Values,
}

/// Continuation of an anytime step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is time for more work.
    Continue,
    /// The budget is exhausted: publish the best result so far.
    Stop,
}

/// Context of a step: its data besides the inputs.
pub struct Context<'a> {
    pub(crate) name: &'a str,
    pub(crate) task: &'a mut Task,
}

/// Data of a step besides its inputs, on whatever thread it runs, and its results besides the outputs.
pub(crate) struct Task {
    pub(crate) now: Time,
    pub(crate) stamp: Time,
    pub(crate) deadline: Option<Time>,
    pub(crate) seed: u64,
    pub(crate) rng: Option<Rng>,
    pub(crate) meter: Meter,
    pub(crate) workers: Option<Workers>,
    pub(crate) unusual: Option<Box<Unusual>>,
}

/// Rare results of a step.
#[derive(Default)]
pub(crate) struct Unusual {
    /// Reason to end the run.
    pub(crate) stop_run: Option<String>,
    /// Reason why a step did not complete, in another process or for want of something outside.
    pub(crate) lost: Option<String>,
    /// True if the step was the first one after its process was restarted.
    pub(crate) restarted: bool,
}

impl Task {
    /// Creates a task that is never cut short.
    #[inline]
    pub(crate) fn new(now: Time, stamp: Time, seed: u64) -> Self {
        Self {
            now,
            stamp,
            deadline: None,
            seed,
            rng: None,
            meter: Meter::default(),
            workers: None,
            unusual: None,
        }
    }
}

/// Counter of the work of a step.
#[derive(Default)]
pub(crate) struct Meter {
    /// Units counted so far.
    pub(crate) units: u64,
    /// Limits of a step that can be cut short.
    pub(crate) cut: Option<Box<Cut>>,
}

/// Limits that cut a step short, and the values that it offers for that case.
#[derive(Default)]
pub(crate) struct Cut {
    /// Count at which the step is requested to stop.
    pub(crate) limit: Option<u64>,
    /// Count at which the step was requested to stop.
    pub(crate) stopped_at: Option<u64>,
    /// True if the step continued after the request to stop.
    pub(crate) went_on: bool,
    /// Number of values offered so far.
    pub(crate) offers: u64,
    /// Number of offers that count, if an earlier run is repeated.
    pub(crate) offers_max: Option<u64>,
    /// Storage of offered values; `None` if no reaction would read them.
    pub(crate) offered: Option<Offered>,
    /// Alarm at the deadline, under wall clock.
    pub(crate) time_is_out: Option<Alarm>,
}

/// Number of offers and the last offered values, shared with the engine while the step runs.
pub(crate) type Offered = Arc<Mutex<(u64, Outs)>>;

impl Context<'_> {
    /// Current instant: the start of the step.
    pub fn now(&self) -> Time {
        self.task.now
    }

    /// Instant that the frame describes.
    pub fn stamp(&self) -> Time {
        self.task.stamp
    }

    /// Instant by which this stamp has to be answered.
    pub fn deadline(&self) -> Option<Time> {
        self.task.deadline
    }

    /// Name of the operator in the graph.
    pub fn name(&self) -> &str {
        self.name
    }

    /// Threads that can continue this step's work while the run goes on. `None` in a run with one thread, on one of
    /// these threads, under wall clock, and if the run time of the step is measured on this host.
    pub fn workers(&self) -> Option<&Workers> {
        self.task.workers.as_ref()
    }

    /// Random number generator of this operator and stamp, seeded by the run.
    pub fn rng(&mut self) -> &mut Rng {
        let Task { stamp, seed, rng, .. } = &mut *self.task;
        rng.get_or_insert_with(|| Rng::keyed(*seed, self.name, &[stamp.ns()]))
    }

    /// Counts `units` of completed work; returns whether there is time for more.
    ///
    /// Under [`Work`](crate::RuntimeModel::Work) the step is requested to stop at the last count that ends by the
    /// deadline. A step that then returns ends at its deadline at the latest; one that continues takes as long as it
    /// counts.
    pub fn spend(&mut self, units: u64) -> Progress {
        let meter = &mut self.task.meter;
        meter.units = meter.units.saturating_add(units);
        let Some(cut) = &mut meter.cut else { return Progress::Continue };
        if cut.stopped_at.is_some() {
            cut.went_on |= units > 0;
            return Progress::Stop;
        }
        let at_limit = cut.limit.is_some_and(|limit| meter.units >= limit);
        if at_limit || cut.time_is_out.as_ref().is_some_and(Alarm::is_out) {
            cut.stopped_at = Some(meter.units);
            return Progress::Stop;
        }
        Progress::Continue
    }

    /// Executes a part of the step that counts no work and is not cut short.
    pub(crate) fn unmetered<R>(&mut self, part: impl FnOnce(&mut Self) -> R) -> R {
        let meter = core::mem::take(&mut self.task.meter);
        let result = part(self);
        self.task.meter = meter;
        result
    }

    /// Offers the best result so far, which a deadline's reaction receives if the step is late.
    ///
    /// Has an effect only if the step can be cut short (under the work model, or under wall clock) and the reaction
    /// reads offers.
    pub fn offer<T: Payload>(&mut self, port: &mut Port<T>, value: T) {
        self.offer_shared(port, Arc::new(value));
    }

    /// As [`offer`](Self::offer), for an existing payload.
    pub fn offer_shared<T: Payload>(&mut self, port: &mut Port<T>, value: Arc<T>) {
        let Some(cut) = &mut self.task.meter.cut else { return };
        let Some(offered) = &cut.offered else { return };
        if cut.went_on || cut.offers_max.is_some_and(|max| cut.offers >= max) {
            return;
        }
        cut.offers += 1;
        let mut slot = offered.lock().unwrap_or_else(PoisonError::into_inner);
        slot.0 = cut.offers;
        slot.1.set(port.index, Sent::new(value));
    }

    /// Ends the run after the sweep of the instant at which this step ends.
    pub fn stop_run(&mut self, reason: impl Into<String>) {
        self.task.unusual.get_or_insert_default().stop_run = Some(reason.into());
    }

    /// Ends the run with an error: the step has no result, because something outside of the program has failed.
    pub fn fail_run(&mut self, why: impl Into<String>) {
        self.task.unusual.get_or_insert_default().lost = Some(why.into());
    }
}

/// An operator with its types erased.
pub(crate) trait Body: Send {
    /// Executes one step on `slots` and fills `outs`.
    fn step(&mut self, cx: &mut Context<'_>, slots: &mut [Slot], outs: &mut Outs);
}

/// Data of a missed deadline, with types erased.
pub(crate) struct ErasedMiss<'a> {
    pub(crate) stamp: Time,
    pub(crate) now: Time,
    pub(crate) last: Option<(Time, &'a Outs)>,
    pub(crate) offered: Option<&'a Outs>,
}

/// [`Operator::on_deadline`] with its types erased.
pub(crate) type OnDeadline = fn(&ErasedMiss<'_>, &mut Outs);

pub(crate) struct Typed<O: Operator> {
    operator: O,
    layout: <O::In as Inputs>::Layout,
    out: O::Out,
}

impl<O: Operator> Typed<O> {
    pub(crate) fn new(operator: O, layout: <O::In as Inputs>::Layout) -> Self {
        Self { operator, layout, out: O::Out::fresh(0) }
    }
}

impl<O: Operator> Body for Typed<O> {
    fn step(&mut self, cx: &mut Context<'_>, slots: &mut [Slot], outs: &mut Outs) {
        let input = O::In::read(&self.layout, &mut Slots(slots.iter_mut()));
        self.operator.step(cx, &input, &mut self.out);
        self.out.take(outs);
    }
}

pub(crate) fn on_deadline<O: Operator>(miss: &ErasedMiss<'_>, outs: &mut Outs) {
    let miss = Miss {
        stamp: miss.stamp,
        now: miss.now,
        last_stamp: miss.last.map(|(stamp, _)| stamp),
        last: O::Out::values(miss.last.map(|(_, outs)| outs), 0),
        offered: O::Out::values(miss.offered, 0),
    };
    let mut out = O::Out::fresh(0);
    O::on_deadline(&miss, &mut out);
    out.take(outs);
}

/// Calls the operator's step; returns its panic message, if it panicked.
#[inline]
pub(crate) fn run_step(
    body: &mut dyn Body,
    name: &str,
    task: &mut Task,
    slots: &mut [Slot],
    outs: &mut Outs,
) -> Option<Box<str>> {
    let mut cx = Context { name, task };
    let result = catch_unwind(AssertUnwindSafe(|| body.step(&mut cx, slots, outs)));
    result.err().map(|panic| said(&*panic).into())
}

/// Message of a panic.
pub(crate) fn said(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_string());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}
