//! Loads of the four wheels from where the body's corners are above the ground.

use crate::VehicleParams;

/// One corner: how the body's nominal contact point sits over the ground.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Corner {
    /// Compression beyond the static one, metres.
    pub(crate) compression_m: f64,
    /// Its rate, m/s.
    pub(crate) compression_mps: f64,
}

/// Wheel loads in newtons (front left, front right, rear left, rear right), never negative.
///
/// Each corner: static load, spring, damper, bump stop, and the anti-roll bar of its axle, which moves load
/// from the less to the more compressed side.
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
