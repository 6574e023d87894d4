//! Pitch of the body on its springs, computed from measured acceleration.

use crate::VehicleParams;

/// Pitch of the body over level ground: a mass on two springs and dampers, without heave.
///
/// The pitch moment of braking is the force at the ground times the height of the centre of gravity; the springs at
/// distances `a` in front and `b` behind resist it with the stiffness `2 (k_f a² + k_r b²)` (Gillespie, "Fundamentals
/// of vehicle dynamics", chapter 5: pitch without bounce).
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Pitch {
    /// Pitch angle, radians; positive nose down.
    pub angle_rad: f64,
    /// Pitch rate, rad/s.
    pub rate_radps: f64,
}

impl Pitch {
    /// Advances by `dt_s`, at most some ten milliseconds, under this longitudinal acceleration.
    pub fn step(&mut self, params: &VehicleParams, accel_mps2: f64, dt_s: f64) {
        let (body, springs) = (&params.body, &params.suspension);
        let [front, rear] = [params.cg_to_front_m(), params.cg_to_rear_m()].map(|m| m * m);
        let stiffness = 2.0 * (springs.front_spring_npm * front + springs.rear_spring_npm * rear);
        let damping = 2.0 * springs.damper_nspm * (front + rear);
        let moment = -body.mass_kg * accel_mps2 * body.cg_height_m
            - stiffness * self.angle_rad
            - damping * self.rate_radps;
        // The new rate advances the angle: stable for short steps.
        self.rate_radps += moment / body.pitch_inertia_kgm2 * dt_s;
        self.angle_rad += self.rate_radps * dt_s;
    }
}
