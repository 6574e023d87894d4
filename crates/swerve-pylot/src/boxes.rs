//! Obstacles of the original planners: axis-aligned boxes, grown, at all predicted places.

use swerve_geom::{Obb, Point2};
use swerve_msg::{ActorKind, Extent, Prediction};
use swerve_planning::collision::SWEPT_STEP_M;
use swerve_planning::{CollisionMode, Request, Solid};

use crate::posed::AxisBox;

/// Distance of a box's corner to the car below which FOT checks the box, metres. Source: `FrenetPath.cpp:89-140`.
const CORNER_NEAR_M: f64 = 6.0;

/// One place of an obstacle.
#[derive(Clone, Copy, PartialEq, Debug)]
struct TimedBox {
    bounds: AxisBox,
    /// Time interval of the place, seconds after the plan begins; unbounded if all places count at once.
    during_s: [f64; 2],
}

/// Selection and treatment of obstacles in range.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Sight {
    /// Treatment of predicted motion: at once, or indexed by time.
    pub(crate) collision: CollisionMode,
    /// Range from the planned point, metres.
    pub(crate) range_m: f64,
    /// True if each place has to be in range itself.
    pub(crate) per_place: bool,
    /// Half the side of a pedestrian's box, replacing the predicted size if all places count at once, metres.
    pub(crate) person_half_m: Option<f64>,
}

/// Axis-aligned boxes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Boxes {
    places: Vec<TimedBox>,
    /// True if everything to the left of a box is solid.
    pub(crate) solid_left: bool,
}

const ALWAYS: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

impl Boxes {
    /// Replaces the content by static boxes, grown by `by_m`.
    pub(crate) fn set_standing<'a>(&mut self, boxes: impl IntoIterator<Item = &'a AxisBox>, by_m: f64) {
        self.places.clear();
        let place = |b: &AxisBox| TimedBox { bounds: grown(*b, by_m), during_s: ALWAYS };
        self.places.extend(boxes.into_iter().map(place));
    }

    /// Replaces the content by the predictions in range of `from`, grown by `by_m`.
    pub(crate) fn set_predicted(&mut self, request: &Request<'_>, from: Point2, sight: Sight, by_m: f64) {
        self.places.clear();
        let near = |point: Point2| point.distance(from) <= sight.range_m;
        for prediction in request.predictions {
            let any = prediction.path.iter().any(|p| near(p.pose.point()));
            let mut last: Option<Point2> = None;
            let swept = sight.collision == CollisionMode::SweptStatic;
            let extent = match (prediction.kind, sight.person_half_m) {
                (ActorKind::Pedestrian, Some(half_m)) if swept => {
                    Extent { length_m: 2.0 * half_m, width_m: 2.0 * half_m, ..prediction.extent }
                }
                _ => prediction.extent,
            };
            // The original's predictions begin one step ahead, without the current place.
            let present = usize::from(swept && prediction.path.len() > 1);
            for (k, place) in prediction.path.iter().enumerate().skip(present) {
                let point = place.pose.point();
                if swept && last.is_some_and(|last| point.distance(last) <= SWEPT_STEP_M) {
                    continue;
                }
                last = Some(point);
                if if sight.per_place { near(point) } else { any } {
                    let bounds = grown(around(&extent.footprint(place.pose)), by_m);
                    let during_s = if swept { ALWAYS } else { during(prediction, k, request) };
                    self.places.push(TimedBox { bounds, during_s });
                }
            }
        }
    }

    /// Returns true if nothing is in range.
    pub(crate) fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The boxes as rectangles, without their growth.
    pub(crate) fn rectangles(&self, grown_m: f64) -> impl Iterator<Item = Obb> {
        let bare = move |place: &TimedBox| {
            let [x_min, y_min, x_max, y_max] = grown(place.bounds, -grown_m);
            Obb::axis_aligned(x_min, y_min, x_max, y_max)
        };
        self.places.iter().map(bare)
    }

    /// Sum of the areas of the boxes, m².
    pub(crate) fn area_m2(&self) -> f64 {
        self.places.iter().map(|p| (p.bounds[2] - p.bounds[0]) * (p.bounds[3] - p.bounds[1])).sum()
    }

    fn at(&self, at_s: f64) -> impl Iterator<Item = &AxisBox> {
        let there = move |p: &&TimedBox| p.during_s[0] <= at_s && at_s <= p.during_s[1];
        self.places.iter().filter(there).map(|p| &p.bounds)
    }

    /// Returns true if the straight line between two points is free; only its first end is checked for lying to the
    /// left of a box.
    pub(crate) fn way_free(&self, from: Point2, to: Point2, at_s: f64) -> bool {
        !self.at(at_s).any(|b| (self.solid_left && is_left(b, from)) || touches(b, from, to))
    }

    /// Returns true if the outline, with these bounds, is free, inside and out.
    pub(crate) fn outline_free(&self, corners: &[Point2; 4], own: AxisBox, at_s: f64) -> bool {
        !self.at(at_s).any(|b| {
            // For a car behind, ahead or right of a box, no corner is to its left and no edge touches it.
            if own[2] < b[0] || own[0] > b[2] || own[3] < b[1] {
                return false;
            }
            let left = || corners.iter().any(|&corner| is_left(b, corner));
            let edges = || (0..4).any(|i| touches(b, corners[i], corners[(i + 1) % 4]));
            (self.solid_left && left()) || (own[1] <= b[3] && edges())
        })
    }

    /// Returns true if the border of the outline crosses no border: a shape wholly inside another one passes.
    pub(crate) fn border_free(&self, car: &Solid, at_s: f64) -> bool {
        let corners = car.corners();
        let own = bounds(&corners);
        !self.at(at_s).any(|b| {
            let apart = own[2] < b[0] || own[0] > b[2] || own[3] < b[1] || own[1] > b[3];
            !apart && is_near(b, car) && !corners.iter().all(|&corner| is_inside(b, corner)) && {
                let box_in_car = box_corners(b).into_iter().all(|corner| holds(car, corner));
                !box_in_car && (0..4).any(|i| touches(b, corners[i], corners[(i + 1) % 4]))
            }
        })
    }
}

