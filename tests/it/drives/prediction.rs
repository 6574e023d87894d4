//! A predictor that is told the truth tells it.

use std::collections::BTreeMap;

use swerve_core::Time;
use swerve_drive::{drive_observed, read_scenario};
use swerve_flow::Event;
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{ActorId, PredictionList};
use swerve_stack::config::Config;

/// Largest and mean distance between what was told of those who move and where they were then, up to 2 s ahead, and how
/// many places that is of.
fn off_m(config: &Config, file: &str) -> (f64, f64, usize) {
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
fn who_is_told_what_will_happen_tells_it_but_for_its_noise() {
    let document = swerve_text::Document::parse("c.toml", "[prediction]\npredictor = \"truth\"\n").unwrap();
    let mut config = Config::from_document(&document, &[]).unwrap_or_else(|problems| panic!("{problems:#?}"));
    let (most_m, _, count) = off_m(&config, "people_crossing.toml");
    assert!(most_m < 1e-6 && count > 500, "{most_m} m of {count}");
    config.prediction.truth_noise_mps = 0.5;
    let (_, mean_m, _) = off_m(&config, "people_crossing.toml");
    // After 1 s in the middle: the mean of a Rayleigh distribution.
    assert!((0.4..0.9).contains(&mean_m), "{mean_m}");
    (config.prediction.truth_noise_mps, config.prediction.truth_horizon_ms) = (0.0, Some(0.0));
    let (most_m, ..) = off_m(&config, "people_crossing.toml");
    assert!(most_m > 0.05, "going straight on is none of the truth: {most_m}");
}

#[test]
fn a_vehicle_has_nobody_who_knows_what_will_happen() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/live/autoware.toml");
    let document = swerve_text::Document::read(file.as_ref()).unwrap();
    let truth = [("prediction.predictor".to_owned(), "truth".into())];
    let problems = Config::from_document(&document, &truth).err().unwrap_or_default();
    let told: Vec<String> = problems.iter().map(ToString::to_string).collect();
    assert!(told.iter().any(|told| told.contains("operator.predictor.reads.worlds")), "{told:?}");
}
