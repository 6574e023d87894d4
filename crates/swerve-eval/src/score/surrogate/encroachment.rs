//! Post-encroachment time.

use swerve_geom::{Obb, Pose2};

/// Sampled motion of a road user: instants in seconds, ascending, with its outline.
pub type Trace<'a> = &'a [(f64, Obb)];

/// Post-encroachment time, seconds (Allen, Shin, Cooper 1978): the least time between one road user leaving a place and
/// the other one entering it, over all places that both cover; zero if they touch. `None` if their paths do not cross.
///
/// Places are those of the samples: two outlines of different instants that overlap. Sampling therefore has to be dense
/// against the outlines' lengths.
pub fn post_encroachment_s(one: Trace<'_>, other: Trace<'_>) -> Option<f64> {
    let between = |(at_s, outline): &(f64, Obb)| {
        let (at_s, outline) = (*at_s, *outline);
        let overlapping = other.iter().filter(move |(_, theirs)| outline.overlaps(theirs));
        overlapping.map(move |(their_s, _)| (their_s - at_s).abs())
    };
    one.iter().flat_map(between).reduce(f64::min)
}

/// Same, at a given conflict area: from the first road user's exit to the other one's entry, seconds; zero if both are
/// inside at once. `None` if one of them does not enter, or enters but does not leave in the samples. Between two samples
/// a road user moves in a straight line with the heading of the first one.
pub fn post_encroachment_in_s(one: Trace<'_>, other: Trace<'_>, area: &Obb) -> Option<f64> {
    let (one, other) = (Stay::of(one, area)?, Stay::of(other, area)?);
    let (first, second) = if one.enter_s <= other.enter_s { (one, other) } else { (other, one) };
    Some((second.enter_s - first.leave_s?).max(0.0))
}

/// Time of a road user in an area.
struct Stay {
    enter_s: f64,
    /// Instant from which on it is outside; `None` if it is inside at the end.
    leave_s: Option<f64>,
}

impl Stay {
    /// The first stay; `None` if there is none.
    fn of(trace: Trace<'_>, area: &Obb) -> Option<Self> {
        let mut enter_s = trace.first().filter(|(_, outline)| outline.overlaps(area)).map(|(at_s, _)| *at_s);
        for pair in trace.windows(2) {
            let [(from_s, from), (to_s, to)] = pair else { continue };
            let step_s = to_s - from_s;
            if step_s <= 0.0 {
                continue;
            }
            let velocity = (to.center.point() - from.center.point()) * (1.0 / step_s);
            if enter_s.is_none() {
                let entry_s = area.time_to_contact_s(from, velocity).filter(|after_s| *after_s <= step_s);
                enter_s = entry_s.map(|after_s| from_s + after_s);
            }
            let center = Pose2::new(to.center.x_m, to.center.y_m, from.center.heading_rad);
            let end = Obb { center, ..*from };
            if let Some(enter_s) = enter_s
                && !end.overlaps(area)
            {
                // Backwards in time from the end of the step.
                let back_s = area.time_to_contact_s(&end, -velocity);
                let leave_s = back_s.map_or(*from_s, |back_s| to_s - back_s.min(step_s));
                return Some(Self { enter_s, leave_s: Some(leave_s.max(enter_s)) });
            }
        }
        enter_s.map(|enter_s| Self { enter_s, leave_s: None })
    }
}
