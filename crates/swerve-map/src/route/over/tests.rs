use swerve_geom::{Obb, Pose2};

use super::*;
use crate::router::{Stop, find, find_over};
use crate::{Features, Junction, JunctionId, LaneId, LaneMarks, Mark, MarkKind, Neighbour, Signal, SignalId};

fn lane(id: u32, points: &[(f64, f64)], successors: &[u32]) -> Lane {
    let points: Vec<Point2> = points.iter().map(|&(x, y)| Point2::new(x, y)).collect();
    let successors = successors.iter().map(|id| LaneId(*id)).collect();
    let borders = Borders::constant(1.75, 1.75);
    Lane { successors, ..Lane::new(LaneId(id), Polyline::new(&points).unwrap(), borders) }
}

fn side_by_side(lanes: &mut [Lane], left: usize, right: usize) {
    let beside = |lane: &Lane| Some(Neighbour { lane: lane.id, opposite: false });
    (lanes[left].right, lanes[right].left) = (beside(&lanes[right]), beside(&lanes[left]));
}

/// Three rows of 40 m with two lanes side by side; the right lane ends with them, the left one goes on for 200 m.
fn motorway() -> Map {
    let row = |k: u32| {
        let [from, to] = [f64::from(k) * 40.0, f64::from(k + 1) * 40.0];
        let next = |id: u32| [id + 2];
        let nexts = |id: u32, ends: bool| if k == 2 && ends { Vec::new() } else { next(id).to_vec() };
        [
            lane(2 * k + 1, &[(from, 0.0), (to, 0.0)], &nexts(2 * k + 1, true)),
            lane(2 * k, &[(from, 3.5), (to, 3.5)], &nexts(2 * k, false)),
        ]
    };
    let mut lanes: Vec<Lane> = (0..3).flat_map(row).collect();
    for k in 0..3 {
        side_by_side(&mut lanes, 2 * k + 1, 2 * k);
    }
    lanes.push(lane(6, &[(120.0, 3.5), (320.0, 3.5)], &[]));
    Map::new(lanes).unwrap()
}

fn over(map: &Map, from: (u32, f64), to: (u32, f64), beyond_m: f64) -> (Route, [f64; 2]) {
    let stop = |(lane, s_m)| Stop { lane: LaneId(lane), s_m };
    Route::over(map, &find(map, stop(from), stop(to), &[]).unwrap(), beyond_m, 15.0).unwrap()
}

/// Largest curvature of a route, 1/m.
fn most_curvature_1pm(route: &Route) -> f64 {
    let count = route.line().length() as u32;
    (0..count).map(|x| route.line().at(f64::from(x)).curvature_1pm.abs()).fold(0.0, f64::max)
}

#[test]
fn change_of_lanes_is_as_gentle_at_any_speed() {
    let [limit, free] = [Some(24.0), None].map(|speed_limit_mps| {
        let lanes = motorway().lanes().to_vec().into_iter();
        Map::new(lanes.map(|lane| Lane { speed_limit_mps, ..lane }).collect()).unwrap()
    });
    let stop = |lane, s_m| Stop { lane: LaneId(lane), s_m };
    // 24 m/s need 72 m of the 120 m; at 40 m/s the move takes all that there is.
    for (map, speed_mps, lateral_mps2) in [(&limit, 30.0, 2.4), (&free, 24.0, 2.4), (&free, 12.0, 1.0)] {
        let way = find(map, stop(1, 5.0), stop(6, 50.0), &[]).unwrap();
        let (route, _) = Route::over(map, &way, 0.0, speed_mps).unwrap();
        let driven_mps = map.lanes()[0].speed_limit_mps.unwrap_or(speed_mps);
        let got_mps2 = most_curvature_1pm(&route) * driven_mps * driven_mps;
        assert!(got_mps2 < lateral_mps2, "{driven_mps} m/s: {got_mps2}");
    }
    let way = find(&free, stop(1, 5.0), stop(6, 50.0), &[]).unwrap();
    let (route, _) = Route::over(&free, &way, 0.0, 40.0).unwrap();
    assert!(most_curvature_1pm(&route) < 5.9 * 3.5 / (110.0 * 110.0));
}

