//! The decision to follow the route without stops.

use swerve_msg::{Decision, SpeedLimit};

use crate::Situation;

/// Decision to follow the route within its speed limits, without overtaking in junctions.
pub(crate) fn along(at: &Situation<'_>) -> Decision {
    let junction_m = at.route.to_junction_m(at.place.s_m);
    Decision {
        stamp: at.stamp,
        route: at.number,
        limits: limits(at),
        overtake_until_m: junction_m.is_finite().then_some(at.place.s_m + junction_m),
        ..Decision::default()
    }
}

/// Speed limits of the route from the ego on, none above the speed on a free road.
fn limits(at: &Situation<'_>) -> Vec<SpeedLimit> {
    let stretches = at.route.stretches_from(at.place.s_m);
    let mut limits: Vec<SpeedLimit> = Vec::new();
    let mut add = |from_m, limit_mps: Option<f64>| {
        let speed_mps = limit_mps.map_or(at.cruise_mps, |limit_mps| limit_mps.min(at.cruise_mps));
        if limits.last().is_none_or(|last| last.speed_mps != speed_mps) {
            limits.push(SpeedLimit { from_m, speed_mps });
        }
    };
    if stretches.is_empty() {
        add(0.0, None);
    }
    stretches.iter().for_each(|stretch| add(stretch.begin_m, stretch.speed_limit_mps));
    limits
}
