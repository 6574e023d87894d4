//! What a planner is given.

use swerve_core::Time;
use swerve_msg::{EgoState, Plan, Prediction, Route};
use swerve_vehicle::{Limits, Shape};

/// Everything a planner may know.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// Stamp of the predictions; becomes the plan's.
    pub stamp: Time,
    /// Where the plan starts: measured at the stamp, or moved on by the expected run time; its `stamp`
    /// is the instant at which the plan begins.
    pub start: EgoState,
    /// Where to go and what ground may be used.
    pub route: &'a Route,
    /// Speed to hold when nothing is in the way, m/s.
    pub target_speed_mps: f64,
    /// What moves where, ordered by identity.
    pub predictions: &'a [Prediction],
    /// Outline of the ego.
    pub shape: &'a Shape,
    /// What the ego can do.
    pub limits: &'a Limits,
    /// The newest plan made before this one.
    pub previous: Option<&'a Plan>,
    /// Seed of this call's random numbers.
    pub seed: u64,
}

/// Whether a step may go on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Goes {
    /// There is budget left.
    On,
    /// The budget is used up: return the best so far.
    Stop,
}

/// Counts a planner's work and says when to stop.
pub trait Budget {
    /// Accounts for `units` of work about to be done.
    fn spend(&mut self, units: u64) -> Goes;
}

/// Never stops; counts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Unlimited {
    /// Units spent so far.
    pub spent: u64,
}

impl Budget for Unlimited {
    fn spend(&mut self, units: u64) -> Goes {
        self.spent += units;
        Goes::On
    }
}

/// Counts what a planner spends, and never asks again once told to stop.
pub(crate) struct Counted<'a> {
    inner: &'a mut dyn Budget,
    pub(crate) spent: u64,
    pub(crate) stopped: bool,
}

impl<'a> Counted<'a> {
    pub(crate) fn new(inner: &'a mut dyn Budget) -> Self {
        Self { inner, spent: 0, stopped: false }
    }
}

impl Budget for Counted<'_> {
    fn spend(&mut self, units: u64) -> Goes {
        if self.stopped {
            return Goes::Stop;
        }
        self.spent += units;
        let goes = self.inner.spend(units);
        self.stopped = goes == Goes::Stop;
        goes
    }
}

/// A motion planner.
pub trait Planner: Send {
    /// Plans once. The plan's `work` is the number of units spent.
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan;
}
