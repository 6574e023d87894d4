//! Shapes on the ground.

use swerve_geom::{Obb, Point2, Pose2};

/// A shape in the map.
#[derive(Clone, PartialEq, Debug)]
pub enum Shape {
    /// A rectangle.
    Rectangle(Obb),
    /// A circle: centre, and radius in metres.
    Circle(Point2, f64),
    /// A simple polygon: its corners in either direction, the first one not repeated.
    Polygon(Vec<Point2>),
}

impl Shape {
    /// This shape, given around the origin, at a pose.
    #[must_use]
    pub fn placed(&self, position: Point2, heading_rad: f64) -> Self {
        let pose: Pose2 = Pose2::new(position.x_m, position.y_m, heading_rad);
        match self {
            Self::Rectangle(local) => {
                let at = pose.from_local(local.center.point());
                let center = Pose2::new(at.x_m, at.y_m, heading_rad + local.center.heading_rad);
                Self::Rectangle(Obb { center, ..*local })
            }
            Self::Circle(center, radius_m) => Self::Circle(pose.from_local(*center), *radius_m),
            Self::Polygon(corners) => {
                Self::Polygon(corners.iter().map(|corner| pose.from_local(*corner)).collect())
            }
        }
    }

    /// True if a point is inside or on the border.
    pub fn contains(&self, point: Point2) -> bool {
        match self {
            Self::Rectangle(rectangle) => rectangle.contains(point),
            Self::Circle(center, radius_m) => center.distance(point) <= *radius_m,
            Self::Polygon(corners) => polygon_contains(corners, point),
        }
    }

    /// True if the shape and a rectangle have a point in common.
    pub fn overlaps(&self, rectangle: &Obb) -> bool {
        match self {
            Self::Rectangle(own) => own.overlaps(rectangle),
            Self::Circle(center, radius_m) => rectangle.distance_to_point(*center) <= *radius_m,
            Self::Polygon(corners) => polygon_overlaps(corners, rectangle),
        }
    }

    /// Distance of a point, metres; 0 inside.
    pub fn distance_m(&self, point: Point2) -> f64 {
        match self {
            Self::Rectangle(rectangle) => rectangle.distance_to_point(point),
            Self::Circle(center, radius_m) => (center.distance(point) - radius_m).max(0.0),
            Self::Polygon(corners) if polygon_contains(corners, point) => 0.0,
            Self::Polygon(corners) => sides(corners)
                .map(|(a, b)| nearest(a, b, point).distance(point))
                .fold(f64::INFINITY, f64::min),
        }
    }

    /// Length and width of the rectangle along the axes that contains the shape, metres.
    pub fn extent_m(&self) -> [f64; 2] {
        match self {
            Self::Rectangle(own) => [2.0 * own.half_length_m, 2.0 * own.half_width_m],
            Self::Circle(_, radius_m) => [2.0 * radius_m; 2],
            Self::Polygon(corners) => {
                let [low, high] = box_of(corners);
                [high.x_m - low.x_m, high.y_m - low.y_m]
            }
        }
    }

    /// Middle of the shape: centre, or mean of the corners.
    pub fn center(&self) -> Point2 {
        match self {
            Self::Rectangle(own) => own.center.point(),
            Self::Circle(center, _) => *center,
            Self::Polygon(corners) => {
                let count = corners.len().max(1) as f64;
                let [x_m, y_m] = corners.iter().fold([0.0, 0.0], |[x, y], one| [x + one.x_m, y + one.y_m]);
                Point2::new(x_m / count, y_m / count)
            }
        }
    }
}

/// Lowest and highest coordinates of points.
pub(crate) fn box_of(points: &[Point2]) -> [Point2; 2] {
    let mut low = Point2::new(f64::INFINITY, f64::INFINITY);
    let mut high = Point2::new(f64::NEG_INFINITY, f64::NEG_INFINITY);
    for point in points {
        low = Point2::new(low.x_m.min(point.x_m), low.y_m.min(point.y_m));
        high = Point2::new(high.x_m.max(point.x_m), high.y_m.max(point.y_m));
    }
    [low, high]
}

/// Sides of a closed polygon.
fn sides(corners: &[Point2]) -> impl Iterator<Item = (Point2, Point2)> + '_ {
    corners.iter().copied().zip(corners.iter().copied().cycle().skip(1))
}

/// Point of a line segment that is nearest to a point.
fn nearest(a: Point2, b: Point2, point: Point2) -> Point2 {
    let along = b - a;
    let squared = along.norm_squared();
    let share = if squared > 0.0 { ((point - a).dot(along) / squared).clamp(0.0, 1.0) } else { 0.0 };
    a + along * share
}

/// Even-odd rule, with the border inside.
pub(crate) fn polygon_contains(corners: &[Point2], point: Point2) -> bool {
    let mut inside = false;
    for (a, b) in sides(corners) {
        if nearest(a, b, point).distance(point) <= 1e-9 {
            return true;
        }
        if (a.y_m > point.y_m) != (b.y_m > point.y_m) {
            let x_m = a.x_m + (point.y_m - a.y_m) / (b.y_m - a.y_m) * (b.x_m - a.x_m);
            inside ^= point.x_m < x_m;
        }
    }
    inside
}

fn polygon_overlaps(corners: &[Point2], rectangle: &Obb) -> bool {
    if corners.len() < 3 {
        return false;
    }
    let of_rectangle = rectangle.corners();
    polygon_contains(corners, rectangle.center.point())
        || corners.iter().any(|corner| rectangle.contains(*corner))
        || of_rectangle.iter().any(|corner| polygon_contains(corners, *corner))
        || sides(corners).any(|(a, b)| sides(&of_rectangle).any(|(c, d)| cross(a, b, c, d)))
}

/// True if two line segments have a point in common; parallel ones do not count.
fn cross(a: Point2, b: Point2, c: Point2, d: Point2) -> bool {
    let (u, v, w) = (b - a, d - c, c - a);
    let across = u.cross(v);
    if across == 0.0 {
        return false;
    }
    let (t, s) = (w.cross(v) / across, w.cross(u) / across);
    (0.0..=1.0).contains(&t) && (0.0..=1.0).contains(&s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Vec<Point2> {
        [(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)].map(|(x, y)| Point2::new(x, y)).to_vec()
    }

    #[test]
    fn polygon_contains_its_border_and_not_the_outside() {
        for (x, y, inside) in [(2.0, 2.0, true), (4.0, 2.0, true), (0.0, 0.0, true), (4.1, 2.0, false)] {
            assert_eq!(Shape::Polygon(square()).contains(Point2::new(x, y)), inside, "{x} {y}");
        }
    }

    #[test]
    fn polygon_overlaps_rectangles_that_cross_it_without_corners_inside() {
        let shape = Shape::Polygon(square());
        let bar = |x: f64| Obb::new(Pose2::new(x, 2.0, 0.0), 20.0, 1.0);
        assert!(shape.overlaps(&bar(0.0)) && shape.overlaps(&bar(2.0)) && !shape.overlaps(&bar(15.0)));
    }

    #[test]
    fn shape_is_placed_by_rotation_around_the_origin() {
        let local = Shape::Circle(Point2::new(1.0, 0.0), 0.5);
        let placed = local.placed(Point2::new(10.0, 20.0), core::f64::consts::FRAC_PI_2);
        let Shape::Circle(center, radius_m) = placed else { panic!("{placed:?}") };
        assert!(center.distance(Point2::new(10.0, 21.0)) < 1e-12 && radius_m == 0.5);
    }
}
