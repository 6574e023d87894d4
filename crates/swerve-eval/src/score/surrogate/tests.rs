use std::collections::BTreeMap;

use serde::Deserialize;
use swerve_geom::{Pose2, math};

use super::*;

fn car(x_m: f64, y_m: f64, heading_rad: f64) -> Obb {
    Obb::new(Pose2::new(x_m, y_m, heading_rad), 4.0, 2.0)
}

fn moving(x_m: f64, y_m: f64, (vx_mps, vy_mps): (f64, f64)) -> Moving {
    Moving { outline: car(x_m, y_m, 0.0), velocity_mps: Vector2::new(vx_mps, vy_mps) }
}

#[test]
fn time_to_collision_is_gap_over_closing_speed() {
    let ego = moving(0.0, 0.0, (15.0, 0.0));
    assert_eq!(time_to_collision_s(&ego, &moving(24.0, 1.9, (5.0, 0.0))), Some(2.0));
    assert_eq!(time_to_collision_s(&ego, &moving(24.0, 2.1, (5.0, 0.0))), None);
    assert_eq!(time_to_collision_s(&ego, &moving(3.0, 0.0, (5.0, 0.0))), Some(0.0));
    assert_eq!(time_to_collision_s(&ego, &moving(24.0, 0.0, (15.0, 0.0))), None);
}

#[test]
fn gap_closes_at_constant_acceleration() {
    assert_eq!(time_to_close_s(20.0, 10.0, 0.0), Some(2.0));
    // 20 = 8 t + t² at t = 2, and 8 t - t² = 15 at t = 3, first.
    assert_eq!(time_to_close_s(20.0, 8.0, 2.0), Some(2.0));
    assert_eq!(time_to_close_s(15.0, 8.0, -2.0), Some(3.0));
    assert_eq!(time_to_close_s(17.0, 8.0, -2.0), None, "16 m are the most");
    assert_eq!(time_to_close_s(8.0, 0.0, 4.0), Some(2.0));
    assert_eq!(time_to_close_s(5.0, -1.0, 0.0), None);
    // CommonRoad-CriMe, DEU_Gar-1_1, ego 200, other 202, rounded there to 0.01 s: the gaps and times of four steps
    // belong to one closing speed.
    for (gap_m, wanted_s) in [(22.16, 3.70), (19.17, 3.19), (16.22, 2.70), (13.22, 2.20)] {
        let time_s = time_to_close_s(gap_m, 6.003, 0.0).unwrap();
        assert!((time_s - wanted_s).abs() < 0.0101, "{gap_m} m: {time_s} s");
    }
}

#[test]
fn worst_time_to_collision_solves_the_equation_of_the_circles() {
    let wttc = |other: Moving, accel: [f64; 2]| {
        worst_time_to_collision_s(&moving(0.0, 0.0, (0.0, 0.0)), &other, accel)
    };
    let reach_m = 2.0 * math::hypot(2.0, 1.0);
    // At rest 30 m apart: d - 2 r = A t² / 2, A = 4 + 6.
    let still = wttc(moving(30.0, 0.0, (0.0, 0.0)), [4.0, 6.0]).unwrap();
    assert!((still - ((30.0 - reach_m) / 5.0).sqrt()).abs() < 1e-6, "{still}");
    // Head on at 10 m/s: one more term.
    let closing = wttc(moving(30.0, 0.0, (-10.0, 0.0)), [4.0, 6.0]).unwrap();
    assert!((30.0 - 10.0 * closing - reach_m - 5.0 * closing * closing).abs() < 1e-6, "{closing}");
    // Away, and past each other: the first solution of the quartic equation.
    for velocity in [(8.0, 0.0), (0.0, 9.0), (-20.0, 3.0)] {
        let time_s = wttc(moving(30.0, 4.0, velocity), [4.0, 4.0]).unwrap();
        let gap_m = |t: f64| math::hypot(30.0 + velocity.0 * t, 4.0 + velocity.1 * t) - reach_m - 4.0 * t * t;
        assert!(gap_m(time_s).abs() < 1e-6, "{velocity:?}: {time_s}");
        assert!(
            (1..1000).all(|k| gap_m(time_s * f64::from(k) / 1000.0) > 0.0),
            "{velocity:?}: not the first"
        );
    }
    assert_eq!(wttc(moving(3.0, 0.0, (0.0, 0.0)), [1.0, 1.0]), Some(0.0));
    assert_eq!(wttc(moving(30.0, 0.0, (0.0, 0.0)), [0.0, 0.0]), None);
    assert_eq!(wttc(moving(30.0, 20.0, (-10.0, 0.0)), [0.0, 0.0]), None, "they pass each other");
}

