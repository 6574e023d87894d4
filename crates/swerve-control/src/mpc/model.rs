//! The kinematic bicycle, its discrete step and its derivatives.

use serde::{Deserialize, Serialize};
use swerve_geom::{Pose2, math};

/// State of the bicycle; the pose is that of the rear axle.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct State {
    /// Position and heading in the map.
    pub pose: Pose2,
    /// Speed along the heading, m/s.
    pub speed_mps: f64,
    /// Angle of the front wheels, radians; positive to the left.
    pub steering_rad: f64,
    /// Acceleration along the heading, m/s².
    pub accel_mps2: f64,
}

impl State {
    pub(crate) fn is_finite(&self) -> bool {
        self.pose.is_finite()
            && self.speed_mps.is_finite()
            && self.steering_rad.is_finite()
            && self.accel_mps2.is_finite()
    }
}

/// Inputs of the bicycle, constant over a step.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Rates {
    /// Steering rate, rad/s.
    pub(crate) steering_radps: f64,
    /// Jerk, m/s³.
    pub(crate) jerk_mps3: f64,
}

/// Order of the states in a deviation: along, across, heading, speed, steering, acceleration.
pub(crate) const N_STATES: usize = 6;
/// Order of the inputs: steering rate, jerk.
pub(crate) const N_INPUTS: usize = 2;

/// A step linearised between two knots of a path.
///
/// With `z` the deviation of the state from a knot, whose first two entries are along and to the left of the knot's
/// heading: `z_next = a z + b u + c`, where `u` are the rates themselves. The methods skip entries that are always 0 or
/// 1: heading, speed, steering and acceleration do not depend on the position, the last two only on themselves and the
/// rates.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Linear {
    pub(crate) a: [[f64; N_STATES]; N_STATES],
    pub(crate) b: [[f64; N_INPUTS]; N_STATES],
    pub(crate) c: [f64; N_STATES],
}

impl Linear {
    /// `a z + b u`: the next state without the constant.
    pub(crate) fn next(&self, z: &[f64; N_STATES], u: &[f64; N_INPUTS]) -> [f64; N_STATES] {
        let Self { a, b, .. } = self;
        let place = |i: usize| {
            a[i][0] * z[0]
                + a[i][1] * z[1]
                + a[i][2] * z[2]
                + a[i][3] * z[3]
                + a[i][4] * z[4]
                + a[i][5] * z[5]
        };
        [
            place(0) + b[0][0] * u[0],
            place(1) + b[1][0] * u[0],
            z[2] + a[2][3] * z[3] + a[2][4] * z[4] + a[2][5] * z[5] + b[2][0] * u[0],
            z[3] + a[3][5] * z[5] + b[3][1] * u[1],
            z[4] + b[4][0] * u[0],
            z[5] + b[5][1] * u[1],
        ]
    }

    /// The transpose of `a` times `p`.
    pub(crate) fn transposed(&self, p: &[f64; N_STATES]) -> [f64; N_STATES] {
        let a = &self.a;
        let by_place = |j: usize| a[0][j] * p[0] + a[1][j] * p[1];
        [
            by_place(0),
            by_place(1),
            by_place(2) + p[2],
            by_place(3) + a[2][3] * p[2] + p[3],
            by_place(4) + a[2][4] * p[2] + p[4],
            by_place(5) + a[2][5] * p[2] + a[3][5] * p[3] + p[5],
        ]
    }

    /// The transpose of `b` times `p`.
    pub(crate) fn transposed_inputs(&self, p: &[f64; N_STATES]) -> [f64; N_INPUTS] {
        let b = &self.b;
        [b[0][0] * p[0] + b[1][0] * p[1] + b[2][0] * p[2] + b[4][0] * p[4], b[3][1] * p[3] + b[5][1] * p[5]]
    }
}

/// Midpoint quantities of one step.
struct Middle {
    /// Speed halfway, m/s.
    speed: f64,
    /// Path curvature halfway, 1/m, and its derivative by the steering angle.
    curvature: f64,
    curvature_by_steering: f64,
    /// Turn of the heading up to halfway, radians.
    half_turn: f64,
}

impl Middle {
    fn new(state: &State, rates: Rates, wheelbase_m: f64, dt_s: f64) -> Self {
        let speed = state.speed_mps + 0.5 * dt_s * state.accel_mps2;
        let tan = math::tan(state.steering_rad + 0.5 * dt_s * rates.steering_radps);
        let curvature = tan / wheelbase_m;
        let curvature_by_steering = (1.0 + tan * tan) / wheelbase_m;
        Self { speed, curvature, curvature_by_steering, half_turn: 0.5 * dt_s * speed * curvature }
    }
}

