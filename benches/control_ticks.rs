//! Ticks of a controller on y = 2 sin(x / 12) at 10 m/s: shared by the bench of our own and the one beside peers.

use swerve_control::mpc::{Knot, State};
use swerve_core::Rng;
use swerve_geom::{Pose2, math};

/// Wheelbase of the car, metres.
pub(crate) const WHEELBASE_M: f64 = 2.85;

/// One call of the predictive controller.
pub(crate) struct Tick {
    /// Where the car is.
    pub(crate) start: State,
    /// The path ahead.
    pub(crate) knots: Vec<Knot>,
}

/// What the path is after `s` metres of way, to good approximation.
fn on_path(s: f64) -> State {
    // The curve is 1.4 % longer than its projection.
    let x = s / 1.0138;
    let (sin, cos) = math::sin_cos(x / 12.0);
    let slope = cos / 6.0;
    let stretch = (1.0 + slope * slope).sqrt();
    let curvature = -sin / 72.0 / (stretch * stretch * stretch);
    State {
        pose: Pose2::new(x, 2.0 * sin, math::atan(slope)),
        speed_mps: 10.0,
        steering_rad: math::atan(WHEELBASE_M * curvature),
        accel_mps2: 0.0,
    }
}

/// `n` ticks of 10 ms with a car that strays by decimetres, one every 0.1 s of the path.
pub(crate) fn ticks(n: usize, horizon: usize) -> Vec<Tick> {
    let mut rng = Rng::keyed(1, "ticks", &[]);
    (0..n)
        .map(|tick| {
            let from_m = 0.1 * tick as f64;
            let here = on_path(from_m);
            let pose = Pose2::new(
                here.pose.x_m + rng.uniform(-0.3, 0.3),
                here.pose.y_m + rng.uniform(-0.3, 0.3),
                here.pose.heading_rad + rng.uniform(-0.05, 0.05),
            );
            let start = State {
                pose,
                speed_mps: rng.uniform(9.0, 11.0),
                steering_rad: here.steering_rad + rng.uniform(-0.03, 0.03),
                accel_mps2: rng.uniform(-1.0, 1.0),
            };
            let knots = (0..=horizon)
                .map(|k| Knot {
                    state: on_path(from_m + k as f64),
                    wanted_speed_mps: 10.0,
                    left_m: 1.2,
                    right_m: 1.2,
                    ..Knot::default()
                })
                .collect();
            Tick { start, knots }
        })
        .collect()
}
