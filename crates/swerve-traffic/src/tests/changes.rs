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
