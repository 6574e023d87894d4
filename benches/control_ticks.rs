//! Calls of the MPC: on y = 2 sin(x / 12) at 10 m/s, and from recorded drives. Shared by the benchmark of this
//! workspace and the one against peers.

use serde::Deserialize;
use swerve_control::mpc::{Knot, State};
use swerve_core::Rng;
use swerve_geom::{Pose2, math};

/// Wheelbase of the car, metres.
pub(crate) const WHEELBASE_M: f64 = 2.85;

/// One call of the MPC.
pub(crate) struct Tick {
    /// State of the car.
    pub(crate) start: State,
    /// The path ahead.
    pub(crate) knots: Vec<Knot>,
}

/// State on the path after `s` metres, to good approximation.
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

/// `n` ticks of 10 ms with a car that deviates by decimetres, one every 0.1 s of the path.
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

/// Calls of one recorded drive.
#[derive(Deserialize)]
pub(crate) struct Drive {
    /// True for an emergency.
    pub(crate) emergency: bool,
    calls: Vec<Call>,
}

/// Numbers of a call: the start state, and per knot those of [`Call::knot`].
#[derive(Deserialize)]
struct Call {
    start: [f64; 6],
    knots: Vec<[f64; 10]>,
}

impl Call {
    fn knot(row: &[f64; 10]) -> Knot {
        let [
            x_m,
            y_m,
            heading_rad,
            speed_mps,
            steering_rad,
            along_m,
            wanted_mps,
            accel_mps2,
            left_m,
            right_m,
        ] = *row;
        Knot {
            state: State {
                pose: Pose2::new(x_m, y_m, heading_rad),
                speed_mps,
                steering_rad,
                accel_mps2: 0.0,
            },
            wanted_along_m: along_m,
            wanted_speed_mps: wanted_mps,
            wanted_accel_mps2: accel_mps2,
            left_m,
            right_m,
        }
    }
}

impl Drive {
    /// Reads the recorded drives of a file.
    pub(crate) fn all(path: &str) -> Vec<Self> {
        let text = std::fs::read_to_string(path).expect("tests/reference/mpc/drives.json");
        serde_json::from_str(&text).expect("written by `--bench control -- record`")
    }

    /// Calls in order: four consecutive ones at each of several instants.
    pub(crate) fn ticks(&self) -> Vec<Tick> {
        let tick = |call: &Call| {
            let [x_m, y_m, heading_rad, speed_mps, steering_rad, accel_mps2] = call.start;
            let pose = Pose2::new(x_m, y_m, heading_rad);
            let start = State { pose, speed_mps, steering_rad, accel_mps2 };
            Tick { start, knots: call.knots.iter().map(Call::knot).collect() }
        };
        self.calls.iter().map(tick).collect()
    }
}
