//! Moving out to a passing offset from standstill or at low speed.

use swerve_msg::Plan;

use super::scene::{HARD_CLEARANCE_M, NEAR_M, Scene, comfortable, is_clear_at, stepped_up_m};
use super::{CURVE_SHARE, Comfort, LATERAL_STEP_M};
use crate::following::{self, Lead, Response};
use crate::fot::line::Line;
use crate::lane::{Aside, QUINTIC_BEND, aside};
use crate::lock::curvature_max_1pm;
use crate::passing::Passing;
use crate::request::Request;
use crate::traffic::{Mover, STANDS_MPS};

impl Comfort {
    /// Moves out to the passing offset, for an ego at low speed: as a last resort with less clearance and at a walking
    /// pace.
    pub(super) fn steer_out(&mut self, scene: &Scene<'_>, open: &Passing<'_>) -> Option<Plan> {
        let start = &scene.request.start;
        if start.speed_mps > STEERS_OUT_MPS {
            return None;
        }
        let leads = leads_but(scene, |one| open.passes(one));
        let may = |plan: &Plan, line: &Line| open.may(plan, line, start, &scene.place);
        let (to_m, clearance_m) = (stepped_up_m(open.offset_m), self.params.clearance_m);
        let out = self.steer_to(scene, to_m, clearance_m, &leads, may);
        let walking = walking(scene.request);
        let scene = &Scene { request: &walking, ..*scene };
        out.or_else(|| self.steer_to(scene, to_m, HARD_CLEARANCE_M.min(clearance_m), &leads, may))
    }

    /// Moves to the smallest clear offset within the ego's lane, for an ego at low speed that goes round obstacles
    /// beside its lane: as a last resort with less clearance and at a walking pace.
    pub(super) fn steer_within(&mut self, scene: &Scene<'_>, (left_m, right_m): (f64, f64)) -> Option<Plan> {
        let request = scene.request;
        if request.start.speed_mps > STEERS_OUT_MPS {
            return None;
        }
        let (leads, clearance_m) = (leads_but(scene, |_| false), self.params.clearance_m);
        let under_way = self.under_way(scene).map(comfortable);
        let steps = |most_m: f64| (most_m / LATERAL_STEP_M) as i32;
        let mut offsets: Vec<i32> = (-steps(right_m)..=steps(left_m)).collect();
        offsets.sort_by_key(|k| k.abs());
        // A slow plan ends before it is past: standing obstacles would be approached at any offset.
        let mut among = |scene: &Scene<'_>, clearance_m: f64| {
            let past = |to_m: &f64| is_clear_at(scene, [scene.place.s_m, *to_m], (NEAR_M, clearance_m));
            let mut past = offsets.iter().map(|&k| f64::from(k) * LATERAL_STEP_M).filter(past);
            past.find_map(|to_m| self.steer_to(scene, to_m, clearance_m, &leads, |_, _| true))
        };
        let walking = walking(request);
        let walking = Scene { request: &walking, ..*scene };
        let out = among(scene, clearance_m).or(under_way);
        out.or_else(|| among(&walking, HARD_CLEARANCE_M.min(clearance_m)))
    }

    /// Moves to an offset at a speed that the turn allows, behind `leads`: lateral motions over time cannot begin at
    /// standstill.
    fn steer_to(
        &mut self,
        scene: &Scene<'_>,
        to_m: f64,
        clearance_m: f64,
        leads: &[Lead<'_>],
        may: impl Fn(&Plan, &Line) -> bool,
    ) -> Option<Plan> {
        let request = scene.request;
        let (start, shape, limits) = (&request.start, request.shape, request.limits);
        let tightest_1pm = CURVE_SHARE * curvature_max_1pm(limits, shape);
        STEER_OUT_M.into_iter().find_map(|length_m| {
            let aside_m = (to_m - scene.place.d_m).abs();
            let bend_1pm = QUINTIC_BEND * aside_m / (length_m * length_m);
            let turn_mps = (CURVE_SHARE * limits.lateral_accel_max_mps2 / bend_1pm.max(1e-9)).sqrt();
            let wheels_1pm = shape.wheelbase_m * QUINTIC_KINK * aside_m / length_m.powi(3);
            let turn_mps =
                turn_mps.min(self.params.wheels_max_radps(shape, STEERS_OUT_MPS) / wheels_1pm.max(1e-9));
            let slow = Request { target_speed_mps: request.target_speed_mps.min(turn_mps), ..*request };
            let profile = self.profile(&Scene { request: &slow, ..*scene }, leads.to_vec());
            let way = Aside { to_m, length_m };
            let points = aside(self.gentle.line(), &scene.place, start, &profile.steps, (shape, way));
            let plan = self.checked(scene, points, clearance_m)?;
            let turns = plan.points.iter().all(|p| p.curvature_1pm.abs() <= tightest_1pm);
            (turns && self.can_steer(&plan, scene) && may(&plan, self.gentle.line())).then_some(plan)
        })
    }

    /// Returns true if the steering rate stays within the lateral jerk of comfort; the first step belongs to the
    /// previous plan.
    pub(super) fn can_steer(&self, plan: &Plan, scene: &Scene<'_>) -> bool {
        let (shape, vehicle) = (scene.request.shape, scene.vehicle);
        plan.points.windows(2).skip(1).all(|p| {
            // Front wheels: δ = atan(L κ), so δ' is at most L κ'.
            let turned_rad = shape.wheelbase_m * (p[1].curvature_1pm - p[0].curvature_1pm).abs();
            let most_radps =
                self.params.wheels_max_radps(shape, p[0].speed_mps).min(vehicle.steering_rate_max_radps);
            p[0].speed_mps < STANDS_MPS || turned_rad <= WHEELS_SPARE * most_radps * following::STEP_S
        })
    }
}

/// The same request at a walking pace.
fn walking<'a>(request: &Request<'a>) -> Request<'a> {
    Request { target_speed_mps: request.target_speed_mps.min(WALKING_MPS), ..*request }
}

/// Lead vehicles, except those that are `passed`.
fn leads_but<'a>(scene: &Scene<'a>, passed: impl Fn(&Mover) -> bool) -> Vec<Lead<'a>> {
    let others = scene.traffic.movers.iter().filter(|one| one.is_vehicle() && !passed(one));
    others.map(|mover| Lead { mover, response: Response::Follow }).collect()
}

/// Above this speed a lateral motion over time is used instead, m/s.
const STEERS_OUT_MPS: f64 = 5.0;

/// A walking pace, m/s: 7 km/h.
const WALKING_MPS: f64 = 2.0;

/// Lengths over which a slow ego moves out, metres.
const STEER_OUT_M: [f64; 5] = [20.0, 16.0, 13.0, 10.5, 8.5];

/// Largest third derivative of the quintic, relative to the distance over the cube of its length.
const QUINTIC_KINK: f64 = 60.0;

/// Tolerance factor on the steering rate, for rounding in tabulated curvatures.
const WHEELS_SPARE: f64 = 1.2;
