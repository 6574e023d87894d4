//! Vehicles follow their lane and keep their distance, or brake.
//!
//! The speed follows the intelligent driver model (Treiber, Hennecke and Helbing 2000) behind the lead on the path,
//! which is simulated by it too, limited by the curvature. All vehicles are simulated simultaneously, so that a
//! slowdown propagates back along the lane as it does on the road. The paths are those of a lane map from the
//! vehicle's position, with stop lines; the scenario's road at the vehicle's offset; or straight ahead. The lateral
//! speed decays.

mod driver;
mod place;

use swerve_core::Time;
use swerve_geom::Point2;

use super::drawn::{mode, spread};
use super::filters::{IMM, predictions as filtered};
use super::{Ground, Horizon, Modes, Tracked};
use driver::{Driver, Rolled};
use place::{Position, settled, walks};

/// Share of vehicles that brake for an unknown reason, and their deceleration, m/s².
const YIELDS: f64 = 0.1;
const YIELD_MPS2: f64 = 2.0;

/// Two modes for each path of a vehicle: continuing and braking. Pedestrians: the modes of the filters.
pub(super) fn predictions(
    seen: &[Tracked],
    stamp: Time,
    horizon: &Horizon,
    ground: Ground<'_>,
) -> Vec<Modes> {
    let places: Vec<Position> = seen.iter().map(|seen| Position::of(seen, stamp, ground)).collect();
    let red = place::held_up(&places, seen, ground);
    let driver =
        |k: usize, way: usize| Driver::of(&seen[k], &places[k].ways[way].1, (&places, seen, k), &red);
    let first = (0..seen.len()).map(|k| driver(k, 0)).collect();
    let rolled = Rolled::all(first, horizon);
    let settled = settled(horizon);
    let of_one = |(k, seen): (usize, &Tracked)| {
        if walks(seen) {
            return filtered(core::slice::from_ref(seen), stamp, horizon, IMM).remove(0);
        }
        let mut modes = Vec::new();
        for (n, (share, along)) in places[k].ways.iter().enumerate() {
            let on_m = match n {
                0 => rolled.of(k),
                _ => rolled.beside(driver(k, n)),
            };
            let mut add = |probability: f64, on_m: &[f64]| {
                let points: Vec<Point2> =
                    on_m.iter().zip(&settled).map(|(on_m, s)| along.at(*on_m, *s)).collect();
                let spots = spread(seen, stamp, horizon, &points);
                let one = mode(probability, seen, stamp, (horizon, &spots));
                modes.push(one);
            };
            add(share * (1.0 - YIELDS), &on_m);
            add(share * YIELDS, &braked(places[k].velocity_mps.norm(), horizon));
        }
        modes
    };
    seen.iter().enumerate().map(of_one).collect()
}

/// Distance covered while braking to a stop, at each instant.
fn braked(speed_mps: f64, horizon: &Horizon) -> Vec<f64> {
    let at = |k: usize| {
        let brakes_s = (horizon.step.as_secs() * k as f64).min(speed_mps / YIELD_MPS2);
        speed_mps * brakes_s - 0.5 * YIELD_MPS2 * brakes_s * brakes_s
    };
    (0..=horizon.steps).map(at).collect()
}

#[cfg(test)]
mod tests;
