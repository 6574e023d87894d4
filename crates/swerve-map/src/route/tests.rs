use super::*;
use crate::{LaneKind, LaneMarks, Mark, MarkKind, Station};
use swerve_geom::{Pose2, math};

fn border(pairs: &[(f64, f64)]) -> Border {
    let stations: Vec<_> = pairs.iter().map(|&(s_m, distance_m)| Station { s_m, distance_m }).collect();
    Border::linear(&stations).unwrap()
}

fn line(points: &[(f64, f64)]) -> Polyline {
    Polyline::new(&points.iter().map(|&(x, y)| Point2::new(x, y)).collect::<Vec<_>>()).unwrap()
}

fn beside(lane: u32, opposite: bool) -> Option<Neighbour> {
    Some(Neighbour { lane: LaneId(lane), opposite })
}

/// Lane 2 is the successor of lane 1. Beside lane 1: to the left an oncoming lane (3) that narrows from 4 m to 2 m
/// against the direction of lane 1, beyond it a footway (4); to the right a shoulder (5).
fn map() -> Map {
    let lane = |id, points: &[(f64, f64)]| Lane::new(LaneId(id), line(points), Borders::constant(2.0, 2.0));
    let narrowing = Borders::new(border(&[(0.0, 2.0), (100.0, 0.0)]), Border::constant(2.0));
    Map::new(vec![
        Lane {
            left: beside(3, true),
            right: beside(5, false),
            successors: vec![LaneId(2)],
            speed_limit_mps: Some(13.9),
            ..lane(1, &[(0.0, 0.0), (60.0, 0.0), (100.0, 0.0)])
        },
        lane(2, &[(100.0, 0.0), (200.0, 0.0)]),
        Lane {
            left: beside(1, true),
            right: beside(4, true),
            borders: narrowing,
            ..lane(3, &[(100.0, 4.0), (0.0, 4.0)])
        },
        Lane { kind: LaneKind::Walking, right: beside(3, true), ..lane(4, &[(0.0, 8.0), (100.0, 8.0)]) },
        Lane {
            kind: LaneKind::Shoulder,
            left: beside(1, false),
            borders: Borders::constant(0.5, 0.5),
            ..lane(5, &[(0.0, -2.5), (100.0, -2.5)])
        },
    ])
    .unwrap()
}

#[test]
fn route_borders_are_those_of_the_drivable_ground_beside_its_lanes() {
    let route = Route::along(&map(), &[LaneId(1), LaneId(2)]).unwrap();
    assert_eq!(route.line().length(), 200.0);
    // Lane 3 is 4 m wide at its start, at the end of lane 1, and 2 m wide at its end.
    for (s_m, left_m, right_m) in
        [(0.0, 4.0, 3.0), (50.0, 5.0, 3.0), (99.999_999, 6.0, 3.0), (100.0, 2.0, 2.0), (199.0, 2.0, 2.0)]
    {
        assert!((route.left_m(s_m) - left_m).abs() < 1e-6, "{s_m}: {}", route.left_m(s_m));
        assert!((route.right_m(s_m) - right_m).abs() < 1e-6, "{s_m}: {}", route.right_m(s_m));
    }
    assert_eq!(
        route.stretches().iter().map(|x| (x.lane.0, x.begin_m)).collect::<Vec<_>>(),
        [(1, 0.0), (2, 100.0)]
    );
    let at = |s_m| route.stretch_at(s_m).map(|x| (x.lane.0, x.speed_limit_mps));
    assert_eq!(
        (at(-5.0), at(99.0), at(100.0)),
        (Some((1, Some(13.9))), Some((1, Some(13.9))), Some((2, None)))
    );
}

