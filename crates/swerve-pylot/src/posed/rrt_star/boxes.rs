//! A point among static boxes.

use swerve_core::Rng;
use swerve_geom::{Point2, Pose2};
use swerve_planning::rrt_star::tree::Space;

use crate::posed::AxisBox;
use crate::rrt_star::{draw_within, step_toward};

/// Axis-aligned boxes, grown, within bounds. Touching their borders is allowed.
#[derive(Clone, Debug, Default)]
pub(crate) struct Boxes {
    boxes: Vec<AxisBox>,
    bounds: AxisBox,
}

/// Depth by which a line may enter a box, metres: tolerance for rounding.
const TOUCH_M: f64 = 1e-9;

/// Upper bound on the rounding error of places along a line, metres.
const SURE_M: f64 = 1e-6;

impl Boxes {
    /// Replaces the content by `boxes` grown by `by_m`, reusing the storage.
    pub(crate) fn set(&mut self, boxes: &[AxisBox], by_m: f64, bounds: AxisBox) {
        self.boxes.clear();
        self.boxes.extend(boxes.iter().map(|b| [b[0] - by_m, b[1] - by_m, b[2] + by_m, b[3] + by_m]));
        self.bounds = bounds;
    }

    /// Returns true if a point is within bounds and in no box.
    pub(crate) fn point_free(&self, p: Point2) -> bool {
        let b = &self.bounds;
        let within = b[0] <= p.x_m && p.x_m <= b[2] && b[1] <= p.y_m && p.y_m <= b[3];
        within && !self.boxes.iter().any(|b| inside(b, p))
    }

    /// Returns true if the straight line between two points within bounds enters no box.
    pub(crate) fn segment_free(&self, from: Point2, to: Point2) -> bool {
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let (low, high) =
            ([from.x_m.min(to.x_m), from.y_m.min(to.y_m)], [from.x_m.max(to.x_m), from.y_m.max(to.y_m)]);
        !self.boxes.iter().any(|b| {
            let inner = [b[0] + TOUCH_M, b[1] + TOUCH_M, b[2] - TOUCH_M, b[3] - TOUCH_M];
            // Usually both ends are on one side of the box.
            if high[0] <= inner[0] || low[0] >= inner[2] || high[1] <= inner[1] || low[1] >= inner[3] {
                return false;
            }
            // The part of the line between the box's two vertical and two horizontal sides.
            let x = between(from.x_m, dx, inner[0], inner[2]);
            let y = between(from.y_m, dy, inner[1], inner[3]);
            x.0.max(y.0).max(0.0) < x.1.min(y.1).min(1.0)
        })
    }

    /// Returns true if all paths between two points that are no longer than `length_m` are certainly free: within
    /// bounds and clear of all boxes.
    pub(crate) fn all_free(&self, from: Point2, to: Point2, length_m: f64) -> bool {
        // Such a path is inside an ellipse around the two points.
        let by_m = 0.5 * (length_m - from.distance(to)).max(0.0) + SURE_M;
        let low = [from.x_m.min(to.x_m) - by_m, from.y_m.min(to.y_m) - by_m];
        let high = [from.x_m.max(to.x_m) + by_m, from.y_m.max(to.y_m) + by_m];
        let b = &self.bounds;
        let within = b[0] <= low[0] && b[1] <= low[1] && high[0] <= b[2] && high[1] <= b[3];
        let beside = |b: &AxisBox| high[0] <= b[0] || low[0] >= b[2] || high[1] <= b[1] || low[1] >= b[3];
        within && self.boxes.iter().all(beside)
    }

    /// Free corners of the boxes: shortest paths bend nowhere else.
    pub(crate) fn corners(&self, corners: &mut Vec<Pose2>) {
        corners.clear();
        for b in &self.boxes {
            for (x, y) in [(b[0], b[1]), (b[2], b[1]), (b[2], b[3]), (b[0], b[3])] {
                if self.point_free(Point2::new(x, y)) {
                    corners.push(Pose2::new(x, y, 0.0));
                }
            }
        }
    }
}

fn inside(b: &AxisBox, p: Point2) -> bool {
    let t = TOUCH_M;
    b[0] + t < p.x_m && p.x_m < b[2] - t && b[1] + t < p.y_m && p.y_m < b[3] - t
}

/// The range of `u` for which `from + u * by` is strictly between `low` and `high`; an empty range is reversed.
fn between(from: f64, by: f64, low: f64, high: f64) -> (f64, f64) {
    if by == 0.0 {
        return if low < from && from < high { (f64::NEG_INFINITY, f64::INFINITY) } else { (1.0, 0.0) };
    }
    let (a, b) = ((low - from) / by, (high - from) / by);
    (a.min(b), a.max(b))
}

impl Space for Boxes {
    fn draw(&self, rng: &mut Rng) -> Pose2 {
        draw_within(&self.bounds, rng)
    }

    fn length_m(&self, from: Pose2, to: Pose2) -> f64 {
        from.point().distance(to.point())
    }

    fn toward(&self, from: Pose2, to: Pose2, step_m: f64) -> Pose2 {
        step_toward(from, to, step_m)
    }

    fn free(&self, from: Pose2, to: Pose2, _: f64) -> bool {
        self.segment_free(from.point(), to.point())
    }

    fn stands(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_may_be_touched_but_not_entered() {
        let mut boxes = Boxes::default();
        boxes.set(&[[1.0, 1.0, 2.0, 2.0]], 0.0, [0.0, 0.0, 4.0, 4.0]);
        let check = |a: (f64, f64), b: (f64, f64), free: bool| {
            let (a, b) = (Point2::new(a.0, a.1), Point2::new(b.0, b.1));
            assert_eq!(boxes.segment_free(a, b), free, "{a:?} {b:?}");
            assert_eq!(boxes.segment_free(b, a), free, "{b:?} {a:?}");
        };
        check((0.0, 0.0), (3.0, 3.0), false);
        check((0.0, 1.0), (3.0, 1.0), true);
        check((0.0, 2.0), (1.0, 3.0), true);
        check((0.0, 3.0), (3.0, 0.0), false);
        check((1.0, 3.0), (3.0, 1.0), true);
        check((1.5, 1.5), (1.5, 1.6), false);
        check((1.5, 0.0), (1.5, 1.0), true);
        check((1.5, 0.0), (1.5, 1.1), false);
        for (length_m, sure) in [(2.0, true), (2.4, false)] {
            let [from, to] = [(0.5, 0.8), (2.5, 0.8)].map(|(x, y)| Point2::new(x, y));
            assert_eq!(boxes.all_free(from, to, length_m), sure, "{length_m}");
        }
        check((0.0, 1.5), (0.9, 1.5), true);
        assert!(!boxes.point_free(Point2::new(1.5, 1.5)));
        assert!(boxes.point_free(Point2::new(1.0, 1.5)));
        assert!(!boxes.point_free(Point2::new(-0.1, 1.5)));
    }
}
