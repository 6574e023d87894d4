//! Ego beside a vehicle that it is passing when the way past is no longer free: finishes the pass, or falls back
//! behind.

use swerve_geom::math;
use swerve_msg::{Plan, PlanStatus};

use super::scene::{HARD_CLEARANCE_M, HARDER_MPS2, Scene, UNDER_WAY, comfortable, stepped_up_m};
use super::{CURVE_SHARE, Comfort};
use crate::following::{FallBack, Lead, Profile, Response, STEP_S, Step, needed_mps2};
use crate::lane::{Aside, QUINTIC_BEND, aside, aside_then_back};
use crate::lock::curvature_max_1pm;
use crate::passing::{Passing, RETURN_GAP_M};
use crate::request::{Counted, Request};
use crate::traffic::{Mover, STANDS_MPS};

impl Comfort {
    /// Plan for an ego beside a vehicle that it is passing, with the first of several times to collision in the other
    /// lane that can be kept: past it, or falling back behind it. A vehicle that is laterally clear of the ego is not
    /// braked for.
    pub(super) fn beside(
        &mut self,
        scene: &Scene<'_>,
        passing: &Passing<'_>,
        own: (f64, f64),
        budget: &mut Counted<'_>,
    ) -> Option<Plan> {
        let Scene { request, place, traffic, .. } = *scene;
        let beside: Vec<&Mover> = traffic.movers.iter().filter(|one| self.is_beside(scene, one)).collect();
        if beside.is_empty() {
            return None;
        }
        for share in TTC_SHARES {
            let passing = passing.committed(share * self.params.other_lane_ttc_s);
            self.gentle.set_offsets(stepped_up_m(passing.offset_m), own.1);
            let past = self.gentle.at_speed(request, budget);
            let may = |plan: &Plan| passing.may(plan, self.gentle.line(), &request.start, &place);
            if let Some(plan) = past.filter(may).or_else(|| self.kept_out(scene, &passing)) {
                return Some(comfortable(plan));
            }
            let behind = FALLS_BACK.into_iter().find_map(|how| self.fall_back(scene, &passing, &beside, how));
            if behind.is_some() {
                return behind;
            }
        }
        self.fall_back(scene, &passing.committed(0.0), &beside, FALLS_BACK_HARD)
    }

    /// True for a vehicle in the ego's lane beside the ego and laterally clear of it: neither behind by the gap needed
    /// to return, nor so far ahead that the ego can stay behind it within comfort.
    fn is_beside(&self, scene: &Scene<'_>, one: &Mover) -> bool {
        let Scene { request, place, .. } = *scene;
        let shape = request.shape;
        let at = one.at(0.0);
        let (lead_mps, brake_mps2) = one.motion(0.0);
        let rear_m = place.s_m - shape.rear_overhang_m;
        let gap_m = at.from_m - rear_m - shape.length_m;
        let room_m = gap_m - self.params.standstill_gap_m;
        let v = request.start.speed_mps.max(0.0);
        // It keeps its motion until they draw level.
        let meets_s = (gap_m / (v - lead_mps).max(0.1)).clamp(0.0, DRAWS_LEVEL_S);
        let d_m = place.d_m + meets_s * v * math::sin(place.turn_rad);
        let clear = d_m - 0.5 * shape.width_m > at.left_m;
        let stays_behind =
            || gap_m > 0.0 && needed_mps2(v, lead_mps, brake_mps2, room_m) <= request.limits.brake_max_mps2;
        one.is_vehicle()
            && lead_mps > -STANDS_MPS
            && self.lane(request).is_blocked(&at)
            && clear
            && at.to_m + RETURN_GAP_M > rear_m
            && !stays_behind()
    }

