//! Passing distances: more than the clearance if the road is wide enough, otherwise less speed.

use swerve_msg::{ActorKind, PredictedPose, Prediction};

use crate::comfort::{LANE_EDGE_M, LATERAL_STEP_M};
use crate::fot::line::Line;
use crate::passing::is_oncoming;
use crate::request::Request;
use crate::traffic::{HORIZON_S, Knot, Mover, STANDS_MPS, Traffic};

/// Desired passing distances, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Wanted {
    /// To all road users.
    pub(crate) clearance_m: f64,
    /// To pedestrians and cyclists.
    pub(crate) person_m: f64,
    /// To moving vehicles.
    pub(crate) vehicle_m: f64,
    /// Additional room in front of a pedestrian who faces the lane.
    pub(crate) step_out_m: f64,
}

impl Wanted {
    /// Half of the desired distances beyond the clearance, for an ego that finds no way past with all of them.
    pub(crate) fn less(self) -> Self {
        let half = |wanted_m: f64| 0.5 * (self.clearance_m + wanted_m);
        Self { person_m: half(self.person_m), vehicle_m: half(self.vehicle_m), step_out_m: 0.0, ..self }
    }
}

/// The traffic with the passing distances added to each road user.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Room {
    /// Road users enlarged by the room that is left to them, less the clearance.
    pub(crate) traffic: Traffic,
    /// Speed past road users for whom the road has less room than desired, m/s.
    pub(crate) slow_mps: f64,
    /// Speed if nobody is given more than the clearance, m/s.
    pub(crate) slower_mps: f64,
}

impl Room {
    /// Returns true if no more room is expected: nobody is predicted to move.
    pub(crate) fn is_final(traffic: &Traffic) -> bool {
        let is_still = |mover: &Mover| {
            let (first, last) = (mover.at(0.0), mover.at(HORIZON_S));
            (last.from_m - first.from_m).abs() < STILL_M && (last.left_m - first.left_m).abs() < STILL_M
        };
        traffic.movers.iter().all(is_still)
    }

    /// Creates the room for an ego at `s_m` of `line`, which can move to the left and right of it by `reach_m`; `None`
    /// if nobody is to be given more than the clearance.
    pub(crate) fn new(
        wanted: Wanted,
        request: &Request<'_>,
        (line, s_m): (&Line, f64),
        traffic: &Traffic,
        reach_m: [f64; 2],
    ) -> Option<Self> {
        let mut room: Option<Self> = None;
        for (k, mover) in traffic.movers.iter().enumerate() {
            let one = &traffic.predictions[mover.index];
            let in_lane = if may_step_out(mover) { 1.0 } else { share_in_lane(mover, request) };
            let facing = if mover.faces_across() { in_lane } else { 0.0 };
            let Some(wanted_m) = wanted_m(wanted, mover, request) else { continue };
            let room = room.get_or_insert_with(|| Self {
                traffic: traffic.clone(),
                slow_mps: f64::INFINITY,
                slower_mps: f64::INFINITY,
            });
            let more_m = (wanted_m - wanted.clearance_m).max(0.0);
            // Road users that leave room within the lane are passed there, with the distance left by the offset steps.
            let is_blocked = blocks(mover, request, wanted_m);
            let spare_m = spare_m(request, traffic, (k, mover, is_blocked), reach_m) - wanted.clearance_m;
            let least_m = if follows(mover, wanted.clearance_m + spare_m) { more_m } else { 0.0 };
            let aside_m = spare_m.clamp(least_m, more_m);
            let ahead_m = (spare_m - aside_m).clamp(0.0, facing * wanted.step_out_m);
            room.traffic.replace(k, wider(one, aside_m, ahead_m), request, line);
            if one.kind.is_person() && in_lane > 0.0 {
                let slow_mps = |share: f64| slow_mps(mover, share, request, s_m);
                room.slower_mps = room.slower_mps.min(slow_mps(1.0));
                if facing > 0.0 || aside_m + SHORT_M < more_m {
                    room.slow_mps = room.slow_mps.min(slow_mps(in_lane));
                }
            }
        }
        room
    }
}

/// Desired passing distance of a road user; `None` for crossing road users, oncoming vehicles, and standing objects
/// other than people.
fn wanted_m(wanted: Wanted, mover: &Mover, request: &Request<'_>) -> Option<f64> {
    let now = mover.knots[0];
    let s_m = 0.5 * (now.from_m + now.to_m);
    let lane = request.route.lane();
    let near =
        now.right_m < lane.left_m(s_m) + wanted.person_m && now.left_m > -lane.right_m(s_m) - wanted.person_m;
    let comes = is_oncoming(mover, request.route, request.shape.width_m);
    if !near || comes || mover.comes_over() || mover.crosses(0.0) {
        return None;
    }
    if mover.kind.is_person() {
        return Some(wanted.person_m);
    }
    (mover.is_vehicle() && mover.motion(0.0).0 > STANDS_MPS && is_in_lane(mover, request))
        .then_some(wanted.vehicle_m)
}

/// True for a cyclist who rides in the ego's lane and would be passed closer than [`CYCLE_M`].
fn follows(mover: &Mover, distance_m: f64) -> bool {
    mover.kind == ActorKind::Cyclist && mover.motion(0.0).0 > STANDS_MPS && distance_m < CYCLE_M
}

/// True for a pedestrian who has just stopped beside the line, facing it: she may go on.
fn may_step_out(mover: &Mover) -> bool {
    let now = mover.knots[0];
    let faces_line = (now.left_m + now.right_m) * mover.faces < 0.0;
    mover.faces_across() && faces_line && mover.changed_lately && mover.stands()
}

/// Returns true for a road user in the ego's lane.
fn is_in_lane(mover: &Mover, request: &Request<'_>) -> bool {
    share_at(&mover.knots[0], request) > 0.0
}

