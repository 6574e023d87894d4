//! Conversion of a target acceleration to pedals.

use crate::VehicleParams;

/// Pedal positions, at most one of them above zero.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Pedals {
    /// Accelerator, 0 to 1.
    pub throttle: f64,
    /// Brake, 0 to 1.
    pub brake: f64,
}

/// Pedals that give `accel_mps2` at `speed_mps` on level ground once the actuators have settled.
///
/// Inverts drag, rolling resistance, torque and power limits; saturates at the car's limits, and releases both pedals
/// if either number is not finite.
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

/// Pedals that brake with `decel_mps2` (0 or more) on level ground, in either direction of motion and at any speed.
///
/// The brake alone, independent of any measured speed: air and rolling resistance add to it. The accelerator is never
/// pressed; a non-finite deceleration gives full brake.
pub fn brake_for_decel(params: &VehicleParams, decel_mps2: f64) -> Pedals {
    let torque_nm = params.effective_mass_kg() * decel_mps2 * params.wheel.radius_m;
    let share = torque_nm / params.brakes.torque_max_nm;
    let brake = if share.is_finite() { share.clamp(0.0, 1.0) } else { 1.0 };
    Pedals { throttle: 0.0, brake }
}

/// Acceleration that the pedals give at `speed_mps` on level ground, m/s²: the inverse of [`pedals_for_accel`].
pub fn accel_for_pedals(params: &VehicleParams, speed_mps: f64, pedals: Pedals) -> f64 {
    let radius = params.wheel.radius_m;
    // A pressed brake overrides the accelerator.
    let torque = if pedals.brake > 0.0 {
        -pedals.brake.min(1.0) * params.brakes.torque_max_nm
    } else {
        pedals.throttle.clamp(0.0, 1.0) * params.drive_torque_max_nm(speed_mps / radius)
    };
    (torque / radius - params.resistance_n(speed_mps)) / params.effective_mass_kg()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_brake_decelerates_at_least_as_asked_and_never_accelerates() {
        let params = VehicleParams::default();
        for decel in [0.0, 0.5, 1.5, 3.0, 8.0] {
            let pedals = brake_for_decel(&params, decel);
            assert_eq!(pedals.throttle, 0.0);
            // Resistance at 20 m/s is added.
            let resistance = params.resistance_n(20.0) / params.effective_mass_kg();
            if decel > 0.0 {
                let reached = -accel_for_pedals(&params, 20.0, pedals);
                assert!((reached - decel - resistance).abs() < 1e-9, "{decel}: {reached}");
            }
        }
        for decel in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e9] {
            assert_eq!(brake_for_decel(&params, decel), Pedals { throttle: 0.0, brake: 1.0 }, "{decel}");
        }
        assert_eq!(brake_for_decel(&params, -1.0), Pedals::default());
    }

    #[test]
    fn force_balance_gives_back_the_acceleration() {
        let params = VehicleParams::default();
        for (speed, accel) in [(0.0, 1.0), (10.0, 2.0), (20.0, -4.0), (25.0, 0.0), (30.0, -0.05)] {
            let pedals = pedals_for_accel(&params, speed, accel);
            let drive = pedals.throttle * params.drive_torque_max_nm(speed / params.wheel.radius_m);
            let brake = pedals.brake * params.brakes.torque_max_nm;
            let force = (drive - brake) / params.wheel.radius_m - params.resistance_n(speed);
            assert!((force / params.effective_mass_kg() - accel).abs() < 1e-9, "{speed} {accel}");
            assert!(pedals.throttle == 0.0 || pedals.brake == 0.0);
            assert!((accel_for_pedals(&params, speed, pedals) - accel).abs() < 1e-9, "{speed} {accel}");
        }
    }

    #[test]
    fn demands_beyond_the_car_saturate_and_non_finite_ones_release_the_pedals() {
        let params = VehicleParams::default();
        assert_eq!(pedals_for_accel(&params, 10.0, 50.0), Pedals { throttle: 1.0, brake: 0.0 });
        assert_eq!(pedals_for_accel(&params, 10.0, -50.0), Pedals { throttle: 0.0, brake: 1.0 });
        assert_eq!(pedals_for_accel(&params, 10.0, f64::NAN), Pedals::default());
        assert_eq!(pedals_for_accel(&params, f64::INFINITY, 1.0), Pedals::default());
        let mut pushed = params.clone();
        pushed.drivetrain.power_max_w = 0.0;
        assert_eq!(pedals_for_accel(&pushed, 10.0, 1.0), Pedals::default());
    }
}
