//! The answers of a turn, and the remains of a step that was not in time.

use std::sync::PoisonError;

use swerve_core::Time;

use crate::operator::Offered;
use crate::sent::Outs;

/// Data published for a stamp, besides the payloads.
pub(super) struct Answer<'a> {
    pub(super) stamp: Time,
    pub(super) reused_from: Option<Time>,
    pub(super) origin: Option<Time>,
    pub(super) reads: &'a [Option<Time>],
}

/// A finished result.
#[derive(Clone)]
pub(crate) struct Finished {
    pub(crate) stamp: Time,
    pub(crate) origin: Option<Time>,
    pub(crate) reads: Vec<Option<Time>>,
    pub(crate) outs: Outs,
}

/// A step that has reached its modelled end.
pub(super) struct Ended {
    pub(super) stamp: Time,
    pub(super) start: Time,
    pub(super) end: Time,
    pub(super) late: bool,
}

/// A frame whose deadline was missed.
pub(super) struct Missed {
    pub(super) stamp: Time,
    pub(super) deadline: Time,
    pub(super) started: bool,
}

/// Results so far of the step of a missed deadline.
#[derive(Default)]
pub(super) struct Step {
    /// The step's own result, if it was only waiting for an older one.
    pub(super) own: Option<Finished>,
    /// Number of values that it offered, and the last one per port.
    pub(super) offered: Option<(u64, Outs)>,
    pub(super) origin: Option<Time>,
    pub(super) reads: Vec<Option<Time>>,
}

/// Copies the number of values offered so far and the last ones.
pub(super) fn snapshot(offered: &Offered) -> (u64, Outs) {
    offered.lock().unwrap_or_else(PoisonError::into_inner).clone()
}