#[test]
fn change_of_lanes_is_one_smooth_move_over_all_rows_where_they_are_side_by_side() {
    let (route, [start_m, goal_m]) = over(&motorway(), (1, 10.0), (6, 50.0), 0.0);
    assert_eq!(start_m, 10.0);
    // The move is longer than its projection by the mean of half its squared slope, 10/7 d²/l, halved.
    assert!((goal_m - 170.0 - 5.0 / 7.0 * 3.5 * 3.5 / 60.0).abs() < 0.01, "{goal_m}");
    let at = |x_m: f64| route.project(Point2::new(x_m, 0.0));
    let y_m = |x_m: f64| route.line().at(at(x_m).s_m).pose.y_m;
    for (x_m, expected) in [(5.0, 0.0), (14.9, 0.0), (45.0, 1.75), (75.5, 3.5), (300.0, 3.5)] {
        assert!((y_m(x_m) - expected).abs() < 0.03, "{x_m}: {}", y_m(x_m));
    }
    // Curvature of a quintic: at most 5.78 d/l².
    assert!(most_curvature_1pm(&route) < 5.9 * 3.5 / 3600.0);
    // On the move both lanes are the ego's and the ground; before and after it, its lane is one of them.
    for (x_m, own, ground) in [
        (5.0, [1.75, -1.75], [5.25, -1.75]),
        (45.0, [5.25, -1.75], [5.25, -1.75]),
        (100.0, [5.25, 1.75], [5.25, -1.75]),
        (200.0, [5.25, 1.75], [5.25, 1.75]),
    ] {
        let (s_m, y_m) = (at(x_m).s_m, y_m(x_m));
        let ends = |of: &Borders| [y_m + of.left_m(s_m), y_m - of.right_m(s_m)];
        for (got, expected) in [(ends(route.lane()), own), (ends(route.borders()), ground)] {
            for k in 0..2 {
                assert!((got[k] - expected[k]).abs() < 0.02, "{x_m}: {got:?}, not {expected:?}");
            }
        }
    }
    let lanes: Vec<u32> = route.stretches().iter().map(|stretch| stretch.lane.0).collect();
    assert_eq!(lanes, [1, 3, 2, 4, 6]);
}

/// A road of 1,000 m with four lanes side by side, from 0 on the left to 3 on the right.
fn wide_road() -> Map {
    let mut lanes: Vec<Lane> =
        (0..4).map(|k| lane(k, &[(0.0, -3.5 * f64::from(k)), (1000.0, -3.5 * f64::from(k))], &[])).collect();
    (0..3).for_each(|left| side_by_side(&mut lanes, left, left + 1));
    Map::new(lanes).unwrap()
}

#[test]
fn route_is_on_the_lane_of_each_place_that_it_passes() {
    let map = wide_road();
    let stop = |(lane, s_m)| Stop { lane: LaneId(lane), s_m };
    for places in [
        &[(3, 60.0), (1, 600.0), (3, 900.0)][..],
        &[(3, 60.0), (3, 600.0), (1, 900.0)],
        &[(3, 60.0), (1, 400.0), (1, 900.0)],
        &[(3, 60.0), (2, 300.0), (0, 500.0), (1, 600.0), (3, 900.0)],
        &[(3, 60.0), (2, 999.8), (3, 1000.0)],
    ] {
        let stops: Vec<Stop> = places.iter().copied().map(stop).collect();
        let way = find_over(&map, &stops, &[]).unwrap();
        let (route, [start_m, goal_m]) = Route::over(&map, &way, 0.0, 15.0).unwrap();
        for &(lane, s_m) in places.iter().filter(|place| place.1 < 999.0) {
            let place = route.project(Point2::new(s_m, -3.5 * f64::from(lane)));
            assert!(place.d_m.abs() < 0.01, "{places:?}: {} m beside {lane} at {s_m} m", place.d_m);
            assert_eq!(route.stretch_at(place.s_m).unwrap().lane, LaneId(lane), "{places:?} at {s_m} m");
        }
        let goal = route.line().at(goal_m).pose;
        assert!((goal.x_m - places.last().unwrap().1).abs() < 0.01, "{places:?}: {goal_m}");
        assert_eq!(start_m, 60.0);
        let twice = route.stretches().windows(2).find(|two| two[0].lane == two[1].lane);
        assert_eq!(twice, None, "{places:?}");
        if goal_m < 950.0 {
            assert!(most_curvature_1pm(&route) < 3.0 * 5.9 * 3.5 / 3600.0);
        }
    }
}

#[test]
fn ways_without_a_change_equal_the_route_along_their_lanes() {
    let map = motorway();
    let (route, ends_m) = over(&map, (0, 5.0), (6, 20.0), 0.0);
    assert_eq!(route, Route::along(&map, &[0, 2, 4, 6].map(LaneId)).unwrap());
    assert_eq!(ends_m, [5.0, 140.0]);
    let (route, ends_m) = over(&map, (0, 5.0), (2, 20.0), 100.0);
    assert_eq!((ends_m, route.line().length()), ([5.0, 60.0], 320.0));
}

#[test]
fn ground_of_a_junction_is_that_of_all_lanes_without_a_gap() {
    let mut lanes = vec![
        lane(0, &[(0.0, 0.0), (20.0, 0.0)], &[]),
        lane(1, &[(20.0, 3.5), (0.0, 3.5)], &[]),
        lane(2, &[(10.0, -20.0), (10.0, 20.0)], &[]),
        lane(3, &[(0.0, -9.0), (20.0, -9.0)], &[]),
    ];
    lanes[3].kind = LaneKind::Walking;
    let junction = Junction {
        id: JunctionId(0),
        name: String::new(),
        lanes: [0, 1, 2, 3].map(LaneId).to_vec(),
        incoming: Vec::new(),
        rights_of_way: Vec::new(),
    };
    let features = Features { junctions: vec![junction], ..Features::default() };
    let map = Map::with_features(lanes, features).unwrap();
    let (route, _) = over(&map, (0, 0.0), (0, 20.0), 0.0);
    for (s_m, left_m, right_m) in [(3.0, 5.25, 1.75), (10.0, 12.0, 12.0), (17.0, 5.25, 1.75)] {
        assert!((route.left_m(s_m) - left_m).abs() < 0.02, "{s_m}: {}", route.left_m(s_m));
        assert!((route.right_m(s_m) - right_m).abs() < 0.02, "{s_m}: {}", route.right_m(s_m));
        assert_eq!((route.lane().left_m(s_m), route.lane().right_m(s_m)), (1.75, 1.75));
    }
    assert!(route.margin_m(&Obb::new(Pose2::new(10.0, 6.0, 0.0), 3.0, 3.0)) > 0.0);
}

