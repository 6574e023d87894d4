//! Lateral velocity of a car: from its inertial unit in a swerve, from tyre slip in a steady turn.
//!
//! The lateral velocity of a localization filter mostly reflects its heading error and jumps with every correction;
//! this estimate has neither problem.

use swerve_core::Time;
use swerve_geom::math;

/// Slip angle of the rear axle per m/s² of lateral acceleration, radians. Assumed: a tyre whose lateral force grows
/// by 22 times its load per radian, as that of the simulated car (`sim.vehicle.tyre.lateral.stiffness`).
const SLIP_RAD_PER_MPS2: f64 = 1.0 / (22.0 * G_MPS2);

/// Roll of the body per m/s² of lateral acceleration, radians. Assumed: 3.5 degrees at the acceleration of gravity.
const ROLL_RAD_PER_MPS2: f64 = 0.0062;

const G_MPS2: f64 = 9.81;

/// Time constant with which the integrals of the readings, which drift, decay to the steady turn, seconds.
const DRIFTS_S: f64 = 1.0;

/// Largest rate of change of the lateral velocity, m/s²; larger values are noise.
const GAIN_MAX_MPS2: f64 = 8.0;

/// Longest step, seconds; after a longer gap the estimate restarts from the steady turn.
const STEP_MAX_S: f64 = 0.2;

/// Lateral velocity of the rear axle in a steady turn, m/s; to the left.
pub fn steady_mps(speed_mps: f64, yaw_rate_radps: f64) -> f64 {
    -SLIP_RAD_PER_MPS2 * speed_mps * speed_mps * yaw_rate_radps
}

/// Motion of a car at one instant.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct LateralMotion {
    /// Acceleration of the inertial unit to the left, gravity removed, m/s².
    pub lateral_mps2: f64,
    /// Angular rate about the ego's x axis, rad/s.
    pub roll_radps: f64,
    /// Angular rate about the ego's z axis, rad/s.
    pub yaw_radps: f64,
    /// Speed of the rear axle, m/s.
    pub speed_mps: f64,
}

/// Lateral velocity of the ego origin, on the ground below the rear axle.
#[derive(Clone, Debug)]
pub struct LateralVelocity {
    /// Position of the unit ahead of and above the origin, metres.
    ahead_m: f64,
    up_m: f64,
    before: Option<(Time, LateralMotion)>,
    /// Lateral velocity of the unit, m/s.
    unit_mps: f64,
}

impl LateralVelocity {
    /// Creates an estimator for a unit at this position in the ego frame, metres.
    pub fn new([ahead_m, _, up_m]: [f64; 3]) -> Self {
        Self { ahead_m, up_m, before: None, unit_mps: 0.0 }
    }

    /// Advances to an instant. Returns the lateral velocity of the origin, m/s to the left.
    pub fn take(&mut self, stamp: Time, moves: LateralMotion) -> f64 {
        let LateralMotion { roll_radps, yaw_radps, speed_mps, .. } = moves;
        let turned_mps = yaw_radps * self.ahead_m;
        let steady_mps = steady_mps(speed_mps, yaw_radps) + turned_mps;
        let before = self.before.replace((stamp, moves));
        let step = before.map(|(at, moves)| ((stamp - at).as_secs(), moves));
        let Some((dt_s, before)) = step.filter(|(dt_s, _)| (0.0..=STEP_MAX_S).contains(dt_s)) else {
            self.unit_mps = steady_mps;
            return steady_mps - turned_mps;
        };
        let gained = |moves: LateralMotion| moves.lateral_mps2 - moves.speed_mps * moves.yaw_radps;
        let gained_mps2 = (0.5 * (gained(before) + gained(moves))).clamp(-GAIN_MAX_MPS2, GAIN_MAX_MPS2);
        self.unit_mps = led(self.unit_mps + gained_mps2 * dt_s, steady_mps, dt_s);
        self.unit_mps - turned_mps + roll_radps * self.up_m
    }
}

/// Roll of the body, by which gravity is removed from the lateral reading of an inertial unit.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct RollEstimate {
    before: Option<Time>,
    roll_rad: f64,
}

impl RollEstimate {
    /// Advances to an instant with the specific force to the left (m/s²) and the angular rate about the x axis
    /// (rad/s). Returns the acceleration to the left, m/s².
    pub fn take(&mut self, stamp: Time, force_mps2: f64, roll_radps: f64) -> f64 {
        let steady_rad = ROLL_RAD_PER_MPS2 * force_mps2;
        let dt_s = self.before.replace(stamp).map(|before| (stamp - before).as_secs());
        self.roll_rad = match dt_s.filter(|dt_s| (0.0..=STEP_MAX_S).contains(dt_s)) {
            Some(dt_s) => led(self.roll_rad + roll_radps * dt_s, steady_rad, dt_s),
            None => steady_rad,
        };
        force_mps2 - G_MPS2 * self.roll_rad
    }
}

