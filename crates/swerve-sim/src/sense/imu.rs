//! Inertial measurement unit: accelerations and rotation rates at its position, with noise, bias random walk and scale
//! errors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Rng, Span, Time};
use swerve_geom::{Ego, Vector, math};
use swerve_msg::Imu;
use swerve_msg::truth::WorldState;
use swerve_vehicle::VehicleParams;

use super::key;
use super::motion::Errors;

/// Errors of the inertial measurement unit; all zero by default.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct ImuParams {
    /// Noise per reading of each acceleration axis, standard deviation, m/s².
    #[schemars(range(min = 0.0, max = 100.0))]
    pub accel_noise_mps2: f64,
    /// Noise density of each acceleration axis, m/s²/√Hz, independent of the period; in addition to the noise per
    /// reading.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub accel_noise_density: f64,
    /// Bias of each acceleration axis, standard deviation, m/s².
    #[schemars(range(min = 0.0, max = 10.0))]
    pub accel_bias_mps2: f64,
    /// Random walk of the acceleration biases, m/s² per √s.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub accel_bias_walk: f64,
    /// Scale error of each acceleration axis, standard deviation as a fraction; drawn once per run.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub accel_scale_error: f64,
    /// Noise per reading of each rotation axis, standard deviation, rad/s.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub gyro_noise_radps: f64,
    /// Noise density of each rotation axis, rad/s/√Hz, independent of the period; in addition to the noise per reading.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gyro_noise_density: f64,
    /// Bias of each rotation axis, standard deviation, rad/s.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gyro_bias_radps: f64,
    /// Random walk of the rotation biases, rad/s per √s.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gyro_bias_walk: f64,
    /// Scale error of each rotation axis, standard deviation as a fraction; drawn once per run.
    #[schemars(range(min = 0.0, max = 0.1))]
    pub gyro_scale_error: f64,
    /// Position of the IMU in the ego frame, m; the centre of gravity when absent.
    #[schemars(inner(range(min = -20.0, max = 20.0)))]
    pub at_m: Option<[f64; 3]>,
}

impl ImuParams {
    /// Position in the ego frame, m.
    pub fn at_m(&self, vehicle: &VehicleParams) -> [f64; 3] {
        self.at_m.unwrap_or([vehicle.cg_to_rear_m(), 0.0, vehicle.body.cg_height_m])
    }

    /// Total noise densities of acceleration (m/s²/√Hz) and rotation (rad/s/√Hz) at readings each `period_s`.
    pub fn densities(&self, period_s: f64) -> [f64; 2] {
        let root = period_s.sqrt();
        [
            math::hypot(self.accel_noise_mps2 * root, self.accel_noise_density),
            math::hypot(self.gyro_noise_radps * root, self.gyro_noise_density),
        ]
    }
}

/// The IMU of one car in one run.
#[derive(Clone, Debug)]
pub struct InertialUnit {
    params: ImuParams,
    /// Vector from the centre of gravity to the IMU.
    lever: Vector<Ego>,
    /// Standard deviations of the noise per reading: acceleration (m/s²), rotation (rad/s).
    noise: [f64; 2],
    sensor: String,
    seed: u64,
    /// Scale errors, and random walks of the biases so far: three axes of acceleration, three of rotation.
    scale: [f64; 6],
    walked: [f64; 6],
    /// Stamp and rotation rates of the last reading.
    last: Option<(Time, Vector<Ego>)>,
}

impl InertialUnit {
    /// Creates an IMU on `vehicle` that is read each `period`, with scale errors drawn under (seed, sensor).
    pub fn new(params: ImuParams, vehicle: &VehicleParams, period: Span, sensor: &str, seed: u64) -> Self {
        let cg_m = ImuParams::default().at_m(vehicle);
        let [x, y, z] = params.at_m(vehicle);
        let root_rate = 1.0 / period.as_secs().max(1e-3).sqrt();
        let mut rng = Rng::keyed(seed, "sensor scale", &[key(sensor)]);
        let per_axis = [params.accel_scale_error, params.gyro_scale_error];
        Self {
            lever: Vector::new(x - cg_m[0], y - cg_m[1], z - cg_m[2]),
            noise: [
                math::hypot(params.accel_noise_mps2, params.accel_noise_density * root_rate),
                math::hypot(params.gyro_noise_radps, params.gyro_noise_density * root_rate),
            ],
            sensor: sensor.to_owned(),
            seed,
            scale: core::array::from_fn(|axis| per_axis[axis / 3] * rng.normal()),
            walked: [0.0; 6],
            last: None,
            params,
        }
    }

    /// Takes one reading. Away from the centre of gravity it includes `dω/dt × r + ω × (ω × r)`, with the rotational
    /// acceleration since the last reading.
    pub fn sense(&mut self, world: &WorldState) -> Imu {
        let stamp = world.stamp;
        let (mut force, turn) =
            (world.ego.specific_force_mps2.coords, world.ego.angular_velocity_radps.coords);
        let since = self.last.map(|(before, rates)| ((stamp - before).as_secs(), rates));
        let since = since.filter(|(dt_s, _)| *dt_s > 0.0);
        let lever = self.lever.coords;
        if lever.dot(&lever) > 0.0 {
            let angular = since.map(|(dt_s, rates)| (turn - rates.coords) / dt_s).unwrap_or_default();
            force += angular.cross(&lever) + turn.cross(&turn.cross(&lever));
        }
        if let Some((dt_s, _)) = since {
            self.walk(stamp, dt_s);
        }
        self.last = Some((stamp, world.ego.angular_velocity_radps));
        let mut errors = Errors::new(self.seed, &self.sensor, stamp);
        let biases = [self.params.accel_bias_mps2, self.params.gyro_bias_radps];
        let mut axis = 0;
        let mut read = |x: f64| {
            let (kind, scaled, walked) = (axis / 3, self.scale[axis] * x, self.walked[axis]);
            axis += 1;
            let reading = x + errors.next(biases[kind], self.noise[kind]);
            // Without these errors readings are bit-identical to the truth, including the sign of zeros.
            [scaled, walked].into_iter().filter(|by| *by != 0.0).fold(reading, |reading, by| reading + by)
        };
        let accel_mps2 = [read(force.x), read(force.y), read(force.z)];
        let gyro_radps = [read(turn.x), read(turn.y), read(turn.z)];
        Imu { stamp, accel_mps2, gyro_radps }
    }

    fn walk(&mut self, stamp: Time, dt_s: f64) {
        let per_axis =
            [self.params.accel_bias_walk, self.params.gyro_bias_walk].map(|walk| walk * dt_s.sqrt());
        if per_axis == [0.0; 2] {
            return;
        }
        let mut rng = Rng::keyed(self.seed, "sensor walk", &[key(&self.sensor), stamp.ns()]);
        for (axis, walked) in self.walked.iter_mut().enumerate() {
            *walked += per_axis[axis / 3] * rng.normal();
        }
    }
}
