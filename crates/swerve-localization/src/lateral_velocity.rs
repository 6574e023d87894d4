//! Lateral velocity of a car: by its inertial unit in a swerve, by the slip of its tyres in a steady turn.
//!
//! The estimate of a filter is mostly an error of the heading, and jumps with every correction; this has neither.

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

/// The tail of a car goes out no faster than this, m/s²: more is noise.
const GAIN_MAX_MPS2: f64 = 8.0;

/// Longest step, seconds: after a longer one nothing is known.
const STEP_MAX_S: f64 = 0.2;

/// Lateral velocity of the rear axle in a steady turn, m/s; to the left.
pub fn steady_mps(speed_mps: f64, yaw_rate_radps: f64) -> f64 {
    -SLIP_RAD_PER_MPS2 * speed_mps * speed_mps * yaw_rate_radps
}

/// Motion of a car at one instant.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct LateralMotion {
    /// Acceleration of the inertial unit to the left, gravity taken out, m/s².
    pub lateral_mps2: f64,
    /// Turn rate about the ego's x axis, rad/s.
    pub roll_radps: f64,
    /// Turn rate about its z axis, rad/s.
    pub yaw_radps: f64,
    /// Speed of the rear axle, m/s.
    pub speed_mps: f64,
}

/// The lateral velocity of the ego origin, on the ground below the rear axle.
#[derive(Clone, Debug)]
pub struct LateralVelocity {
    /// The unit's place ahead of the origin and above it, metres.
    ahead_m: f64,
    up_m: f64,
    before: Option<(Time, LateralMotion)>,
    /// Lateral velocity of the unit, m/s.
    unit_mps: f64,
}

impl LateralVelocity {
    /// By a unit at this place in the ego frame, metres.
    pub fn new([ahead_m, _, up_m]: [f64; 3]) -> Self {
        Self { ahead_m, up_m, before: None, unit_mps: 0.0 }
    }

    /// Goes on to an instant; the lateral velocity of the origin then, m/s to the left.
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

/// The lateral acceleration of a unit whose readings have a share of gravity, as the body rolls.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct RollEstimate {
    before: Option<Time>,
    roll_rad: f64,
}

impl RollEstimate {
    /// Goes on to an instant with its specific force to the left (m/s²) and turn rate about the x axis (rad/s). Returns the
    /// acceleration to the left, m/s².
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

/// An integral after a step, led to what it is in a steady turn.
fn led(integral: f64, steady: f64, dt_s: f64) -> f64 {
    steady + (integral - steady) * math::exp(-dt_s / DRIFTS_S)
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

    /// RollEstimate, its rate and the lateral velocity with its derivative.
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
    fn a_swerve_is_felt_before_it_is_a_steady_turn() {
        let (mut lateral_velocity, mut rolls) = (LateralVelocity::new(AT_M), RollEstimate::default());
        let (mut off_mps, mut steady_off_mps): (f64, f64) = (0.0, 0.0);
        for step in 0..=50 {
            let t = 0.01 * f64::from(step);
            let ((yaw_radps, yaw_radps2), (roll_rad, roll_radps), (_, mps2)) = (yaw(t), roll(t), lateral(t));
            // The unit: the origin's acceleration, the turn about it, the roll; what is read has a share of gravity.
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
    fn what_a_unit_is_off_by_does_not_add_up() {
        let (mut lateral_velocity, mut rolls) = (LateralVelocity::new(AT_M), RollEstimate::default());
        let mut take = |ms: i64, force_mps2: f64, yaw_radps: f64| {
            let stamp = Time::from_ms(ms);
            let lateral_mps2 = rolls.take(stamp, force_mps2, 0.0);
            lateral_velocity.take(stamp, moves(lateral_mps2, 0.0, yaw_radps))
        };
        let found = (0..6000).map(|step| take(10 * step, 0.02, 0.0)).last().unwrap();
        assert!(found.abs() < 0.03, "{found}");
        // A steady turn: the slip of its tyres.
        let (yaw_radps, roll_rad) = (0.2, ROLL_RAD_PER_MPS2 * SPEED_MPS * 0.2);
        let force_mps2 = SPEED_MPS * yaw_radps + G_MPS2 * roll_rad;
        let found = (6000..7000).map(|step| take(10 * step, force_mps2, yaw_radps)).last().unwrap();
        assert!((found - steady_mps(SPEED_MPS, yaw_radps)).abs() < 0.03, "{found}");
        // After a gap it starts again.
        let found = take(100_000, 3.0, 0.0);
        assert!(found.abs() < 1e-12, "{found}");
        // A unit of nothing but noise: a tenth of a second of it is no swerve.
        let most = (1..=10).map(|k| take(100_000 + 10 * k, if k < 6 { 60.0 } else { -60.0 }, 0.0).abs());
        assert!(most.fold(0.0, f64::max) < 0.45);
    }
}
