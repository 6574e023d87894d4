//! Rounds the corners of a path of straight lines to make it drivable.

use core::f64::consts::PI;

use swerve_geom::{Point2, Pose2, Vector2, math, wrap_angle};

use swerve_planning::path::piece::Piece;

/// A circle that the path follows at a corner. The ends of the path are circles of radius zero.
#[derive(Clone, Copy, Debug)]
struct Bend {
    center: Point2,
    /// Signed radius, metres: positive for a left turn.
    radius_m: f64,
}

/// Storage, reused between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rounder {
    bends: Vec<Bend>,
}

impl Rounder {
    /// Path that goes straight from corner to corner and around each on a circle of the given radius through the
    /// corner: a string around pegs of that radius. It stays outside the corners that the straight lines touched.
    /// Returns the heading of its start, and writes its pieces to `pieces`.
    ///
    /// `None` if two bends are too near to each other for these radii, or the string would not touch a peg.
    pub(crate) fn round(
        &mut self,
        points: &[Pose2],
        radius_m: impl Fn(usize) -> f64,
        pieces: &mut Vec<Piece>,
    ) -> Option<f64> {
        pieces.clear();
        self.place(points, radius_m);
        let mut start = None;
        let mut heading_rad = 0.0;
        for i in 0..self.bends.len() - 1 {
            let (from, to) = (self.bends[i], self.bends[i + 1]);
            let (next_rad, straight_m) = tangent(&from, &to)?;
            if start.is_none() {
                start = Some(next_rad);
            } else {
                let turn = wrap_angle(next_rad - heading_rad);
                let length_m = turn * from.radius_m;
                if length_m < 0.0 || turn.abs() > 0.9 * PI {
                    return None;
                }
                pieces.push(Piece { curvature_1pm: 1.0 / from.radius_m, length_m });
            }
            pieces.push(Piece { curvature_1pm: 0.0, length_m: straight_m });
            heading_rad = next_rad;
        }
        start
    }

    fn place(&mut self, points: &[Pose2], radius_m: impl Fn(usize) -> f64) {
        self.bends.clear();
        let last = points.len() - 1;
        for (i, corner) in points.iter().enumerate() {
            let point = corner.point();
            if i == 0 || i == last {
                self.bends.push(Bend { center: point, radius_m: 0.0 });
                continue;
            }
            let before = unit(points[i - 1].point(), point);
            let after = unit(point, points[i + 1].point());
            let side = if before.cross(after) < 0.0 { -1.0 } else { 1.0 };
            // Towards the inside of the turn, half way between the normals of the two lines.
            let inward = before.left() + after.left();
            let inward = inward * (side / inward.norm().max(1e-12));
            let r = radius_m(i);
            self.bends.push(Bend { center: point + inward * r, radius_m: side * r });
        }
    }
}

fn unit(from: Point2, to: Point2) -> Vector2 {
    let way = to - from;
    way * (1.0 / way.norm().max(1e-12))
}

/// Heading and length of the straight line that leaves one circle and joins the next in their directions of travel.
///
/// A point of the path is `center - radius * left(direction)`; with both points on one line of that direction,
/// `distance * sin(bearing - heading) = radius_to - radius_from`, radii signed.
fn tangent(from: &Bend, to: &Bend) -> Option<(f64, f64)> {
    let between = to.center - from.center;
    let (distance_m, offset_m) = (between.norm(), to.radius_m - from.radius_m);
    if distance_m <= offset_m.abs() {
        return None;
    }
    let heading_rad = wrap_angle(between.heading() - math::asin(offset_m / distance_m));
    Some((heading_rad, (distance_m * distance_m - offset_m * offset_m).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_planning::path::piece::advance;

    #[test]
    fn path_around_two_pegs_is_a_string() {
        let corners = [(0.0, 0.0), (10.0, 3.0), (20.0, 3.0), (28.0, -1.0), (40.0, 0.0)];
        let points: Vec<Pose2> = corners.iter().map(|&(x, y)| Pose2::new(x, y, 0.0)).collect();
        let mut pieces = Vec::new();
        let heading = Rounder::default().round(&points, |_| 6.0, &mut pieces).unwrap();
        assert_eq!(pieces.len(), 7);
        let mut pose = Pose2::new(0.0, 0.0, heading);
        let mut rims = 0;
        for piece in &pieces {
            if piece.curvature_1pm != 0.0 {
                // The corner is on the arc.
                let corner = points[rims + 1].point();
                let (mut nearest, n) = (f64::INFINITY, 2000);
                for k in 0..=n {
                    let s = piece.length_m * f64::from(k) / f64::from(n);
                    nearest = nearest.min(advance(pose, piece.curvature_1pm, s).point().distance(corner));
                }
                assert!(nearest < 1e-3, "{corner:?} {nearest}");
                rims += 1;
            }
            pose = advance(pose, piece.curvature_1pm, piece.length_m);
        }
        assert!(pose.point().distance(Point2::new(40.0, 0.0)) < 1e-9, "{pose:?}");
    }

    #[test]
    fn bends_too_near_to_each_other_are_refused() {
        let points = [(0.0, 0.0), (5.0, 4.0), (6.0, -4.0), (12.0, 0.0)].map(|(x, y)| Pose2::new(x, y, 0.0));
        assert!(Rounder::default().round(&points, |_| 8.0, &mut Vec::new()).is_none());
        assert!(Rounder::default().round(&points, |_| 0.5, &mut Vec::new()).is_some());
    }
}
