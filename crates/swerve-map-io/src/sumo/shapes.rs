//! Shapes: lists of coordinates in attributes.

use swerve_geom::{Point2, Vector2};

use super::{NEAR_M, WHOLE_M};
use crate::import::STEP_M;
use crate::xml::{Element, Reader, number};

/// Vertices closer than this are one, metres; as in `Polyline::new`.
const SAME_M: f64 = 1e-6;

/// `netOffset` of the file, metres.
pub(super) fn offset_m(xml: &mut Reader, at: Element<'_>) -> [f64; 2] {
    let Some(text) = at.attribute("netOffset") else { return [0.0; 2] };
    match numbers(text, ',') {
        Ok(numbers) if numbers.len() == 2 => [numbers[0], numbers[1]],
        Ok(numbers) => {
            xml.fault_in(at, "netOffset", || format!("expected 2 numbers, found {}", numbers.len()));
            [0.0; 2]
        }
        Err(message) => {
            xml.fault_in(at, "netOffset", || message);
            [0.0; 2]
        }
    }
}

/// `convBoundary` of the file, metres: smallest x and y, largest x and y; `None` if it has none.
pub(super) fn boundary_m(at: Element<'_>) -> Option<[f64; 4]> {
    numbers(at.attribute("convBoundary")?, ',').ok()?.try_into().ok()
}

/// Offset that brings a network near the origin, given that of its file and its boundary.
pub(super) fn near(offset_m: [f64; 2], boundary_m: Option<[f64; 4]>) -> [f64; 2] {
    let Some([x_min, y_min, x_max, y_max]) = boundary_m else { return offset_m };
    let is_near = |[x, y]: [f64; 2]| {
        [x_min - x, y_min - y, x_max - x, y_max - y].iter().all(|place| place.abs() <= NEAR_M)
    };
    let corner_m = [x_min, y_min].map(|place| (place / WHOLE_M).floor() * WHOLE_M);
    [offset_m, [0.0; 2]].into_iter().find(|moved| is_near(*moved)).unwrap_or(corner_m)
}

/// Vertices of a shape.
pub(super) struct Vertices {
    /// In the frame of the map, without repetitions.
    pub(super) points: Vec<Point2>,
    /// Height of each point, metres; `None` where it has none.
    pub(super) heights_m: Vec<Option<f64>>,
}

/// A required shape: at least one vertex `x,y` or `x,y,z`, separated by spaces.
pub(super) fn shape(
    xml: &mut Reader,
    at: Element<'_>,
    attribute: &str,
    offset_m: [f64; 2],
) -> Option<Vertices> {
    let Some(text) = at.attribute(attribute) else {
        xml.missing(at, attribute);
        return None;
    };
    let mut found = Vertices { points: Vec::new(), heights_m: Vec::new() };
    for vertex in text.split_whitespace() {
        let numbers = match numbers(vertex, ',') {
            Ok(numbers) if matches!(numbers.len(), 2 | 3) => numbers,
            Ok(numbers) => {
                xml.fault_in(at, attribute, || {
                    format!("expected vertices of 2 or 3 numbers, found one of {}", numbers.len())
                });
                return None;
            }
            Err(message) => {
                xml.fault_in(at, attribute, || message);
                return None;
            }
        };
        let point = Point2::new(numbers[0] - offset_m[0], numbers[1] - offset_m[1]);
        if found.points.last().is_none_or(|last: &Point2| last.distance(point) > SAME_M) {
            found.points.push(point);
            found.heights_m.push(numbers.get(2).copied());
        }
    }
    if found.points.is_empty() {
        xml.fault_in(at, attribute, || "expected at least one vertex".to_owned());
        return None;
    }
    Some(found)
}

/// Numbers with a separator between them. At most four: one more than any use has.
fn numbers(text: &str, separator: char) -> Result<Vec<f64>, String> {
    text.split(separator).take(4).map(number).collect()
}

/// Number of vertices with those that [`dense`] adds.
pub(super) fn dense_count(points: &[Point2]) -> f64 {
    points.windows(2).map(|two| steps(two[0], two[1])).sum()
}

/// Number of pieces of a straight line.
fn steps(a: Point2, b: Point2) -> f64 {
    (a.distance(b) / STEP_M).ceil().max(1.0)
}

/// Vertices at most [`STEP_M`] apart.
pub(super) fn dense(points: &[Point2]) -> Vec<Point2> {
    let mut dense: Vec<Point2> = points.first().copied().into_iter().collect();
    for two in points.windows(2) {
        let (a, b) = (two[0], two[1]);
        let steps = steps(a, b);
        dense.extend((1..steps as usize).map(|k| a + (b - a) * (k as f64 / steps)));
        dense.push(b);
    }
    dense
}

/// Outline of a strip around a line of at least two vertices.
pub(super) fn strip(line: &[Point2], width_m: f64) -> Vec<Point2> {
    let to_left = |k: usize| -> Vector2 {
        let (before, after) = (line[k.saturating_sub(1)], line[(k + 1).min(line.len() - 1)]);
        let along = after - before;
        along.left() * (0.5 * width_m / along.norm().max(SAME_M))
    };
    let left = (0..line.len()).map(|k| line[k] + to_left(k));
    let right = (0..line.len()).rev().map(|k| line[k] + to_left(k) * -1.0);
    left.chain(right).collect()
}
