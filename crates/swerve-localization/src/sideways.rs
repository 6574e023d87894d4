//! How fast a car goes sideways: by its inertial unit in a swerve, by the slip of its tyres in a steady turn.
//!
//! A filter estimates it with everything else; this is for who has none.

use swerve_core::Time;
use swerve_geom::math;

/// Slip angle of the rear axle for each m/s² of lateral acceleration, radians. Assumed: a tyre whose lateral force grows by 22
/// times its load for each radian, as that of the simulated car (`sim.vehicle.tyre.lateral.stiffness`).
const SLIP_RAD_PER_MPS2: f64 = 1.0 / (22.0 * G_MPS2);

/// Roll of the body for each m/s² of lateral acceleration, radians. Assumed: 3.5 degrees at the acceleration of gravity.
const ROLL_RAD_PER_MPS2: f64 = 0.0062;

const G_MPS2: f64 = 9.81;

/// The integrals of the unit's readings drift: they are led to the steady turn with this time constant, seconds.
const DRIFTS_S: f64 = 1.0;

/// Longest step, seconds: after a longer one nothing is known.
const STEP_MAX_S: f64 = 0.2;

/// Lateral velocity of the rear axle in a steady turn, m/s; to the left.
pub fn steady_mps(speed_mps: f64, yaw_rate_radps: f64) -> f64 {
    -SLIP_RAD_PER_MPS2 * speed_mps * speed_mps * yaw_rate_radps
}

/// The lateral velocity of the ego origin, on the ground below the rear axle.
#[derive(Clone, Debug)]
pub struct Sideways {
    /// The unit's place ahead of the origin and above it, metres.
    ahead_m: f64,
    up_m: f64,
    stamp: Option<Time>,
    roll_rad: f64,
    /// Lateral velocity of the unit, m/s.
    unit_mps: f64,
}

impl Sideways {
    /// By a unit at this place in the ego frame, metres.
    pub fn new([ahead_m, _, up_m]: [f64; 3]) -> Self {
        Self { ahead_m, up_m, stamp: None, roll_rad: 0.0, unit_mps: 0.0 }
    }

    /// Takes a reading of the unit: specific force (m/s²) and turn rate (rad/s) in the ego's axes, with the speed of the rear
    /// axle, m/s. Returns the lateral velocity of the origin, m/s; to the left.
    pub fn take(&mut self, stamp: Time, force_mps2: [f64; 3], gyro_radps: [f64; 3], speed_mps: f64) -> f64 {
        let [roll_radps, _, yaw_rate_radps] = gyro_radps;
        let steady_mps = steady_mps(speed_mps, yaw_rate_radps);
        let turned_mps = yaw_rate_radps * self.ahead_m;
        let dt_s = self.stamp.map_or(f64::INFINITY, |before| (stamp - before).as_secs());
        self.stamp = Some(stamp);
        if !(0.0..=STEP_MAX_S).contains(&dt_s) {
            self.roll_rad = ROLL_RAD_PER_MPS2 * force_mps2[1];
            self.unit_mps = steady_mps + turned_mps;
            return steady_mps;
        }
        let left = math::exp(-dt_s / DRIFTS_S);
        let led = |to: f64, integral: f64| to + (integral - to) * left;
        self.roll_rad = led(ROLL_RAD_PER_MPS2 * force_mps2[1], self.roll_rad + roll_radps * dt_s);
        let gained_mps2 = force_mps2[1] - G_MPS2 * self.roll_rad - speed_mps * yaw_rate_radps;
        self.unit_mps = led(steady_mps + turned_mps, self.unit_mps + gained_mps2 * dt_s);
        self.unit_mps - turned_mps + roll_radps * self.up_m
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::Span;

    use super::*;

    const SPEED_MPS: f64 = 18.0;
    const AT_M: [f64; 3] = [1.3, 0.0, 0.5];

    /// Yaw rate and its derivative, in a swerve of a second.
    fn yaw(t: f64) -> (f64, f64) {
        (0.2 * (1.0 - math::cos(2.0 * t)), 0.4 * math::sin(2.0 * t))
    }

    /// Roll, its rate and the lateral velocity with its derivative.
    fn roll(t: f64) -> (f64, f64) {
        (0.02 * (1.0 - math::cos(2.0 * t)), 0.04 * math::sin(2.0 * t))
    }

    fn lateral(t: f64) -> (f64, f64) {
        (-1.2 * (1.0 - math::cos(2.0 * t)), -2.4 * math::sin(2.0 * t))
    }

    #[test]
    fn a_swerve_is_felt_before_it_is_a_steady_turn() {
        let mut sideways = Sideways::new(AT_M);
        let (mut off_mps, mut steady_off_mps): (f64, f64) = (0.0, 0.0);
        for step in 0..=50 {
            let t = 0.01 * f64::from(step);
            let ((yaw_radps, yaw_radps2), (roll_rad, roll_radps), (_, mps2)) = (yaw(t), roll(t), lateral(t));
            // The unit: the origin's acceleration, the turn about it, the roll; what is read has a share of gravity.
            let roll_radps2 = 0.08 * math::cos(2.0 * t);
            let unit_mps2 = mps2 + SPEED_MPS * yaw_radps + yaw_radps2 * AT_M[0] - roll_radps2 * AT_M[2];
            let force_mps2 = [0.0, unit_mps2 + G_MPS2 * roll_rad, G_MPS2];
            let stamp = Time::ZERO + Span::from_secs(t);
            let found = sideways.take(stamp, force_mps2, [roll_radps, 0.0, yaw_radps], SPEED_MPS);
            off_mps = off_mps.max((found - lateral(t).0).abs());
            steady_off_mps = steady_off_mps.max((steady_mps(SPEED_MPS, yaw_radps) - lateral(t).0).abs());
        }
        assert!(off_mps < 0.15 && steady_off_mps > 2.5 * off_mps, "{off_mps} {steady_off_mps}");
    }

    #[test]
    fn what_a_unit_is_off_by_does_not_add_up() {
        let mut sideways = Sideways::new(AT_M);
        let mut found = 0.0;
        for step in 0..6000 {
            found = sideways.take(Time::from_ms(10 * step), [0.0, 0.02, G_MPS2], [0.0; 3], SPEED_MPS);
        }
        assert!(found.abs() < 0.03, "{found}");
        // A steady turn: the slip of its tyres.
        let (yaw_radps, roll_rad) = (0.2, ROLL_RAD_PER_MPS2 * SPEED_MPS * 0.2);
        for step in 6000..7000 {
            let force = [0.0, SPEED_MPS * yaw_radps + G_MPS2 * roll_rad, G_MPS2];
            found = sideways.take(Time::from_ms(10 * step), force, [0.0, 0.0, yaw_radps], SPEED_MPS);
        }
        assert!((found - steady_mps(SPEED_MPS, yaw_radps)).abs() < 0.03, "{found}");
        // After a gap it starts again.
        found = sideways.take(Time::from_ms(100_000), [0.0, 3.0, G_MPS2], [0.0; 3], SPEED_MPS);
        assert!(found.abs() < 1e-12, "{found}");
    }
}
