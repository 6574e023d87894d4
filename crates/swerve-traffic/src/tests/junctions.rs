//! Rights of way at junctions.

use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_map::{Aspect, LaneId};

use super::run::{overlaps, put, scenario_map, ways};
use crate::{Lights, Traffic, TrafficSetup};

fn traffic(map: &str, vehicles: usize) -> Traffic {
    let setup = TrafficSetup { vehicles, ..TrafficSetup::default() };
    Traffic::new(scenario_map(map), &setup, Lights::new(|_, _| Aspect::Off), 1, &[])
}

/// Instants at which vehicles enter and leave the junction on the second lane of their ways, seconds.
fn passages(traffic: &mut Traffic, seconds: f64) -> Vec<[Option<f64>; 2]> {
    let mut found = vec![[None; 2]; traffic.cars.len()];
    let begin = traffic.tick;
    let entries: Vec<i64> = traffic.cars.iter().map(|car| car.entries).collect();
    for k in 0..(seconds * 10.0) as i64 {
        let now: Time = begin + Span::from_ms(100) * k;
        traffic.advance_alone(now);
        assert_eq!(overlaps(traffic, now), 0);
        for (who, car) in traffic.cars.iter().enumerate() {
            let is_in = traffic.net.lane(car.lane()).in_junction;
            let [entered, left] = &mut found[who];
            if car.entries == entries[who] && is_in {
                entered.get_or_insert(now.as_secs());
            } else if entered.is_some() {
                left.get_or_insert(now.as_secs());
            }
        }
    }
    found
}

fn length_m(traffic: &Traffic, id: LaneId) -> f64 {
    traffic.net.lanes.iter().find(|lane| lane.id == id).unwrap().length_m
}

#[test]
fn four_cars_at_a_crossing_without_signs_do_not_block_each_other() {
    for turn_rad in [0.0, 1.5] {
        let mut traffic = traffic("crossing_right_first.xodr", 4);
        let ways = ways(&traffic, turn_rad);
        assert_eq!(ways.len(), 4);
        for (who, way) in ways.iter().enumerate() {
            let s_m = length_m(&traffic, way[0]) - 30.0;
            put(&mut traffic, who, way, s_m, 6.0);
        }
        let passages = passages(&mut traffic, 60.0);
        println!("{passages:?}, {:?}", traffic.counts());
        assert!(passages.iter().all(|[_, left]| left.is_some()), "{passages:?}");
        // Going straight on, each has someone to its right: one must be let go.
        assert!(turn_rad != 0.0 || traffic.counts().circles >= 1);
    }
}

#[test]
fn traffic_from_the_right_goes_first() {
    let mut traffic = traffic("crossing_right_first.xodr", 2);
    let ways = ways(&traffic, 0.0);
    // Ordered by heading: the one after comes from the right.
    for (who, way) in ways[..2].iter().enumerate() {
        let s_m = length_m(&traffic, way[0]) - 40.0;
        put(&mut traffic, who, way, s_m, 8.0);
    }
    let passages = passages(&mut traffic, 40.0);
    let [[yields_in, _], [_, first_out]] = passages[..] else { panic!() };
    assert!(yields_in.unwrap() > first_out.unwrap() - 1.5, "{passages:?}");
    assert!(passages[1][0].unwrap() < 8.0, "{passages:?}");
}

#[test]
fn left_turn_waits_for_oncoming_traffic() {
    for (ahead_m, waits) in [(50.0, true), (150.0, false)] {
        let mut traffic = traffic("crossing_right_first.xodr", 2);
        let (left, straight) = (ways(&traffic, 1.57), ways(&traffic, 0.0));
        let s_m = length_m(&traffic, left[0][0]) - 15.0;
        put(&mut traffic, 0, &left[0], s_m, 3.0);
        let oncoming = &straight[2];
        let s_m = (length_m(&traffic, oncoming[0]) - ahead_m).max(5.0);
        put(&mut traffic, 1, oncoming, s_m, 10.0);
        let passages = passages(&mut traffic, 40.0);
        println!("{passages:?}");
        let goes_after = passages[0][1].unwrap() > passages[1][1].unwrap();
        assert_eq!(goes_after, waits, "{ahead_m} m: {passages:?}");
    }
}

#[test]
fn red_light_holds_and_green_lets_go() {
    let setup = TrafficSetup { vehicles: 1, ..TrafficSetup::default() };
    let lights = |green_s: f64| {
        Lights::new(move |_, at| if at.as_secs() < green_s { Aspect::Red } else { Aspect::Green })
    };
    for green_s in [20.0, 35.0] {
        let map = scenario_map("crossing.xodr");
        assert!(!map.signals().is_empty());
        let mut traffic = Traffic::new(Arc::clone(&map), &setup, lights(green_s), 1, &[]);
        let way = ways(&traffic, 0.0).remove(0);
        let s_m = length_m(&traffic, way[0]) - 45.0;
        put(&mut traffic, 0, &way, s_m, 10.0);
        let passages = passages(&mut traffic, 60.0);
        let entered_s = passages[0][0].unwrap();
        assert!((green_s..green_s + 6.0).contains(&entered_s), "{green_s} s: {passages:?}");
    }
}

#[test]
fn driver_too_close_to_stop_passes_a_light_that_turns_yellow() {
    let map = scenario_map("crossing.xodr");
    let setup = TrafficSetup { vehicles: 1, ..TrafficSetup::default() };
    for (before_m, passes) in [(12.0, true), (35.0, false)] {
        let lights = Lights::new(|_, at| match at.as_secs() {
            s if s < 0.3 => Aspect::Green,
            s if s < 3.3 => Aspect::Yellow,
            s if s < 30.0 => Aspect::Red,
            _ => Aspect::Green,
        });
        let mut traffic = Traffic::new(Arc::clone(&map), &setup, lights, 1, &[]);
        let way = ways(&traffic, 0.0).remove(0);
        let s_m = length_m(&traffic, way[0]) - before_m - 3.0;
        put(&mut traffic, 0, &way, s_m, 10.0);
        let entered_s = passages(&mut traffic, 60.0)[0][0].unwrap();
        assert_eq!(entered_s < 4.0, passes, "{before_m} m: {entered_s} s");
    }
}
