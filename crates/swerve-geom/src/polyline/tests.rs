use super::*;
use crate::math;

/// A left-turning arc of radius 20 m with a point every `step` radians.
fn arc(step: f64) -> Vec<Point2> {
    (0..=(1.5 / step) as usize)
        .map(|k| {
            let (sin, cos) = math::sin_cos(k as f64 * step);
            Point2::new(20.0 * sin, 20.0 - 20.0 * cos)
        })
        .collect()
}

#[test]
fn arc_has_its_curvature_and_heading() {
    let line = Polyline::new(&arc(0.01)).unwrap();
    let at = line.at(10.0);
    assert!((at.curvature_1pm - 0.05).abs() < 1e-4, "{at:?}");
    assert!((at.pose.heading_rad - 0.5).abs() < 1e-3, "{at:?}");
}

#[test]
fn smooth_line_is_resampled_up_to_a_largest_length() {
    let far = |x_m| Polyline::smooth(&[Point2::new(0.0, 0.0), Point2::new(x_m, 0.0)], 0.25);
    assert_eq!(far(2e5).unwrap().points().len(), 800_001);
    assert_eq!(far(1e54), Err(PolylineError::TooLong { length_m: 1e54, max_m: 2.5e5 }));
}

#[test]
fn smooth_line_through_sparse_points_keeps_the_arc() {
    let line = Polyline::smooth(&arc(0.15), 0.25).unwrap();
    for s in [5.0, 10.0, 15.0, 20.0] {
        let p = line.at(s).pose.point();
        let radius = p.distance(Point2::new(0.0, 20.0));
        assert!((radius - 20.0).abs() < 0.01, "{s}: {radius}");
    }
    assert!((line.at(15.0).curvature_1pm - 0.05).abs() < 0.003);
}

#[test]
fn frenet_coordinates_round_trip() {
    let line = Polyline::new(&arc(0.01)).unwrap();
    for (s_m, d_m) in [(3.0, 1.5), (12.0, -2.0), (25.0, 0.0)] {
        let there = line.to_map(FrenetPoint { s_m, d_m });
        let back = line.project(there);
        assert!((back.s_m - s_m).abs() < 0.02 && (back.d_m - d_m).abs() < 0.01, "{back:?}");
        let near = line.project_near(there, s_m + 1.0, 5.0);
        assert_eq!(near, back);
    }
}

#[test]
fn vertices_have_their_arc_lengths() {
    let points = [(0.0, 0.0), (3.0, 4.0), (3.0, 4.0), (3.0, 10.0)].map(|(x, y)| Point2::new(x, y));
    let line = Polyline::new(&points).unwrap();
    let wanted = [(0.0, points[0]), (5.0, points[1]), (11.0, points[3])];
    assert_eq!(line.vertices().collect::<Vec<_>>(), wanted, "the repeated point is merged");
}

#[test]
fn part_begins_and_ends_at_its_arc_lengths() {
    let line =
        Polyline::new(&[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)].map(|(x, y)| Point2::new(x, y))).unwrap();
    let part = |from_m, to_m| line.part([from_m, to_m]).map(|part| part.points().to_vec());
    let points = |all: &[(f64, f64)]| Some(all.iter().map(|&(x, y)| Point2::new(x, y)).collect::<Vec<_>>());
    assert_eq!(part(2.0, 15.0), points(&[(2.0, 0.0), (10.0, 0.0), (10.0, 5.0)]));
    assert_eq!(part(10.0, 20.0), points(&[(10.0, 0.0), (10.0, 10.0)]));
    assert_eq!(part(3.0, 4.0), points(&[(3.0, 0.0), (4.0, 0.0)]));
    assert_eq!(part(3.0, 3.0), None);
}

#[test]
fn line_continues_straight_beyond_its_ends() {
    let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(10.0, 0.0)]).unwrap();
    assert_eq!(line.project(Point2::new(-5.0, 2.0)), FrenetPoint { s_m: -5.0, d_m: 2.0 });
    assert_eq!(line.at(14.0).pose, Pose2::new(14.0, 0.0, 0.0));
}

/// A line that crosses itself, projected with its boxes and without them.
#[test]
fn boxes_do_not_change_projections() {
    let eight = |k: i32| {
        let (sin, cos) = math::sin_cos(0.01 * f64::from(k));
        Point2::new(40.0 * sin, 40.0 * sin * cos)
    };
    let line = Polyline::new(&(0..1300).map(eight).collect::<Vec<_>>()).unwrap();
    let plain = Polyline { boxes: Boxes::default(), ..line.clone() };
    for k in 0..4000 {
        let [x, y] = [k * 37 % 1000, k * 61 % 983].map(|m| 0.12 * f64::from(m) - 60.0);
        let point = Point2::new(x, y);
        assert_eq!(line.project(point), plain.project(point), "{point:?}");
        let near_s_m = f64::from(k % 400);
        let both = [&line, &plain].map(|line| line.project_near(point, near_s_m, 45.0));
        assert_eq!(both[0], both[1], "{point:?} near {near_s_m}");
    }
    for point in [Point2::new(f64::NAN, 1.0), Point2::new(f64::INFINITY, 0.0), eight(7)] {
        let both = [&line, &plain].map(|line| format!("{:?}", line.project(point)));
        assert_eq!(both[0], both[1]);
    }
}

#[test]
fn at_each_agrees_with_at() {
    let line = Polyline::new(&arc(0.05)).unwrap();
    let places = [-3.0, -1.0, 0.0, 0.4, 5.0, 5.0, 12.3, 29.0, 31.0, 400.0, 7.0];
    let each: Vec<PolylinePoint> = line.at_each(places).collect();
    assert_eq!(each, places.map(|s_m| line.at(s_m)));
}

#[test]
fn too_few_points_and_nan_are_rejected() {
    assert_eq!(Polyline::new(&[]), Err(PolylineError::TooShort));
    assert_eq!(Polyline::new(&[Point2::new(1.0, 1.0); 3]), Err(PolylineError::TooShort));
    assert_eq!(
        Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(f64::NAN, 1.0)]),
        Err(PolylineError::NotFinite(1))
    );
}
