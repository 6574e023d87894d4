//! Sampling space of the closed-loop tree.

use swerve_core::Rng;
use swerve_geom::{FrenetPoint, Pose2};
use swerve_map::Route;

use super::tree::Space;
use crate::path::dubins::Dubins;
use crate::path::ground::Ground;
use crate::path::piece::advance;

/// Poses of a car with a turning radius on a road.
pub(crate) struct RoadSpace<'a> {
    pub(crate) ground: &'a Ground<'a>,
    pub(crate) route: &'a Route,
    pub(crate) radius_m: f64,
    /// Arc lengths of start and goal on the route, metres.
    pub(crate) from_s_m: f64,
    pub(crate) to_s_m: f64,
    /// Half the width of the car, metres.
    pub(crate) half_width_m: f64,
}

/// Largest sampled angle to the road, radians.
const OFF_RAD: f64 = 0.35;

impl RoadSpace<'_> {
    /// Pose beside the line at arc length `s_m`, rotated relative to the road.
    pub(crate) fn beside(&self, s_m: f64, d_m: f64, off_rad: f64) -> Pose2 {
        let on_line = self.route.line().at(s_m).pose;
        let at = self.route.unproject(FrenetPoint { s_m, d_m });
        Pose2::new(at.x_m, at.y_m, on_line.heading_rad + off_rad)
    }
}

impl Space for RoadSpace<'_> {
    fn draw(&self, rng: &mut Rng) -> Pose2 {
        let s_m = rng.uniform(self.from_s_m, self.to_s_m);
        let (left_m, right_m) = (self.route.left_m(s_m), self.route.right_m(s_m));
        let d_m = rng.uniform(self.half_width_m - right_m, left_m - self.half_width_m);
        self.beside(s_m, d_m, rng.uniform(-OFF_RAD, OFF_RAD))
    }

    fn length_m(&self, from: Pose2, to: Pose2) -> f64 {
        Dubins::shortest(from, to, self.radius_m).length()
    }

    fn toward(&self, from: Pose2, to: Pose2, step_m: f64) -> Pose2 {
        let path = Dubins::shortest(from, to, self.radius_m);
        if path.length() <= step_m {
            return to;
        }
        let (mut at, mut left_m) = (from, step_m);
        for piece in path.pieces {
            at = advance(at, piece.curvature_1pm, piece.length_m.min(left_m));
            left_m = (left_m - piece.length_m).max(0.0);
        }
        at
    }

    fn free(&self, from: Pose2, to: Pose2, travelled_m: f64) -> bool {
        self.ground.path_free(from, &Dubins::shortest(from, to, self.radius_m), travelled_m)
    }
}