    /// Returns to the lane behind the vehicles no longer passed, in the longest of several times that leaves the other
    /// lane before oncoming traffic arrives: for an ego over the line.
    pub(super) fn come_back(
        &mut self,
        scene: &Scene<'_>,
        passing: &Passing<'_>,
        profile: &Profile,
    ) -> Option<Plan> {
        let Scene { request, place, vehicle, .. } = *scene;
        if !self.lane(request).is_over(place.s_m, place.d_m) {
            return None;
        }
        let alone = (!profile.is_led).then(|| self.profile(scene, Vec::new()));
        let steps = &alone.as_ref().unwrap_or(profile).steps;
        let (start, shape) = (&request.start, request.shape);
        let tightest_1pm = CURVE_SHARE * curvature_max_1pm(request.limits, shape);
        let least_m = (QUINTIC_BEND * place.d_m.abs() / tightest_1pm).sqrt();
        let hard = Request { limits: vehicle, ..*request };
        let hard = Scene { request: &hard, ..*scene };
        let no_margin = passing.committed(0.0);
        [passing, &no_margin].into_iter().find_map(|passing| {
            COMES_BACK_S.into_iter().find_map(|time_s| {
                let way = Aside { to_m: 0.0, length_m: (time_s * start.speed_mps).max(least_m) };
                let points = aside(self.gentle.line(), &place, start, steps, (shape, way));
                let plan = self.checked(&hard, points, HARD_CLEARANCE_M.min(self.params.clearance_m))?;
                let may = passing.may_give_up(&plan, self.gentle.line(), start, &place);
                (may && self.returns_clear(scene, &plan))
                    .then_some(Plan { status: PlanStatus::Found, ..plan })
            })
        })
    }

    /// Stays beside the vehicles until they are ahead, then returns to the lane behind them.
    fn fall_back(
        &mut self,
        scene: &Scene<'_>,
        passing: &Passing<'_>,
        beside: &[&Mover],
        how: FallBack,
    ) -> Option<Plan> {
        let Scene { request, place, traffic, .. } = *scene;
        let is_beside = |mover: &Mover| beside.iter().any(|one| core::ptr::eq(*one, mover));
        let vehicles = traffic.movers.iter().filter(|one| one.is_vehicle());
        let response = |mover| if is_beside(mover) { Response::FallBack(how) } else { Response::Follow };
        let leads = vehicles.map(|mover| Lead { mover, response: response(mover) });
        let profile = self.profile(scene, leads.collect());
        let front_m = request.shape.length_m - request.shape.rear_overhang_m;
        let behind = |(k, step): (usize, &Step)| {
            let t_s = k as f64 * STEP_S;
            beside.iter().all(|one| one.at(t_s).from_m > step.s_m + front_m + self.params.clearance_m)
        };
        let k = profile.steps.iter().enumerate().position(behind)?;
        let to_m = passing.offset_m.max(place.d_m);
        let (line, start) = (self.gentle.line(), &request.start);
        let points = aside_then_back(line, &place, start, (&profile.steps, k), (request.shape, to_m));
        let hard = profile.brake_mps2 > request.limits.brake_max_mps2 + HARDER_MPS2;
        let clearance_m =
            if hard { HARD_CLEARANCE_M.min(self.params.clearance_m) } else { self.params.clearance_m };
        let plan = self.checked(scene, points, clearance_m)?;
        let status = if hard { PlanStatus::Found } else { PlanStatus::Comfortable };
        let plan = Plan { status, ..plan };
        passing.may_give_up(&plan, self.gentle.line(), &request.start, &place).then_some(plan)
    }
}

/// Fractions of the time to collision in the other lane that are tried for an ego beside a vehicle it is passing.
const TTC_SHARES: [f64; 3] = [UNDER_WAY, 0.3, 0.1];

/// Times to return to the lane, seconds: a lane's width takes 2 to 5 m/s² laterally.
const COMES_BACK_S: [f64; 4] = [3.2, 2.7, 2.3, 2.0];

/// Ways to fall back behind a vehicle, gentlest first, and the last resort.
const FALLS_BACK: [FallBack; 2] =
    [FallBack { slower_mps: 3.0, brake_mps2: 2.0 }, FallBack { slower_mps: 6.0, brake_mps2: 3.5 }];
const FALLS_BACK_HARD: FallBack = FallBack { slower_mps: 10.0, brake_mps2: 8.0 };

/// Longest time until an ego that is moving out draws level, seconds.
const DRAWS_LEVEL_S: f64 = 1.0;