#[test]
fn junctions_ahead_count_from_the_lane_at_the_place() {
    let stretch = |lane, begin_m, in_junction| Stretch {
        lane: LaneId(lane),
        begin_m,
        speed_limit_mps: None,
        in_junction,
    };
    let plain = Route::uniform(line(&[(0.0, 0.0), (300.0, 0.0)]), 2.0, 2.0);
    assert_eq!(plain.stretch_at(5.0), None);
    assert_eq!(plain.to_junction_m(5.0), f64::INFINITY);
    let stretches = vec![stretch(1, 0.0, false), stretch(2, 100.0, true), stretch(3, 120.0, false)];
    let route = Route { stretches, ..plain };
    // Place, lane, distance to the junction.
    for (s_m, lane, junction_m) in [
        (-5.0, 1, 105.0),
        (99.0, 1, 1.0),
        (100.0, 2, 0.0),
        (119.0, 2, 0.0),
        (120.0, 3, f64::INFINITY),
        (999.0, 3, f64::INFINITY),
    ] {
        assert_eq!(route.stretch_at(s_m).map(|x| x.lane), Some(LaneId(lane)), "{s_m}");
        assert_eq!(route.to_junction_m(s_m), junction_m, "{s_m}");
    }
}

#[test]
fn lanes_that_are_not_successors_are_rejected() {
    let along = |ids: &[u32]| {
        let ids: Vec<_> = ids.iter().map(|&id| LaneId(id)).collect();
        Route::along(&map(), &ids).unwrap_err().to_string()
    };
    assert_eq!(along(&[]), "a route needs one lane at least");
    assert_eq!(along(&[1, 9]), "lane 9 is not on the map");
    assert_eq!(along(&[2, 1]), "lane 1 does not go on from lane 2");
}

#[test]
fn margin_follows_a_road_that_narrows_and_widens() {
    let left = border(&[(40.0, 6.0), (60.0, 2.0), (80.0, 2.0), (100.0, 6.0)]);
    let route = Route::new(line(&[(0.0, 0.0), (150.0, 0.0)]), Borders::new(left, Border::constant(2.0)));
    let margin = |s_m: f64, d_m: f64| {
        let center = route.unproject(FrenetPoint { s_m, d_m });
        route.margin_m(&Obb::new(Pose2::new(center.x_m, center.y_m, 0.0), 4.0, 2.0))
    };
    // In the middle of a strip that is 8 m wide, then 4 m, then 8 m again.
    for (s_m, wanted_m) in [(20.0, 3.0), (70.0, -1.0), (130.0, 3.0)] {
        assert!((margin(s_m, 2.0) - wanted_m).abs() < 1e-9, "{s_m}: {}", margin(s_m, 2.0));
    }
    // Where it narrows by 1 m in 5 m, the front left corner is nearest; where it widens, the rear left one.
    assert!((margin(50.0, 2.0) - (4.0 - 0.4 - 3.0)).abs() < 1e-9);
    assert!((margin(90.0, 2.0) - (4.0 - 0.4 - 3.0)).abs() < 1e-9);
}

/// Margin of a strip of constant width, as computed before borders could vary.
fn margin_of_a_strip(line: &Polyline, left_m: f64, right_m: f64, outline: &Obb) -> f64 {
    outline.corners().into_iter().fold(f64::INFINITY, |margin, corner| {
        let FrenetPoint { d_m, .. } = line.project(corner);
        margin.min(left_m - d_m).min(d_m + right_m)
    })
}

#[test]
fn margin_of_a_constant_strip_is_bitwise_unchanged() {
    let points: Vec<_> = (0..80)
        .map(|k| {
            let (sin, cos) = math::sin_cos(0.03 * f64::from(k));
            (30.0 * sin, 30.0 - 30.0 * cos)
        })
        .collect();
    let (line, left_m, right_m) = (line(&points), 5.3, 2.1);
    let route = Route::uniform(line.clone(), left_m, right_m);
    for k in 0..400 {
        let (x, y) = (f64::from(k % 20) * 2.7 - 10.0, f64::from(k / 20) * 3.1 - 5.0);
        let outline = Obb::new(Pose2::new(x, y, f64::from(k) * 0.1), 4.93, 1.86);
        let (was, is) = (margin_of_a_strip(&line, left_m, right_m, &outline), route.margin_m(&outline));
        assert_eq!(was.to_bits(), is.to_bits(), "{outline:?}");
    }
}

