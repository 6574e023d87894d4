//! Sensors of the ego's own motion: pose, inertial unit, satellite fix; with noise and bias when asked for.
//!
//! A **bias** is drawn once per (seed, sensor) and holds for the run; **noise** is drawn per (seed, sensor,
//! stamp). Both are normal with the given standard deviations; zero gives the truth.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Rng, Time};
use swerve_geom::{Pose2, math};
use swerve_msg::truth::WorldState;
use swerve_msg::{EgoState, Gnss, Imu};

/// Deviations of a pose source; all zero by default: a perfect localization.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PoseParams {
    /// Noise of x and of y, metres.
    pub position_noise_m: f64,
    /// Bias of x and of y, metres.
    pub position_bias_m: f64,
    /// Noise of the heading, radians.
    pub heading_noise_rad: f64,
    /// Bias of the heading, radians.
    pub heading_bias_rad: f64,
    /// Noise of the speed, m/s.
    pub speed_noise_mps: f64,
}

/// Deviations of the inertial unit; all zero by default.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImuParams {
    /// Noise of each axis of acceleration, m/s².
    pub accel_noise_mps2: f64,
    /// Bias of each axis of acceleration, m/s².
    pub accel_bias_mps2: f64,
    /// Noise of each axis of rotation, rad/s.
    pub gyro_noise_radps: f64,
    /// Bias of each axis of rotation, rad/s.
    pub gyro_bias_radps: f64,
}

/// A satellite receiver, and where on Earth the map lies.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GnssParams {
    /// Latitude of the map's origin, degrees north. Default 37.4 (with the longitude: the south of San Francisco Bay).
    pub origin_latitude_deg: f64,
    /// Longitude of the map's origin, degrees east. Default -122.0.
    pub origin_longitude_deg: f64,
    /// Height of the map's plane above the ellipsoid, metres. Default 0.
    pub origin_altitude_m: f64,
    /// Noise of east and of north, metres. Default 0.5. Height gets twice as much.
    pub noise_m: f64,
    /// Bias of east and of north, metres. Default 0.5. Height gets twice as much.
    pub bias_m: f64,
}

impl Default for GnssParams {
    fn default() -> Self {
        Self {
            origin_latitude_deg: 37.4,
            origin_longitude_deg: -122.0,
            origin_altitude_m: 0.0,
            noise_m: 0.5,
            bias_m: 0.5,
        }
    }
}

/// The draws of one sensor at one stamp.
pub(super) struct Errors {
    bias: Rng,
    noise: Rng,
}

impl Errors {
    pub(super) fn new(seed: u64, sensor: &str, stamp: Time) -> Self {
        Self {
            bias: Rng::keyed(seed, "sensor bias", &[key(sensor)]),
            noise: Rng::keyed(seed, "sensor noise", &[key(sensor), stamp.ns()]),
        }
    }

    /// The next axis: one draw of bias, one of noise.
    pub(super) fn next(&mut self, bias: f64, noise: f64) -> f64 {
        bias * self.bias.normal() + noise * self.noise.normal()
    }
}

/// A sensor's name as part of a key.
pub(super) fn key(sensor: &str) -> i64 {
    Rng::keyed(0, sensor, &[]).bits().cast_signed()
}

/// Pose and motion of the ego as a localization with these deviations reports them.
pub fn pose(world: &WorldState, sensor: &str, params: &PoseParams, seed: u64) -> EgoState {
    let truth = world.ego.state;
    let mut errors = Errors::new(seed, sensor, world.stamp);
    let x = errors.next(params.position_bias_m, params.position_noise_m);
    let y = errors.next(params.position_bias_m, params.position_noise_m);
    let heading = errors.next(params.heading_bias_rad, params.heading_noise_rad);
    let speed = errors.next(0.0, params.speed_noise_mps);
    EgoState {
        stamp: world.stamp,
        pose: Pose2::new(truth.pose.x_m + x, truth.pose.y_m + y, truth.pose.heading_rad + heading),
        speed_mps: truth.speed_mps + speed,
        ..truth
    }
}

/// One reading of the inertial unit at the centre of gravity.
pub fn imu(world: &WorldState, sensor: &str, params: &ImuParams, seed: u64) -> Imu {
    let mut errors = Errors::new(seed, sensor, world.stamp);
    let (force, rate) = (world.ego.specific_force_mps2.coords, world.ego.angular_velocity_radps.coords);
    let mut accel = |x: f64| x + errors.next(params.accel_bias_mps2, params.accel_noise_mps2);
    let accel_mps2 = [accel(force.x), accel(force.y), accel(force.z)];
    let mut gyro = |x: f64| x + errors.next(params.gyro_bias_radps, params.gyro_noise_radps);
    let gyro_radps = [gyro(rate.x), gyro(rate.y), gyro(rate.z)];
    Imu { stamp: world.stamp, accel_mps2, gyro_radps }
}

/// One fix of the ego origin.
///
/// The map is taken as flat, with the radii of curvature of WGS 84 at its origin; the error of that grows with
/// the square of the distance from the origin and is about 0.1 m at a kilometre.
pub fn gnss(world: &WorldState, sensor: &str, params: &GnssParams, seed: u64) -> Gnss {
    const EQUATOR_M: f64 = 6_378_137.0;
    const FLATTENING: f64 = 1.0 / 298.257_223_563;
    let mut errors = Errors::new(seed, sensor, world.stamp);
    let at = world.ego.map_from_ego.origin().coords;
    let east = at.x + errors.next(params.bias_m, params.noise_m);
    let north = at.y + errors.next(params.bias_m, params.noise_m);
    let up = at.z + errors.next(2.0 * params.bias_m, 2.0 * params.noise_m);
    let (sin, cos) = math::sin_cos(params.origin_latitude_deg.to_radians());
    let eccentricity_squared = FLATTENING * (2.0 - FLATTENING);
    let root = (1.0 - eccentricity_squared * sin * sin).sqrt();
    let across_m = EQUATOR_M / root + params.origin_altitude_m;
    let along_m = EQUATOR_M * (1.0 - eccentricity_squared) / (root * root * root) + params.origin_altitude_m;
    Gnss {
        stamp: world.stamp,
        latitude_deg: params.origin_latitude_deg + (north / along_m).to_degrees(),
        longitude_deg: params.origin_longitude_deg + (east / (across_m * cos)).to_degrees(),
        altitude_m: params.origin_altitude_m + up,
        deviation_m: math::hypot(params.noise_m, params.bias_m),
    }
}
