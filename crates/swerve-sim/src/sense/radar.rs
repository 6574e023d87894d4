//! Radar: echoes of actors with missed detections, clutter and false alarms.
//!
//! **Echoes.** An actor of box shape has three scatterers: the point of its outline closest to the sensor, with six
//! tenths of its cross-section, and the two adjacent corners that face the sensor, with two tenths each; a pedestrian
//! has one. A scatterer counts if it is within the limits of the sensor and on a free line of sight (as for
//! ground-truth sensing). Scatterers that the sensor cannot resolve are one echo, at the position of the strongest one,
//! with the power of all.
//!
//! **Strength.** The radar equation gives the mean signal-to-noise ratio: it falls with the fourth power of the
//! distance, grows with the cross-section ([`rcs_dbsm`]), and falls towards the edges of the field of view. From scan
//! to scan the echo fluctuates as that of many small scatterers (Swerling's case 1: P. Swerling, *Probability of
//! detection for fluctuating targets*, RAND RM-1217, 1954): detected power over noise is exponentially distributed with
//! mean `1 + SNR`. With the threshold that noise alone exceeds with probability `P_fa`, the echo is detected with
//! `P_d = P_fa^(1 / (1 + SNR))`.
//!
//! **Random numbers.** All are drawn per (seed, sensor, stamp, actor, scatterer), so that the draws for one actor do
//! not depend on the presence of others.

mod decibel;
mod echo;
mod params;
mod rcs;

pub use params::{RadarParams, RadarPreset};
pub use rcs::rcs_dbsm;

use swerve_core::Rng;
use swerve_geom::{Ego, Point, math};
use swerve_msg::truth::{RadarSources, WorldState};
use swerve_msg::{ActorId, RadarDetection, RadarScan};
use swerve_vehicle::VehicleParams;

use super::{SensorMount, key};
use decibel::decibels;
use echo::{Echo, Eye, echoes, resolved};

/// A radar on the ego.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Radar {
    params: RadarParams,
    mount: SensorMount,
    /// Reference point of the velocity in the world state.
    center_of_gravity: Point<Ego>,
}

/// A detection with its true source, known only to the simulator.
type Found = (RadarDetection, Option<ActorId>);

impl Radar {
    /// Creates a radar with these parameters at this mount of this vehicle.
    pub fn new(params: RadarParams, mount: SensorMount, vehicle: &VehicleParams) -> Self {
        let center_of_gravity = Point::new(vehicle.cg_to_rear_m(), 0.0, vehicle.body.cg_height_m);
        Self { params, mount, center_of_gravity }
    }

    /// Parameters of the radar.
    pub fn params(&self) -> &RadarParams {
        &self.params
    }

    /// One scan of the world, and the sources of its echoes.
    pub fn scan(&self, world: &WorldState, sensor: &str, seed: u64) -> (RadarScan, RadarSources) {
        let eye = Eye::new(world, &self.mount, self.center_of_gravity);
        let mut found = Vec::new();
        for echo in resolved(echoes(world, &eye, &self.params), &self.params) {
            let part = [key(sensor), world.stamp.ns(), i64::from(echo.actor.0), echo.part];
            let rng = Rng::keyed(seed, "radar echo", &part);
            found.extend(self.detected(&echo, rng).map(|detection| (detection, Some(echo.actor))));
        }
        let rng = Rng::keyed(seed, "radar clutter", &[key(sensor), world.stamp.ns()]);
        self.clutter(&eye, rng, &mut found);
        let rng = Rng::keyed(seed, "radar false alarms", &[key(sensor), world.stamp.ns()]);
        self.false_alarms(rng, &mut found);
        found.sort_by(|(a, _), (b, _)| a.range_m.total_cmp(&b.range_m));
        let (detections, sources) = found.into_iter().unzip();
        (RadarScan { stamp: world.stamp, detections }, RadarSources { stamp: world.stamp, sources })
    }

    /// Detection of an echo in this scan; `None` below the threshold.
    fn detected(&self, echo: &Echo, mut rng: Rng) -> Option<RadarDetection> {
        let p = &self.params;
        let power = -(1.0 + echo.snr) * math::ln(1.0 - rng.unit());
        let is_detected = power > p.threshold();
        let range_m = (echo.range_m + p.range_noise_m * rng.normal()).max(0.0);
        let range_rate_mps = echo.range_rate_mps + p.range_rate_noise_mps * rng.normal();
        let azimuth_rad = echo.azimuth_rad + p.azimuth_noise_rad * rng.normal();
        let elevation_rad = echo.elevation_rad + p.elevation_noise_rad * rng.normal();
        is_detected.then(|| self.detection(range_m, range_rate_mps, azimuth_rad, elevation_rad, power))
    }

    /// Adds clutter: echoes at rest in the map, anywhere in the field of view.
    fn clutter(&self, eye: &Eye, mut rng: Rng, found: &mut Vec<Found>) {
        for _ in 0..poisson(&mut rng, self.params.clutter_per_scan) {
            let (range_m, azimuth_rad) = self.anywhere(&mut rng);
            let down_rad = -math::asin((self.mount.z_m / range_m).clamp(0.0, 1.0));
            let towards = eye.direction(azimuth_rad, down_rad);
            let noise = self.params.range_rate_noise_mps * rng.normal();
            let range_rate_mps = -eye.velocity_mps.dot(towards) + noise;
            let power = self.params.threshold() - math::ln(1.0 - rng.unit());
            found.push((self.detection(range_m, range_rate_mps, azimuth_rad, down_rad, power), None));
        }
    }

    /// Adds false alarms: noise above the threshold, at any position and range rate.
    fn false_alarms(&self, mut rng: Rng, found: &mut Vec<Found>) {
        let p = &self.params;
        for _ in 0..poisson(&mut rng, p.false_alarms_per_scan) {
            let (range_m, azimuth_rad) = self.anywhere(&mut rng);
            let elevation_rad = p.elevation_fov_rad * (rng.unit() - 0.5);
            let range_rate_mps = rng.uniform(-p.range_rate_max_mps, p.range_rate_max_mps);
            let power = p.threshold() - math::ln(1.0 - rng.unit());
            found.push((self.detection(range_m, range_rate_mps, azimuth_rad, elevation_rad, power), None));
        }
    }

    /// Random range and azimuth, uniform in both.
    fn anywhere(&self, rng: &mut Rng) -> (f64, f64) {
        let p = &self.params;
        (rng.uniform(p.range_min_m, p.range_max_m), p.fov_rad * (rng.unit() - 0.5))
    }

    fn detection(
        &self,
        range_m: f64,
        range_rate_mps: f64,
        azimuth_rad: f64,
        elevation_rad: f64,
        power: f64,
    ) -> RadarDetection {
        let snr = power - 1.0;
        RadarDetection {
            range_m,
            range_rate_mps,
            azimuth_rad,
            elevation_rad: self.params.measures_elevation.then_some(elevation_rad),
            rcs_dbsm: self.params.rcs_of_snr_dbsm(snr, range_m, azimuth_rad),
            snr_db: decibels(snr),
        }
    }
}

/// Draws from a Poisson distribution with this mean (multiplication of uniforms; Knuth, *The Art of Computer
/// Programming*, volume 2, 3.4.1).
fn poisson(rng: &mut Rng, mean: f64) -> usize {
    let (limit, mut product, mut n) = (math::exp(-mean), rng.unit(), 0);
    while product > limit {
        product *= rng.unit();
        n += 1;
    }
    n
}

#[cfg(test)]
mod tests;
