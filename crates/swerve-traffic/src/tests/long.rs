//! Long drives, run with `--ignored`.

use super::run::{cars, data_map, drive};

#[test]
#[ignore = "an hour of traffic for 20 seeds"]
fn two_hundred_cars_neither_overlap_nor_move_backwards_in_an_hour() {
    let Some(map) = data_map("external/carla/Town01.xodr") else { return };
    let seeds = std::env::var("SWERVE_SEEDS").ok().and_then(|seeds| seeds.parse().ok()).unwrap_or(20);
    let mut stuck = 0;
    for seed in 0..seeds {
        let mut traffic = cars(&map, 200, seed);
        let sums = drive(&mut traffic, 3600.0, |_| Vec::new());
        println!("seed {seed}: {sums:?}");
        assert_eq!((sums.overlaps, sums.red_lines), (0, 0), "seed {seed}");
        assert!(sums.slowest_mps >= 0.0, "seed {seed}");
        stuck += sums.counts.deadlocks;
    }
    println!("{stuck} cars were stuck");
    assert_eq!(stuck, 0);
}
