//! Wheel loads from the heights of the body's corners above the ground.

use crate::VehicleParams;

/// One corner: position of the body's nominal contact point relative to the ground.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Corner {
    /// Compression beyond the static compression, metres.
    pub(crate) compression_m: f64,
    /// Compression rate, m/s.
    pub(crate) compression_mps: f64,
}

/// Wheel loads in newtons (front left, front right, rear left, rear right), never negative.
///
/// Contributions of each corner: static load, spring, damper, bump stop, and the anti-roll bar of its axle, which moves
/// load from the less to the more compressed side.
pub(crate) fn wheel_loads_n(params: &VehicleParams, corners: &[Corner; 4]) -> [f64; 4] {
    let s = &params.suspension;
    let spring = [s.front_spring_npm, s.front_spring_npm, s.rear_spring_npm, s.rear_spring_npm];
    let bar = [s.front_anti_roll_npm, s.front_anti_roll_npm, s.rear_anti_roll_npm, s.rear_anti_roll_npm];
    let rest = params.static_loads_n();
    core::array::from_fn(|i| {
        let Corner { compression_m, compression_mps } = corners[i];
        let other_side = corners[i ^ 1].compression_m;
        let bump = s.bump_stop_npm * (compression_m - s.bump_stop_m).max(0.0);
        let load = rest[i]
            + spring[i] * compression_m
            + s.damper_nspm * compression_mps
            + bar[i] * (compression_m - other_side)
            + bump;
        load.max(0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(compressions_m: [f64; 4]) -> [f64; 4] {
        let corner = |compression_m| Corner { compression_m, compression_mps: 0.0 };
        wheel_loads_n(&VehicleParams::default(), &compressions_m.map(corner))
    }

    #[test]
    fn wheels_at_rest_have_their_static_load() {
        assert_eq!(at([0.0; 4]), VehicleParams::default().static_loads_n());
    }

    #[test]
    fn roll_moves_load_across_and_heave_adds_it() {
        let params = VehicleParams::default();
        let rest = params.static_loads_n();
        let rolled = at([0.02, -0.02, 0.02, -0.02]);
        let [front, rear] = [rolled[0] - rest[0], rolled[2] - rest[2]];
        assert!((front - (30_000.0 * 0.02 + 20_000.0 * 0.04)).abs() < 1e-9);
        assert!((rear - (28_000.0 * 0.02 + 12_000.0 * 0.04)).abs() < 1e-9);
        assert!((rolled.iter().sum::<f64>() - rest.iter().sum::<f64>()).abs() < 1e-9);
        let lowered = at([0.01; 4]);
        assert!((lowered[0] - rest[0] - 300.0).abs() < 1e-9);
    }

    #[test]
    fn lifted_wheel_carries_no_load_and_bump_stop_a_high_one() {
        assert_eq!(at([-0.5; 4]), [0.0; 4]);
        let stopped = at([0.1; 4])[0] - VehicleParams::default().static_loads_n()[0];
        assert!((stopped - (3_000.0 + 150_000.0 * 0.02)).abs() < 1e-9);
    }
}
