//! The dynamic single-track model: the car's tyres, masses and load transfer, two wheels, in the plane.

use swerve_geom::{Pose2, math};

use crate::tyre::slip_for_force;
use crate::{GRAVITY_MPS2, VehicleParams, combined_slip_force};

/// State of the single-track model.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct SingleTrackState {
    /// Pose of the ego origin (centre of the rear axle).
    pub pose: Pose2,
    /// Velocity of the centre of gravity along the heading, m/s.
    pub vx_mps: f64,
    /// Velocity of the centre of gravity to the left, m/s.
    pub vy_mps: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_radps: f64,
    /// Angle of the front road wheels, radians.
    pub steering_rad: f64,
    /// Longitudinal acceleration after the last step, m/s²: determines the load transfer.
    pub accel_mps2: f64,
    /// Lateral acceleration at the centre of gravity after the last step, m/s².
    pub lateral_accel_mps2: f64,
}

/// The car as a dynamic single-track model.
///
/// Each axle has twice the force of one tyre of the car at half the axle's load. Slip is steady-state (no relaxation,
/// no wheel spin): the requested acceleration is a requested longitudinal tyre force, distributed like brakes and
/// drive, which reduces the available lateral force. Below 1 m/s the wheels roll without slip.
#[derive(Clone, PartialEq, Debug)]
pub struct SingleTrack {
    params: VehicleParams,
    friction: f64,
    /// Longitudinal slip of largest force.
    slip_peak: f64,
}

/// Longest inner step, seconds: keeps the tyres stable down to the kinematic speed.
const SUBSTEP_MAX_S: f64 = 0.005;
/// Below this speed the slip angle is undefined, m/s.
const KINEMATIC_BELOW_MPS: f64 = 1.0;

impl SingleTrack {
    /// Creates the single-track model of a car on ground of the given friction.
    pub fn new(params: &VehicleParams, friction: f64) -> Self {
        let friction = params.tyre.friction_on(friction);
        let slip_peak = params.tyre.longitudinal.peak_slip(friction);
        Self { params: params.clone(), friction, slip_peak }
    }

    /// A state of straight driving.
    pub fn straight(pose: Pose2, speed_mps: f64) -> SingleTrackState {
        SingleTrackState { pose, vx_mps: speed_mps, ..SingleTrackState::default() }
    }

