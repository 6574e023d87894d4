//! Vehicles that wait before a stop line, one behind the other.

use swerve_msg::ActorId;

use super::Own;
use super::others::Vehicle;

/// Largest gap of a queue: from a line to the first vehicle, and from one to the next, metres.
const GAP_M: f64 = 12.0;
/// Distance over a line up to which a vehicle waits before it, metres.
const OVER_M: f64 = 3.0;
/// Speed below which a vehicle waits, m/s.
const WAITS_MPS: f64 = 3.0;
/// Time at rest after which a vehicle does not wait but is parked, seconds: longer than lights are red.
const PARKS_S: f64 = 120.0;
/// Distance ahead of the ego within which lines are looked at, metres.
const SIGHT_M: f64 = 200.0;

/// Vehicles on the ego's lanes that wait before a line ahead of the ego, ordered by identity.
pub(super) fn waiting(own: Own, lines_m: impl Iterator<Item = f64>, vehicles: &[Vehicle]) -> Vec<ActorId> {
    let mut ahead: Vec<(f64, &Vehicle)> = vehicles
        .iter()
        .filter_map(|one| Some((one.route_m.filter(|s_m| *s_m > own.center_m)?, one)))
        .collect();
    ahead.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.id.cmp(&b.1.id)));
    let mut found = Vec::new();
    for line_m in lines_m.filter(|line_m| (own.front_m..own.front_m + SIGHT_M).contains(line_m)) {
        let mut end_m = line_m + OVER_M;
        let mut gap_m = GAP_M + OVER_M;
        for (s_m, one) in ahead.iter().filter(|(s_m, one)| s_m + one.half_m < line_m + OVER_M) {
            let waits = one.speed_mps < WAITS_MPS && one.stands_s < PARKS_S;
            if !waits || end_m - (s_m + one.half_m) > gap_m {
                break;
            }
            found.push(one.id);
            (end_m, gap_m) = (s_m - one.half_m, GAP_M);
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}
