//! Car following on a ring.

use std::sync::Arc;

use swerve_geom::{Point2, Polyline, math};
use swerve_map::{Borders, Lane, LaneId, Map};
use swerve_road_user::idm::Idm;

use super::run::lights;
use crate::{DriverParams, Traffic, TrafficSetup};

const RADIUS_M: f64 = 250.0;
const LIMIT_MPS: f64 = 15.0;

/// A ring of two lanes, one after the other.
fn ring() -> Arc<Map> {
    let half = |id: u32| {
        let at = |k: u32| {
            let angle_rad = core::f64::consts::PI * (f64::from(k) / 400.0 + f64::from(id));
            let (sin, cos) = math::sin_cos(angle_rad);
            Point2::new(RADIUS_M * cos, RADIUS_M * sin)
        };
        let line = Polyline::new(&(0..=400).map(at).collect::<Vec<_>>()).unwrap();
        let mut lane = Lane::new(LaneId(id), line, Borders::constant(1.75, 1.75));
        lane.successors = vec![LaneId(1 - id)];
        lane.speed_limit_mps = Some(LIMIT_MPS);
        lane
    };
    Arc::new(Map::new(vec![half(0), half(1)]).unwrap())
}

#[test]
fn gaps_on_a_ring_are_those_of_the_equilibrium() {
    let idm = Idm { gain_mps2: 1.2, brake_mps2: 2.0, headway_s: 1.2, stand_gap_m: 2.0 };
    for vehicles in [40, 60, 90] {
        let drivers = DriverParams::uniform(idm);
        let setup = TrafficSetup { vehicles, drivers, ..TrafficSetup::default() };
        let mut traffic = Traffic::new(ring(), &setup, lights(&ring()), 5, &[]);
        assert_eq!(traffic.cars.len(), vehicles);
        traffic.advance_alone(swerve_core::Time::ZERO + swerve_core::Span::from_secs(1500.0));
        let length_m: f64 = traffic.net.lanes.iter().map(|lane| lane.length_m).sum();
        let place_m = |car: &crate::car::Car| {
            let before_m = if car.lane() == 0 { 0.0 } else { traffic.net.lane(0).length_m };
            before_m + car.s_m()
        };
        let mut order: Vec<&crate::car::Car> = traffic.cars.iter().collect();
        order.sort_by(|a, b| place_m(a).total_cmp(&place_m(b)));
        for (k, car) in order.iter().enumerate() {
            let lead = order[(k + 1) % order.len()];
            let along_m = (place_m(lead) - place_m(car)).rem_euclid(length_m);
            let gap_m = along_m - car.half_m() - lead.half_m();
            let due_m = idm.equilibrium_gap_m(car.speed_mps, LIMIT_MPS);
            assert!((gap_m / due_m - 1.0).abs() < 0.01, "{vehicles}: {gap_m} m, {due_m} m");
        }
    }
}
