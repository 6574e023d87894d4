//! `scenarios/street.toml` as sensors see it at the start of a drive.

use std::path::Path;

use swerve_core::Span;
use swerve_scenario::Scenario;
use swerve_scene::WeatherPreset;
use swerve_sim::{SimParams, Simulator};
use swerve_stack::street::Street;
use swerve_vehicle::VehicleParams;

/// The scenario, and its street with all actors at their start.
pub(crate) fn at_start(vehicle: &VehicleParams) -> (Scenario, Street) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenarios/street.toml");
    let scenario = Scenario::read(&file).expect("a scenario of ours");
    let params = SimParams { dt: Span::from_ms(5), vehicle: vehicle.clone() };
    let world = Simulator::exact(scenario.clone(), &params).expect("it drives").state().clone();
    let mut street = Street::new(&scenario, &vehicle.shape, WeatherPreset::default(), 1);
    street.show(&world);
    (scenario, street)
}
