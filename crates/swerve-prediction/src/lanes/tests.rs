use swerve_map::{Borders, Features, Signal, StopLine};

use super::*;

fn lane(id: u32, points: &[(f64, f64)], successors: &[u32]) -> Lane {
    let points: Vec<Point2> = points.iter().map(|(x, y)| Point2::new(*x, *y)).collect();
    let line = Polyline::new(&points).unwrap();
    let mut lane = Lane::new(LaneId(id), line, Borders::constant(1.75, 1.75));
    lane.successors = successors.iter().copied().map(LaneId).collect();
    lane
}

/// 40 m to the east, then straight on or to the left.
fn fork() -> LaneGraph {
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
    LaneGraph::new(Map::with_features(lanes, features).unwrap())
}

#[test]
fn lane_sequences_cover_all_successors_and_extensions() {
    let lanes = fork();
    let ways = lanes.ways(0);
    let over: Vec<Vec<usize>> =
        ways.iter().map(|way| way.lanes.iter().map(|(lane, _)| *lane).collect()).collect();
    assert_eq!(over, [[0, 1], [0, 2]]);
    // There is no lane before the first or after the second: both ends are extended.
    assert_eq!(ways[0].line.length(), 90.0 + 2.0 * BEYOND_M);
    assert_eq!(ways[0].stops, [(BEYOND_M + 38.0, 0)]);
    assert!(ways[0].turn_rad < 1e-9 && (ways[1].turn_rad - 1.326).abs() < 0.01, "{}", ways[1].turn_rad);
    assert!(ways[0].curvature_1pm(200.0).abs() < 1e-9 && ways[0].curvature_1pm(-1e9) == 0.0);
    assert!(ways[1].curvature_1pm(BEYOND_M + 47.0) > 0.05, "a bend to the left");
    assert_eq!((lanes.signals(0).collect::<Vec<_>>(), lanes.signals(1).count()), (vec![SignalId(7)], 0));
}

#[test]
fn point_is_on_all_lanes_that_contain_it() {
    let lanes = fork();
    let on = |x_m, y_m| -> Vec<usize> {
        lanes.spots(Point2::new(x_m, y_m)).iter().map(|spot| spot.lane).collect()
    };
    assert_eq!(on(20.0, 1.0), [0]);
    assert_eq!(on(44.0, 1.0), [1, 2]);
    assert_eq!(on(20.0, 2.7), [0], "a little beside");
    assert!(on(20.0, 2.8).is_empty());
    assert_eq!((on(-140.0, 0.0), on(-160.0, 0.0)), (vec![0], vec![]), "before its beginning");
    let spot = lanes.spots(Point2::new(20.0, 1.0))[0];
    assert_eq!((spot.at.s_m, spot.at.d_m), (BEYOND_M + 20.0, 1.0));
    assert!(lanes.is_between_ends(&spot) && !lanes.is_between_ends(&lanes.spots(Point2::new(-5.0, 0.0))[0]));
}

#[test]
fn lane_sequences_of_cyclic_maps_are_bounded() {
    // A ring of two lanes, and three short lanes that are successors of each other.
    let ring = vec![
        lane(1, &[(0.0, 0.0), (10.0, 5.0), (20.0, 0.0)], &[2]),
        lane(2, &[(20.0, 0.0), (10.0, -5.0), (0.0, 0.0)], &[1]),
    ];
    let knot = (1..=3).map(|id| lane(id, &[(0.0, 0.0), (0.001, 0.0), (0.0, 0.0)], &[1, 2, 3])).collect();
    for (lanes, ways_max) in [(ring, 1), (knot, WAYS_MAX)] {
        let lanes = LaneGraph::new(Map::new(lanes).unwrap());
        assert_eq!(lanes.ways(0).len(), ways_max);
        assert!(lanes.ways(0).iter().all(|way| way.lanes.len() <= LANES_MAX && way.line.length() < 250.0));
    }
}
