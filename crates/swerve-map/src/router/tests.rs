use swerve_geom::Polyline;

use super::*;
use crate::{Borders, Lane, Neighbour};

fn lane(id: u32, y: f64, [from, to]: [f64; 2], successors: &[u32]) -> Lane {
    let line = Polyline::new(&[Point2::new(from, y), Point2::new(to, y)]).unwrap();
    let successors = successors.iter().map(|id| LaneId(*id)).collect();
    Lane { successors, ..Lane::new(LaneId(id), line, Borders::constant(1.5, 1.5)) }
}

/// Two lanes side by side, twice; only the right ones are joined.
fn map() -> Map {
    let beside = |id| Some(Neighbour { lane: LaneId(id), opposite: false });
    let pair = |left: Lane, right: Lane| {
        let (a, b) = (left.id.0, right.id.0);
        [Lane { right: beside(b), ..left }, Lane { left: beside(a), ..right }]
    };
    let first = pair(lane(0, 3.0, [0.0, 100.0], &[]), lane(1, 0.0, [0.0, 100.0], &[3]));
    let second = pair(lane(2, 3.0, [100.0, 200.0], &[]), lane(3, 0.0, [100.0, 200.0], &[]));
    Map::new(first.into_iter().chain(second).collect()).unwrap()
}

fn way(from: (u32, f64), to: (u32, f64)) -> Option<Way> {
    let stop = |(lane, s_m)| Stop { lane: LaneId(lane), s_m };
    find(&map(), stop(from), stop(to), &[])
}

#[test]
fn route_changes_lanes_only_where_it_must() {
    let along = way((1, 10.0), (3, 50.0)).unwrap();
    assert_eq!(
        (along.length_m, along.lanes),
        (140.0, vec![(Step::Begin, LaneId(1)), (Step::Follow, LaneId(3))])
    );
    let line = way((1, 10.0), (3, 50.0)).unwrap();
    let ends = [(0, 10.0, 100.0), (1, 100.0, 150.0)];
    for (k, from, to) in ends {
        assert_eq!(line.line(&map(), k), [Point2::new(from, 0.0), Point2::new(to, 0.0)]);
    }
    let across = way((0, 10.0), (2, 50.0)).unwrap();
    assert_eq!((across.length_m, across.changes()), (140.0, 2));
    let steps: Vec<Step> = across.lanes.iter().map(|(step, _)| *step).collect();
    assert_eq!(steps, [Step::Begin, Step::ChangeRight, Step::Follow, Step::ChangeLeft]);
}

#[test]
fn places_behind_the_start_are_not_reached_on_its_lane() {
    assert_eq!(way((1, 50.0), (1, 40.0)), None);
    assert_eq!(way((1, 50.0), (0, 40.0)), None);
    assert_eq!(way((1, 40.0), (1, 50.0)).unwrap().length_m, 10.0);
    assert_eq!(way((3, 0.0), (1, 50.0)), None);
}
