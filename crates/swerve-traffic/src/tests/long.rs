//! Long drives, run with `--ignored`.

use super::run::{cars, data_map, drive};

/// An hour each with `SWERVE_SEEDS` seeds, by default one; the number of cars that were stuck.
fn hours(vehicles: usize) -> Option<u64> {
    let map = data_map("external/carla/Town01.xodr")?;
    let seeds = std::env::var("SWERVE_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(1);
    let mut stuck = 0;
    for seed in 0..seeds {
        let mut traffic = cars(&map, vehicles, seed);
        let sums = drive(&mut traffic, 3600.0, |_| Vec::new());
        println!("{vehicles} cars, seed {seed}: {sums:?}");
        assert_eq!((sums.overlaps, sums.red_lines), (0, 0), "seed {seed}");
        assert!(sums.slowest_mps >= 0.0, "seed {seed}");
        stuck += sums.counts.deadlocks;
    }
    println!("{stuck} of {vehicles} cars were stuck in {seeds} hours");
    Some(stuck)
}

#[test]
#[ignore = "an hour of traffic for each of SWERVE_SEEDS seeds"]
fn hundred_cars_neither_overlap_nor_get_stuck_in_an_hour() {
    assert_eq!(hours(100).unwrap_or(0), 0);
}

/// So many cars fill the short roads between junctions in circles now and then; nobody in them can move.
#[test]
#[ignore = "an hour of traffic for each of SWERVE_SEEDS seeds"]
fn two_hundred_cars_neither_overlap_nor_move_backwards_in_an_hour() {
    hours(200);
}
