//! Long drives, run with `--ignored`.

use std::sync::Arc;

use swerve_map::Map;

use super::run::{cars, data_map, drive, scenario_map};

/// An hour each with `SWERVE_SEEDS` seeds, by default one; the number of cars that were stuck.
fn hours(map: &Arc<Map>, vehicles: usize) -> u64 {
    let seeds = std::env::var("SWERVE_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(1);
    let mut stuck = 0;
    for seed in 0..seeds {
        let mut traffic = cars(map, vehicles, seed);
        let sums = drive(&mut traffic, 3600.0, |_| Vec::new());
        println!("{vehicles} cars, seed {seed}: {sums:?}");
        assert_eq!((sums.overlaps, sums.red_lines, sums.counts.hard_brakes), (0, 0, 0), "seed {seed}");
        assert!(sums.slowest_mps >= 0.0, "seed {seed}");
        stuck += sums.counts.deadlocks;
    }
    println!("{stuck} of {vehicles} cars were stuck in {seeds} hours");
    stuck
}

#[test]
#[ignore = "an hour of traffic for each of SWERVE_SEEDS seeds"]
fn hundred_cars_neither_overlap_nor_get_stuck_in_an_hour() {
    let Some(map) = data_map("external/carla/Town01.xodr") else { return };
    assert_eq!(hours(&map, 100), 0);
}

/// So many cars fill the short roads between junctions in circles now and then; nobody in them can move.
#[test]
#[ignore = "an hour of traffic for each of SWERVE_SEEDS seeds"]
fn two_hundred_cars_neither_overlap_nor_move_backwards_in_an_hour() {
    let Some(map) = data_map("external/carla/Town01.xodr") else { return };
    hours(&map, 200);
}

/// Streets, roundabouts, and a motorway with ramps.
#[test]
#[ignore = "an hour of traffic for each of SWERVE_SEEDS seeds"]
fn hundred_cars_in_the_town_of_the_scenarios_do_neither() {
    assert_eq!(hours(&scenario_map("town.xodr"), 100), 0);
}
