//! Ladders: variants of an operator with known run times, of which a step takes the one that fits its deadline.

use swerve_core::{Span, Time};

use crate::input::{Inputs, Slot, Slots};
use crate::operator::{Body, Context, Operator};
use crate::output::{Declaration, Outputs, Port};
use crate::payload::Payload;
use crate::runtime::UNIT_NS;
use crate::sent::Outs;

/// Variants of an operator, of which each step takes the finest that meets the deadline, and the fastest if none does.
///
/// A step that publishes nothing takes no time. Under [`on_deadline`](Operator::on_deadline) there are no offers.
pub struct Ladder<O, T> {
    /// Run time and operator of each rung, the fastest first; at least one.
    pub rungs: Vec<(Span, O)>,
    /// True if the rungs set the run time of a step; it is then not cut short, and units that it counts are ignored.
    pub sets_run_time: bool,
    /// Carries the state from the rung of the step before to that of this step.
    pub carry: fn(&mut O, &mut O),
    /// Name of the output for the reports.
    pub output: &'static str,
    /// Report of a step that published something.
    pub report: Box<dyn FnMut(Taken) -> Option<T> + Send>,
}

/// A step on a ladder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Taken {
    /// Position of the rung.
    pub rung: usize,
    /// Stamp of the step.
    pub stamp: Time,
    /// Time from the start of the step to its deadline.
    pub left: Option<Span>,
}

/// An operator on a ladder, with its types erased.
pub(crate) struct OnLadder<O: Operator, T> {
    ladder: Ladder<O, T>,
    layout: <O::In as Inputs>::Layout,
    out: O::Out,
    reports: Port<T>,
    /// Rung of the step before.
    rung: usize,
}

impl<O: Operator, T: Payload> OnLadder<O, T> {
    /// Declares the output for the reports after the operator's own.
    pub(crate) fn new(
        ladder: Ladder<O, T>,
        layout: <O::In as Inputs>::Layout,
        streams: &mut Declaration,
    ) -> Self {
        let reports = Port::fresh(streams.types.len());
        streams.stream::<T>(Some(ladder.output));
        Self { ladder, layout, out: O::Out::fresh(0), reports, rung: 0 }
    }
}

impl<O, T> Ladder<O, T> {
    /// Goes from a rung to the finest one that ends within the time left: its run time and operator.
    fn climb(&mut self, rung: &mut usize, left: Option<Span>) -> (Span, &mut O) {
        let fits = |(run_time, _): &(Span, O)| left.is_none_or(|left| *run_time <= left);
        let before = core::mem::replace(rung, self.rungs.iter().rposition(fits).unwrap_or(0));
        if let Ok([(_, from), (_, to)]) = self.rungs.get_disjoint_mut([before, *rung]) {
            (self.carry)(from, to);
        }
        let (run_time, operator) = &mut self.rungs[*rung];
        (*run_time, operator)
    }
}

impl<O: Operator, T: Payload> Body for OnLadder<O, T> {
    fn step(&mut self, cx: &mut Context<'_>, slots: &mut [Slot], outs: &mut Outs) {
        let Self { ladder, layout, out, reports, rung } = self;
        let sets_run_time = ladder.sets_run_time;
        let left = cx.deadline().map(|deadline| deadline - cx.now());
        let input = O::In::read(layout, &mut Slots(slots.iter_mut()));
        let (run_time, operator) = ladder.climb(rung, left);
        match sets_run_time {
            true => cx.unmetered(|cx| operator.step(cx, &input, out)),
            false => operator.step(cx, &input, out),
        }
        out.take(outs);
        if outs.is_empty() {
            return;
        }
        if sets_run_time {
            spend(cx, run_time);
        }
        if let Some(report) = (ladder.report)(Taken { rung: *rung, stamp: cx.stamp(), left }) {
            reports.send(report);
            reports.take(outs);
        }
    }
}

/// Spends the run time of a rung, in two parts: a step on a rung that does not fit is late rather than cut.
fn spend(cx: &mut Context<'_>, run_time: Span) {
    let units = run_time.ns().unsigned_abs().div_ceil(UNIT_NS);
    cx.spend(units.saturating_sub(1));
    cx.spend(1);
}
