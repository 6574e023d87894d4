//! Shapes.

use swerve_geom::{Obb, Point2, Pose2};
use swerve_map_io::content::{all, child};
use swerve_map_io::xml::{Element, Reader};

use crate::Shape;
use crate::read::values;

/// Elements that are shapes.
const SHAPES: [&str; 3] = ["rectangle", "circle", "polygon"];

/// The shapes in an element, at least one.
pub(crate) fn shapes(xml: &mut Reader, of: Element<'_>) -> Vec<Shape> {
    let elements: Vec<_> = of.children().filter(|at| SHAPES.contains(&at.tag_name().name())).collect();
    if elements.is_empty() {
        xml.fault(of, || format!("expected one of {}, found none", SHAPES.join(", ")));
    }
    elements.into_iter().map(|at| shape(xml, at)).collect()
}

fn shape(xml: &mut Reader, at: Element<'_>) -> Shape {
    let center = child(at, "center").map_or_else(Point2::default, |at| values::coordinates(xml, at));
    match at.tag_name().name() {
        "rectangle" => {
            let [length_m, width_m] = ["length", "width"].map(|name| size(xml, at, name));
            let heading_rad = match child(at, "orientation") {
                Some(_) => xml.measure(at, "orientation"),
                None => 0.0,
            };
            let center = Pose2::new(center.x_m, center.y_m, heading_rad);
            Shape::Rectangle(Obb::new(center, length_m, width_m))
        }
        "circle" => Shape::Circle(center, size(xml, at, "radius")),
        _ => {
            let mut corners: Vec<Point2> =
                all(at, "point").map(|point| values::coordinates(xml, point)).collect();
            if corners.len() > 1 && corners.first() == corners.last() {
                corners.pop();
            }
            if corners.len() < 3 {
                let count = corners.len();
                xml.fault(at, || format!("expected a polygon of at least 3 corners, found {count}"));
            }
            Shape::Polygon(corners)
        }
    }
}

fn size(xml: &mut Reader, at: Element<'_>, name: &str) -> f64 {
    let faults = xml.faults();
    let value = xml.measure(at, name);
    if xml.faults() == faults && !(1e-3..=1e4).contains(&value) {
        xml.fault(at, || format!("`{name}`: expected 0.001 to 10000 m, found {value}"));
    }
    value
}
