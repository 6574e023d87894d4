use swerve_geom::{FrenetPoint, Point2, Polyline};

use crate::Scenario;

/// A patch of the ground with a friction of its own, along a stretch of a lane.
#[derive(Clone, PartialEq, Debug)]
pub struct Slippery {
    /// Unique name.
    pub name: String,
    /// Friction coefficient of the surface, in place of that of the road and of
    /// [`TyreParams::friction`](swerve_vehicle::TyreParams::friction).
    pub friction: f64,
    /// Stretch of a centre line that it lies along, from its begin to its end.
    pub line: Polyline,
    /// Position of its middle across the line, metres; positive to the left.
    pub d_m: f64,
    /// Width, metres.
    pub width_m: f64,
}

impl Slippery {
    /// Returns true if a point of the ground is on the patch, its edge included.
    pub fn contains(&self, point: Point2) -> bool {
        let length_m = self.line.length();
        let reach_m = length_m + self.d_m.abs() + 0.5 * self.width_m;
        if self.line.points()[0].distance(point) > reach_m {
            return false;
        }
        let at = self.line.project(point);
        (0.0..=length_m).contains(&at.s_m) && (at.d_m - self.d_m).abs() <= 0.5 * self.width_m
    }

    /// Corners of the patch, counter-clockwise from its right corner at the begin.
    pub fn outline(&self) -> Vec<Point2> {
        let beside = |side: f64| {
            let d_m = self.d_m + 0.5 * side * self.width_m;
            self.line.vertices().map(move |(s_m, _)| self.line.to_map(FrenetPoint { s_m, d_m }))
        };
        beside(-1.0).chain(beside(1.0).rev()).collect()
    }
}

impl Scenario {
    /// Friction of the patch that a point of the ground is on, the lowest of several; `None` beside all patches.
    pub fn slippery_at(&self, point: Point2) -> Option<f64> {
        let on = self.slippery.iter().filter(|patch| patch.contains(point));
        on.map(|patch| patch.friction).reduce(f64::min)
    }
}

#[cfg(test)]
mod tests;