/// The state `dt_s` later, by the explicit midpoint rule (error of third order in the step).
pub(crate) fn step(state: &State, rates: Rates, wheelbase_m: f64, dt_s: f64) -> State {
    let middle = Middle::new(state, rates, wheelbase_m, dt_s);
    let (sin, cos) = math::sin_cos(state.pose.heading_rad + middle.half_turn);
    State {
        pose: Pose2::new(
            state.pose.x_m + dt_s * middle.speed * cos,
            state.pose.y_m + dt_s * middle.speed * sin,
            state.pose.heading_rad + 2.0 * middle.half_turn,
        ),
        speed_mps: state.speed_mps + dt_s * (state.accel_mps2 + 0.5 * dt_s * rates.jerk_mps3),
        steering_rad: state.steering_rad + dt_s * rates.steering_radps,
        accel_mps2: state.accel_mps2 + dt_s * rates.jerk_mps3,
    }
}

/// `other` as a deviation from `knot`, in the axes of the knot.
pub(crate) fn deviation(other: &State, knot: &State) -> [f64; N_STATES] {
    let local: swerve_geom::Point2<swerve_geom::Ego> = knot.pose.to_local(other.pose.point());
    [
        local.x_m,
        local.y_m,
        swerve_geom::angle_between(knot.pose.heading_rad, other.pose.heading_rad),
        other.speed_mps - knot.speed_mps,
        other.steering_rad - knot.steering_rad,
        other.accel_mps2 - knot.accel_mps2,
    ]
}

/// The state that deviates by `z` from `knot`; the inverse of [`deviation`].
pub(crate) fn deviated(knot: &State, z: &[f64]) -> State {
    let point = knot.pose.from_local(swerve_geom::Point2::<swerve_geom::Ego>::new(z[0], z[1]));
    State {
        pose: Pose2::new(point.x_m, point.y_m, knot.pose.heading_rad + z[2]),
        speed_mps: knot.speed_mps + z[3],
        steering_rad: knot.steering_rad + z[4],
        accel_mps2: knot.accel_mps2 + z[5],
    }
}

/// The step from `from` to `to`, linearised around `from` with the rates that take its steering and acceleration to
/// those of `to`. The knots need not satisfy the model: the residual is `c`.
pub(crate) fn linearise(from: &State, to: &State, wheelbase_m: f64, dt_s: f64) -> Linear {
    let rates = Rates {
        steering_radps: (to.steering_rad - from.steering_rad) / dt_s,
        jerk_mps3: (to.accel_mps2 - from.accel_mps2) / dt_s,
    };
    let middle = Middle::new(from, rates, wheelbase_m, dt_s);
    // Derivatives of the turn over the whole step by (speed, steering, acceleration, steering rate).
    let by_speed = dt_s * middle.curvature;
    let by_steering = dt_s * middle.speed * middle.curvature_by_steering;
    let turn_by = [by_speed, by_steering, 0.5 * dt_s * by_speed, 0.5 * dt_s * by_steering];
    // Derivatives of the distance by the same.
    let way_by = [dt_s, 0.0, 0.5 * dt_s * dt_s, 0.0];
    let way = dt_s * middle.speed;
    // Direction of travel and axes of `from`, both in the axes of `to`.
    let turned = swerve_geom::angle_between(to.pose.heading_rad, from.pose.heading_rad);
    let (way_sin, way_cos) = math::sin_cos(turned + middle.half_turn);
    let (sin, cos) = math::sin_cos(turned);

    let mut linear = Linear::default();
    let (a, b) = (&mut linear.a, &mut linear.b);
    a[0][0] = cos;
    a[0][1] = -sin;
    a[1][0] = sin;
    a[1][1] = cos;
    a[0][2] = -way * way_sin;
    a[1][2] = way * way_cos;
    for (axis, (ahead, left)) in [(way_cos, -way_sin), (way_sin, way_cos)].into_iter().enumerate() {
        let by = |k: usize| way_by[k] * ahead + way * left * 0.5 * turn_by[k];
        (a[axis][3], a[axis][4], a[axis][5], b[axis][0]) = (by(0), by(1), by(2), by(3));
    }
    (a[2][2], a[2][3], a[2][4], a[2][5], b[2][0]) = (1.0, turn_by[0], turn_by[1], turn_by[2], turn_by[3]);
    (a[3][3], a[3][5], b[3][1]) = (1.0, dt_s, 0.5 * dt_s * dt_s);
    (a[4][4], b[4][0]) = (1.0, dt_s);
    (a[5][5], b[5][1]) = (1.0, dt_s);

    let reached = deviation(&step(from, rates, wheelbase_m, dt_s), to);
    for (i, c) in linear.c.iter_mut().enumerate() {
        *c = reached[i] - linear.b[i][0] * rates.steering_radps - linear.b[i][1] * rates.jerk_mps3;
    }
    linear
}