/// Fraction of the width of a road user in the ego's lane that is inside it, now or while the ego passes.
fn share_in_lane(mover: &Mover, request: &Request<'_>) -> f64 {
    if !is_in_lane(mover, request) {
        return 0.0;
    }
    let soon = mover.knots.iter().take_while(|knot| knot.t_s <= SLOWS_S);
    soon.map(|knot| share_at(knot, request)).fold(0.0, f64::max)
}

/// Fraction of a road user's width inside the ego's lane at one instant.
fn share_at(knot: &Knot, request: &Request<'_>) -> f64 {
    let s_m = 0.5 * (knot.from_m + knot.to_m);
    let lane = request.route.lane();
    let inside_m = knot.left_m.min(lane.left_m(s_m)) - knot.right_m.max(-lane.right_m(s_m));
    (inside_m / (knot.left_m - knot.right_m).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}

/// Returns true for a road user that the ego cannot pass at this distance within its lane.
fn blocks(mover: &Mover, request: &Request<'_>, distance_m: f64) -> bool {
    let now = mover.knots[0];
    let s_m = 0.5 * (now.from_m + now.to_m);
    let lane = request.route.lane();
    let room_m = (lane.left_m(s_m) - now.left_m).max(now.right_m + lane.right_m(s_m));
    room_m < request.shape.width_m + distance_m
}

/// Distance that the widest way past leaves, metres: beside the lane for road users that block it, otherwise within it.
fn spare_m(
    request: &Request<'_>,
    traffic: &Traffic,
    (k, mover, is_blocked): (usize, &Mover, bool),
    reach_m: [f64; 2],
) -> f64 {
    let now = mover.knots[0];
    let s_m = 0.5 * (now.from_m + now.to_m);
    let (lane, half_m) = (request.route.lane(), 0.5 * request.shape.width_m);
    let [left_m, right_m] = reach_m.map(|reach_m| reach_m + half_m);
    let is_passed_beyond = is_blocked && is_in_lane(mover, request);
    let ground_m = if is_passed_beyond { request.route.left_m(s_m) } else { lane.left_m(s_m) };
    let stands_beside = |(j, other): &(usize, &Mover)| {
        let at = other.knots[0];
        let beside = at.to_m > now.from_m - BESIDE_M && at.from_m < now.to_m + BESIDE_M;
        *j != k && other.stands() && beside && at.right_m > now.left_m
    };
    let others = traffic.movers.iter().enumerate().filter(stands_beside);
    let free_m = others.map(|(_, other)| other.knots[0].right_m).fold(ground_m.min(left_m), f64::min);
    // Within the lane up to the candidates' offsets, which are discrete.
    let in_lane_m = |edge_m: f64| ((edge_m - half_m - LANE_EDGE_M) / LATERAL_STEP_M).floor() * LATERAL_STEP_M;
    let on_left_m = in_lane_m(free_m.min(lane.left_m(s_m))) - half_m - now.left_m;
    let on_right_m = in_lane_m(lane.right_m(s_m).min(right_m)) - half_m + now.right_m;
    let beyond_m = free_m - now.left_m - request.shape.width_m - SPARE_M;
    on_left_m.max(on_right_m).max(beyond_m) - SETTLES_M
}

/// A prediction enlarged to all sides, and ahead.
fn wider(one: &Prediction, aside_m: f64, ahead_m: f64) -> Prediction {
    let mut one = one.clone();
    let walks = one.kind == ActorKind::Pedestrian;
    one.extent.width_m += 2.0 * aside_m;
    one.extent.length_m += ahead_m + if walks { 2.0 * aside_m } else { 0.0 };
    let moved = |p: &PredictedPose| PredictedPose { pose: p.pose.ahead(0.5 * ahead_m), ..*p };
    one.path = one.path.iter().map(moved).collect();
    one
}

/// Speed for passing a road user once it is near, m/s: the smaller the part of it in the lane, the closer to the target
/// speed.
fn slow_mps(mover: &Mover, in_lane: f64, request: &Request<'_>, s_m: f64) -> f64 {
    let (now, shape) = (mover.knots[0], request.shape);
    let rear_m = s_m - shape.rear_overhang_m;
    let gap_m = now.from_m - rear_m - shape.length_m;
    let its_mps = mover.motion(0.0).0;
    let closing_mps = (request.start.speed_mps - its_mps).max(PAST_MPS);
    let is_near = now.to_m > rear_m && gap_m < SLOWS_S * closing_mps;
    let slow_mps = its_mps.max(0.0) + PAST_MPS;
    let free_mps = (request.target_speed_mps - slow_mps).max(0.0);
    if is_near { slow_mps + (1.0 - in_lane) * free_mps } else { f64::INFINITY }
}

/// Speed above that of a person at which the ego passes it with less room than desired, or in front of it, m/s: 20
/// km/h.
const PAST_MPS: f64 = 5.5;

/// Least distance at which a cyclist is passed who moves, metres: with less the ego stays behind.
const CYCLE_M: f64 = 1.0;

/// Time before drawing level at which the ego begins to slow for that, seconds.
const SLOWS_S: f64 = 4.0;

/// A road user predicted to move less than this stands still, metres.
const STILL_M: f64 = 0.1;

/// Shortage of room from which it counts, metres.
const SHORT_M: f64 = 0.05;

/// Standing objects within this distance along the road are beside, metres.
const BESIDE_M: f64 = 12.0;

/// Reserve outside the lane for the edge of the road and the lattice step, metres.
const SPARE_M: f64 = 0.3;

/// Reserve within the lane, metres: a lateral motion of a metre is within this of its end after four fifths of its
/// time.
const SETTLES_M: f64 = 0.05;
