use super::*;
use crate::{Borders, Features, Signal, SignalId, StopLine};

fn lane(id: u32, points: &[(f64, f64)], successors: &[u32]) -> Lane {
    let points: Vec<Point2> = points.iter().map(|(x, y)| Point2::new(*x, *y)).collect();
    let line = Polyline::new(&points).unwrap();
    let successors = successors.iter().copied().map(LaneId).collect();
    Lane { successors, ..Lane::new(LaneId(id), line, Borders::constant(1.75, 1.75)) }
}

/// 40 m to the east, then straight on or to the left.
fn fork() -> Map {
    let lanes = vec![
        lane(1, &[(0.0, 0.0), (40.0, 0.0)], &[2, 3]),
        lane(2, &[(40.0, 0.0), (90.0, 0.0)], &[]),
        lane(3, &[(40.0, 0.0), (48.0, 2.0), (52.0, 10.0), (52.0, 40.0)], &[]),
    ];
    let light = Signal {
        id: SignalId(7),
        name: String::new(),
        position: Point2::new(45.0, 3.0),
        heading_rad: 3.1,
        height_m: None,
        lanes: vec![LaneId(1)],
        controller: None,
        program: None,
    };
    let stop = StopLine { signals: vec![SignalId(7)], ..StopLine::new(LaneId(1), 38.0) };
    let features = Features { signals: vec![light], stop_lines: vec![stop], ..Features::default() };
    Map::with_features(lanes, features).unwrap()
}

#[test]
fn paths_cover_all_successors_and_extensions() {
    let map = fork();
    let paths = map.paths(LaneId(1));
    let lanes: Vec<&[(LaneId, f64)]> = paths.iter().map(|path| &path.lanes[..]).collect();
    let begins_m = [BEYOND_M, BEYOND_M + 40.0];
    assert_eq!(lanes[0], [(LaneId(1), begins_m[0]), (LaneId(2), begins_m[1])]);
    assert_eq!(lanes[1], [(LaneId(1), begins_m[0]), (LaneId(3), begins_m[1])]);
    assert_eq!((paths[1].begin_m(LaneId(3)), paths[1].begin_m(LaneId(2))), (Some(begins_m[1]), None));
    // There is no lane before the first or after the second: both ends are extended.
    assert_eq!(paths[0].line.length(), 90.0 + 2.0 * BEYOND_M);
    assert_eq!(paths[0].stop_lines, [(BEYOND_M + 38.0, LaneId(1))]);
    assert!(paths[0].turn_rad < 1e-9 && (paths[1].turn_rad - 1.326).abs() < 0.01, "{}", paths[1].turn_rad);
    assert!(paths[0].curvature_1pm(200.0).abs() < 1e-9 && paths[0].curvature_1pm(-1e9) == 0.0);
    assert!(paths[1].curvature_1pm(BEYOND_M + 47.0) > 0.05, "a bend to the left");
    assert!(map.paths(LaneId(9)).is_empty());
    assert_eq!(map, fork(), "computed paths do not count in comparisons");
}

#[test]
fn point_is_on_all_lanes_that_contain_it_or_are_close_beside_it() {
    let map = fork();
    let on =
        |x_m, y_m| -> Vec<u32> { map.path_places(Point2::new(x_m, y_m)).map(|found| found.lane.0).collect() };
    assert_eq!(on(20.0, 1.0), [1]);
    assert_eq!(on(44.0, 1.0), [2, 3]);
    assert_eq!(on(20.0, 2.7), [1], "a little beside");
    assert!(on(20.0, 2.8).is_empty());
    assert_eq!((on(-140.0, 0.0), on(-160.0, 0.0)), (vec![1], vec![]), "before its beginning");
    for x_m in [20.0, -5.0] {
        let found = map.path_places(Point2::new(x_m, 1.0)).next().unwrap();
        assert_eq!((found.place.s_m, found.place.d_m), (x_m, 1.0));
        assert_eq!(map.path_pose(found), Some(Pose2::new(x_m, 0.0, 0.0)));
    }
}

#[test]
fn paths_of_cyclic_maps_are_bounded() {
    // A ring of two lanes, and three short lanes that are successors of each other.
    let ring = vec![
        lane(1, &[(0.0, 0.0), (10.0, 5.0), (20.0, 0.0)], &[2]),
        lane(2, &[(20.0, 0.0), (10.0, -5.0), (0.0, 0.0)], &[1]),
    ];
    let knot = (1..=3).map(|id| lane(id, &[(0.0, 0.0), (0.001, 0.0), (0.0, 0.0)], &[1, 2, 3])).collect();
    for (lanes, paths_max) in [(ring, 1), (knot, PATHS_MAX)] {
        let map = Map::new(lanes).unwrap();
        let paths = map.paths(LaneId(1));
        assert_eq!(paths.len(), paths_max);
        assert!(paths.iter().all(|path| path.lanes.len() <= LANES_MAX && path.line.length() < 250.0));
    }
}

#[test]
fn best_successor_has_the_smallest_cost_and_of_equal_costs_the_smallest_identity() {
    let map = fork();
    let first = &map.lanes()[0];
    let best = |cost: fn(&Lane) -> Option<f64>| map.best_successor(first, cost).map(|lane| lane.id.0);
    assert_eq!(best(|lane| Some(-lane.line.length())), Some(2));
    assert_eq!(best(|lane| (lane.id != LaneId(2)).then_some(0.0)), Some(3));
    assert_eq!((best(|_| Some(0.0)), best(|_| None)), (Some(2), None));
}
