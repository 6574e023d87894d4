//! What a turn answers with, and what is left of a step that did not come in time.

use std::sync::PoisonError;

use swerve_core::Time;

use super::node::Finished;
use crate::operator::Offered;
use crate::payload::Outs;

/// What is published for a stamp, beside the payloads.
pub(super) struct Answer<'a> {
    pub(super) stamp: Time,
    pub(super) reused_from: Option<Time>,
    pub(super) origin: Option<Time>,
    pub(super) reads: &'a [Option<Time>],
}

/// A step whose modelled end has come.
pub(super) struct Ended {
    pub(super) stamp: Time,
    pub(super) start: Time,
    pub(super) end: Time,
    pub(super) late: bool,
}

/// A frame whose deadline has passed.
pub(super) struct Missed {
    pub(super) stamp: Time,
    pub(super) deadline: Time,
    pub(super) started: bool,
}

/// What the step of a missed deadline has so far.
#[derive(Default)]
pub(super) struct Step {
    /// Its own result, where it only waited for an older one.
    pub(super) own: Option<Finished>,
    /// How many values it offered, and the last.
    pub(super) offered: Option<(u64, Outs)>,
    pub(super) origin: Option<Time>,
    pub(super) reads: Vec<Option<Time>>,
}

/// What a running step offered so far: how many values, and the last.
pub(super) fn snapshot(offered: &Offered) -> (u64, Outs) {
    offered.lock().unwrap_or_else(PoisonError::into_inner).clone()
}
