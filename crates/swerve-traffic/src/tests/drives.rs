//! Drives of many vehicles: no overlap, no motion backwards, no red light passed, nobody stuck.

use std::sync::Arc;

use swerve_map::Map;

use super::run::{Sums, data_map, drive, lights, scenario_map};
use crate::{Traffic, TrafficSetup};

/// Drives with seeds and checks what holds in every drive.
fn check(name: &str, map: &Arc<Map>, setup: &TrafficSetup, seeds: core::ops::Range<u64>, seconds: f64) {
    for seed in seeds {
        let mut traffic = Traffic::new(Arc::clone(map), setup, lights(map), seed, &[]);
        let count = traffic.cars.len();
        let sums = drive(&mut traffic, seconds, |_| Vec::new());
        let mean_mps = sums.covered_m / seconds / count as f64;
        println!("{name}, seed {seed}: {count} vehicles, {mean_mps:.2} m/s, {sums:?}");
        let Sums { overlaps, red_lines, slowest_mps, counts, .. } = sums;
        assert_eq!((overlaps, red_lines, counts.deadlocks), (0, 0, 0), "{name}, seed {seed}");
        assert_eq!(counts.hard_brakes, 0, "{name}, seed {seed}");
        assert!(slowest_mps >= 0.0 && mean_mps > 0.5, "{name}, seed {seed}: {mean_mps} m/s");
    }
}

#[test]
fn vehicles_neither_overlap_nor_get_stuck_on_maps_of_scenarios() {
    for (name, vehicles, cyclists) in [
        ("crossing.xodr", 12, 3),
        ("crossing_priority.xodr", 12, 3),
        ("crossing_right_first.xodr", 12, 3),
        ("roundabout.xodr", 15, 3),
        ("ramp.xodr", 20, 0),
        ("two_lane_road.xodr", 15, 0),
        ("two_ways.xodr", 15, 0),
    ] {
        let setup = TrafficSetup { vehicles, cyclists, pedestrians: 8, ..TrafficSetup::default() };
        check(name, &scenario_map(name), &setup, 0..4, 300.0);
    }
}

#[test]
fn vehicles_neither_overlap_nor_get_stuck_in_towns() {
    for (name, vehicles) in [
        ("external/carla/Town01.xodr", 130),
        ("external/carla/Town02.xodr", 80),
        ("worlds/sumo/made/cross.net.xml", 60),
    ] {
        let Some(map) = data_map(name) else { continue };
        let setup = TrafficSetup { vehicles, pedestrians: 40, cyclists: 10, ..TrafficSetup::default() };
        check(name, &map, &setup, 0..2, 120.0);
    }
}

#[test]
fn vehicles_leave_a_map_and_enter_it_at_speed() {
    let setup = TrafficSetup { vehicles: 6, ..TrafficSetup::default() };
    let map = scenario_map("two_lane_road.xodr");
    let mut traffic = Traffic::new(Arc::clone(&map), &setup, lights(&map), 2, &[]);
    let (mut slowest_mps, mut farthest_m) = (f64::INFINITY, 0.0_f64);
    for k in 1..3000 {
        traffic.advance_alone(swerve_core::Time::ZERO + swerve_core::Span::from_ms(100) * k);
        // At the start, they begin at speeds from which they stop behind those ahead.
        for car in traffic.cars.iter().filter(|_| k > 300) {
            slowest_mps = slowest_mps.min(car.speed_mps);
            farthest_m = farthest_m.max(car.s_m() + car.half_m() - traffic.net.lane(car.lane()).length_m);
        }
    }
    assert!(traffic.counts().re_entries > 30 && slowest_mps > 8.0, "{slowest_mps} m/s");
    // Half a second between two attempts to enter.
    assert!(farthest_m < 30.0, "{farthest_m} m beyond the map");
}

#[test]
fn vehicles_drive_around_a_closed_place_or_stop_before_it() {
    let map = scenario_map("two_ways.xodr");
    // The direct road, in both directions.
    let is_direct = |lane: &&swerve_map::Lane| (lane.line.length() - 228.0).abs() < 1.0;
    let closed: Vec<_> = map.lanes().iter().filter(is_direct).map(|lane| lane.id).collect();
    assert!(closed.len() >= 2);
    let setup = TrafficSetup {
        vehicles: 12,
        closed: closed.iter().map(|lane| (*lane, 120.0)).collect(),
        ..TrafficSetup::default()
    };
    for seed in 0..3 {
        let mut traffic = Traffic::new(Arc::clone(&map), &setup, lights(&map), seed, &[]);
        let is_in = |car: &crate::car::Car, net: &crate::net::Net| {
            closed.contains(&net.lane(car.lane()).id) && (car.s_m() - 120.0).abs() < car.half_m()
        };
        for k in 1..1200 {
            traffic.advance_alone(swerve_core::Time::ZERO + swerve_core::Span::from_ms(100) * k);
            assert!(traffic.cars.iter().all(|car| !is_in(car, &traffic.net)), "seed {seed}");
        }
        assert_eq!(traffic.counts().deadlocks, 0, "seed {seed}");
    }
}
