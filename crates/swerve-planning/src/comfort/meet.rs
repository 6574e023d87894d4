//! Meeting an oncoming road user who comes close to the ego's lane, or into it: to the right and slower.

use swerve_msg::{Plan, PlanPoint, PlanStatus};
use swerve_vehicle::Limits;

use super::decision::{HARD_CLEARANCE_M, Scene};
use super::{Comfort, EDGE_SWING_M};
use crate::lane::{Aside, aside};
use crate::request::Request;
use crate::traffic::Mover;

/// Where the ego and an oncoming road user draw level.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Meeting {
    /// From the plan's beginning, seconds.
    at_s: f64,
    /// Between the two with the ego on the line, metres; negative where they overlap.
    beside_m: f64,
}

impl Meeting {
    /// Way on which an ego at this speed moves over, metres.
    fn length_m(&self, speed_mps: f64) -> f64 {
        (speed_mps * MOVES_OVER_S.min(self.at_s)).max(MOVES_OVER_M)
    }
}

impl Comfort {
    /// To the right within the road and braking within comfort until they have passed, where somebody oncoming comes closer
    /// than [`CLOSE_M`] beside an ego on the line.
    pub(super) fn meet(&mut self, scene: &Scene<'_>) -> Option<Plan> {
        let Scene { request, traffic, .. } = *scene;
        let meetings = traffic.movers.iter().filter_map(|one| meeting(one, scene));
        let meeting = meetings.min_by(|a, b| a.beside_m.total_cmp(&b.beside_m))?;
        if meeting.beside_m > CLOSE_M {
            return None;
        }
        let closeness = ((CLOSE_M - meeting.beside_m) / CLOSE_M).clamp(0.0, 1.0);
        let brake_max_mps2 = request.limits.brake_max_mps2 * closeness.max(LEAST_BRAKE_SHARE);
        let slower_mps = SLOWEST_SHARE * request.target_speed_mps;
        let points = self.to_the_right(scene, &meeting, (brake_max_mps2, slower_mps));
        let wanted_m = self.params.clearance_m;
        if let Some(plan) = self.checked(scene, points.clone(), wanted_m) {
            return Some(plan);
        }
        let firm = self.checked(scene, points, HARD_CLEARANCE_M.min(wanted_m));
        let plan = firm.or_else(|| self.rest_at_edge(scene, &meeting))?;
        Some(Plan { status: PlanStatus::Found, ..plan })
    }

    /// To rest at the edge of the road where that leaves room to pass, braking no harder than leads there: an ego at rest
    /// moves over no further.
    fn rest_at_edge(&self, scene: &Scene<'_>, meeting: &Meeting) -> Option<Plan> {
        let request = scene.request;
        if meeting.beside_m + self.room_m(scene) <= 0.0 {
            return None;
        }
        let v = request.start.speed_mps.max(0.0);
        let brake_mps2 = (v * v / (2.0 * meeting.length_m(v))).min(scene.vehicle.brake_max_mps2);
        let points = self.to_the_right(scene, meeting, (brake_mps2, 0.0));
        let poses: Vec<_> = points.iter().map(|p| (p.pose, p.at)).collect();
        let plan = Plan { stamp: request.stamp, points, ..Plan::default() };
        self.gentle.keeps_road(request, &poses).then_some(plan)
    }

    /// Room to the right of the line for the ego's origin, metres.
    fn room_m(&self, scene: &Scene<'_>) -> f64 {
        let Scene { request, place, .. } = *scene;
        (request.route.right_m(place.s_m) - 0.5 * request.shape.width_m - EDGE_SWING_M).max(0.0)
    }

    /// As far to the right as the road allows or the meeting needs, braking up to a limit to a speed, m/s² and m/s.
    fn to_the_right(
        &self,
        scene: &Scene<'_>,
        meeting: &Meeting,
        (brake_max_mps2, target_speed_mps): (f64, f64),
    ) -> Vec<PlanPoint> {
        let Scene { request, place, .. } = *scene;
        let limits = Limits { brake_max_mps2, ..*request.limits };
        let slow = Request { target_speed_mps, limits: &limits, ..*request };
        let slow = Scene { request: &slow, ..*scene };
        let led = self.led(&slow, false, |_| true);
        let profile = if led.steps.is_empty() { self.profile(&slow, Vec::new()) } else { led };
        let to_m = -(CLOSE_M - meeting.beside_m).min(self.room_m(scene)).max(0.0);
        let length_m = meeting.length_m(request.start.speed_mps.max(0.0));
        let way = Aside { to_m, length_m };
        aside(self.gentle.line(), &place, &request.start, &profile.steps, (request.shape, way))
    }
}

/// Where the ego at its speed meets a road user, if that comes the other way.
fn meeting(one: &Mover, scene: &Scene<'_>) -> Option<Meeting> {
    let Scene { request, place, .. } = *scene;
    if !one.is_vehicle() || one.motion(0.0).0 > -COMES_MPS || one.crosses(0.0) {
        return None;
    }
    let shape = request.shape;
    let half_m = 0.5 * shape.width_m;
    let rear_m = |t_s: f64| place.s_m + request.start.speed_mps.max(0.0) * t_s - shape.rear_overhang_m;
    let instants = (0..=(AHEAD_S / LOOK_S) as usize).map(|k| k as f64 * LOOK_S);
    let level = instants.filter(|&t_s| {
        let at = one.at(t_s);
        at.from_m < rear_m(t_s) + shape.length_m + NEAR_M && at.to_m > rear_m(t_s)
    });
    level.fold(None, |found: Option<Meeting>, t_s| {
        let beside_m = one.at(t_s).right_m - half_m;
        let (at_s, least_m) = found.map_or((t_s, beside_m), |it| (it.at_s, it.beside_m.min(beside_m)));
        Some(Meeting { at_s, beside_m: least_m })
    })
}

/// Closer than this beside the ego is close, metres.
const CLOSE_M: f64 = 0.8;

/// Slower than this a road user does not come the other way, m/s.
const COMES_MPS: f64 = 1.0;

/// Meetings are looked for until this long after the start, seconds, and so far before the ego, metres.
const AHEAD_S: f64 = 4.0;
const LOOK_S: f64 = 0.1;
const NEAR_M: f64 = 2.0;

/// Least share of the deceleration of comfort, and the speed that it leads to at most, by the target.
const LEAST_BRAKE_SHARE: f64 = 0.4;
const SLOWEST_SHARE: f64 = 0.4;

/// Moving over takes this long, seconds, and at least this far, metres.
const MOVES_OVER_S: f64 = 2.0;
const MOVES_OVER_M: f64 = 10.0;
