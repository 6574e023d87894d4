//! Drives with other predictors than the default: the one that uses ground truth, and all of them in bends.

use std::collections::BTreeMap;

use swerve_core::Time;
use swerve_drive::{drive_observed, read_scenario};
use swerve_flow::Event;
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{ActorId, PredictionList};
use swerve_scenario::Scenario;
use swerve_stack::Setup;

use crate::common;

/// Largest and mean distance between predicted and true positions of moving actors, up to 2 s ahead, and the number of
/// positions.
fn off_m(config: &Setup, file: &str) -> (f64, f64, usize) {
    let scenario =
        read_scenario(format!("{}/../scenarios/{file}", env!("CARGO_MANIFEST_DIR")).as_ref()).unwrap();
    let mut worlds: BTreeMap<Time, BTreeMap<ActorId, Actor>> = BTreeMap::new();
    let mut lists: Vec<PredictionList> = Vec::new();
    let mut watch = |event: &Event<'_>| {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(world) = payload.downcast_ref::<WorldState>() {
            worlds.insert(world.stamp, world.actors.iter().map(|actor| (actor.id, actor.clone())).collect());
        } else if let Some(list) = payload.downcast_ref::<PredictionList>() {
            lists.push(list.clone());
        }
    };
    drive_observed(config, &scenario, 1, &mut [&mut watch]).unwrap();
    let mut off = Vec::new();
    for list in &lists {
        for prediction in &list.predictions {
            if worlds[&list.stamp][&prediction.id].velocity_mps.norm() == 0.0 {
                continue;
            }
            for told in prediction.path.iter().take(21) {
                if let Some(world) = worlds.get(&told.at) {
                    off.push(told.pose.point().distance(world[&prediction.id].pose.point()));
                }
            }
        }
    }
    let mean_m = off.iter().sum::<f64>() / off.len().max(1) as f64;
    (off.iter().copied().fold(0.0, f64::max), mean_m, off.len())
}

#[test]
fn truth_predictor_is_exact_except_for_its_noise() {
    let document = swerve_text::Document::parse("c.toml", "[prediction]\npredictor = \"truth\"\n").unwrap();
    let mut config = Setup::from_document(&document, &[]).unwrap_or_else(|problems| panic!("{problems:#?}"));
    let (most_m, _, count) = off_m(&config, "people_crossing.toml");
    assert!(most_m < 1e-6 && count > 500, "{most_m} m of {count}");
    config.prediction.truth_noise_mps = 0.5;
    let (_, mean_m, _) = off_m(&config, "people_crossing.toml");
    // After 1 s on average: the mean of a Rayleigh distribution.
    assert!((0.4..0.9).contains(&mean_m), "{mean_m}");
    (config.prediction.truth_noise_mps, config.prediction.truth_horizon_ms) = (0.0, Some(0.0));
    let (most_m, ..) = off_m(&config, "people_crossing.toml");
    assert!(most_m > 0.05, "going straight on is none of the truth: {most_m}");
}

#[test]
fn truth_predictor_is_refused_for_a_vehicle() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/live/autoware.toml");
    let document = swerve_text::Document::read(file.as_ref()).unwrap();
    let truth = [("prediction.predictor".to_owned(), "truth".into())];
    let problems = Setup::from_document(&document, &truth).err().unwrap_or_default();
    let told: Vec<String> = problems.iter().map(ToString::to_string).collect();
    assert!(told.iter().any(|told| told.contains("operator.predictor.reads.worlds")), "{told:?}");
}

/// A truck and a car come through bends: on the map their straight modes cross the ego lane.
const BENDS: &str = r#"
name = "oncoming_in_bends"
description = "A truck and a car come towards the ego through a bend to the right and one to the left."

[road]
segments = [{ length_m = 60.0 }, { length_m = 70.0, curvature_1pm = -0.011 }, { length_m = 70.0, curvature_1pm = 0.0125 }, { length_m = 40.0 }]
lane_width_m = 3.8
left_m = 5.7
right_m = 1.9

[ego]
target_speed_mps = 12.0
end_m = 215.0

[[actor]]
name = "truck"
kind = "truck"
s_m = 195.0
d_m = 3.9
heading_rad = 3.14159
motion = [{ path = { speed_mps = 10.0, points = [
  [185.0, 3.9], [175.0, 3.9], [165.0, 3.9], [155.0, 3.9], [145.0, 3.9], [135.0, 3.9], [125.0, 3.9], [115.0, 3.9],
  [105.0, 3.9], [95.0, 3.9], [85.0, 3.9], [75.0, 3.9], [65.0, 3.9], [0.0, 3.9],
] } }]

[[actor]]
name = "car"
kind = "car"
s_m = 225.0
d_m = 3.9
heading_rad = 3.14159
motion = [{ path = { speed_mps = 10.0, points = [
  [205.0, 3.9], [195.0, 3.9], [185.0, 3.9], [175.0, 3.9], [165.0, 3.9], [155.0, 3.9], [145.0, 3.9], [135.0, 3.9],
  [125.0, 3.9], [115.0, 3.9], [105.0, 3.9], [95.0, 3.9], [85.0, 3.9], [75.0, 3.9], [65.0, 3.9], [0.0, 3.9],
] } }]

# The truck is 2.5 m wide: 3.9 - 1.25 - 0.93 = 1.7 m from an ego in the middle of its lane.
[expect]
verdict = "avoided"
min_distance_m = { min = 0.8 }
duration_s = { max = 24.0 }
deceleration_max_mps2 = { max = 4.0 }
"#;

/// With any predictor, the ego passes oncoming traffic in its own lane: no swerve, no stop, no hard braking.
#[test]
fn oncoming_traffic_in_bends_is_passed_in_the_own_lane_with_every_predictor() {
    let scenario = Scenario::parse("bends", BENDS).unwrap_or_else(|problems| panic!("{problems:#?}"));
    let kinematic =
        ["linear", "constant_velocity", "kalman", "ctra", "imm", "social_force", "orca", "lane_idm"];
    let all = kinematic.into_iter().chain(["multipath", "mfp", "r2p2"]);
    for (predictor, seed) in all.flat_map(|name| [(name, 1), (name, 2)]) {
        let config = common::config(&[&format!("prediction.predictor={predictor}"), &format!("seed={seed}")]);
        let outcome = swerve_drive::drive(&config, &scenario).unwrap();
        let broken = outcome.broken(scenario.expectation("fot").unwrap());
        assert_eq!(broken, Vec::<String>::new(), "{predictor}, seed {seed}");
    }
}
