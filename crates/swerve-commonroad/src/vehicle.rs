//! Vehicles of the benchmark and their equations of motion.
//!
//! Source: M. Althoff and G. Würsching, "CommonRoad: Vehicle Models", version 2020a, and the parameters of
//! `commonroad-vehicle-models` 3.0.2.

use swerve_geom::math;

use crate::{Model, SolutionState};

/// Standard gravity as the models use it, m/s².
const GRAVITY_MPS2: f64 = 9.81;

/// Coefficient of friction of the tyres.
const FRICTION: f64 = 1.0489;

/// Cornering stiffness of a tyre per load and friction, 1/rad.
const STIFFNESS: f64 = 21.92 / FRICTION;

/// Speed below which the single track is kinematic, m/s.
const KINEMATIC_MPS: f64 = 0.1;

/// Longest step of integration, seconds.
const STEP_MAX_S: f64 = 0.025;

/// Most steps of integration between two states.
const STEPS_MAX: f64 = 2000.0;

/// Kind of a vehicle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum VehicleKind {
    /// Ford Escort, number 1.
    FordEscort,
    /// BMW 320i, number 2.
    Bmw320i,
    /// VW Vanagon, number 3.
    VwVanagon,
}

impl VehicleKind {
    const ALL: [Self; 3] = [Self::FordEscort, Self::Bmw320i, Self::VwVanagon];

    /// Number in the identity of a benchmark.
    pub fn number(self) -> u8 {
        match self {
            Self::FordEscort => 1,
            Self::Bmw320i => 2,
            Self::VwVanagon => 3,
        }
    }

    /// The kind of a number.
    pub fn numbered(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.number() == number)
    }

    /// Parameters of the kind.
    pub fn vehicle(self) -> Vehicle {
        match self {
            Self::FordEscort => Vehicle {
                length_m: 4.298,
                width_m: 1.674,
                front_m: 0.88392,
                rear_m: 1.50876,
                mass_kg: 1225.8878467253344,
                yaw_inertia_kgm2: 1538.8533713561394,
                height_m: 0.59436,
                steering_max_rad: 0.91,
                switch_mps: 4.755,
                speeds_mps: [-13.9, 45.8],
            },
            Self::Bmw320i => Vehicle {
                length_m: 4.508,
                width_m: 1.61,
                front_m: 1.1561957064,
                rear_m: 1.4227170936,
                mass_kg: 1093.2952334674046,
                yaw_inertia_kgm2: 1791.5995300122856,
                height_m: 0.61373004,
                steering_max_rad: 1.066,
                switch_mps: 7.319,
                speeds_mps: [-13.9, 50.8],
            },
            Self::VwVanagon => Vehicle {
                length_m: 4.569,
                width_m: 1.844,
                front_m: 1.1507916024,
                rear_m: 1.3211363976000001,
                mass_kg: 1478.8979637767998,
                yaw_inertia_kgm2: 2473.1176915564442,
                height_m: 0.804490644,
                steering_max_rad: 1.023,
                switch_mps: 7.824,
                speeds_mps: [-11.2, 41.7],
            },
        }
    }
}

/// Parameters of a vehicle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Vehicle {
    /// Length, metres.
    pub length_m: f64,
    /// Width, metres.
    pub width_m: f64,
    /// Distance of the front axle from the centre of gravity, metres.
    pub front_m: f64,
    /// Distance of the rear axle from the centre of gravity, metres.
    pub rear_m: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Moment of inertia in yaw, kg m².
    pub yaw_inertia_kgm2: f64,
    /// Height of the centre of gravity, metres.
    pub height_m: f64,
    /// Largest steering angle, radians.
    pub steering_max_rad: f64,
    /// Speed from which on the power limits the acceleration, m/s.
    pub switch_mps: f64,
    /// Lowest and highest speed, m/s.
    pub speeds_mps: [f64; 2],
}

/// Largest acceleration in any direction, m/s²: the radius of the friction circle.
pub(crate) const ACCEL_MAX_MPS2: f64 = 11.5;

/// Largest steering rate, rad/s.
pub(crate) const STEERING_RATE_MAX_RADPS: f64 = 0.4;

/// State of the equations: x, y, steering angle, speed, heading, yaw rate, slip angle; of the point mass x, y and the
/// two components of the velocity. The kinematic model refers to the rear axle.
pub(crate) type Values = [f64; 7];

/// Input of the equations: steering rate in rad/s and acceleration in m/s²; of the point mass the two components of the
/// acceleration.
pub(crate) type Input = [f64; 2];

impl Vehicle {
    /// Distance between the axles, metres.
    pub fn wheelbase_m(&self) -> f64 {
        self.front_m + self.rear_m
    }

    /// The state of a solution as values of the equations.
    pub(crate) fn values(&self, model: Model, state: &SolutionState) -> Values {
        let (x, y, heading) = (state.position.x_m, state.position.y_m, state.heading_rad);
        let (sin, cos) = math::sin_cos(heading);
        let (steering, speed) = (state.steering_rad, state.speed_mps);
        match model {
            Model::Pm => [x, y, speed * cos, speed * sin, 0.0, 0.0, 0.0],
            Model::Ks => [x - self.rear_m * cos, y - self.rear_m * sin, steering, speed, heading, 0.0, 0.0],
            Model::St => [x, y, steering, speed, heading, state.yaw_rate_radps, state.slip_rad],
        }
    }

