//! Lane changes.

use std::sync::Arc;

use swerve_core::Span;
use swerve_geom::{Point2, Polyline};
use swerve_map::{
    Borders, Features, Junction, JunctionId, Lane, LaneId, LaneMarks, Map, Mark, MarkKind, Neighbour,
};

use super::run::{lights, overlaps, put};
use crate::{Traffic, TrafficSetup};

/// Two lanes beside each other, with a mark between them.
fn road(mark: MarkKind, in_junction: bool) -> Arc<Map> {
    let lane = |id: u32, y_m: f64| {
        let line = Polyline::new(&[Point2::new(0.0, y_m), Point2::new(2000.0, y_m)]).unwrap();
        let mut lane = Lane::new(LaneId(id), line, Borders::constant(1.75, 1.75));
        lane.speed_limit_mps = Some(15.0);
        lane
    };
    let (mut right, mut left) = (lane(0, 0.0), lane(1, 3.5));
    let beside = |id: u32| Some(Neighbour { lane: LaneId(id), opposite: false });
    (right.left, left.right) = (beside(1), beside(0));
    let marks = vec![Mark::new(0.0, mark)];
    right.marks = LaneMarks::new(marks.clone(), Vec::new()).unwrap();
    left.marks = LaneMarks::new(Vec::new(), marks).unwrap();
    let junction = Junction {
        id: JunctionId(0),
        name: String::new(),
        lanes: vec![LaneId(0), LaneId(1)],
        incoming: Vec::new(),
        rights_of_way: Vec::new(),
    };
    let junctions = if in_junction { vec![junction] } else { Vec::new() };
    let features = Features { junctions, ..Features::default() };
    Arc::new(Map::with_features(vec![right, left], features).unwrap())
}

/// A fast car behind a slow one; true if it has overtaken.
fn overtakes(map: &Arc<Map>) -> bool {
    let setup = TrafficSetup { vehicles: 2, ..TrafficSetup::default() };
    // Lanes inside a junction are not entered: cars begin on a map without.
    let mut traffic = Traffic::new(Arc::clone(map), &setup, lights(map), 3, &[]);
    while traffic.cars.len() < 2 {
        let car = crate::spawn::vehicle(&setup, 3, false, traffic.cars.len(), swerve_msg::ActorId(9));
        traffic.cars.push(car);
    }
    put(&mut traffic, 0, &[LaneId(0)], 120.0, 5.0);
    put(&mut traffic, 1, &[LaneId(0)], 60.0, 14.0);
    traffic.cars[0].top_mps = 5.0;
    let begin = traffic.tick;
    for k in 1..500 {
        let now = begin + Span::from_ms(100) * k;
        traffic.advance_alone(now);
        assert_eq!(overlaps(&traffic, now), 0);
    }
    traffic.cars[1].s_m() > traffic.cars[0].s_m()
}

#[test]
fn driver_changes_lanes_where_the_mark_and_the_place_permit_it() {
    for (mark, in_junction, permitted) in [
        (MarkKind::Broken, false, true),
        (MarkKind::Solid, false, false),
        (MarkKind::SolidBroken, false, false),
        (MarkKind::Broken, true, false),
    ] {
        assert_eq!(overtakes(&road(mark, in_junction)), permitted, "{mark:?}, in a junction: {in_junction}");
    }
}

/// Three lanes of which the right one ends at 400 m. A car in the left lane follows a slow one; true if it changes to the
/// middle within 10 s, with another car on the right lane so far ahead of it.
fn changes_beside_an_entry(ahead_m: f64) -> bool {
    let lane = |id: u32, y_m: f64, length_m: f64| {
        let line = Polyline::new(&[Point2::new(0.0, y_m), Point2::new(length_m, y_m)]).unwrap();
        let mut lane = Lane::new(LaneId(id), line, Borders::constant(1.75, 1.75));
        lane.speed_limit_mps = Some(20.0);
        lane
    };
    let beside = |id: u32| Some(Neighbour { lane: LaneId(id), opposite: false });
    let (mut entry, mut middle, mut left) = (lane(0, 0.0, 400.0), lane(1, 3.5, 1900.0), lane(2, 7.0, 1900.0));
    (entry.left, middle.left, middle.right, left.right) = (beside(1), beside(2), beside(0), beside(1));
    let map = Arc::new(Map::new(vec![entry, middle, left]).unwrap());
    let setup = TrafficSetup { vehicles: 3, ..TrafficSetup::default() };
    let mut traffic = Traffic::new(Arc::clone(&map), &setup, lights(&map), 3, &[]);
    while traffic.cars.len() < 3 {
        let car = crate::spawn::vehicle(&setup, 3, false, traffic.cars.len(), swerve_msg::ActorId(9));
        traffic.cars.push(car);
    }
    // Behind a slow car in the left lane, the middle is better.
    put(&mut traffic, 0, &[LaneId(2)], 160.0, 5.0);
    put(&mut traffic, 1, &[LaneId(2)], 100.0, 15.0);
    put(&mut traffic, 2, &[LaneId(0)], 100.0 + ahead_m, 15.0);
    traffic.cars[0].top_mps = 5.0;
    let begin = traffic.tick;
    for k in 1..=100 {
        traffic.advance_alone(begin + Span::from_ms(100) * k);
        if traffic.cars[1].change.is_some() {
            return true;
        }
        // The one on the entry stays beside.
        let (s_m, speed_mps) = (traffic.cars[1].s_m() + ahead_m, traffic.cars[1].speed_mps);
        put(&mut traffic, 2, &[LaneId(0)], s_m, speed_mps);
    }
    false
}

#[test]
fn driver_does_not_change_to_where_another_one_merges_from_the_other_side() {
    let changes = [-60.0, -10.0, 0.0, 10.0, 60.0].map(changes_beside_an_entry);
    assert_eq!(changes, [true, false, false, false, true]);
}