/// Samples every 10 ms of a car with constant velocity.
fn trace(from: (f64, f64, f64), speed_mps: f64) -> Vec<(f64, Obb)> {
    let start = Pose2::new(from.0, from.1, from.2);
    (0..=600)
        .map(|k| {
            let at_s = 0.01 * f64::from(k);
            (at_s, Obb::new(start.ahead(speed_mps * at_s), 4.0, 2.0))
        })
        .collect()
}

#[test]
fn encroachment_is_the_time_between_exit_and_entry() {
    let quarter = core::f64::consts::FRAC_PI_2;
    // East along y = 0: the rear leaves x = 1 after (1 + 2 + 20) / 10 s. North along x = 0: the front reaches y = -1 after
    // (30 - 1 - 2) / 8 s.
    let (one, other) = (trace((-20.0, 0.0, 0.0), 10.0), trace((0.0, -30.0, quarter), 8.0));
    let area = Obb::new(Pose2::new(0.0, 0.0, 0.0), 2.0, 2.0);
    let wanted_s = 27.0 / 8.0 - 23.0 / 10.0;
    let found_s = post_encroachment_in_s(&one, &other, &area).unwrap();
    assert!((found_s - wanted_s).abs() < 1e-9, "{found_s} {wanted_s}");
    assert_eq!(post_encroachment_in_s(&other, &one, &area), Some(found_s));
    // Without an area, it is the square that both cover; its time is found to a sample on either side.
    let swept_s = post_encroachment_s(&one, &other).unwrap();
    assert!((swept_s - wanted_s).abs() < 0.021, "{swept_s} {wanted_s}");
    // Both inside at once; one that never comes; one that stays.
    let same = trace((0.0, -20.0, quarter), 10.0);
    assert_eq!(post_encroachment_in_s(&one, &same, &area), Some(0.0));
    assert_eq!(post_encroachment_s(&one, &same), Some(0.0));
    let far = trace((0.0, 50.0, quarter), 10.0);
    assert_eq!((post_encroachment_in_s(&one, &far, &area), post_encroachment_s(&one, &far)), (None, None));
    let parked = trace((0.0, 0.0, quarter), 0.0);
    assert_eq!(post_encroachment_in_s(&parked, &one, &area), None);
}

#[test]
fn rss_distances_match_their_closed_forms() {
    let rss = RssParams::R157;
    // 20 * 0.75 + 3 * 0.75² / 2 + 22.25² / 12 - 15² / 12.
    let wanted_m = 15.0 + 0.843_75 + 22.25 * 22.25 / 12.0 - 18.75;
    assert!((rss.longitudinal_m(20.0, 15.0) - wanted_m).abs() < 1e-12);
    assert_eq!(rss.longitudinal_m(5.0, 40.0), 0.0);
    let way_m = 15.0 + 0.843_75 + 22.25 * 22.25 / 12.0;
    assert!((rss.oncoming_m(20.0, 20.0) - 2.0 * way_m).abs() < 1e-12);
    // Both at rest: each gains 0.75 m/s in 0.28125 m and loses it in as much.
    assert!((rss.lateral_m(0.0, 0.0) - (0.3 + 2.0 * 0.5625)).abs() < 1e-12);
    assert!((rss.lateral_to_cut_in_m(-1.0) - (0.3 + 0.75 + 0.281_25 + 1.75 * 1.75 / 2.0)).abs() < 1e-12);
    assert_eq!(rss.lateral_m(-5.0, 0.0), 0.3, "they move apart");
    let gap =
        RssGap { lon_m: wanted_m - 0.01, lat_m: 1.4, rear_mps: 20.0, front_mps: 15.0, towards_mps: [0.0; 2] };
    assert!(gap.is_dangerous(&rss));
    assert!(!RssGap { lon_m: wanted_m + 0.01, ..gap }.is_dangerous(&rss));
    assert!(!RssGap { lat_m: 1.43, ..gap }.is_dangerous(&rss));
}

#[derive(Deserialize)]
struct JrcFile {
    low_speed: JrcCases,
    high_speed: JrcCases,
}

#[derive(Deserialize)]
struct JrcCases {
    lat_mps: Vec<f64>,
    dist_m: Vec<f64>,
    cells: Vec<JrcCell>,
}