    /// Values after `dt_s` under a constant input; `None` beyond the friction circle.
    pub(crate) fn after(&self, model: Model, from: Values, input: Input, dt_s: f64) -> Option<Values> {
        let turning = match model {
            Model::Pm => input[0],
            _ => from[3] * self.change(model, &from, input)[4],
        };
        if turning * turning + input[1] * input[1] > ACCEL_MAX_MPS2 * ACCEL_MAX_MPS2 {
            return None;
        }
        let steps = self.steps(model, &from, input, dt_s);
        let h = dt_s / steps;
        let mut x = from;
        for _ in 0..steps as usize {
            let at = |by: f64, change: &Values| core::array::from_fn(|k| x[k] + by * change[k]);
            let a = self.change(model, &x, input);
            let b = self.change(model, &at(0.5 * h, &a), input);
            let c = self.change(model, &at(0.5 * h, &b), input);
            let d = self.change(model, &at(h, &c), input);
            x = core::array::from_fn(|k| x[k] + h / 6.0 * (a[k] + 2.0 * (b[k] + c[k]) + d[k]));
        }
        Some(x)
    }

    /// Number of steps of integration: the tyres of a slow single track are stiff.
    fn steps(&self, model: Model, from: &Values, input: Input, dt_s: f64) -> f64 {
        let plain = (dt_s / STEP_MAX_S).ceil().max(1.0);
        let slowest = from[3].abs().min((from[3] + input[1] * dt_s).abs()).max(KINEMATIC_MPS);
        if model != Model::St || from[3].abs() < KINEMATIC_MPS {
            return plain;
        }
        let lever = self.mass_kg * self.wheelbase_m() * self.wheelbase_m() / self.yaw_inertia_kgm2;
        let rate = FRICTION * STIFFNESS * GRAVITY_MPS2 / slowest * (1.0 + lever);
        (dt_s * rate).ceil().clamp(plain, STEPS_MAX)
    }

    /// Rates of change of the values.
    fn change(&self, model: Model, x: &Values, input: Input) -> Values {
        if model == Model::Pm {
            return [x[2], x[3], input[0], input[1], 0.0, 0.0, 0.0];
        }
        let u = self.limited(x, input);
        let (sin, cos) = math::sin_cos(x[4]);
        match model {
            Model::St if x[3].abs() < KINEMATIC_MPS => self.slow_change(x, u),
            Model::St => self.slip_change(x, u),
            _ => {
                let turn = x[3] / self.wheelbase_m() * math::tan(x[2]);
                [x[3] * cos, x[3] * sin, u[0], u[1], turn, 0.0, 0.0]
            }
        }
    }

    /// The input within the limits of steering and drive.
    fn limited(&self, x: &Values, input: Input) -> Input {
        let [rate, accel] = input;
        let at_end = |value: f64, low: f64, high: f64, change: f64| {
            (value <= low && change <= 0.0) || (value >= high && change >= 0.0)
        };
        let most = self.steering_max_rad;
        let rate = match at_end(x[2], -most, most, rate) {
            true => 0.0,
            false => rate.clamp(-STEERING_RATE_MAX_RADPS, STEERING_RATE_MAX_RADPS),
        };
        let power = if x[3] > self.switch_mps { self.switch_mps / x[3] } else { 1.0 };
        let [slowest, fastest] = self.speeds_mps;
        let accel = match at_end(x[3], slowest, fastest, accel) {
            true => 0.0,
            false => accel.clamp(-ACCEL_MAX_MPS2, ACCEL_MAX_MPS2 * power),
        };
        [rate, accel]
    }

    /// The single track below [`KINEMATIC_MPS`]: wheels roll without slip, around the centre of gravity.
    fn slow_change(&self, x: &Values, u: Input) -> Values {
        let (length, rear) = (self.wheelbase_m(), self.rear_m);
        let (tan, cos) = (math::tan(x[2]), math::cos(x[2]));
        let beta = math::atan(tan * rear / length);
        let ratio = tan * tan * rear / length;
        let beta_rate = rear * u[0] / (length * cos * cos * (1.0 + ratio * ratio));
        let (sin_slip, cos_slip) = math::sin_cos(x[6]);
        let turn =
            u[1] * cos_slip * tan - x[3] * sin_slip * beta_rate * tan + x[3] * cos_slip * u[0] / (cos * cos);
        [
            x[3] * math::cos(beta + x[4]),
            x[3] * math::sin(beta + x[4]),
            u[0],
            u[1],
            x[3] * math::cos(beta) * tan / length,
            turn / length,
            beta_rate,
        ]
    }

    /// The single track with linear tyres.
    fn slip_change(&self, x: &Values, u: Input) -> Values {
        let (front, rear, length) = (self.front_m, self.rear_m, self.wheelbase_m());
        let load_front = STIFFNESS * (GRAVITY_MPS2 * rear - u[1] * self.height_m);
        let load_rear = STIFFNESS * (GRAVITY_MPS2 * front + u[1] * self.height_m);
        let (speed, yaw_rate, slip, steering) = (x[3], x[5], x[6], x[2]);
        let turn = FRICTION * self.mass_kg / (self.yaw_inertia_kgm2 * length);
        let slide = FRICTION / (speed * length);
        [
            speed * math::cos(slip + x[4]),
            speed * math::sin(slip + x[4]),
            u[0],
            u[1],
            yaw_rate,
            -turn / speed * (front * front * load_front + rear * rear * load_rear) * yaw_rate
                + turn * (rear * load_rear - front * load_front) * slip
                + turn * front * load_front * steering,
            (slide / speed * (load_rear * rear - load_front * front) - 1.0) * yaw_rate
                - slide * (load_rear + load_front) * slip
                + slide * load_front * steering,
        ]
    }
}