/// Time interval of place `k` of an obstacle: until half way to the next.
fn during(prediction: &Prediction, k: usize, request: &Request<'_>) -> [f64; 2] {
    let after_s = |k: usize| (prediction.path[k].at - request.start.stamp).as_secs();
    let middle = |a: usize, b: usize| 0.5 * (after_s(a) + after_s(b));
    let last = prediction.path.len() - 1;
    let from_s = if k == 0 { f64::NEG_INFINITY } else { middle(k - 1, k) };
    [from_s, if k == last { f64::INFINITY } else { middle(k, k + 1) }]
}

fn grown(b: AxisBox, by_m: f64) -> AxisBox {
    [b[0] - by_m, b[1] - by_m, b[2] + by_m, b[3] + by_m]
}

fn around(obb: &Obb) -> AxisBox {
    bounds(&obb.corners())
}

/// The smallest box around the corners.
pub(crate) fn bounds(corners: &[Point2; 4]) -> AxisBox {
    let none = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    corners.iter().fold(none, |b, c| [b[0].min(c.x_m), b[1].min(c.y_m), b[2].max(c.x_m), b[3].max(c.y_m)])
}

fn box_corners(b: &AxisBox) -> [Point2; 4] {
    [(b[0], b[1]), (b[2], b[1]), (b[2], b[3]), (b[0], b[3])].map(|(x, y)| Point2::new(x, y))
}

/// The original's test for a point in a box, with its effect in Town01.
fn is_left(b: &AxisBox, p: Point2) -> bool {
    b[0] < p.x_m && p.x_m < b[2] && p.y_m > b[1]
}

fn is_inside(b: &AxisBox, p: Point2) -> bool {
    b[0] < p.x_m && p.x_m < b[2] && b[1] < p.y_m && p.y_m < b[3]
}

fn holds(car: &Solid, p: Point2) -> bool {
    let (dx, dy) = (p.x_m - car.x_m, p.y_m - car.y_m);
    (dx * car.cos + dy * car.sin).abs() < car.half_length_m
        && (dy * car.cos - dx * car.sin).abs() < car.half_width_m
}

fn is_near(b: &AxisBox, car: &Solid) -> bool {
    box_corners(b).into_iter().any(|c| c.distance(Point2::new(car.x_m, car.y_m)) <= CORNER_NEAR_M)
}

/// Returns true if the straight line touches the box or its border.
fn touches(b: &AxisBox, from: Point2, to: Point2) -> bool {
    let x = within(from.x_m, to.x_m - from.x_m, b[0], b[2]);
    let y = within(from.y_m, to.y_m - from.y_m, b[1], b[3]);
    x.0.max(y.0).max(0.0) <= x.1.min(y.1).min(1.0)
}

