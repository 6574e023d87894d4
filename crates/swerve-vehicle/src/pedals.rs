//! From a wanted acceleration to pedals.

use crate::VehicleParams;

/// Pedal positions, at most one of them above zero.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Pedals {
    /// Accelerator, 0 to 1.
    pub throttle: f64,
    /// Brake, 0 to 1.
    pub brake: f64,
}

/// The pedals that give `accel_mps2` at `speed_mps` on level ground once the actuators have settled.
///
/// Inverts drag, rolling resistance, torque and power limits; asks for the most the car has where the wish
/// is beyond that, and releases both pedals where either number is not finite.
pub fn pedals_for_accel(params: &VehicleParams, speed_mps: f64, accel_mps2: f64) -> Pedals {
    if !(speed_mps.is_finite() && accel_mps2.is_finite()) {
        return Pedals::default();
    }
    let radius = params.wheel.radius_m;
    let force = params.effective_mass_kg() * accel_mps2 + params.resistance_n(speed_mps);
    if force >= 0.0 {
        let most = params.drive_torque_max_nm(speed_mps / radius);
        if most <= 0.0 {
            return Pedals::default();
        }
        Pedals { throttle: (force * radius / most).min(1.0), brake: 0.0 }
    } else {
        Pedals { throttle: 0.0, brake: (-force * radius / params.brakes.torque_max_nm).min(1.0) }
    }
}