    /// Advances one step towards the target steering angle (bounded by the actuator's angle and rate) at the target
    /// acceleration (bounded by the friction and the drivetrain).
    pub fn step(
        &self,
        state: SingleTrackState,
        steering_rad: f64,
        accel_mps2: f64,
        dt_s: f64,
    ) -> SingleTrackState {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few substeps, above 0"
        )]
        let substeps = (dt_s / SUBSTEP_MAX_S).ceil().clamp(1.0, 1000.0) as u32;
        let h_s = dt_s / f64::from(substeps);
        (0..substeps).fold(state, |state, _| self.substep(state, steering_rad, accel_mps2, h_s))
    }

    fn substep(
        &self,
        mut s: SingleTrackState,
        steering_rad: f64,
        accel_mps2: f64,
        h_s: f64,
    ) -> SingleTrackState {
        let p = &self.params;
        let (a, b) = (p.cg_to_front_m(), p.cg_to_rear_m());
        let most = p.limits.steering_rate_max_radps * h_s;
        let wanted = steering_rad.clamp(-p.limits.steering_max_rad, p.limits.steering_max_rad);
        s.steering_rad += (wanted - s.steering_rad).clamp(-most, most);
        let [fx, fy, moment] = self.forces(&s, accel_mps2);
        let mass = p.body.mass_kg;
        let (ax, ay) = (fx / mass, fy / mass);
        let vx = s.vx_mps + h_s * (ax + s.vy_mps * s.yaw_rate_radps);
        if vx < KINEMATIC_BELOW_MPS {
            s.vx_mps = vx.max(0.0);
            s.yaw_rate_radps = s.vx_mps * math::tan(s.steering_rad) / (a + b);
            s.vy_mps = b * s.yaw_rate_radps;
            s.lateral_accel_mps2 = s.vx_mps * s.yaw_rate_radps;
        } else {
            s.vy_mps += h_s * (ay - s.vx_mps * s.yaw_rate_radps);
            s.yaw_rate_radps += h_s * moment / p.body.yaw_inertia_kgm2;
            s.vx_mps = vx;
            s.lateral_accel_mps2 = ay;
        }
        s.accel_mps2 = if s.vx_mps > 0.0 { ax } else { 0.0 };
        let heading = s.pose.heading_rad;
        // The origin is on the rear axle: it does not share the yaw motion of the centre of gravity.
        let (sin, cos) = math::sin_cos(heading + 0.5 * h_s * s.yaw_rate_radps);
        let vy_rear = s.vy_mps - b * s.yaw_rate_radps;
        s.pose = Pose2::new(
            s.pose.x_m + h_s * (cos * s.vx_mps - sin * vy_rear),
            s.pose.y_m + h_s * (sin * s.vx_mps + cos * vy_rear),
            heading + h_s * s.yaw_rate_radps,
        );
        s
    }

    /// Forces along the heading and to the left, newtons, and yaw moment, N m.
    fn forces(&self, s: &SingleTrackState, accel_mps2: f64) -> [f64; 3] {
        let p = &self.params;
        let (a, b) = (p.cg_to_front_m(), p.cg_to_rear_m());
        let (mass, h) = (p.body.mass_kg, p.body.cg_height_m);
        let transfer = mass * s.accel_mps2 * h / (a + b);
        let load_front = (mass * GRAVITY_MPS2 * b / (a + b) - transfer).max(0.0);
        let load_rear = (mass * GRAVITY_MPS2 * a / (a + b) + transfer).max(0.0);
        let (sin, cos) = math::sin_cos(s.steering_rad);
        let vy_front = s.vy_mps + a * s.yaw_rate_radps;
        let vy_rear = s.vy_mps - b * s.yaw_rate_radps;
        let along_front = (s.vx_mps * cos + vy_front * sin).max(KINEMATIC_BELOW_MPS);
        let slip_front = (s.vx_mps * sin - vy_front * cos) / along_front;
        let slip_rear = -vy_rear / s.vx_mps.max(KINEMATIC_BELOW_MPS);
        let (ask_front, ask_rear) = self.asked_forces(s.vx_mps, accel_mps2);
        let (fx_front, fy_front) = self.axle(load_front, ask_front, slip_front);
        let (fx_rear, fy_rear) = self.axle(load_rear, ask_rear, slip_rear);
        let drag = 0.5 * p.aero.air_density_kgpm3 * p.aero.drag_area_m2 * s.vx_mps * s.vx_mps;
        let rolling = p.wheel.rolling_resistance * mass * GRAVITY_MPS2;
        let resistance = if s.vx_mps > 0.0 { drag + rolling } else { 0.0 };
        let front_left = fx_front * sin + fy_front * cos;
        [
            fx_front * cos - fy_front * sin + fx_rear - resistance,
            front_left + fy_rear,
            a * front_left - b * fy_rear,
        ]
    }

    /// Longitudinal forces requested from the front and the rear axle, newtons.
    fn asked_forces(&self, speed_mps: f64, accel_mps2: f64) -> (f64, f64) {
        let p = &self.params;
        let force = p.body.mass_kg * accel_mps2 + p.resistance_n(speed_mps);
        let radius = p.wheel.radius_m;
        // Part of the torque accelerates the wheels' own spin.
        let per_torque = p.body.mass_kg / p.effective_mass_kg() / radius;
        let (force, front) = if force >= 0.0 {
            (force.min(p.drive_torque_max_nm(speed_mps / radius) * per_torque), p.drivetrain.front_share)
        } else {
            (force.max(-p.brakes.torque_max_nm * per_torque), p.brakes.front_share)
        };
        (force * front, force * (1.0 - front))
    }

    /// Longitudinal and lateral force of an axle with equally loaded tyres, newtons: the longitudinal slip gives the
    /// requested force at this lateral slip, as far as the anti-lock control allows.
    fn axle(&self, load_n: f64, asked_n: f64, slip_y: f64) -> (f64, f64) {
        let tyre = &self.params.tyre;
        let half = 0.5 * load_n;
        if half <= 0.0 || self.friction <= 0.0 {
            return (0.0, 0.0);
        }
        let most = self.params.brakes.abs.slip_target * self.slip_peak;
        let slip_x = slip_for_force(tyre, half, self.friction, 0.5 * asked_n, slip_y, most);
        let force = combined_slip_force(tyre, half, self.friction, [slip_x, slip_y]);
        (2.0 * force.fx_n, 2.0 * force.fy_n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car() -> SingleTrack {
        SingleTrack::new(&VehicleParams::default(), 0.9)
    }

    #[test]
    fn steady_turn_needs_the_angle_of_the_understeer_gradient() {
        let params = VehicleParams::default();
        let (mut state, steering_rad) = (SingleTrack::straight(Pose2::default(), 20.0), 0.02);
        for _ in 0..400 {
            state = car().step(state, steering_rad, 0.0, 0.01);
        }
        let curvature = state.yaw_rate_radps / math::hypot(state.vx_mps, state.vy_mps);
        let needed = 2.85 * curvature + params.understeer_gradient_rads2pm() * state.lateral_accel_mps2;
        assert!((needed / steering_rad - 1.0).abs() < 0.02, "{needed}");
        assert!((state.lateral_accel_mps2 - 3.0).abs() < 0.5);
    }

    #[test]
    fn full_braking_decelerates_at_mu_g_to_a_lasting_stop() {
        let mut state = SingleTrack::straight(Pose2::default(), 20.0);
        for _ in 0..500 {
            state = car().step(state, 0.0, -20.0, 0.01);
        }
        let ideal_m = 400.0 / (2.0 * 0.9 * GRAVITY_MPS2);
        assert!((state.pose.x_m / ideal_m - 1.0).abs() < 0.02, "{state:?}");
        assert_eq!((state.vx_mps, state.accel_mps2), (0.0, 0.0));
    }

    #[test]
    fn cornering_stays_within_the_friction_and_shares_it_with_braking() {
        let corner = |accel_mps2: f64| {
            let mut state = SingleTrack::straight(Pose2::default(), 25.0);
            let mut most = 0.0f64;
            for _ in 0..100 {
                state = car().step(state, 0.3, accel_mps2, 0.01);
                most = most.max(state.lateral_accel_mps2);
                assert!(state.pose.is_finite());
            }
            most
        };
        let (free, braked) = (corner(0.0), corner(-7.0));
        assert!(free < 0.9 * GRAVITY_MPS2 * 1.03 && free > 0.8 * GRAVITY_MPS2, "{free}");
        assert!(braked < 0.93 * free, "{braked} of {free}");
    }
}
