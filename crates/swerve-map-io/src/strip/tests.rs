//! Borders of lanes against the lines that they are made of.

use swerve_geom::{Point2, Polyline};
use swerve_map::Borders;

use super::*;

/// Largest difference between a line and a border of a lane where the line is beside the lane, metres.
pub(crate) fn worst_m(lane: &Polyline, borders: &Borders, [left, right]: [&[Point2]; 2]) -> f64 {
    let mut worst_m = 0.0_f64;
    for (line, side) in [(left, 1.0), (right, -1.0)] {
        let border = if side > 0.0 { borders.left() } else { borders.right() };
        for two in line.windows(2) {
            let steps = (two[0].distance(two[1]) / 0.05).ceil().clamp(1.0, 200.0);
            for k in 0..=steps as usize {
                let place = lane.project(two[0] + (two[1] - two[0]) * (k as f64 / steps));
                if 0.0 < place.s_m && place.s_m < lane.length() {
                    worst_m = worst_m.max((border.at(place.s_m) - side * place.d_m).abs());
                }
            }
        }
    }
    worst_m
}

/// Coordinates of a line.
type Line = Vec<(f64, f64)>;

fn points(line: &[(f64, f64)]) -> Vec<Point2> {
    line.iter().map(|&(x, y)| Point2::new(x, y)).collect()
}

/// A line beside a circle of 20 m about the origin, from 0° to 90°, with `count` pieces.
fn arc(radius_m: f64, count: usize) -> Line {
    let at = |k: usize| {
        let (sin, cos) = math::sin_cos(core::f64::consts::FRAC_PI_2 * k as f64 / count as f64);
        (radius_m * cos, radius_m * sin)
    };
    (0..=count).map(at).collect()
}

#[test]
fn borders_are_exact_beside_any_centre_line() {
    let cases: &[(&str, Line, Line)] = &[
        ("straight", vec![(0.0, 2.0), (30.0, 2.0)], vec![(0.0, -2.0), (30.0, -2.0)]),
        (
            "one sparse, one dense",
            vec![(0.0, 2.0), (30.0, 2.0)],
            (0..=60).map(|k| (0.5 * f64::from(k), -2.0)).collect(),
        ),
        ("widening", vec![(0.0, 1.0), (30.0, 4.0)], vec![(0.0, -1.0), (12.0, -1.0), (30.0, -3.0)]),
        ("to a point", vec![(0.0, 1.5), (20.0, 0.0)], vec![(0.0, -1.5), (20.0, 0.0)]),
        ("skewed ends", vec![(0.0, 2.0), (30.0, 2.0)], vec![(3.0, -2.0), (33.0, -2.0)]),
        (
            "bay",
            vec![(0.0, 2.0), (10.0, 2.0), (12.0, 4.0), (18.0, 4.0), (20.0, 2.0), (30.0, 2.0)],
            vec![(0.0, -2.0), (30.0, -2.0)],
        ),
        ("left bend", arc(18.0, 12), arc(22.0, 12)),
        ("coarse bend", arc(18.0, 4), arc(22.0, 5)),
        ("tight bend", arc(3.0, 6), arc(7.0, 6)),
        ("right bend", arc(22.0, 12).into_iter().rev().collect(), arc(18.0, 12).into_iter().rev().collect()),
        (
            "corner",
            vec![(0.0, 2.0), (10.0, 2.0), (10.0, 12.0)],
            vec![(0.0, -2.0), (14.0, -2.0), (14.0, 12.0)],
        ),
    ];
    for (name, left, right) in cases {
        let (left, right) = (points(left), points(right));
        let center = rounded(&dense(&centered(&left, &right, None)));
        let line = Polyline::new(&center).unwrap();
        let borders = measured(&center, &left, &right);
        let worst_m = worst_m(&line, &borders, [&left, &right]);
        println!("{name}: {} vertices, worst {:.4} mm", center.len(), 1e3 * worst_m);
        // Corners of 45° and 90° have the largest number of pieces.
        let within_m = match *name {
            "bay" => 2e-3,
            "corner" => 8e-3,
            _ => 1e-3,
        };
        assert!(worst_m < within_m, "{name}: {worst_m}");

        assert!(!is_swapped(&center, &left, &right) && is_swapped(&center, &right, &left), "{name}");
    }
}

#[test]
fn straight_lanes_have_constant_borders() {
    let (left, right) = (points(&[(0.3, 2.0), (30.1, 2.0)]), points(&[(0.3, -1.5), (30.1, -1.5)]));
    let center = rounded(&dense(&centered(&left, &right, None)));
    assert_eq!(measured(&center, &left, &right), Borders::constant(1.75, 1.75));
    assert!(center.windows(2).all(|two| two[0].distance(two[1]) <= STEP_M + 1e-9));
}

#[test]
fn centre_line_of_the_file_is_kept() {
    let (left, right) = (points(&[(0.0, 2.0), (30.0, 2.0)]), points(&[(0.0, -2.0), (30.0, -2.0)]));
    let given = points(&[(0.0, 0.5), (11.0, 0.5), (30.0, 0.5)]);
    let center = rounded(&dense(&centered(&left, &right, Some(&given))));
    assert_eq!(measured(&center, &left, &right), Borders::constant(1.5, 2.5));
    assert!(center.contains(&Point2::new(11.0, 0.5)), "{center:?}");
}