#[cfg(test)]
mod tests {
    use super::*;

    const L: f64 = 2.85;
    const DT: f64 = 0.1;

    fn knots() -> (State, State) {
        let from =
            State { pose: Pose2::new(3.0, -2.0, 3.1), speed_mps: 12.0, steering_rad: 0.08, accel_mps2: -1.0 };
        // Not the state that the model reaches from there.
        let to =
            State { pose: Pose2::new(1.9, -1.8, -3.1), speed_mps: 11.7, steering_rad: 0.1, accel_mps2: -0.5 };
        (from, to)
    }

    #[test]
    fn derivatives_match_those_of_the_step() {
        let (from, to) = knots();
        let linear = linearise(&from, &to, L, DT);
        let rates = Rates { steering_radps: 0.2, jerk_mps3: 5.0 };
        let h = 1e-6;
        let base = deviation(&step(&from, rates, L, DT), &to);
        for k in 0..N_STATES {
            let mut z = [0.0; N_STATES];
            z[k] = h;
            let moved = deviation(&step(&deviated(&from, &z), rates, L, DT), &to);
            for i in 0..N_STATES {
                let slope = (moved[i] - base[i]) / h;
                assert!((slope - linear.a[i][k]).abs() < 1e-5, "a[{i}][{k}]: {slope} {}", linear.a[i][k]);
            }
        }
        for k in 0..N_INPUTS {
            let mut bent = rates;
            if k == 0 {
                bent.steering_radps += h
            } else {
                bent.jerk_mps3 += h
            }
            let moved = deviation(&step(&from, bent, L, DT), &to);
            for i in 0..N_STATES {
                let slope = (moved[i] - base[i]) / h;
                assert!((slope - linear.b[i][k]).abs() < 1e-5, "b[{i}][{k}]: {slope} {}", linear.b[i][k]);
            }
        }
        for (i, base) in base.into_iter().enumerate() {
            let at_knot = linear.c[i] + linear.b[i][0] * 0.2 + linear.b[i][1] * 5.0;
            assert!((at_knot - base).abs() < 1e-12, "c[{i}]");
        }
    }

    #[test]
    fn sparse_products_equal_dense_ones() {
        let (from, to) = knots();
        let Linear { a, b, .. } = linearise(&from, &to, L, DT);
        let linear = linearise(&from, &to, L, DT);
        let (z, u) = ([0.3, -0.7, 0.2, 1.1, -0.4, 0.9], [0.6, -1.3]);
        let next = linear.next(&z, &u);
        let (transposed, by_inputs) = (linear.transposed(&z), linear.transposed_inputs(&z));
        for i in 0..N_STATES {
            let row: f64 = (0..N_STATES).map(|j| a[i][j] * z[j]).sum();
            let inputs: f64 = (0..N_INPUTS).map(|j| b[i][j] * u[j]).sum();
            assert!((next[i] - row - inputs).abs() < 1e-14, "row {i}");
            let column: f64 = (0..N_STATES).map(|j| a[j][i] * z[j]).sum();
            assert!((transposed[i] - column).abs() < 1e-14, "column {i}");
        }
        for j in 0..N_INPUTS {
            let column: f64 = (0..N_STATES).map(|i| b[i][j] * z[i]).sum();
            assert!((by_inputs[j] - column).abs() < 1e-14, "input {j}");
        }
    }

    #[test]
    fn deviations_round_trip() {
        let (a, b) = knots();
        let back = deviated(&a, &deviation(&b, &a));
        assert!((back.pose.point().distance(b.pose.point())) < 1e-12);
        assert!((back.pose.heading_rad - b.pose.heading_rad).abs() < 1e-12);
    }

    #[test]
    fn a_constant_turn_stays_on_its_circle() {
        let steering_rad = 0.1;
        let radius = L / math::tan(steering_rad);
        let mut state = State { speed_mps: 10.0, steering_rad, ..State::default() };
        for _ in 0..40 {
            state = step(&state, Rates::default(), L, DT);
        }
        let off = state.pose.point().distance(swerve_geom::Point2::new(0.0, radius)) - radius;
        assert!(off.abs() < 0.02, "{off}");
        assert!((state.pose.heading_rad - swerve_geom::wrap_angle(40.0 / radius)).abs() < 1e-9);
    }
}
