//! Pitch of the body on its springs, as a stack can follow it from measured acceleration.

use crate::VehicleParams;

/// Pitch of the body over level ground: a mass on two springs and dampers, without heave.
///
/// Braking turns it by the force at the ground times the height of the centre of gravity; the springs at a distance
/// `a` before and `b` behind hold against that with `2 (k_f a² + k_r b²)` (Gillespie, "Fundamentals of vehicle
/// dynamics", chapter 5: pitch without bounce).
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Pitch {
    /// Nose down is positive, radians.
    pub angle_rad: f64,
    /// Its rate, rad/s.
    pub rate_radps: f64,
}

impl Pitch {
    /// Goes on for a while, at most some ten milliseconds, under this acceleration along the car.
    pub fn step(&mut self, params: &VehicleParams, accel_mps2: f64, dt_s: f64) {
        let (body, springs) = (&params.body, &params.suspension);
        let [front, rear] = [params.cg_to_front_m(), params.cg_to_rear_m()].map(|m| m * m);
        let stiffness = 2.0 * (springs.front_spring_npm * front + springs.rear_spring_npm * rear);
        let damping = 2.0 * springs.damper_nspm * (front + rear);
        let moment = -body.mass_kg * accel_mps2 * body.cg_height_m
            - stiffness * self.angle_rad
            - damping * self.rate_radps;
        // The new rate moves the angle: stable where the step is short.
        self.rate_radps += moment / body.pitch_inertia_kgm2 * dt_s;
        self.angle_rad += self.rate_radps * dt_s;
    }
}
