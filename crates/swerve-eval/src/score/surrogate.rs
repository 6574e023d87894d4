//! Surrogate safety measures of two road users: time to collision, post-encroachment time, RSS distances, worst time to
//! collision.
//!
//! Road users are oriented rectangles on the ground ([`Moving`]). Where there is no contact, the result is `None`.

mod encroachment;
mod rss;
#[cfg(test)]
mod tests;

use swerve_geom::{Obb, Vector2};

pub use encroachment::{Trace, post_encroachment_in_s, post_encroachment_s};
pub use rss::{RssGap, RssParams};

/// A road user at one instant.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Moving {
    /// Outline.
    pub outline: Obb,
    /// Velocity in the map frame, m/s.
    pub velocity_mps: Vector2,
}

impl Moving {
    /// Velocity of another road user relative to this one.
    fn relative_mps(&self, other: &Self) -> Vector2 {
        other.velocity_mps - self.velocity_mps
    }
}

/// Time until the outlines touch if both keep velocity and heading, seconds (Hayward 1972); zero in contact.
pub fn time_to_collision_s(one: &Moving, other: &Moving) -> Option<f64> {
    one.outline.time_to_contact_s(&other.outline, one.relative_mps(other))
}

/// Time until a gap along a lane is closed, seconds: the gap, the speed at which it closes and the acceleration of that
/// speed, both positive if the gap shrinks. This is the time to collision at constant accelerations (CommonRoad-CriMe's
/// `TTC`, not rounded).
pub fn time_to_close_s(gap_m: f64, closing_mps: f64, closing_mps2: f64) -> Option<f64> {
    if gap_m <= 0.0 {
        return Some(0.0);
    }
    let root = closing_mps * closing_mps + 2.0 * closing_mps2 * gap_m;
    if root < 0.0 {
        return None;
    }
    // The form of the solution without cancellation.
    let sum = closing_mps + root.sqrt();
    (sum > 0.0).then(|| 2.0 * gap_m / sum)
}

/// Worst time to collision, seconds (Wachenfeld, Junietz, Wenzel, Winner 2016): until the earliest contact that is
/// possible if each road user accelerates in any direction, by up to `accel_mps2` of its own. Outlines are their
/// circumscribed circles, because a swerving vehicle turns. `None` if no contact is possible: without acceleration, on
/// courses that do not meet.
pub fn worst_time_to_collision_s(one: &Moving, other: &Moving, accel_mps2: [f64; 2]) -> Option<f64> {
    let between = other.outline.center.point() - one.outline.center.point();
    let relative = one.relative_mps(other);
    let reach_m = one.outline.radius() + other.outline.radius();
    let accel = accel_mps2[0].max(0.0) + accel_mps2[1].max(0.0);
    let gap_m = |t: f64| (between + relative * t).norm() - reach_m - 0.5 * accel * t * t;
    let speed = relative.norm();
    let mut at_s = 0.0;
    // The gap shrinks at most by the closing speed and the growth of the reach. A step that would close it at that rate
    // never passes the first contact.
    for _ in 0..STEPS_MAX {
        let left_m = gap_m(at_s);
        if left_m <= CONTACT_M {
            return Some(at_s);
        }
        at_s += time_to_close_s(left_m, speed + accel * at_s, accel)?;
        if !at_s.is_finite() || at_s > HORIZON_S {
            return None;
        }
    }
    // So near to a contact that steps are tiny, or passing without one.
    (accel > 0.0).then_some(at_s)
}

/// Gap taken as contact, metres.
const CONTACT_M: f64 = 1e-9;
/// Maximum number of steps towards the contact.
const STEPS_MAX: usize = 10_000;
/// Time beyond which there is no contact, seconds.
const HORIZON_S: f64 = 1e6;