#[derive(Deserialize)]
struct JrcCell {
    model: String,
    ego_kmh: f64,
    cutin_kmh: f64,
    outcome: Vec<String>,
}

const HZ: f64 = 10.0;
const LENGTH_M: f64 = 4.3;
const WIDTH_M: f64 = 1.9;

/// Lateral speeds and positions of the vehicle that cuts in, per step: it accelerates by 1.5 m/s², keeps the speed, and
/// stops on the line of the ego.
fn cut_in(lat_mps: f64) -> (Vec<f64>, Vec<f64>) {
    let start_m = 1.6 + WIDTH_M;
    let steps = (HZ * start_m / lat_mps).floor() as usize + 1;
    let rising = libm::ceil(lat_mps / 0.15) as usize;
    let mut speeds: Vec<f64> = (0..rising).map(|k| -0.15 * k as f64).collect();
    // The speed is inserted once more where acceleration and profile are joined.
    let mut positions: Vec<f64> =
        (0..rising).map(|k| start_m - speeds[k..].iter().rev().sum::<f64>() / HZ).collect();
    positions.push(start_m);
    speeds.push(-lat_mps);
    let mut at_m = start_m;
    for k in 0..350 {
        let speed = if k < steps { -lat_mps } else { 0.0 };
        at_m += speed / HZ;
        speeds.push(speed);
        positions.push(at_m);
    }
    (speeds, positions)
}

/// Outcome of a cut-in with the RSS driver of JRC-FSM: 0 without contact, 1 with the ego's centre ahead, 2 behind.
fn rss_outcome(ego_mps: f64, cutin_mps: f64, dist_m: f64, lat_mps: f64) -> u8 {
    let rss = RssParams::R157;
    let (speeds, positions) = cut_in(lat_mps);
    let lead = positions.len() - 350;
    let (mut ego_m, mut v_mps) = (-ego_mps * (lead - 1) as f64 / HZ, ego_mps);
    let (mut waited_s, mut braking, mut is_safe) = (0.75, 0.0, true);
    let mut outcome = 0;
    for (i, (lat_speed, lat_m)) in speeds.iter().zip(&positions).enumerate().take(speeds.len() - 1) {
        let steps = i as f64 - (lead - 1) as f64;
        let other_m = dist_m + LENGTH_M + cutin_mps * steps / HZ;
        let (lon_m, side_m) = ((ego_m - other_m).abs() - LENGTH_M, lat_m.abs() - WIDTH_M);
        if lon_m < 0.0 && side_m < 0.0 && outcome == 0 {
            outcome = if ego_m > other_m { 1 } else { 2 };
        }
        let dangerous = ego_m <= other_m
            && lon_m < rss.longitudinal_m(v_mps, cutin_mps)
            && side_m < rss.lateral_to_cut_in_m(*lat_speed);
        if dangerous {
            is_safe = false;
            if waited_s > 0.0 {
                waited_s -= 1.0 / HZ;
            } else {
                braking = f64::min(braking + 12.65 / HZ, 0.774 * 9.81);
                v_mps = (v_mps - braking / HZ).max(0.0);
            }
        } else if is_safe {
            v_mps = f64::min(ego_mps, v_mps + 1.0 / HZ);
        }
        ego_m += v_mps / HZ;
    }
    outcome
}

#[test]
fn rss_driver_reproduces_the_outcomes_of_jrc_fsm() {
    let Some(path) = swerve_tests::data_or_skip("oracles/jrc_fsm.json") else { return };
    let file: JrcFile = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut counts = BTreeMap::new();
    for cases in [&file.low_speed, &file.high_speed] {
        for cell in cases.cells.iter().filter(|cell| cell.model == "RSS") {
            for (row, dist_m) in cell.outcome.iter().zip(&cases.dist_m) {
                for (wanted, lat_mps) in row.bytes().zip(&cases.lat_mps) {
                    let found = rss_outcome(cell.ego_kmh / 3.6, cell.cutin_kmh / 3.6, *dist_m, *lat_mps);
                    *counts.entry((wanted - b'0', found)).or_insert(0) += 1;
                }
            }
        }
    }
    let differing: i32 = counts.iter().filter(|((a, b), _)| a != b).map(|(_, n)| n).sum();
    let all: i32 = counts.values().sum();
    assert!(all > 6000, "{counts:?}");
    assert_eq!(differing, 0, "{counts:?} (theirs, ours)");
}