/// The range of `u` for which `from + u * by` is between `low` and `high`; an empty range is reversed.
fn within(from: f64, by: f64, low: f64, high: f64) -> (f64, f64) {
    if by == 0.0 {
        return if low <= from && from <= high { ALWAYS.into() } else { (1.0, 0.0) };
    }
    let (a, b) = ((low - from) / by, (high - from) / by);
    (a.min(b), a.max(b))
}

#[cfg(test)]
mod tests {
    use swerve_planning::testing::World;

    use super::*;

    fn boxes(all: &[AxisBox], by_m: f64, solid_left: bool) -> Boxes {
        let mut boxes = Boxes { solid_left, ..Boxes::default() };
        boxes.set_standing(all, by_m);
        boxes
    }

    #[test]
    fn left_of_a_box_is_solid_with_the_typo() {
        let way = |solid_left, y_m: f64| {
            let boxes = boxes(&[[10.0, -1.0, 11.0, 1.0]], 0.5, solid_left);
            boxes.way_free(Point2::new(10.2, y_m), Point2::new(12.5, y_m), 0.0)
        };
        // Left of the box, inside it, right of it.
        assert_eq!([5.0, 0.0, -3.0].map(|y_m| way(true, y_m)), [false, false, true]);
        assert_eq!([5.0, 0.0, -3.0].map(|y_m| way(false, y_m)), [true, false, true]);
    }

    #[test]
    fn box_inside_the_car_passes_if_only_borders_count() {
        let small = boxes(&[[-0.2, -0.2, 0.2, 0.2]], 0.0, false);
        let car = |x_m| Solid { x_m, y_m: 0.0, cos: 1.0, sin: 0.0, half_length_m: 2.4, half_width_m: 0.9 };
        assert!(small.border_free(&car(0.0), 0.0));
        assert!(!small.border_free(&car(2.3), 0.0));
        let outline_free = |corners: [Point2; 4]| small.outline_free(&corners, bounds(&corners), 0.0);
        assert!(!outline_free(car(2.3).corners()));
        assert!(small.border_free(&car(4.0), 0.0) && outline_free(car(4.0).corners()));
    }

    #[test]
    fn person_has_the_width_of_the_rule() {
        let world = World::straight(10.0).with_person((20.0, 4.0), (0.0, 0.0));
        let width_m = |person_half_m| {
            let mut boxes = Boxes::default();
            let sight = Sight {
                collision: CollisionMode::SweptStatic,
                range_m: 30.0,
                per_place: true,
                person_half_m,
            };
            boxes.set_predicted(&world.request(), Point2::new(0.0, 0.0), sight, 0.5);
            boxes.area_m2().sqrt() - 1.0
        };
        assert!((width_m(Some(0.19)) - 0.38).abs() < 1e-9);
        assert!((width_m(None) - 0.38).abs() > 0.01);
    }

    #[test]
    fn predicted_places_count_at_once_or_by_time() {
        let world = World::straight(10.0).with_person((20.0, 4.0), (0.0, -2.0));
        let predicted = |collision, per_place, range_m| {
            let mut boxes = Boxes::default();
            let sight = Sight { collision, range_m, per_place, person_half_m: None };
            boxes.set_predicted(&world.request(), Point2::new(0.0, 0.0), sight, 0.5);
            boxes
        };
        let across = |boxes: &Boxes, y_m: f64, at_s| {
            boxes.way_free(Point2::new(19.0, y_m), Point2::new(21.0, y_m), at_s)
        };
        let swept = predicted(CollisionMode::SweptStatic, true, 30.0);
        assert!([4.0, 2.0, -2.0].iter().all(|&y_m| !across(&swept, y_m, 0.0)));
        let timed = predicted(CollisionMode::TimeIndexed, true, 30.0);
        assert!(!across(&timed, 4.0, 0.0) && across(&timed, 2.0, 0.0) && !across(&timed, 2.0, 1.0));
        // In range only while she is straight ahead.
        let near = predicted(CollisionMode::SweptStatic, true, 20.05);
        assert!(across(&near, 4.0, 0.0) && !across(&near, 0.0, 0.0));
        assert!(!across(&predicted(CollisionMode::SweptStatic, false, 20.05), 4.0, 0.0));
    }
}
