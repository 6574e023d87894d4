//! Collision and road checks of a car, with its arrival times.

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Pose2, math};

use super::dubins::Dubins;
use super::piece::{Piece, advance, walk};
use crate::collision::{Obstacles, Solid};
use crate::road::Road;

/// Sampling distance along a motion during the search, metres. Between two samples less than [`SLACK_M`] can be missed;
/// [`Ground::free_exactly`] makes the final check.
const LOOK_M: f64 = 0.25;

/// Sampling distance for the edge of the road, metres.
const ROAD_LOOK_M: f64 = 1.0;

/// Cap on the distance measured at a sample, beyond the required clearance, metres.
const SPARE_M: f64 = 4.0;

/// Added to the clearance and to the distance from the edge of the road during the search, metres.
const SLACK_M: f64 = 0.02;

/// The moving outline: a rectangle ahead of the planned point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Outline {
    /// Half of its length, metres.
    pub half_length_m: f64,
    /// Half of its width, metres.
    pub half_width_m: f64,
    /// Distance from the planned point forward to the rectangle's centre, metres.
    pub center_ahead_m: f64,
}

impl Outline {
    /// The planned point alone.
    pub const POINT: Self = Self { half_length_m: 0.0, half_width_m: 0.0, center_ahead_m: 0.0 };

    /// The rectangle with the planned point at `point`.
    pub fn at(&self, point: Point2, [cos, sin]: [f64; 2]) -> Solid {
        Solid {
            x_m: point.x_m + cos * self.center_ahead_m,
            y_m: point.y_m + sin * self.center_ahead_m,
            cos,
            sin,
            half_length_m: self.half_length_m,
            half_width_m: self.half_width_m,
        }
    }

    /// Distance from the planned point to the furthest point of the rectangle, metres.
    pub fn reach_m(&self) -> f64 {
        math::hypot(self.half_length_m + self.center_ahead_m.abs(), self.half_width_m)
    }
}

/// The usable ground.
#[derive(Clone, Copy, Debug)]
pub enum Area<'a> {
    /// Bounds of the planned point: x_min, y_min, x_max, y_max, metres.
    Box([f64; 4]),
    /// The whole outline stays inside the drivable ground, and the planned point inside the bounds.
    Road {
        /// The drivable ground.
        road: &'a Road,
        /// Distance to keep from its edge, metres.
        margin_m: f64,
        /// As for [`Area::Box`].
        bounds: [f64; 4],
    },
}

/// Arrival times of the car: from its current speed it changes to the target speed, then holds it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Clock {
    /// Start instant of the path.
    pub start: Time,
    /// Speed at the start, m/s.
    pub speed_mps: f64,
    /// Target speed, m/s.
    pub target_mps: f64,
    /// Rate of the change, m/s² (positive).
    pub accel_mps2: f64,
}

/// Lower bound on planned speeds, m/s: bounds the duration of a path.
const CREEP_MPS: f64 = 0.5;

impl Clock {
    /// Clock on which no time passes.
    pub const STANDING: Self =
        Self { start: Time::ZERO, speed_mps: f64::INFINITY, target_mps: f64::INFINITY, accel_mps2: 1.0 };

    /// Time until `travelled_m` are covered, seconds.
    pub fn after_s(&self, travelled_m: f64) -> f64 {
        if self.target_mps == f64::INFINITY {
            return 0.0;
        }
        let (v0, v1) = (self.speed_mps.max(CREEP_MPS), self.target_mps.max(CREEP_MPS));
        let rate = if v1 >= v0 { self.accel_mps2 } else { -self.accel_mps2 };
        let change_s = (v1 - v0) / rate;
        let change_m = 0.5 * (v0 + v1) * change_s;
        if travelled_m >= change_m {
            return change_s + (travelled_m - change_m) / v1;
        }
        // Root of v0 t + rate t^2 / 2 = travelled that is also stable for small rates.
        2.0 * travelled_m / (v0 + (v0 * v0 + 2.0 * rate * travelled_m).max(0.0).sqrt())
    }

    /// Instant at which `travelled_m` are covered.
    pub fn at(&self, travelled_m: f64) -> Time {
        self.start + Span::from_secs(self.after_s(travelled_m))
    }
}

/// Conditions on the poses of a car.
#[derive(Clone, Copy, Debug)]
pub struct Ground<'a> {
    /// Obstacles, which must not be touched.
    pub obstacles: &'a Obstacles,
    /// Distance to keep from obstacles, metres.
    pub clearance_m: f64,
    /// The moving outline.
    pub outline: Outline,
    /// The usable ground.
    pub area: Area<'a>,
    /// Arrival times.
    pub clock: Clock,
}

