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
        check(name, &scenario_map(name), &setup, 0..3, 120.0);
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
