//! Crossings.

use serde::{Deserialize, Serialize};
use swerve_geom::{Point2, Polyline};

use crate::LaneId;

/// Identity of a crossing in its map.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CrossingId(pub u32);

/// Ground on which pedestrians or cyclists cross lanes.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Crossing {
    /// Identity in the map.
    pub id: CrossingId,
    /// Identity in the file that the map is from; may be empty.
    #[serde(default)]
    pub name: String,
    /// Corners in order, at least 3; the last is joined with the first.
    pub outline: Vec<Point2>,
    /// Lanes that it crosses, ordered by identity; empty if unknown.
    #[serde(default)]
    pub lanes: Vec<LaneId>,
}

/// Interval of samples of a line, metres.
const SAMPLE_M: f64 = 0.5;

impl Crossing {
    /// Returns true if a point is inside the outline.
    pub fn contains(&self, point: Point2) -> bool {
        let mut inside = false;
        for (k, a) in self.outline.iter().enumerate() {
            let b = self.outline[(k + 1) % self.outline.len()];
            if (a.y_m > point.y_m) != (b.y_m > point.y_m) {
                let x_m = a.x_m + (point.y_m - a.y_m) / (b.y_m - a.y_m) * (b.x_m - a.x_m);
                inside ^= point.x_m < x_m;
            }
        }
        inside
    }

    /// Part of a line within the outline, metres, to half a metre; `None` if it is outside.
    pub fn covered_m(&self, line: &Polyline) -> Option<[f64; 2]> {
        let steps = (line.length() / SAMPLE_M).ceil().max(1.0);
        let mut part: Option<[f64; 2]> = None;
        for at in line.at_each((0..=steps as usize).map(|n| line.length() * n as f64 / steps)) {
            if self.contains(at.pose.point()) {
                part = Some(part.map_or([at.s_m; 2], |[from, _]| [from, at.s_m]));
            }
        }
        part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_is_inside_between_its_borders() {
        let corners = [(10.0, -4.0), (13.0, -4.0), (13.0, 4.0), (10.0, 4.0)];
        let crossing = Crossing {
            id: CrossingId(1),
            name: String::new(),
            outline: corners.map(|(x_m, y_m)| Point2::new(x_m, y_m)).to_vec(),
            lanes: Vec::new(),
        };
        let line = |y_m| Polyline::new(&[Point2::new(0.0, y_m), Point2::new(20.0, y_m)]).unwrap();
        let [from_m, to_m] = crossing.covered_m(&line(1.0)).unwrap();
        assert!((10.0..=10.5).contains(&from_m) && (12.5..=13.0).contains(&to_m), "{from_m} to {to_m}");
        assert_eq!(crossing.covered_m(&line(4.5)), None);
        assert!(crossing.contains(Point2::new(11.0, 3.9)) && !crossing.contains(Point2::new(9.9, 0.0)));
    }
}
