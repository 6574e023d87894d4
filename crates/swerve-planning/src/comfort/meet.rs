//! Meeting an oncoming road user close to or inside the ego's lane: keeps right and slows.

use swerve_msg::{Plan, PlanPoint, PlanStatus};
use swerve_vehicle::Limits;

use super::scene::{HARD_CLEARANCE_M, Scene};
use super::{Comfort, EDGE_SWING_M};
use crate::lane::{Aside, aside};
use crate::request::Request;
use crate::traffic::Mover;

/// Predicted meeting of the ego and an oncoming road user.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Meeting {
    /// Time until they draw level, from the plan's start, seconds.
    at_s: f64,
    /// Lateral gap between the two with the ego on the line, metres; negative if they overlap.
    beside_m: f64,
}

impl Meeting {
    /// Distances over which an ego at this speed may move over, metres: to have moved when they draw level, and gentler
    /// ones.
    fn lengths_m(&self, speed_mps: f64) -> [f64; MOVES_OVER_M.len()] {
        let in_time_m = speed_mps * MOVES_OVER_S.min(self.at_s);
        MOVES_OVER_M.map(|least_m| in_time_m.max(least_m))
    }
}

impl Comfort {
    /// Moves to the right within the road and brakes within comfort until an oncoming road user that comes closer than
    /// [`CLOSE_M`] beside an ego on the line has passed; if the ego `steers_out` afterwards, it keeps room to do so.
    pub(super) fn meet(&mut self, scene: &Scene<'_>, steers_out: bool) -> Option<Plan> {
        let Scene { request, traffic, .. } = *scene;
        let meetings = traffic.movers.iter().filter_map(|one| meeting(one, scene));
        let meeting = meetings.min_by(|a, b| a.beside_m.total_cmp(&b.beside_m))?;
        if meeting.beside_m > CLOSE_M {
            return None;
        }
        let closeness = ((CLOSE_M - meeting.beside_m) / CLOSE_M).clamp(0.0, 1.0);
        let brake_max_mps2 = request.limits.brake_max_mps2 * closeness.max(LEAST_BRAKE_SHARE);
        let slower_mps = SLOWEST_SHARE * request.target_speed_mps;
        let wanted_m = self.params.clearance_m;
        let lengths_m = meeting.lengths_m(request.start.speed_mps.max(0.0));
        let mut meets = |clearance_m: f64, is_gentle: bool| {
            lengths_m.into_iter().find_map(|length_m| {
                // In a long move the corners swing further.
                ROOM_SHARES.into_iter().find_map(|share| {
                    let way = (&meeting, share * self.room_m(scene), length_m);
                    let points = self.to_the_right(scene, way, steers_out, (brake_max_mps2, slower_mps));
                    let plan = self.checked(scene, points, clearance_m)?;
                    (!is_gentle || self.can_steer(&plan, scene)).then_some(plan)
                })
            })
        };
        if let Some(plan) = meets(wanted_m, true).or_else(|| meets(wanted_m, false)) {
            return Some(plan);
        }
        let firm = meets(HARD_CLEARANCE_M.min(wanted_m), false);
        let plan = firm.or_else(|| self.rest_at_edge(scene, &meeting))?;
        Some(Plan { status: PlanStatus::Found, ..plan })
    }

    /// Comes to rest at the edge of the road if that leaves room to pass, braking only as hard as the distance
    /// requires: an ego at rest moves over no further.
    fn rest_at_edge(&self, scene: &Scene<'_>, meeting: &Meeting) -> Option<Plan> {
        let request = scene.request;
        if meeting.beside_m + self.room_m(scene) <= 0.0 {
            return None;
        }
        let v = request.start.speed_mps.max(0.0);
        let [.., length_m] = meeting.lengths_m(v);
        let brake_mps2 = (v * v / (2.0 * length_m)).min(scene.vehicle.brake_max_mps2);
        let way = (meeting, self.room_m(scene), length_m);
        let points = self.to_the_right(scene, way, false, (brake_mps2, 0.0));
        let poses: Vec<_> = points.iter().map(|p| (p.pose, p.at)).collect();
        let plan = Plan { stamp: request.stamp, points, ..Plan::default() };
        self.gentle.keeps_road(request, &poses).then_some(plan)
    }

    /// Room for the ego's origin to the right of the line, metres.
    fn room_m(&self, scene: &Scene<'_>) -> f64 {
        let Scene { request, place, .. } = *scene;
        (request.route.right_m(place.s_m) - 0.5 * request.shape.width_m - EDGE_SWING_M).max(0.0)
    }

    /// Moves to the right as far as the room allows or the meeting needs, braking up to a limit down to a speed, m/s²
    /// and m/s.
    fn to_the_right(
        &self,
        scene: &Scene<'_>,
        (meeting, room_m, length_m): (&Meeting, f64, f64),
        steers_out: bool,
        (brake_max_mps2, target_speed_mps): (f64, f64),
    ) -> Vec<PlanPoint> {
        let Scene { request, place, .. } = *scene;
        let limits = Limits { brake_max_mps2, ..*request.limits };
        let slow = Request { target_speed_mps, limits: &limits, ..*request };
        let slow = Scene { request: &slow, ..*scene };
        // Whoever comes is met, not stopped for.
        let led = self.led(&slow, steers_out, |one| one.motion(0.0).0 > -COMES_MPS);
        let profile = if led.steps.is_empty() { self.profile(&slow, Vec::new()) } else { led };
        let to_m = -(CLOSE_M - meeting.beside_m).min(room_m).max(0.0);
        let way = Aside { to_m, length_m };
        aside(self.gentle.line(), &place, &request.start, &profile.steps, (request.shape, way))
    }
}

/// Meeting with a road user at the ego's current speed, if it is oncoming.
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
        // One that is on the right of the ego's way is not met by moving to the right.
        at.from_m < rear_m(t_s) + shape.length_m + NEAR_M && at.to_m > rear_m(t_s) && at.left_m > -half_m
    });
    level.fold(None, |found: Option<Meeting>, t_s| {
        let beside_m = one.at(t_s).right_m - half_m;
        let (at_s, least_m) = found.map_or((t_s, beside_m), |it| (it.at_s, it.beside_m.min(beside_m)));
        Some(Meeting { at_s, beside_m: least_m })
    })
}

/// Fractions of the room on the right that are tried.
const ROOM_SHARES: [f64; 3] = [1.0, 0.85, 0.7];

/// Smaller lateral gaps than this are close, metres.
const CLOSE_M: f64 = 0.8;

/// Below this speed a road user is not oncoming, m/s.
const COMES_MPS: f64 = 1.0;

/// Meetings are searched for up to this time after the start, in these steps, seconds, and from this distance ahead of
/// the ego, metres.
const AHEAD_S: f64 = 4.0;
const LOOK_S: f64 = 0.1;
const NEAR_M: f64 = 2.0;

/// Smallest fraction of the comfort deceleration, and the speed braked to as a fraction of the target speed.
const LEAST_BRAKE_SHARE: f64 = 0.4;
const SLOWEST_SHARE: f64 = 0.4;

/// Duration of moving over, seconds, and its smallest lengths, metres.
const MOVES_OVER_S: f64 = 2.0;
const MOVES_OVER_M: [f64; 4] = [5.0, 6.5, 8.0, 10.0];