/// Integral after a step, decayed towards its value in a steady turn.
fn led(integral: f64, steady: f64, dt_s: f64) -> f64 {
    steady + (integral - steady) * math::exp(-dt_s / DRIFTS_S)
}

#[cfg(test)]
mod tests {
    use swerve_core::Span;

    use super::*;

    const SPEED_MPS: f64 = 18.0;
    const AT_M: [f64; 3] = [1.3, 0.0, 0.5];

    /// Yaw rate and its derivative in a swerve of one second.
    fn yaw(t: f64) -> (f64, f64) {
        (0.2 * (1.0 - math::cos(2.0 * t)), 0.4 * math::sin(2.0 * t))
    }

    /// Roll angle and its rate.
    fn roll(t: f64) -> (f64, f64) {
        (0.02 * (1.0 - math::cos(2.0 * t)), 0.04 * math::sin(2.0 * t))
    }

    fn lateral(t: f64) -> (f64, f64) {
        (-1.2 * (1.0 - math::cos(2.0 * t)), -2.4 * math::sin(2.0 * t))
    }

    fn moves(lateral_mps2: f64, roll_radps: f64, yaw_radps: f64) -> LateralMotion {
        LateralMotion { lateral_mps2, roll_radps, yaw_radps, speed_mps: SPEED_MPS }
    }

    #[test]
    fn swerve_is_measured_before_it_becomes_a_steady_turn() {
        let (mut lateral_velocity, mut rolls) = (LateralVelocity::new(AT_M), RollEstimate::default());
        let (mut off_mps, mut steady_off_mps): (f64, f64) = (0.0, 0.0);
        for step in 0..=50 {
            let t = 0.01 * f64::from(step);
            let ((yaw_radps, yaw_radps2), (roll_rad, roll_radps), (_, mps2)) = (yaw(t), roll(t), lateral(t));
            // Reading of the unit: acceleration of the origin, rotation about it, roll, and a share of gravity.
            let roll_radps2 = 0.08 * math::cos(2.0 * t);
            let unit_mps2 = mps2 + SPEED_MPS * yaw_radps + yaw_radps2 * AT_M[0] - roll_radps2 * AT_M[2];
            let stamp = Time::ZERO + Span::from_secs(t);
            let lateral_mps2 = rolls.take(stamp, unit_mps2 + G_MPS2 * roll_rad, roll_radps);
            let found = lateral_velocity.take(stamp, moves(lateral_mps2, roll_radps, yaw_radps));
            off_mps = off_mps.max((found - lateral(t).0).abs());
            steady_off_mps = steady_off_mps.max((steady_mps(SPEED_MPS, yaw_radps) - lateral(t).0).abs());
        }
        assert!(off_mps < 0.15 && steady_off_mps > 2.5 * off_mps, "{off_mps} {steady_off_mps}");
    }

    #[test]
    fn bias_of_a_unit_does_not_accumulate() {
        let (mut lateral_velocity, mut rolls) = (LateralVelocity::new(AT_M), RollEstimate::default());
        let mut take = |ms: i64, force_mps2: f64, yaw_radps: f64| {
            let stamp = Time::from_ms(ms);
            let lateral_mps2 = rolls.take(stamp, force_mps2, 0.0);
            lateral_velocity.take(stamp, moves(lateral_mps2, 0.0, yaw_radps))
        };
        let found = (0..6000).map(|step| take(10 * step, 0.02, 0.0)).last().unwrap();
        assert!(found.abs() < 0.03, "{found}");
        // A steady turn: the lateral velocity is that of tyre slip.
        let (yaw_radps, roll_rad) = (0.2, ROLL_RAD_PER_MPS2 * SPEED_MPS * 0.2);
        let force_mps2 = SPEED_MPS * yaw_radps + G_MPS2 * roll_rad;
        let found = (6000..7000).map(|step| take(10 * step, force_mps2, yaw_radps)).last().unwrap();
        assert!((found - steady_mps(SPEED_MPS, yaw_radps)).abs() < 0.03, "{found}");
        // After a gap the estimate restarts.
        let found = take(100_000, 3.0, 0.0);
        assert!(found.abs() < 1e-12, "{found}");
        // Pure noise for a tenth of a second is not taken for a swerve.
        let most = (1..=10).map(|k| take(100_000 + 10 * k, if k < 6 { 60.0 } else { -60.0 }, 0.0).abs());
        assert!(most.fold(0.0, f64::max) < 0.45);
    }
}