impl Ground<'_> {
    /// Returns true if the car may be at `pose` after `travelled_m`.
    pub fn pose_free(&self, pose: Pose2, travelled_m: f64) -> bool {
        let (sin, cos) = math::sin_cos(pose.heading_rad);
        self.place_free(pose.point(), [cos, sin], travelled_m, self.clearance_m)
    }

    fn place_free(&self, point: Point2, direction: [f64; 2], travelled_m: f64, clearance_m: f64) -> bool {
        let solid = self.outline.at(point, direction);
        self.within(point)
            && self.obstacles.solid_free(&solid, self.clock.at(travelled_m), clearance_m)
            && self.on_road(&solid, 0.0)
    }

    fn within(&self, point: Point2) -> bool {
        let (Area::Box(b) | Area::Road { bounds: b, .. }) = self.area;
        b[0] <= point.x_m && b[1] <= point.y_m && point.x_m <= b[2] && point.y_m <= b[3]
    }

    fn on_road(&self, solid: &Solid, slack_m: f64) -> bool {
        match self.area {
            Area::Box(_) => true,
            Area::Road { road, margin_m, .. } => road.margin_m(solid) >= margin_m + slack_m,
        }
    }

    /// Returns true if a piece that begins at `from` after `travelled_m` is free, sampled every `LOOK_M`: obstacles
    /// only once one can have come near since the last sample, the road every `ROAD_LOOK_M`.
    pub fn piece_free(&self, from: Pose2, piece: Piece, travelled_m: f64) -> bool {
        let need_m = self.clearance_m + SLACK_M;
        let nearing = self.nearing(piece.curvature_1pm);
        let (mut look_m, mut road_m) = (0.0, 0.0);
        let end_m = piece.length_m - 1e-9;
        walk(from, piece, LOOK_M, |point, direction, s_m| {
            if !self.within(point) {
                return false;
            }
            let (look, look_road) = (s_m >= look_m, s_m >= road_m || s_m >= end_m);
            if !look && !look_road {
                return true;
            }
            let solid = self.outline.at(point, direction);
            if look {
                let at = self.clock.at(travelled_m + s_m);
                let spare_m = self.obstacles.distance_below(&solid, at, need_m + SPARE_M) - need_m;
                if spare_m < 0.0 {
                    return false;
                }
                look_m = s_m + spare_m / nearing;
            }
            if look_road {
                road_m = s_m + ROAD_LOOK_M - 1e-9;
                return self.on_road(&solid, SLACK_M);
            }
            true
        })
    }

    /// Largest approach of an obstacle per metre driven.
    fn nearing(&self, curvature_1pm: f64) -> f64 {
        let slowest_mps = self.clock.speed_mps.min(self.clock.target_mps).max(CREEP_MPS);
        1.0 + curvature_1pm.abs() * self.outline.reach_m() + self.obstacles.fastest_mps() / slowest_mps
    }

    /// As [`piece_free`](Self::piece_free), for a whole path.
    pub fn path_free(&self, from: Pose2, path: &Dubins, travelled_m: f64) -> bool {
        let (mut pose, mut travelled_m) = (from, travelled_m);
        for &piece in &path.pieces {
            if !self.piece_free(pose, piece, travelled_m) {
                return false;
            }
            pose = advance(pose, piece.curvature_1pm, piece.length_m);
            travelled_m += piece.length_m;
        }
        true
    }

    /// Returns true if the pieces from `from` on are free without gaps: obstacles by bisection, the edge of the road at
    /// samples 20 cm apart.
    pub fn free_exactly(&self, from: Pose2, pieces: &[Piece]) -> bool {
        let (mut pose, mut travelled_m) = (from, 0.0);
        for &piece in pieces {
            let mut place = |u: f64| {
                let s_m = u * piece.length_m;
                let at = advance(pose, piece.curvature_1pm, s_m);
                let (sin, cos) = math::sin_cos(at.heading_rad);
                (self.outline.at(at.point(), [cos, sin]), self.clock.at(travelled_m + s_m))
            };
            let travel_m = piece.length_m * (1.0 + piece.curvature_1pm.abs() * self.outline.reach_m());
            if !self.obstacles.motion_free(&mut place, travel_m, self.clearance_m) {
                return false;
            }
            let stays =
                walk(pose, piece, 0.2, |p, direction, _| self.on_road(&self.outline.at(p, direction), 0.0));
            if !stays {
                return false;
            }
            pose = advance(pose, piece.curvature_1pm, piece.length_m);
            travelled_m += piece.length_m;
        }
        true
    }
}

/// The bounding box of poses, enlarged: x_min, y_min, x_max, y_max, metres.
pub fn around(poses: &[Pose2], by_m: f64) -> [f64; 4] {
    let start = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    let b =
        poses.iter().fold(start, |b, p| [b[0].min(p.x_m), b[1].min(p.y_m), b[2].max(p.x_m), b[3].max(p.y_m)]);
    [b[0] - by_m, b[1] - by_m, b[2] + by_m, b[3] + by_m]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clock_accelerates_then_holds_the_target_speed() {
        let clock = Clock { start: Time::ZERO, speed_mps: 4.0, target_mps: 10.0, accel_mps2: 3.0 };
        // 4 to 10 m/s at 3 m/s² takes 2 s and 14 m.
        assert!((clock.after_s(14.0) - 2.0).abs() < 1e-12);
        assert!((clock.after_s(24.0) - 3.0).abs() < 1e-12);
        assert!((clock.after_s(4.0 + 1.5) - 1.0).abs() < 1e-12);
        let slowing = Clock { speed_mps: 10.0, target_mps: 4.0, ..clock };
        assert!((slowing.after_s(14.0) - 2.0).abs() < 1e-12);
        assert!((slowing.after_s(18.0) - 3.0).abs() < 1e-12);
    }
}
