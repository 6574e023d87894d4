//! Collision checks of motions and paths: free throughout, however far apart the poses are.

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Pose2, angle_between};

use super::{Obstacles, Solid};

/// Intervals in which nothing moves further than this are decided by their ends and middle, metres.
const RESOLUTION_M: f64 = 0.02;

/// Every n-th place along a path is checked first.
const FEW: usize = 8;

/// Checks along a path measure distances up to this much beyond the smallest one so far, metres.
const SPARE_M: f64 = 4.0;

/// Upper bound on the rounding error of a sum of distances, metres.
const ROUNDING_M: f64 = 1e-6;

impl Obstacles {
    /// Returns true if a motion keeps `clearance_m` to all obstacles throughout.
    ///
    /// `place` gives footprint and instant for `u` in `[0, 1]`, with steady motion between; no point of the footprint
    /// travels further than `travel_m` over the whole motion, and at most in proportion to `u`.
    pub fn motion_free(
        &self,
        place: &mut dyn FnMut(f64) -> (Solid, Time),
        travel_m: f64,
        clearance_m: f64,
    ) -> bool {
        self.first_near(place, travel_m, clearance_m).is_none()
    }

    /// As [`motion_free`](Self::motion_free): the first place found that violates the clearance.
    pub(crate) fn first_near(
        &self,
        place: &mut dyn FnMut(f64) -> (Solid, Time),
        travel_m: f64,
        clearance_m: f64,
    ) -> Option<f64> {
        if self.is_empty() {
            return None;
        }
        let (first, from) = place(0.0);
        let (last, to) = place(1.0);
        let moves_m = travel_m + self.fastest_mps() * (to - from).as_secs().max(0.0);
        if !self.solid_free(&first, from, clearance_m) {
            return Some(0.0);
        }
        if !self.solid_free(&last, to, clearance_m) {
            return Some(1.0);
        }
        self.near_in_stretch(place, 0.0, 1.0, moves_m, clearance_m)
    }

    /// `moves_m`: largest motion relative to the footprint over the interval, metres.
    fn near_in_stretch(
        &self,
        place: &mut dyn FnMut(f64) -> (Solid, Time),
        low: f64,
        high: f64,
        moves_m: f64,
        clearance_m: f64,
    ) -> Option<f64> {
        let limit = clearance_m.max(f64::MIN_POSITIVE);
        let middle = 0.5 * (low + high);
        let (solid, at) = place(middle);
        let enough_m = limit + 0.5 * moves_m;
        let distance_m = self.distance_below(&solid, at, enough_m);
        if distance_m < limit {
            return Some(middle);
        }
        if distance_m >= enough_m || moves_m <= RESOLUTION_M {
            return None;
        }
        self.near_in_stretch(place, low, middle, 0.5 * moves_m, clearance_m)
            .or_else(|| self.near_in_stretch(place, middle, high, 0.5 * moves_m, clearance_m))
    }

    /// Returns true if the footprint keeps `clearance_m` when moved straight from pose to pose (headings turn steadily
    /// the short way); `footprint` gives the outline at a pose.
    pub fn path_free(
        &self,
        footprint: impl Fn(Pose2) -> Obb,
        path: &[(Pose2, Time)],
        clearance_m: f64,
    ) -> bool {
        if let [(pose, at)] = path {
            return self.free(&footprint(*pose), *at, clearance_m);
        }
        path.windows(2).all(|pair| {
            let ((a, from), (b, to)) = (pair[0], pair[1]);
            let turn = angle_between(a.heading_rad, b.heading_rad);
            let mut place = |u: f64| {
                let pose = between(a, b, u);
                let ns = (to - from).as_secs() * u;
                (Solid::from(&footprint(pose)), from + Span::from_secs(ns))
            };
            // Any corner travels at most as far as the reference point plus the turn times its lever arm.
            let obb = footprint(a);
            let lever_m = obb.center.point().distance(a.point()) + obb.radius();
            let travel_m = a.point().distance(b.point()) + turn.abs() * lever_m;
            self.motion_free(&mut place, travel_m, clearance_m)
        })
    }

    /// Smallest clearance along a path, metres, sampled so that nothing moves more than `step_m` between samples;
    /// infinite without obstacles.
    pub fn path_clearance_m(
        &self,
        footprint: impl Fn(Pose2) -> Obb,
        path: &[(Pose2, Time)],
        step_m: f64,
    ) -> f64 {
        let look = |pose: Pose2, at: Time, cap_m: f64| {
            self.distance_below(&Solid::from(&footprint(pose)), at, cap_m)
        };
        // Sparse samples along the path first: the nearer they are, the fewer of the others can be nearer still.
        let few = path.iter().step_by(FEW);
        let mut least_m = few.fold(f64::INFINITY, |least_m, &(pose, at)| look(pose, at, least_m));
        let fastest_mps = self.fastest_mps();
        // Distance by which obstacles must approach since the last sample to be nearer than all samples so far.
        let mut spare_m = 0.0;
        for (i, &(a, from)) in path.iter().enumerate() {
            let (b, to) = path.get(i + 1).copied().unwrap_or((a, from));
            let way_m = a.point().distance(b.point());
            let turn_rad = angle_between(a.heading_rad, b.heading_rad).abs();
            let (took_s, outline) = ((to - from).as_secs(), footprint(a));
            let moved_m = way_m + turn_rad * outline.radius() + fastest_mps * took_s.max(0.0);
            let steps = (moved_m / step_m).ceil().clamp(1.0, 10_000.0) as usize;
            let lever_m = a.point().distance(outline.center.point()) + outline.radius();
            let nearing_m = (way_m + turn_rad * lever_m + fastest_mps * took_s.abs()) / steps as f64;
            for k in 0..steps {
                if spare_m <= ROUNDING_M {
                    let u = k as f64 / steps as f64;
                    let at = from + Span::from_secs(took_s * u);
                    let distance_m = look(between(a, b, u), at, least_m + SPARE_M);
                    least_m = least_m.min(distance_m);
                    spare_m = distance_m - least_m;
                }
                spare_m -= nearing_m;
            }
        }
        least_m
    }
}

/// Pose at fraction `u` of the way from `a` to `b`: straight, turning steadily the short way.
pub fn between(a: Pose2, b: Pose2, u: f64) -> Pose2 {
    let turn = angle_between(a.heading_rad, b.heading_rad);
    Pose2::new(a.x_m + (b.x_m - a.x_m) * u, a.y_m + (b.y_m - a.y_m) * u, a.heading_rad + turn * u)
}
