//! Vehicles keep to their lane and their distance, or brake.
//!
//! The speed is that of the intelligent driver model (Treiber, Hennecke and Helbing 2000) behind whoever is next on the
//! way, who is driven by it too, and at most what the bend allows. Everybody is driven at once, so that what slows who is
//! ahead comes back through the lane as it does on the road. The ways are those of a lane graph from where the vehicle is,
//! with its stop lines; the scenario's road at the vehicle's offset; or straight on. What of the speed goes across dies away.

mod driver;
mod place;

use swerve_core::Time;
use swerve_geom::Point2;
use swerve_msg::{ActorKind, Forecast, Mode};

use super::drawn::{forecast, mode, spread};
use super::filters::{IMM, forecasts as filtered};
use super::{Ground, Horizon, Seen};
use driver::{Driver, Rolled};
use place::{Place, settled};

/// Share of vehicles that brake for no reason that is known here, and how hard, m/s².
const YIELDS: f64 = 0.1;
const YIELD_MPS2: f64 = 2.0;

/// Two modes for each way of a vehicle: on, or braking; of people: on, or stopping.
pub(super) fn forecasts(seen: &[Seen], stamp: Time, horizon: &Horizon, ground: Ground<'_>) -> Vec<Forecast> {
    let places: Vec<Place> = seen.iter().map(|seen| Place::of(seen, stamp, ground)).collect();
    let red = place::held_up(&places, seen, ground);
    let driver =
        |k: usize, way: usize| Driver::of(&seen[k], &places[k].ways[way].1, (&places, seen, k), &red);
    let first = (0..seen.len()).map(|k| driver(k, 0)).collect();
    let rolled = Rolled::all(first, horizon);
    let settled = settled(horizon);
    let of_one = |(k, seen): (usize, &Seen)| {
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
                let one: Mode = mode(probability, seen, stamp, (horizon, &spots));
                modes.push(one);
            };
            add(share * (1.0 - YIELDS), &on_m);
            add(share * YIELDS, &braked(places[k].velocity_mps.norm(), horizon));
        }
        forecast(seen, modes)
    };
    seen.iter().enumerate().map(of_one).collect()
}

fn walks(seen: &Seen) -> bool {
    matches!(seen.past.kind, ActorKind::Pedestrian | ActorKind::Static)
}

/// How far who brakes to a stand has come.
fn braked(speed_mps: f64, horizon: &Horizon) -> Vec<f64> {
    let at = |k: usize| {
        let brakes_s = (horizon.step.as_secs() * k as f64).min(speed_mps / YIELD_MPS2);
        speed_mps * brakes_s - 0.5 * YIELD_MPS2 * brakes_s * brakes_s
    };
    (0..=horizon.steps).map(at).collect()
}

#[cfg(test)]
mod tests;
