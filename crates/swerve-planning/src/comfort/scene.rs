//! Scene of one planning step of the layer: its input, and checks on it.

use swerve_msg::{Plan, PlanStatus};
use swerve_vehicle::Limits;

use super::{LATERAL_STEP_M, LEFT_MAX_M};
use crate::following::SpeedTable;
use crate::fot::line::OnLine;
use crate::request::Request;
use crate::traffic::{Mover, Traffic};

/// Fraction of the time to collision in the other lane that suffices once the ego is in it.
pub(super) const UNDER_WAY: f64 = 0.6;

/// Below this speed the ego has not set off, m/s.
pub(super) const REST_MPS: f64 = 0.1;

/// A plan that exceeds the comfort deceleration by more than this is not comfortable, m/s².
pub(super) const HARDER_MPS2: f64 = 0.1;

/// Distance from obstacles that suffices where the comfort clearance is not available, metres.
pub(super) const HARD_CLEARANCE_M: f64 = 0.3;

/// Standing obstacles within this distance ahead are to be passed, metres.
pub(super) const NEAR_M: f64 = 30.0;

/// Input of one planning step of the layer.
#[derive(Clone, Copy)]
pub(super) struct Scene<'a> {
    /// Request from the state where the plan continues, within the limits of comfort.
    pub(super) request: &'a Request<'a>,
    /// Place of that state along the line.
    pub(super) place: OnLine,
    pub(super) traffic: &'a Traffic,
    /// Limits of the vehicle.
    pub(super) vehicle: &'a Limits,
    /// Speeds that the curves ahead allow.
    pub(super) curves: &'a SpeedTable,
    /// True if the speed is to change at once: for a curve ahead, or away from a road user behind.
    pub(super) at_once: bool,
}

/// True for vehicles, which are followed, and for obstacles that close the road, which are stopped for.
pub(super) fn can_lead(one: &Mover, request: &Request<'_>) -> bool {
    one.is_vehicle() || one.closes(request.route, request.shape.width_m)
}

pub(super) fn comfortable(plan: Plan) -> Plan {
    Plan { status: PlanStatus::Comfortable, ..plan }
}

/// Next lattice offset that is not smaller, metres.
pub(super) fn stepped_up_m(offset_m: f64) -> f64 {
    ((offset_m / LATERAL_STEP_M).ceil() * LATERAL_STEP_M).min(LEFT_MAX_M)
}

/// Returns true if an ego that continues from `s_m` at an offset passes all standing obstacles within `ahead_m`, except
/// people.
pub(super) fn is_clear_at(
    scene: &Scene<'_>,
    [s_m, d_m]: [f64; 2],
    (ahead_m, clearance_m): (f64, f64),
) -> bool {
    let half_m = 0.5 * scene.request.shape.width_m + clearance_m;
    scene.traffic.movers.iter().filter(|one| one.stands() && !one.kind.is_person()).all(|one| {
        let at = one.knots[0];
        let is_near = at.to_m > s_m && at.from_m < s_m + ahead_m;
        !is_near || at.right_m > d_m + half_m || at.left_m < d_m - half_m
    })
}
