//! Operators that take the finest of several implementations that fits the time left.

use swerve_core::Span;
use swerve_flow::{Context, RuntimeModel};
use swerve_msg::RungTaken;

use crate::config::model::Rung;

/// Duration of a unit of work of an operator on a ladder.
const UNIT_NS: i64 = 1000;

/// Run-time model of an operator on a ladder: the run time of its rung.
pub(super) fn on_ladder() -> RuntimeModel {
    RuntimeModel::Work { base: Span::ZERO, per_unit_ns: UNIT_NS as f64 }
}

/// Takes the finest rung that meets the deadline, the fastest if none does, and spends its time.
pub(super) fn take<'a, T>(rungs: &'a mut [Rung<T>], cx: &mut Context<'_>) -> (&'a mut T, RungTaken) {
    let left = cx.deadline().map(|deadline| deadline - cx.now());
    let fits = rungs.iter().rposition(|rung| left.is_none_or(|left| rung.run_time <= left)).unwrap_or(0);
    let Rung { name, run_time, what } = &mut rungs[fits];
    // In two parts, so that a rung that does not fit is late rather than cut.
    let units = run_time.ns().unsigned_abs().div_ceil(UNIT_NS.unsigned_abs());
    cx.spend(units.saturating_sub(1));
    cx.spend(1);
    let taken = RungTaken { stamp: cx.stamp(), rung: name.clone(), run_time: *run_time, left };
    (what, taken)
}