#[test]
fn route_text_has_a_number_for_a_constant_border_and_stations_otherwise() {
    let route = Route::uniform(line(&[(0.0, 0.0), (50.0, 0.0)]), 6.0, 2.0);
    let text = serde_json::to_string(&route).unwrap();
    assert!(text.contains("\"borders\":{\"left_m\":6.0,\"right_m\":2.0}"), "{text}");
    assert_eq!(serde_json::from_str::<Route>(&text).unwrap(), route);
    let varying = Route::along(&map(), &[LaneId(1), LaneId(2)]).unwrap();
    let text = serde_json::to_string(&varying).unwrap();
    assert!(text.contains("\"right_m\":[[0.0,3.0],[100.0,3.0],[100.0,2.0],[200.0,2.0]]"), "{text}");
    assert_eq!(serde_json::from_str::<Route>(&text).unwrap(), varying);
    let bytes = postcard::to_allocvec(&varying).unwrap();
    assert_eq!(postcard::from_bytes::<Route>(&bytes).unwrap(), varying);
}

/// The same map with a line to the left of lane 1 that is solid up to 40 m, and a solid line to its shoulder.
fn lined() -> Map {
    let marks = |left: Vec<Mark>, right: Vec<Mark>| LaneMarks::new(left, right).unwrap();
    let lanes = map().lanes().to_vec().into_iter().map(|lane| match lane.id.0 {
        1 => {
            let left = vec![Mark::new(0.0, MarkKind::Solid), Mark::new(40.0, MarkKind::BrokenSolid)];
            Lane { marks: marks(left, vec![Mark::new(0.0, MarkKind::Solid)]), ..lane }
        }
        // Seen from the other direction it is solid everywhere.
        3 => Lane { marks: marks(vec![Mark::new(0.0, MarkKind::Solid)], Vec::new()), ..lane },
        _ => lane,
    });
    Map::new(lanes.collect()).unwrap()
}

#[test]
fn ground_between_lines_ends_at_the_first_line_that_must_not_be_crossed() {
    let along = |map: &Map, lanes: &[u32]| {
        Route::along(map, &lanes.iter().map(|id| LaneId(*id)).collect::<Vec<_>>()).unwrap()
    };
    assert_eq!(along(&map(), &[1, 2]).between_lines(), None, "unknown lines may be crossed");
    let route = along(&lined(), &[1, 2]);
    assert_eq!(*route.borders(), *along(&map(), &[1, 2]).borders(), "the ground is the same");
    let lines = route.between_lines().unwrap();
    // The oncoming lane is 2 m wide at 0, and 4 m at 100 m.
    for (s_m, left_m) in [(0.0, 2.0), (39.0, 2.0), (40.0, 4.8), (99.9, 6.0), (150.0, 2.0)] {
        assert!((lines.left_m(s_m) - left_m).abs() < 0.02, "{s_m}: {}", lines.left_m(s_m));
        assert!((lines.right_m(s_m) - 2.0).abs() < 1e-9);
    }
    let narrowed = route.narrowed(0.5);
    assert!((narrowed.between_lines().unwrap().left_m(10.0) - 1.5).abs() < 1e-9);
    assert_eq!(route.within(Borders::constant(1.0, 1.0)).between_lines(), None);
    let oncoming = along(&lined(), &[3]);
    let lines = oncoming.between_lines().unwrap();
    for s_m in [5.0, 50.0, 95.0] {
        assert!((lines.left_m(s_m) - oncoming.lane().left_m(s_m)).abs() < 1e-9, "{s_m}");
    }
}
