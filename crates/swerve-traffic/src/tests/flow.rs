//! Flow through a signalised junction, compared with SUMO's. `tests/reference/traffic/flow.py` describes the cases.

use std::sync::Arc;

use swerve_core::Span;
use swerve_map::{LaneId, Map};
use swerve_msg::{ActorId, Extent};
use swerve_road_user::idm::Idm;

use super::run::{data_map, overlaps, put};
use crate::{DriverParams, Lights, Traffic, TrafficSetup};

const IDM: Idm = Idm { gain_mps2: 1.5, brake_mps2: 2.0, headway_s: 1.5, stand_gap_m: 2.0 };
/// Places of fronts at the begin and the end of a trip, metres, and the speed at the begin, m/s.
const BEGIN_M: f64 = 12.25;
const END_M: f64 = 150.0;
const BEGIN_MPS: f64 = 10.0;
/// Time of the measurement, seconds.
const FROM_S: f64 = 300.0;
const TO_S: f64 = 2100.0;

/// Ways straight on from the right lane of each arm: inwards, across, outwards.
fn straight_on(map: &Map) -> Vec<Vec<LaneId>> {
    let heading_rad = |id: LaneId, end: bool| {
        let line = &map.lane(id).unwrap().line;
        line.at(if end { line.length() } else { 0.0 }).pose.heading_rad
    };
    let inwards = map.lanes().iter().filter(|lane| {
        let leads_in = lane.successors.iter().any(|next| map.is_in_junction(*next));
        lane.line.length() > 100.0 && leads_in && lane.line.points()[0].distance(Default::default()) > 100.0
    });
    let straight = inwards.filter_map(|lane| {
        let next = lane.successors.iter().find(|next| {
            let turn_rad = swerve_geom::angle_between(heading_rad(lane.id, true), heading_rad(**next, true));
            map.is_in_junction(**next) && turn_rad.abs() < 0.1
        })?;
        Some(vec![lane.id, *next, map.lane(*next)?.successors[0]])
    });
    // Of two lanes of an arm, the right one.
    straight
        .filter(|way| {
            map.lane(way[0])
                .unwrap()
                .right
                .is_none_or(|right| map.lane(right.lane).unwrap().kind != swerve_map::LaneKind::Driving)
        })
        .collect()
}

/// Cars per hour and mean speed, m/s, with a car every `period_s` on each arm.
fn measure(map: &Arc<Map>, period_s: f64) -> (f64, f64) {
    let mut drivers = DriverParams::uniform(IDM);
    drivers.mobil.threshold_mps2 = f64::INFINITY;
    let setup = TrafficSetup { drivers, ..TrafficSetup::default() };
    let mut traffic = Traffic::new(Arc::clone(map), &setup, Lights::of_map(map), 1, &[]);
    let ways = straight_on(map);
    assert_eq!(ways.len(), 4);
    let mut waiting = vec![Vec::new(); 4];
    let mut begun: Vec<(ActorId, f64, f64)> = Vec::new();
    let (mut next_id, mut done, mut covered_m, mut lasted_s) = (1, 0, 0.0, 0.0);
    let begin = traffic.tick;
    for k in 0..(TO_S * 10.0) as i64 {
        let now = begin + Span::from_ms(100) * k;
        traffic.advance_alone(now);
        let now_s = now.as_secs();
        for (way, waiting) in ways.iter().zip(&mut waiting) {
            let is_due = (now_s / period_s).floor() > ((now_s - 0.1) / period_s).floor();
            if is_due || k == 0 {
                waiting.push(now_s);
            }
            let lane = traffic.net.lanes.iter().position(|lane| lane.id == way[0]).unwrap();
            let last =
                traffic.cars.iter().filter(|car| car.lane() == lane).min_by(|a, b| a.x_m.total_cmp(&b.x_m));
            let lead = last.map(|last| (last.s_m() - last.half_m() - BEGIN_M, last.speed_mps));
            let fits = IDM.acceleration_mps2(BEGIN_MPS, 13.9, lead) > -IDM.brake_mps2;
            if waiting.is_empty() || !fits {
                continue;
            }
            waiting.remove(0);
            let who = traffic.cars.len();
            let mut car = crate::spawn::vehicle(&setup, 1, false, who, ActorId(next_id));
            next_id += 1;
            car.extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
            traffic.cars.push(car);
            put(&mut traffic, who, way, BEGIN_M - 2.25, BEGIN_MPS);
            let lanes = way[..2].iter().map(|id| map.lane(*id).unwrap().line.length());
            begun.push((ActorId(next_id - 1), now_s, lanes.sum::<f64>() + END_M - BEGIN_M));
        }
        begun.retain(|(id, begun_s, trip_m)| {
            let who = traffic.cars.iter().position(|car| car.id == *id).unwrap();
            let is_done = traffic.cars[who].x_m - (BEGIN_M - 2.25) >= *trip_m;
            if is_done {
                traffic.cars.remove(who);
                let counts = now_s >= FROM_S;
                (done, covered_m, lasted_s) = if counts {
                    (done + 1, covered_m + trip_m, lasted_s + now_s - begun_s)
                } else {
                    (done, covered_m, lasted_s)
                };
            }
            !is_done
        });
        assert_eq!(overlaps(&traffic, now), 0);
    }
    (f64::from(done) * 3600.0 / (TO_S - FROM_S), covered_m / lasted_s)
}

#[test]
fn flow_and_speed_at_a_signalised_junction_are_near_those_of_sumo() {
    let Some(map) = data_map("worlds/sumo/made/cross.net.xml") else { return };
    let text = include_str!("../../../../tests/reference/traffic/flow.json");
    let reference: serde_json::Value = serde_json::from_str(text).unwrap();
    for case in reference["cases"].as_array().unwrap() {
        let [period_s, cars_per_h, speed_mps] =
            ["period_s", "cars_per_h", "speed_mps"].map(|key| case[key].as_f64().unwrap());
        let found = measure(&map, period_s);
        println!("every {period_s} s: {found:?}, SUMO {cars_per_h} cars/h, {speed_mps} m/s");
        for (found, sumo) in [(found.0, cars_per_h), (found.1, speed_mps)] {
            assert!((found / sumo - 1.0).abs() < 0.1, "every {period_s} s: {found}, SUMO {sumo}");
        }
    }
}
