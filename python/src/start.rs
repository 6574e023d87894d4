//! Facts of a drive for classes in Python, before their first step.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use swerve_core::Span;
use swerve_geom::{Map, Pose2};
use swerve_msg::Route;
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_vehicle::{Limits, Shape, VehicleParams};

use crate::algorithms::RouteFields;
use crate::convert::{cbor_of, plain};

/// Facts of a drive, as `swerve.Start` has them.
#[derive(Serialize)]
struct Facts<'a> {
    seed: u64,
    scenario: &'a str,
    route: RouteFields,
    pose: Pose2<Map>,
    speed_mps: f64,
    target_speed_mps: f64,
    end_m: f64,
    timeout_s: f64,
    shape: &'a Shape,
    limits: &'a Limits,
    step_ns: i64,
    keys: toml::Table,
}

/// The facts of a drive, for a class in the process of this name.
pub(crate) fn facts<'py>(
    py: Python<'py>,
    (setup, process): (&Setup, &str),
    (scenario, route, vehicle): (&Scenario, &Route, &VehicleParams),
) -> PyResult<Bound<'py, PyDict>> {
    let ego = &scenario.ego;
    let facts = Facts {
        seed: setup.seed,
        scenario: &scenario.text,
        route: RouteFields::of(route),
        pose: ego.pose(route.line(), &vehicle.shape),
        speed_mps: ego.start_speed(),
        target_speed_mps: ego.target_speed_mps,
        end_m: ego.end_m,
        timeout_s: scenario.end.timeout_s,
        shape: &vehicle.shape,
        limits: &vehicle.limits,
        step_ns: Span::from_secs(setup.sim.dt_ms * 1e-3).ns(),
        keys: setup.process.get(process).map(|own| own.keys.clone()).unwrap_or_default(),
    };
    Ok(plain(py, &cbor_of(&facts)?)?.cast_into()?)
}