#[test]
fn change_crosses_where_the_line_is_broken() {
    let lined = |solid_rows: &[usize]| {
        let lanes = motorway().lanes().to_vec().into_iter().enumerate().map(|(k, lane)| {
            let kind = if solid_rows.contains(&(k / 2)) { MarkKind::Solid } else { MarkKind::Broken };
            // The right lanes have odd identities.
            let left = if k % 2 == 1 { vec![Mark::new(0.0, kind)] } else { Vec::new() };
            Lane { marks: LaneMarks::new(left, Vec::new()).unwrap(), ..lane }
        });
        Map::new(lanes.collect()).unwrap()
    };
    let middle_m = |map: &Map| {
        let (route, _) = over(map, (1, 10.0), (6, 50.0), 0.0);
        (0..200).find(|x| route.line().at(f64::from(*x)).pose.y_m > 1.75).map(f64::from)
    };
    assert!(middle_m(&lined(&[])).is_some_and(|x| (44.0..48.0).contains(&x)), "{:?}", middle_m(&lined(&[])));
    // Over the line from 40 m on.
    let late_m = middle_m(&lined(&[0])).unwrap();
    assert!(late_m >= 40.0 + 15.0, "{late_m}");
    // No way crosses a line that is solid everywhere.
    let stop = |lane, s_m| Stop { lane: LaneId(lane), s_m };
    assert_eq!(find(&lined(&[0, 1, 2]), stop(1, 10.0), stop(6, 50.0), &[]), None);
    assert_eq!(find(&lined(&[1, 2]), stop(3, 10.0), stop(6, 50.0), &[]), None);
}

/// The goal is on the last lane of a change over several rows: farther along it than the change is long.
#[test]
fn goal_on_the_last_lane_of_a_change_is_where_it_is_on_the_road() {
    let lanes = motorway().lanes().to_vec().into_iter().map(|lane| match lane.id.0 {
        // Both lanes of the last row go on for 300 m.
        4 | 5 => {
            let y_m = lane.line.points()[0].y_m;
            let line = Polyline::new(&[Point2::new(80.0, y_m), Point2::new(380.0, y_m)]).unwrap();
            Lane { line, successors: Vec::new(), ..lane }
        }
        _ => lane,
    });
    let map = Map::new(lanes.filter(|lane| lane.id.0 != 6).collect()).unwrap();
    for goal_s_m in [20.0, 100.0, 290.0] {
        let (route, [start_m, goal_m]) = over(&map, (1, 10.0), (4, goal_s_m), 0.0);
        let goal = route.unproject(FrenetPoint { s_m: goal_m, d_m: 0.0 });
        assert_eq!(start_m, 10.0);
        assert!((goal.x_m - 80.0 - goal_s_m).abs() < 0.1, "{goal_s_m}: {goal:?}");
    }
}

#[test]
fn stop_is_at_the_end_of_the_lane_that_the_route_changes_to() {
    let mut lanes = vec![
        lane(0, &[(0.0, 3.5), (200.0, 3.5)], &[2]),
        lane(1, &[(0.0, 0.0), (200.0, 0.0)], &[]),
        lane(2, &[(200.0, 3.5), (220.0, 3.5)], &[3]),
        lane(3, &[(220.0, 3.5), (300.0, 3.5)], &[]),
    ];
    side_by_side(&mut lanes, 0, 1);
    let junction = Junction {
        id: JunctionId(0),
        name: String::new(),
        lanes: vec![LaneId(2)],
        incoming: vec![LaneId(0)],
        rights_of_way: Vec::new(),
    };
    let signal = Signal {
        id: SignalId(0),
        name: String::new(),
        position: Point2::new(200.0, 3.5),
        heading_rad: 0.0,
        height_m: None,
        lanes: vec![LaneId(0)],
        controller: None,
        program: None,
    };
    let features = Features { junctions: vec![junction], signals: vec![signal], ..Features::default() };
    let map = Map::with_features(lanes, features).unwrap();
    for from in [0, 1] {
        let (route, _) = over(&map, (from, 10.0), (3, 40.0), 0.0);
        let stop_m = route.stop_s_m(&map, &map.signals()[0]).unwrap();
        let x_m = route.line().at(stop_m).pose.x_m;
        assert!((x_m - 199.0).abs() < 0.01, "from lane {from}: {x_m}");
    }
}
