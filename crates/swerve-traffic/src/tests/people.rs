//! Pedestrians.

use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Polyline};
use swerve_map::{
    Aspect, Borders, Crossing, CrossingId, Features, Lane, LaneId, LaneKind, Map, Signal, SignalId, StopLine,
};
use swerve_msg::ActorKind;

use super::run::overlaps;
use crate::{Lights, Traffic, TrafficSetup};

/// A one-way street of 400 m with pavements and a crossing in the middle, with or without a light.
fn street(with_light: bool) -> Arc<Map> {
    let lane = |id: u32, y_m: f64, kind: LaneKind| {
        let line = Polyline::new(&[Point2::new(0.0, y_m), Point2::new(400.0, y_m)]).unwrap();
        let mut lane = Lane::new(LaneId(id), line, Borders::constant(1.5, 1.5));
        lane.kind = kind;
        lane
    };
    let lanes = vec![
        lane(0, 0.0, LaneKind::Driving),
        lane(1, -4.0, LaneKind::Walking),
        lane(2, 4.0, LaneKind::Walking),
    ];
    let corners = [(198.0, -2.0), (202.0, -2.0), (202.0, 2.0), (198.0, 2.0)];
    let outline = corners.map(|(x_m, y_m)| Point2::new(x_m, y_m)).to_vec();
    let crossings =
        vec![Crossing { id: CrossingId(0), name: String::new(), outline, lanes: vec![LaneId(0)] }];
    let mut features = Features { crossings, ..Features::default() };
    if with_light {
        features.signals = vec![Signal {
            id: SignalId(0),
            name: String::new(),
            position: Point2::new(195.0, -3.0),
            heading_rad: 3.0,
            height_m: None,
            lanes: vec![LaneId(0)],
            controller: None,
            program: None,
        }];
        features.stop_lines =
            vec![StopLine { signals: vec![SignalId(0)], ..StopLine::new(LaneId(0), 195.0) }];
    }
    Arc::new(Map::with_features(lanes, features).unwrap())
}

fn phases(at: Time) -> Aspect {
    match at.as_secs() % 60.0 {
        s if s < 30.0 => Aspect::Green,
        s if s < 33.0 => Aspect::Yellow,
        _ => Aspect::Red,
    }
}

#[test]
fn pedestrians_cross_in_gaps_and_at_red_and_are_never_touched() {
    for with_light in [false, true] {
        let setup = TrafficSetup { vehicles: 6, pedestrians: 30, ..TrafficSetup::default() };
        let lights = Lights::new(|_, at| phases(at));
        let mut traffic = Traffic::new(street(with_light), &setup, lights, 4, &[]);
        assert_eq!(traffic.counts().left_out, 0);
        let (mut crossed, mut on_green, mut stops, mut farthest_m) = (0, 0, 0, 0.0_f64);
        for k in 1..6000 {
            let now = Time::ZERO + Span::from_ms(100) * k;
            traffic.advance_alone(now);
            assert_eq!(overlaps(&traffic, now), 0);
            let people = traffic.actors().iter().filter(|actor| actor.kind == ActorKind::Pedestrian);
            for point in people.filter_map(|actor| traffic.movement(actor.id, now)).map(|m| m.pose.point()) {
                let is_on_road = point.y_m.abs() < 1.0;
                assert!(!is_on_road || (point.x_m - 200.0).abs() < 3.0, "{point:?}");
                crossed += u64::from(is_on_road);
                on_green += u64::from(is_on_road && phases(now) == Aspect::Green);
                farthest_m = farthest_m.max(point.y_m.abs());
            }
            stops += traffic.cars.iter().filter(|car| car.speed_mps < 0.1).count();
        }
        println!(
            "light {with_light}: {crossed} ticks on the road, {stops} of cars at rest, {farthest_m:.2} m"
        );
        assert!(crossed > 100 && stops > 10 && farthest_m < 6.5);
        assert!(!with_light || on_green == 0);
    }
}
