//! Wheel odometry: encoders on four wheels, and what they say of the car's motion.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_within};
use swerve_core::{Rng, Time};
use swerve_geom::math;
use swerve_msg::WheelOdometry;
use swerve_msg::truth::{EgoTruth, WorldState};
use swerve_vehicle::VehicleParams;

use super::key;
use super::motion::Errors;

/// Which wheels speed and yaw rate are computed from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OdometryWheels {
    /// The rear pair: needs no steering angle. Driven wheels slip more.
    #[default]
    Rear,
    /// All four, by least squares, with the front ones along their steering angle.
    All,
}

/// Encoders and their errors. Default: 96 counts, no other error.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct WheelOdometryParams {
    /// Counts of each encoder per turn of its wheel. Default 96: both edges of 48 teeth.
    pub counts_per_turn: u32,
    /// Standard deviation of each wheel's radius over the one assumed, as a share of it; drawn once per wheel
    /// and run. A millimetre of tread is 0.003.
    pub radius_error: f64,
    /// Noise of the steering angle, radians.
    pub steering_noise_rad: f64,
    /// Bias of the steering angle, radians.
    pub steering_bias_rad: f64,
    /// Which wheels are used.
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

impl WheelOdometryParams {
    /// Every parameter that is out of range.
    pub fn problems(&self) -> Vec<ParamError> {
        let all = [
            ("counts_per_turn", f64::from(self.counts_per_turn), [1.0, 1_000_000.0]),
            ("radius_error", self.radius_error, [0.0, 0.1]),
            ("steering_noise_rad", self.steering_noise_rad, [0.0, 1.0]),
            ("steering_bias_rad", self.steering_bias_rad, [0.0, 1.0]),
        ];
        all.into_iter().filter_map(|(key, x, ends)| require_within(key, x, ends).err()).collect()
    }
}

/// The encoders of one car in one run.
#[derive(Clone, Debug)]
pub struct WheelOdometer {
    params: WheelOdometryParams,
    wheels: Wheels,
    sensor: String,
    seed: u64,
    /// Radius of each wheel over that assumed.
    scale: [f64; 4],
    turned_rad: [f64; 4],
    /// Stamp, speeds and counts of the last reading.
    last: Option<(Time, [f64; 4], [i64; 4])>,
}

/// Where the wheels are and how large they are, as the vehicle's parameters say.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Wheels {
    wheelbase_m: f64,
    half_track_m: f64,
    radius_m: f64,
    /// From the rear axle forward to the centre of gravity, metres.
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

    /// How much the speed along each wheel grows with the speed of the origin along the heading, with that of
    /// it to the left, and with the yaw rate. The front wheels stand as the vehicle's do: on circles around one centre.
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

/// Speeds of the wheels if they roll without slip along their headings, rad/s: front left, front right, rear
/// left, rear right. For where the wheels' own speeds are not at hand, as in the state of the world.
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
    /// Encoders on `vehicle`, whose wheels' radii are drawn under (seed, sensor).
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

    /// One reading. `speeds_radps` are those of wheels of the nominal radius (the simulator's own, or
    /// [`rolling_speeds_radps`]); between two readings they are taken as linear. `None` for the first reading,
    /// and for one that is not after the last: there is no time to count over.
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
            // A larger wheel turns less on the same way.
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

    /// Speed and yaw rate that fit the wheels' speeds best, by least squares, with no motion of the rear axle to the
    /// side. For the rear pair alone: their mean, and their difference over the track.
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
