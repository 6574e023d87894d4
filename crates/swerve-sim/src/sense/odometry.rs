//! Wheel odometry: encoders on four wheels, and the car's motion computed from them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Rng, Time};
use swerve_geom::math;
use swerve_msg::WheelOdometry;
use swerve_msg::truth::{EgoTruth, WorldState};
use swerve_vehicle::VehicleParams;

use super::key;
use super::motion::Errors;

/// Wheels from which speed and yaw rate are computed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OdometryWheels {
    /// Rear pair: needs no steering angle. Driven wheels slip more.
    #[default]
    Rear,
    /// All four, by least squares, with the front wheels along their steering angles.
    All,
}

/// Wheel encoders and their errors. Default: 96 counts, no other errors.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct WheelOdometryParams {
    /// Counts of each encoder per wheel turn. Default 96: both edges of 48 teeth.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub counts_per_turn: u32,
    /// Standard deviation of each wheel's radius, as a fraction of the nominal radius; drawn once per wheel and run.
    /// One millimetre of tread is 0.003.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub radius_error: f64,
    /// Noise of the steering angle, standard deviation, radians.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub steering_noise_rad: f64,
    /// Bias of the steering angle, standard deviation, radians.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub steering_bias_rad: f64,
    /// Wheels from which speed and yaw rate are computed.
    pub wheels: OdometryWheels,
}

impl Default for WheelOdometryParams {
    fn default() -> Self {
        Self {
            counts_per_turn: 96,
            radius_error: 0.0,
            steering_noise_rad: 0.0,
            steering_bias_rad: 0.0,
            wheels: OdometryWheels::default(),
        }
    }
}

/// The encoders of one car in one run.
#[derive(Clone, Debug)]
pub struct WheelOdometer {
    params: WheelOdometryParams,
    wheels: Wheels,
    sensor: String,
    seed: u64,
    /// Radius of each wheel over the nominal one.
    scale: [f64; 4],
    turned_rad: [f64; 4],
    /// Stamp, speeds and counts of the last reading.
    last: Option<(Time, [f64; 4], [i64; 4])>,
}

/// Geometry of the wheels from the vehicle's parameters.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Wheels {
    wheelbase_m: f64,
    half_track_m: f64,
    radius_m: f64,
    /// Distance from the rear axle forward to the centre of gravity, metres.
    cg_ahead_m: f64,
}

impl Wheels {
    fn new(vehicle: &VehicleParams) -> Self {
        Self {
            wheelbase_m: vehicle.shape.wheelbase_m,
            half_track_m: 0.5 * vehicle.body.track_m,
            radius_m: vehicle.wheel.radius_m,
            cg_ahead_m: vehicle.cg_to_rear_m(),
        }
    }

    /// Coefficients of each wheel's speed for the origin's forward speed, its speed to the left, and the yaw rate. The
    /// front wheels are steered as the vehicle's: on circles around one centre.
    fn rows(&self, steering_rad: f64) -> [[f64; 3]; 4] {
        let tan = math::tan(steering_rad);
        let inner = self.half_track_m / self.wheelbase_m * tan;
        let row = |x_m: f64, y_m: f64, tan: f64| {
            let cos = 1.0 / (1.0 + tan * tan).sqrt();
            let sin = tan * cos;
            [cos, sin, x_m * sin - y_m * cos]
        };
        let (l, w) = (self.wheelbase_m, self.half_track_m);
        [row(l, w, tan / (1.0 - inner)), row(l, -w, tan / (1.0 + inner)), row(0.0, w, 0.0), row(0.0, -w, 0.0)]
    }
}

