//! Plan changes that a figure shows.

use swerve_core::Span;

use super::record::{PlanMark, Story};
use super::view::View;

/// Minimum time between drawn plan changes. An earlier change counts to the last one drawn, unless a path was found or
/// lost.
const SETTLED: Span = Span::from_ms(250);
/// Maximum number of plans drawn; more cannot be distinguished.
const PLANS_MAX: usize = 9;
/// An ego that has moved less than this since the last drawn plan is considered stationary, metres.
pub(super) const MOVED_M: f64 = 0.3;

/// Plan changes within the view.
pub(super) struct Changes<'a> {
    /// Drawn changes, in order of time.
    pub(super) shown: Vec<&'a PlanMark>,
    /// Number of further changes, each soon after a drawn one.
    pub(super) left_out: usize,
}

/// Plan changes within the view that a reader can distinguish.
pub(super) fn changes<'a>(story: &'a Story, view: &View) -> Changes<'a> {
    let (from, to) = view.span;
    // The first plan is not a change.
    let marks = story.plans.iter().skip(1);
    let inside: Vec<&PlanMark> = marks.filter(|mark| mark.at >= from && mark.at <= to).collect();
    let mut gap = SETTLED;
    loop {
        // If paths are found and lost many times over, these changes are thinned as well.
        let shown = settled(story, &inside, gap, gap == SETTLED);
        if shown.len() <= PLANS_MAX {
            return Changes { left_out: inside.len() - shown.len(), shown };
        }
        gap = gap * 2;
    }
}

fn settled<'a>(story: &Story, marks: &[&'a PlanMark], gap: Span, found_or_lost: bool) -> Vec<&'a PlanMark> {
    let place = |mark: &PlanMark| story.ego_at(mark.at).map(|ego| ego.pose.point());
    let stands = |a, b| place(a).zip(place(b)).is_some_and(|(a, b)| a.distance(b) < MOVED_M);
    let mut shown: Vec<&PlanMark> = Vec::new();
    for mark in marks {
        let is_fallback = |mark: &PlanMark| mark.plan.status.is_fallback();
        let is_next = shown.last().is_none_or(|last| {
            (mark.at - last.at >= gap && !stands(mark, last))
                || (found_or_lost && is_fallback(mark) != is_fallback(last))
        });
        if is_next {
            shown.push(mark);
        }
    }
    shown
}
