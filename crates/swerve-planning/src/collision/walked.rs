//! Ground covered by a pedestrian who may stop on the way.

use swerve_core::Time;
use swerve_geom::{Obb, Point2, Pose2, math};
use swerve_msg::Prediction;

use super::size::sizes_m;

/// A pedestrian predicted to move at most this far counts as standing, metres.
const STANDS_M: f64 = 0.02;

/// Boxes whose sizes differ by less than this factor count as equal, so that rounding does not decide.
const SMALLER: f64 = 0.999;

/// Frame along a pedestrian's path.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Walk;

/// Ground covered by a pedestrian who walks as predicted and may stop on the way: per instant of the prediction, the
/// box around all places up to then. It is aligned with the path, or with the outline if that makes it smaller: for a
/// drift of centimetres at 45 degrees to a square outline, a box along the drift is wider than the outline by two
/// fifths.
pub(super) struct Walked<'a> {
    prediction: &'a Prediction,
    /// Direction of the boxes, at the first place.
    frame: Pose2,
    next: usize,
    /// Reach ahead from, ahead to, left from, left to, metres.
    reach_m: [f64; 4],
}

impl<'a> Walked<'a> {
    /// Returns `None` for a standing pedestrian.
    pub(super) fn new(prediction: &'a Prediction) -> Option<Self> {
        let (first, last) = (prediction.path.first()?.pose, prediction.path.last()?.pose);
        let way = last.point() - first.point();
        if way.norm() <= STANDS_M {
            return None;
        }
        let along = |heading_rad: f64| Self {
            prediction,
            frame: Pose2::new(first.x_m, first.y_m, heading_rad),
            next: 0,
            reach_m: [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY],
        };
        let of_way = along(way.heading());
        let of_outline = along(first.heading_rad);
        Some(if of_outline.area_m2() < SMALLER * of_way.area_m2() { of_outline } else { of_way })
    }

    /// Area of the box around all places, m².
    fn area_m2(&self) -> f64 {
        let whole = Self { reach_m: self.reach_m, ..*self };
        whole.last().map_or(0.0, |(_, all)| 4.0 * all.half_length_m * all.half_width_m)
    }
}

impl Iterator for Walked<'_> {
    type Item = (Time, Obb);

    fn next(&mut self) -> Option<Self::Item> {
        let place = self.prediction.path.get(self.next)?;
        let [length_m, width_m] = sizes_m(self.prediction, self.next);
        self.next += 1;
        let at: Point2<Walk> = self.frame.to_local(place.pose.point());
        let (sin, cos) = math::sin_cos(place.pose.heading_rad - self.frame.heading_rad);
        let ahead_m = 0.5 * (length_m * cos.abs() + width_m * sin.abs());
        let left_m = 0.5 * (length_m * sin.abs() + width_m * cos.abs());
        let r = &mut self.reach_m;
        *r = [
            r[0].min(at.x_m - ahead_m),
            r[1].max(at.x_m + ahead_m),
            r[2].min(at.y_m - left_m),
            r[3].max(at.y_m + left_m),
        ];
        let middle = self.frame.from_local(Point2::<Walk>::new(0.5 * (r[0] + r[1]), 0.5 * (r[2] + r[3])));
        let center = Pose2::new(middle.x_m, middle.y_m, self.frame.heading_rad);
        Some((place.at, Obb::new(center, r[1] - r[0], r[3] - r[2])))
    }
}
