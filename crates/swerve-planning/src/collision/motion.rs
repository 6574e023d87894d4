//! Motions and paths among obstacles: free throughout, however far apart the poses are.

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Pose2, angle_between};

use super::{Obstacles, Solid};

/// Stretches in which nothing moves further than this are settled by their ends and middle, metres.
const RESOLUTION_M: f64 = 0.02;

impl Obstacles {
    /// Whether a motion keeps `clearance_m` to everything throughout.
    ///
    /// `place` gives footprint and instant for `u` in `[0, 1]`, moving on steadily between; no point of
    /// the footprint travels further than `travel_m` over the whole motion, at most in proportion to `u`.
    pub fn motion_free(
        &self,
        place: &mut dyn FnMut(f64) -> (Solid, Time),
        travel_m: f64,
        clearance_m: f64,
    ) -> bool {
        if self.is_empty() {
            return true;
        }
        let (first, from) = place(0.0);
        let (last, to) = place(1.0);
        let moves_m = travel_m + self.fastest_mps() * (to - from).as_secs().max(0.0);
        self.solid_free(&first, from, clearance_m)
            && self.solid_free(&last, to, clearance_m)
            && self.stretch_free(place, 0.0, 1.0, moves_m, clearance_m)
    }

    /// `moves_m`: how far anything moves relative to the footprint over the stretch.
    fn stretch_free(
        &self,
        place: &mut dyn FnMut(f64) -> (Solid, Time),
        low: f64,
        high: f64,
        moves_m: f64,
        clearance_m: f64,
    ) -> bool {
        let limit = clearance_m.max(f64::MIN_POSITIVE);
        let middle = 0.5 * (low + high);
        let (solid, at) = place(middle);
        let enough_m = limit + 0.5 * moves_m;
        let distance_m = self.distance_below(&solid, at, enough_m);
        if distance_m < limit {
            return false;
        }
        if distance_m >= enough_m || moves_m <= RESOLUTION_M {
            return true;
        }
        self.stretch_free(place, low, middle, 0.5 * moves_m, clearance_m)
            && self.stretch_free(place, middle, high, 0.5 * moves_m, clearance_m)
    }

    /// Whether the footprint, carried straight from one pose to the next (headings turn steadily the short
    /// way), keeps `clearance_m`; `footprint` gives the outline at a pose.
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
            // Any corner travels at most as far as the reference point plus the turn times its lever.
            let obb = footprint(a);
            let lever_m = obb.center.point().distance(a.point()) + obb.radius();
            let travel_m = a.point().distance(b.point()) + turn.abs() * lever_m;
            self.motion_free(&mut place, travel_m, clearance_m)
        })
    }

    /// Smallest clearance along a path, sampled so that nothing moves more than `step_m` between two looks;
    /// infinite without obstacles.
    pub fn path_clearance_m(
        &self,
        footprint: impl Fn(Pose2) -> Obb,
        path: &[(Pose2, Time)],
        step_m: f64,
    ) -> f64 {
        let mut least_m = f64::INFINITY;
        for (i, &(a, from)) in path.iter().enumerate() {
            let (b, to) = path.get(i + 1).copied().unwrap_or((a, from));
            let moved_m = a.point().distance(b.point())
                + angle_between(a.heading_rad, b.heading_rad).abs() * footprint(a).radius()
                + self.fastest_mps() * (to - from).as_secs().max(0.0);
            let steps = (moved_m / step_m).ceil().clamp(1.0, 10_000.0) as usize;
            for k in 0..steps {
                let u = k as f64 / steps as f64;
                let at = from + Span::from_secs((to - from).as_secs() * u);
                let solid = Solid::from(&footprint(between(a, b, u)));
                least_m = least_m.min(self.distance_below(&solid, at, least_m));
            }
        }
        least_m
    }
}

/// The pose at share `u` of the way from `a` to `b`: straight, turning steadily the short way.
pub fn between(a: Pose2, b: Pose2, u: f64) -> Pose2 {
    let turn = angle_between(a.heading_rad, b.heading_rad);
    Pose2::new(a.x_m + (b.x_m - a.x_m) * u, a.y_m + (b.y_m - a.y_m) * u, a.heading_rad + turn * u)
}
