//! Operators: what the steps of a graph do.

use std::sync::Arc;
use std::sync::{Mutex, PoisonError};

use swerve_core::{Rng, Time};

use crate::input::{Inputs, Slot, Slots};
use crate::output::{Outputs, Port};
use crate::payload::{Outs, Payload, Sent};
use crate::promise::Workers;
use crate::wall::Alarm;

/// One component: a step from inputs to outputs, with state of its own.
///
/// A step reads no clock, no file and no global: what it needs is in its inputs, its state and its
/// context, so the same run always gives the same result.
pub trait Operator: Send + 'static {
    /// The input ports: [`At`](crate::At), [`Latest`](crate::Latest), [`Window`](crate::Window),
    /// [`Every`](crate::Every), tuples and `Vec`s of them.
    type In: Inputs;
    /// The output ports: `()`, a [`Port`] or a tuple of ports.
    type Out: Outputs;

    /// Answers one frame.
    fn step(&mut self, cx: &mut Context<'_>, input: &Self::In, out: &mut Self::Out);

    /// Answers a stamp whose deadline passed, where the reaction is [`OnDeadline`](crate::Reaction::OnDeadline).
    /// It has no access to the operator's state, which a step may be using at this moment.
    fn on_deadline(miss: &Miss<Self::Out>, out: &mut Self::Out) {
        let _ = (miss, out);
    }
}

/// What a deadline's reaction has to work with.
pub struct Miss<O: Outputs> {
    /// The stamp to be answered.
    pub stamp: Time,
    /// The present instant.
    pub now: Time,
    /// The stamp of the newest finished result.
    pub last_stamp: Option<Time>,
    /// The newest finished result, by port.
    pub last: O::Values,
    /// What the running step offered last, by port.
    pub offered: O::Values,
}

/// Whether an anytime step goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is time for more.
    Continue,
    /// The budget is used up: publish what there is.
    Stop,
}

/// What a step knows besides its inputs.
pub struct Context<'a> {
    pub(crate) name: &'a str,
    pub(crate) task: &'a mut Task,
}

/// What a step needs to run beside its inputs, on whatever thread, and what it leaves behind beside its outputs.
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

/// What few steps leave behind.
#[derive(Default)]
pub(crate) struct Unusual {
    /// The run is to end: why.
    pub(crate) stop_run: Option<String>,
    /// A step that another process took did not come to its end: why.
    pub(crate) lost: Option<String>,
    /// It was the first one after its process was restarted.
    pub(crate) restarted: bool,
}

impl Task {
    /// A task that nothing cuts.
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

/// Counts the work of a step.
#[derive(Default)]
pub(crate) struct Meter {
    /// Units counted so far.
    pub(crate) units: u64,
    /// What cuts the step; none where nothing can.
    pub(crate) cut: Option<Box<Cut>>,
}

/// What cuts a step before its own end, and what it offers for that case.
#[derive(Default)]
pub(crate) struct Cut {
    /// The count at which the step is told to stop.
    pub(crate) limit: Option<u64>,
    /// The count at which the step was told to stop.
    pub(crate) stopped_at: Option<u64>,
    /// The step went on after it had been told to stop.
    pub(crate) went_on: bool,
    /// How many values were offered so far.
    pub(crate) offers: u64,
    /// How many of them count, where an earlier run is repeated.
    pub(crate) offers_max: Option<u64>,
    /// Where offered values go; none if nobody would read them.
    pub(crate) offered: Option<Offered>,
    /// Says whether the time is out, under wall clock.
    pub(crate) time_is_out: Option<Alarm>,
}

/// The last offered values and how many there were, shared with the engine while the step runs.
pub(crate) type Offered = Arc<Mutex<(u64, Outs)>>;

impl Context<'_> {
    /// The present instant: when the step starts.
    pub fn now(&self) -> Time {
        self.task.now
    }

    /// The instant that the frame describes.
    pub fn stamp(&self) -> Time {
        self.task.stamp
    }

    /// When this stamp has to be answered.
    pub fn deadline(&self) -> Option<Time> {
        self.task.deadline
    }

    /// The operator's name in the graph.
    pub fn name(&self) -> &str {
        self.name
    }

    /// Who may go on with this step's work while the run goes on; none on one thread, on a thread of theirs, under wall
    /// clock, and where the run time is what the step takes on this host.
    pub fn workers(&self) -> Option<&Workers> {
        self.task.workers.as_ref()
    }

    /// Random numbers of this operator and stamp, under the run's seed.
    pub fn rng(&mut self) -> &mut Rng {
        let Task { stamp, seed, rng, .. } = &mut *self.task;
        rng.get_or_insert_with(|| Rng::keyed(*seed, self.name, &[stamp.ns()]))
    }

    /// Counts `units` of work done; says whether there is time for more.
    ///
    /// Under [`Work`](crate::RuntimeModel::Work) the step is told to stop at the last count that ends by the
    /// deadline. A step that returns then ends at its deadline at the latest; one that goes on all the
    /// same takes as long as it counts.
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

    /// Offers the best result so far: what a deadline's reaction gets if the step is late.
    ///
    /// Counts only where a step can be cut (under the work model, or under wall clock) and the reaction
    /// would read it.
    pub fn offer<T: Payload>(&mut self, port: &mut Port<T>, value: T) {
        self.offer_shared(port, Arc::new(value));
    }

    /// As [`offer`](Self::offer), for a payload that exists already.
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

    /// Ends the run after the sweep of the instant at which this step is done.
    pub fn stop_run(&mut self, reason: impl Into<String>) {
        self.task.unusual.get_or_insert_default().stop_run = Some(reason.into());
    }
}

/// An operator with its types erased.
pub(crate) trait Body: Send {
    /// Runs one step on `slots`, filling `outs`.
    fn step(&mut self, cx: &mut Context<'_>, slots: &mut [Slot], outs: &mut Outs);
}

/// The facts of a missed deadline, with types erased.
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
