use serde::{Deserialize, Serialize};
use swerve_geom::{Point2, Polyline, math};
use swerve_msg::Route;

/// The road, as a chain of straight and circular pieces from the map's origin, heading along +x.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Road {
    /// The pieces of the centre line of the ego's lane. Never empty.
    pub segments: Vec<Segment>,
    /// Width of the ego's lane, metres.
    pub lane_width_m: f64,
    /// Drivable ground to the left of the lane's centre, metres (positive).
    pub left_m: f64,
    /// Drivable ground to the right of the lane's centre, metres (positive).
    pub right_m: f64,
    /// Coefficient of friction of the surface.
    pub friction: f64,
}

/// One piece of road.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Segment {
    /// Its length, metres.
    pub length_m: f64,
    /// Its curvature, 1/m; zero is straight, positive turns left.
    pub curvature_1pm: f64,
}

/// Distance between the points of a curved road, metres: at 20 m radius they are 6 mm off the arc.
const STEP_M: f64 = 1.0;

impl Road {
    /// Length of its centre line, metres.
    pub fn length_m(&self) -> f64 {
        self.segments.iter().map(|s| s.length_m).sum()
    }

    /// The centre line: two points when all is straight, else one at most every metre, on the arcs.
    ///
    /// # Panics
    /// When the road has no length, which a checked scenario excludes.
    pub fn line(&self) -> Polyline {
        let straight = self.segments.iter().all(|s| s.curvature_1pm == 0.0);
        let mut points = vec![Point2::new(0.0, 0.0)];
        if straight {
            points.push(Point2::new(self.length_m(), 0.0));
        } else {
            let (mut from, mut heading) = (Point2::new(0.0, 0.0), 0.0);
            for segment in &self.segments {
                let n = (segment.length_m / STEP_M).ceil().max(1.0) as usize;
                let at = |s_m: f64| arc(from, heading, segment.curvature_1pm, s_m);
                points.extend((1..=n).map(|k| at(segment.length_m * k as f64 / n as f64)));
                from = at(segment.length_m);
                heading += segment.curvature_1pm * segment.length_m;
            }
        }
        Polyline::new(&points).expect("a checked road has a length")
    }

    /// The centre line with the drivable limits.
    ///
    /// # Panics
    /// As [`line`](Self::line).
    pub fn route(&self) -> Route {
        Route { line: self.line(), left_m: self.left_m, right_m: self.right_m }
    }
}

/// The point `s_m` along an arc that starts at `from`.
fn arc(from: Point2, heading_rad: f64, curvature_1pm: f64, s_m: f64) -> Point2 {
    let turn = curvature_1pm * s_m;
    // Length of the chord over that of the arc: sin(x)/x of half the turn.
    let half = 0.5 * turn;
    let chord = if half.abs() < 1e-9 { s_m } else { s_m * math::sin(half) / half };
    let (sin, cos) = math::sin_cos(heading_rad + half);
    Point2::new(from.x_m + chord * cos, from.y_m + chord * sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn road(segments: &[(f64, f64)]) -> Road {
        let segments =
            segments.iter().map(|&(length_m, curvature_1pm)| Segment { length_m, curvature_1pm }).collect();
        Road { segments, lane_width_m: 4.0, left_m: 6.0, right_m: 2.0, friction: 0.9 }
    }

    #[test]
    fn a_straight_road_is_two_points() {
        let line = road(&[(100.0, 0.0), (80.0, 0.0)]).line();
        assert_eq!(line.points().len(), 2);
        assert_eq!(line.length(), 180.0);
    }

    #[test]
    fn a_quarter_circle_to_the_left_ends_one_radius_ahead_and_to_the_left() {
        let quarter = 50.0 * core::f64::consts::FRAC_PI_2;
        let line = road(&[(30.0, 0.0), (quarter, 0.02), (10.0, 0.0)]).line();
        let end = line.points()[line.points().len() - 1];
        assert!(end.distance(Point2::new(80.0, 60.0)) < 1e-9, "{end:?}");
        assert!((line.length() - 40.0 - quarter).abs() < 0.01);
        assert!((line.at(60.0).curvature_1pm - 0.02).abs() < 1e-4);
    }
}
