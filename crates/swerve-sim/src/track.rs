//! Recorded motion: linear between the poses of a track, headings by the short way.
//!
//! An absent road user is parked far from all roads, one beside the other, and left out of the states of the world.

use swerve_geom::{Pose2, Vector2, angle_between};
use swerve_msg::ActorId;
use swerve_scenario::Track;
use swerve_world::Movement;

/// Coordinate y of parked road users, metres: beyond the places that scenarios can have.
const PARK_Y_M: f64 = 200_000.0;

/// Distance between parked road users, metres.
const PARK_STEP_M: f64 = 100.0;

/// True for road users that are absent.
pub(crate) fn is_parked(pose: Pose2) -> bool {
    pose.y_m == PARK_Y_M
}

/// A track that is played.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Played {
    id: ActorId,
    track: Track,
}

impl Played {
    pub(crate) fn new(id: ActorId, track: &Track) -> Self {
        Self { id, track: track.clone() }
    }

    /// True if it is absent for good, and was so a step ago.
    pub(crate) fn is_over(&self, after_s: f64) -> bool {
        after_s > self.track.from_s + (self.track.poses.len() as f64 + 1.0) * self.track.step_s
    }

    /// The recording.
    pub(crate) fn track(&self) -> &Track {
        &self.track
    }

    /// Place among the poses at a time since the start of the run: 2.5 is the middle between the third and the fourth.
    pub(crate) fn place(&self, after_s: f64) -> f64 {
        // Half a nanosecond: stamps are whole ones.
        (after_s - self.track.from_s + 5e-10) / self.track.step_s
    }

    /// Movement at a time since the start of the run.
    pub(crate) fn at(&self, after_s: f64) -> Movement {
        let place = self.place(after_s);
        if place < 0.0 || place > (self.track.poses.len() - 1) as f64 + 1e-6 {
            let park = Pose2::new(PARK_STEP_M * f64::from(self.id.0), PARK_Y_M, 0.0);
            return Movement::at_rest(park);
        }
        self.at_place(place)
    }

    /// Movement at a place among the poses.
    pub(crate) fn at_place(&self, place: f64) -> Movement {
        let poses = &self.track.poses;
        let last = poses.len() - 1;
        let k = (place as usize).min(last);
        let share = (place - k as f64).clamp(0.0, 1.0);
        let (from, to) = (poses[k], poses[(k + 1).min(last)]);
        let turn_rad = share * angle_between(from.heading_rad, to.heading_rad);
        let at = from.point() + (to.point() - from.point()) * share;
        let pose = Pose2::new(at.x_m, at.y_m, from.heading_rad + turn_rad);
        let (a, b) = (self.velocity_mps(k), self.velocity_mps((k + 1).min(last)));
        Movement { pose, velocity_mps: a + (b - a) * share }
    }

    /// Velocity at a pose of the track, by the poses beside it.
    fn velocity_mps(&self, k: usize) -> Vector2 {
        let poses = &self.track.poses;
        let (from, to) = (k.saturating_sub(1), (k + 1).min(poses.len() - 1));
        let way = poses[to].point() - poses[from].point();
        if to == from { Vector2::default() } else { way * (1.0 / ((to - from) as f64 * self.track.step_s)) }
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::PI;
    use std::sync::Arc;

    use super::*;

    fn played() -> Played {
        let poses = Arc::from([
            Pose2::new(0.0, 0.0, PI - 0.1),
            Pose2::new(1.0, 0.0, -PI + 0.1),
            Pose2::new(3.0, 0.0, -PI + 0.1),
        ]);
        Played::new(ActorId(3), &Track { from_s: 0.5, step_s: 0.1, poses, reacts: false })
    }

    #[test]
    fn track_is_linear_between_poses_and_turns_by_the_short_way() {
        let between = played().at(0.55);
        assert!((between.pose.x_m - 0.5).abs() < 1e-6 && (between.pose.heading_rad.abs() - PI).abs() < 1e-6);
        assert!((played().at(0.6).velocity_mps.x - 15.0).abs() < 1e-6);
    }

    #[test]
    fn road_user_is_absent_before_and_after_its_track() {
        for (after_s, is_absent) in [(0.0, true), (0.499, true), (0.5, false), (0.7, false), (0.71, true)] {
            assert_eq!(is_parked(played().at(after_s).pose), is_absent, "{after_s}");
        }
        assert!(!played().is_over(0.75) && played().is_over(1.0));
    }
}
