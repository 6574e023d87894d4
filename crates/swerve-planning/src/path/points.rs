//! Points of a path without times.

use swerve_geom::{Pose2, angle_between};

use super::piece::{Piece, advance};
use crate::collision::between;

/// Distance between points placed along arcs and straights, metres.
const POINT_M: f64 = 0.5;

/// One point of a path without times.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct PathPoint {
    /// Pose of the ego origin.
    pub pose: Pose2,
    /// Curvature, 1/m; positive turns left.
    pub curvature_1pm: f64,
}

/// Path points with curvatures from the change of heading between neighbours (centred inside).
pub fn with_curvature(poses: &[Pose2]) -> Vec<PathPoint> {
    let last = poses.len().saturating_sub(1);
    poses
        .iter()
        .enumerate()
        .map(|(i, &pose)| {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
            let length_m: f64 = poses[a..=b].windows(2).map(|p| p[0].point().distance(p[1].point())).sum();
            let turn = angle_between(poses[a].heading_rad, poses[b].heading_rad);
            let curvature_1pm = if length_m > 1e-9 { turn / length_m } else { 0.0 };
            PathPoint { pose, curvature_1pm }
        })
        .collect()
}

/// A path with the distances between its points.
#[derive(Clone, Debug)]
pub struct Measured<'a> {
    path: &'a [PathPoint],
    gaps_m: Vec<f64>,
}

impl<'a> Measured<'a> {
    /// Creates a measured path of at least one point.
    pub fn new(path: &'a [PathPoint]) -> Self {
        let gap_m = |pair: &[PathPoint]| pair[0].pose.point().distance(pair[1].pose.point());
        Self { path, gaps_m: path.windows(2).map(gap_m).collect() }
    }

    /// The point at `s_m` along the path; the path is extended straight beyond its end.
    pub fn at(&self, s_m: f64) -> PathPoint {
        let mut left_m = s_m;
        for (pair, &gap_m) in self.path.windows(2).zip(&self.gaps_m) {
            if left_m <= gap_m && gap_m > 0.0 {
                let u = left_m / gap_m;
                let curvature_1pm =
                    pair[0].curvature_1pm + (pair[1].curvature_1pm - pair[0].curvature_1pm) * u;
                return PathPoint { pose: between(pair[0].pose, pair[1].pose, u), curvature_1pm };
            }
            left_m -= gap_m;
        }
        let last = self.path.last().copied().unwrap_or_default();
        PathPoint { pose: last.pose.ahead(left_m.max(0.0)), curvature_1pm: 0.0 }
    }
}

/// Appends points along pieces from `start`, from the start to the end of the last piece.
pub fn place_points(start: Pose2, pieces: &[Piece], path: &mut Vec<PathPoint>) {
    let curvature_1pm = pieces.first().map_or(0.0, |p| p.curvature_1pm);
    path.push(PathPoint { pose: start, curvature_1pm });
    let mut from = start;
    for &Piece { curvature_1pm, length_m } in pieces {
        let n = (length_m / POINT_M).ceil().max(1.0);
        for k in 1..=n as usize {
            let pose = advance(from, curvature_1pm, length_m * k as f64 / n);
            path.push(PathPoint { pose, curvature_1pm });
        }
        from = advance(from, curvature_1pm, length_m);
    }
}
