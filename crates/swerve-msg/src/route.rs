use serde::{Deserialize, Serialize};
use swerve_geom::{FrenetPoint, Obb, Polyline};

/// The way the ego is to go, and the ground it may use.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Route {
    /// Centre line of the ego's lane.
    pub line: Polyline,
    /// Drivable ground to the left of the line, metres (positive).
    pub left_m: f64,
    /// Drivable ground to the right of the line, metres (positive).
    pub right_m: f64,
}

impl Route {
    /// How far the worst corner of `footprint` is inside the drivable ground, metres; negative outside.
    pub fn margin_m(&self, footprint: &Obb) -> f64 {
        footprint.corners().into_iter().fold(f64::INFINITY, |margin, corner| {
            let FrenetPoint { d_m, .. } = self.line.project(corner);
            margin.min(self.left_m - d_m).min(d_m + self.right_m)
        })
    }
}