/// Speeds of wheels that roll without slip along their headings, rad/s: front left, front right, rear left, rear right.
/// For use where the wheels' own speeds are not available, as in the world state.
pub fn rolling_speeds_radps(ego: &EgoTruth, vehicle: &VehicleParams) -> [f64; 4] {
    let wheels = Wheels::new(vehicle);
    let state = &ego.state;
    let (sin, cos) = math::sin_cos(state.pose.heading_rad);
    let left_mps = ego.velocity_mps.coords.y * cos - ego.velocity_mps.coords.x * sin;
    let origin_left_mps = left_mps - state.yaw_rate_radps * wheels.cg_ahead_m;
    wheels.rows(state.steering_rad).map(|[ahead, left, turn]| {
        let along = state.speed_mps * ahead + origin_left_mps * left + state.yaw_rate_radps * turn;
        along / wheels.radius_m
    })
}

impl WheelOdometer {
    /// Creates encoders on `vehicle`, with wheel radii drawn under (seed, sensor).
    pub fn new(params: WheelOdometryParams, vehicle: &VehicleParams, sensor: &str, seed: u64) -> Self {
        let mut rng = Rng::keyed(seed, "wheel radii", &[key(sensor)]);
        let scale = core::array::from_fn(|_| (1.0 + params.radius_error * rng.normal()).max(0.5));
        Self {
            params,
            wheels: Wheels::new(vehicle),
            sensor: sensor.to_owned(),
            seed,
            scale,
            turned_rad: [0.0; 4],
            last: None,
        }
    }

    /// Takes one reading. `speeds_radps` are the speeds of wheels of nominal radius (the simulator's, or
    /// [`rolling_speeds_radps`]), taken as linear between two readings. `None` for the first reading, and for one that
    /// is not later than the last.
    ///
    /// Speed and yaw rate are means over the time since the last reading, so they lag by half of it.
    pub fn sense(&mut self, world: &WorldState, speeds_radps: [f64; 4]) -> Option<WheelOdometry> {
        let Some((before, old_radps, old_counts)) = self.last else {
            self.last = Some((world.stamp, speeds_radps, [0; 4]));
            return None;
        };
        let dt_s = (world.stamp - before).as_secs();
        if dt_s <= 0.0 {
            return None;
        }
        let per_turn = f64::from(self.params.counts_per_turn.max(1));
        let per_count_rad = core::f64::consts::TAU / per_turn;
        let mut counts = [0; 4];
        for i in 0..4 {
            // A larger wheel turns less over the same distance.
            self.turned_rad[i] += 0.5 * (old_radps[i] + speeds_radps[i]) * dt_s / self.scale[i];
            counts[i] = (self.turned_rad[i] / per_count_rad).floor() as i64;
        }
        self.last = Some((world.stamp, speeds_radps, counts));
        let wheel_speeds_radps =
            core::array::from_fn(|i| (counts[i] - old_counts[i]) as f64 * per_count_rad / dt_s);
        let mut errors = Errors::new(self.seed, &self.sensor, world.stamp);
        let (bias, noise) = (self.params.steering_bias_rad, self.params.steering_noise_rad);
        let steering_rad = world.ego.state.steering_rad + errors.next(bias, noise);
        let (speed_mps, yaw_rate_radps) = self.motion(wheel_speeds_radps, steering_rad);
        let stamp = world.stamp;
        Some(WheelOdometry { stamp, counts, wheel_speeds_radps, speed_mps, yaw_rate_radps, steering_rad })
    }

    /// Speed and yaw rate fitted to the wheel speeds by least squares, without lateral motion of the rear axle. For the
    /// rear pair alone: their mean, and their difference over the track.
    fn motion(&self, speeds_radps: [f64; 4], steering_rad: f64) -> (f64, f64) {
        let first = match self.params.wheels {
            OdometryWheels::Rear => 2,
            OdometryWheels::All => 0,
        };
        let rows = self.wheels.rows(steering_rad);
        let (mut aa, mut ab, mut bb, mut ay, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for i in first..4 {
            let ([a, _, b], y) = (rows[i], speeds_radps[i] * self.wheels.radius_m);
            (aa, ab, bb) = (aa + a * a, ab + a * b, bb + b * b);
            (ay, by) = (ay + a * y, by + b * y);
        }
        let determinant = aa * bb - ab * ab;
        ((ay * bb - by * ab) / determinant, (by * aa - ay * ab) / determinant)
    }
}

#[cfg(test)]
mod tests;
