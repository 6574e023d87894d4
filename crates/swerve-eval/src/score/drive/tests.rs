use swerve_geom::{Obb, Pose2};

use super::*;
use crate::score::nuplan::{EgoState, LaneFacts};
use crate::score::{Ego, RoutePlace};

/// A drive of 100 m along x at 10 m/s, with this acceleration in the samples for which `brakes` is true.
fn drive(lon_accel_mps2: f64, brakes: fn(usize) -> bool, is_emergency: fn(usize) -> bool) -> DrivingScores {
    let mut judge = DriveJudge::new(100.0);
    for k in 0..=100_usize {
        let x_m = k as f64;
        let center = Pose2::new(x_m, 0.0, 0.0);
        let endings = judge.take(&StepFacts {
            at_s: 0.1 * x_m,
            ego: Ego { center, half_length_m: 2.5, speed_mps: 10.0, forward_mps: 10.0 },
            place: RoutePlace { s_m: x_m, to_end_m: 100.0 - x_m, limit_mps: 10.0, ..RoutePlace::default() },
            touches: &[],
            red_lights: &[],
            stop_signs: &[],
            traffic_mps: None,
            scenarios: &[],
        });
        assert_eq!(endings, if k > 99 { [Some(Ending::Completed); 2] } else { [None; 2] });
        let ego = EgoState {
            rear_axle: center,
            outline: Obb::new(center, 5.0, 2.0),
            speed_mps: 10.0,
            lon_accel_mps2: if brakes(k) { lon_accel_mps2 } else { 0.0 },
            lat_accel_mps2: 0.0,
        };
        let step = Step { ego, tracks: Vec::new(), lane: LaneFacts::default() };
        judge.sample(DriveFacts { step, yaw_rate_radps: 0.0, is_emergency: is_emergency(k) });
    }
    assert_eq!(judge.samples(), 101);
    judge.scores(Progress { ego_m: 100.0, expert_m: 100.0 })
}

#[test]
fn perfect_drive_has_all_scores() {
    let scores = drive(0.0, |_| false, |_| false);
    assert_eq!(scores.driving_score, 100.0);
    for version in Version::ALL {
        let of = &scores.leaderboard[version.name()];
        assert_eq!((of.driving_score, of.route_completion, of.penalty), (100.0, 100.0, 1.0));
        assert_eq!(scores.record(version).score(version).driving_score, 100.0);
    }
    assert_eq!(scores.nuplan.unwrap().score, 1.0);
    assert!(scores.bench2drive.success);
    assert_eq!((scores.comfort_share, scores.emergency_s), (Some(1.0), 0.0));
}

#[test]
fn hard_braking_in_an_emergency_does_not_count_for_comfort() {
    let brakes = |k: usize| (40..60).contains(&k);
    let hard = drive(-8.0, brakes, |_| false).comfort_share.unwrap();
    assert!((0.6..=0.8).contains(&hard), "{hard}");
    // Smoothing spreads it over neighbouring samples.
    let emergency = drive(-8.0, brakes, |k| (25..75).contains(&k));
    assert_eq!(emergency.comfort_share, Some(1.0));
    assert!((emergency.emergency_s - 5.0).abs() < 1e-9);
    assert_eq!(drive(-8.0, brakes, |_| true).comfort_share, None);
}

#[test]
fn scores_are_the_same_after_json() {
    let scores = drive(-8.0, |k| k == 50, |_| false);
    let text = serde_json::to_string(&scores).unwrap();
    assert_eq!(serde_json::from_str::<DrivingScores>(&text).unwrap(), scores);
}
