//! Leaving the own lane to pass a blockage: the benefit, the offset, and the check that the other lane is free until
//! the ego is back.

use swerve_core::{Span, Time};
use swerve_geom::{Pose2, math};
use swerve_msg::{ActorKind, EgoState, Plan, Route};
use swerve_vehicle::Shape;

use crate::following::needed_mps2;
use crate::fot::line::{Line, OnLine};
use crate::lane::Lane;
use crate::traffic::{HORIZON_S, Knot, Mover, STANDS_MPS, Traffic};

/// Conditions for using the other lane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Rules {
    /// Smallest time to collision with road users in it, seconds.
    pub(crate) ttc_min_s: f64,
    /// Smallest speed gain for passing a lead vehicle, m/s.
    pub(crate) gain_min_mps: f64,
    /// Longest time over the line to pass a moving road user, seconds.
    pub(crate) over_line_max_s: f64,
    /// Longest distance over the line to pass a moving road user, metres, for an ego in its own lane.
    pub(crate) over_line_max_m: f64,
    /// True if the ego is already in the other lane.
    pub(crate) under_way: bool,
    /// True if a moving road user in the other lane occupies the lane's full width, not only its own place.
    pub(crate) whole_lane: bool,
}

/// Gap to the passed road user before the ego returns, metres, and per speed of that road user, seconds.
pub(crate) const RETURN_GAP_M: f64 = 4.0;
const RETURN_GAP_S: f64 = 0.3;

/// Time for which the ego is still over the line while it returns, seconds.
const RETURN_S: f64 = 2.5;

/// Acceleration towards the target after the end of a plan, m/s².
const ACCEL_MPS2: f64 = 1.0;

/// The next vehicle is passed together with the one before it if the gap between them is less than this plus the ego's
/// length, metres.
const BETWEEN_M: f64 = 12.0;

/// The same per speed, seconds, for standing ones passed at once: a return takes this long.
const BETWEEN_S: f64 = 3.0;

/// Only blockages within this time at the target speed are passed, seconds.
const AHEAD_S: f64 = 7.0;

/// Factor on the longest time over the line for passing vehicles and people at rest.
const STANDING_SHARE: f64 = 4.0;

/// With its outline further from the centre of its lane than on the line by this, the ego has begun to pass, metres.
pub(crate) const MOVES_OUT_M: f64 = 0.3;

/// Road users that reach an ego at rest beyond the line within this time are in its way, seconds.
const RESTS_S: f64 = 20.0;

/// Time step of the checks, seconds.
const LOOK_S: f64 = 0.25;

/// The blockage of the ego's lane, and the way past it.
#[derive(Clone, Debug)]
pub(crate) struct Passing<'a> {
    rules: Rules,
    lane: Lane<'a>,
    route: &'a Route,
    shape: &'a Shape,
    /// Road users to pass, the nearest first.
    blocking: Vec<&'a Mover>,
    /// All other road users.
    others: Vec<&'a Mover>,
    /// Oncoming car beyond the sight of an ego in its own lane, which does not move out before it to pass something
    /// that moves.
    unseen: Option<&'a Mover>,
    target_mps: f64,
    /// Offset to the left at which all of them are passed, metres.
    pub(crate) offset_m: f64,
    /// True if their places in some seconds are not known yet: a vehicle still brakes, has just stopped or may pull out,
    /// or a pedestrian may step in front of a fast ego.
    waits: bool,
    /// True if moving out now may be possible, whatever the plan.
    pub(crate) may_open: bool,
}

impl<'a> Passing<'a> {
    /// Creates the pass of the first blockage ahead, with what stands too soon after it to return at speed if moving out
    /// may then be possible now; `None` if there is none, if there is no room, or if it is hardly slower than the ego.
    pub(crate) fn new(
        rules: Rules,
        lane: Lane<'a>,
        (route, shape): (&'a Route, &'a Shape),
        traffic: &'a Traffic,
        (start, place, target_mps): (&EgoState, &OnLine, f64),
    ) -> Option<Self> {
        let front_m = shape.length_m - shape.rear_overhang_m;
        let reach_m = front_m + AHEAD_S * target_mps.max(5.0);
        let rear_m = place.s_m - shape.rear_overhang_m;
        // A pass lasts until there is a gap to return.
        let behind_m = if rules.under_way { RETURN_GAP_M } else { 0.0 };
        let blocks = |one: &&Mover| {
            let now = one.knots[0];
            now.to_m + behind_m > rear_m
                && now.from_m < place.s_m + reach_m
                && one.knots.iter().any(|knot| lane.is_blocked(knot))
        };
        let mut blocking: Vec<&Mover> = traffic.movers.iter().filter(blocks).collect();
        blocking.sort_by(|a, b| a.knots[0].from_m.total_cmp(&b.knots[0].from_m));
        let near = |pair: &[&Mover], standing_s: f64| {
            let stand = pair.iter().all(|one| one.stands());
            let between_m = BETWEEN_M + shape.length_m + if stand { standing_s * target_mps } else { 0.0 };
            let is_near = |t_s: f64| pair[1].at(t_s).from_m - pair[0].at(t_s).to_m < between_m;
            // A road user that drives away from the first has left room to return by then.
            let closing_mps = (target_mps - pair[0].motion(0.0).0).max(1.0);
            let reaches_s = (pair[0].knots[0].to_m - rear_m).max(0.0) / closing_mps;
            is_near(0.0) && is_near(reaches_s.min(HORIZON_S))
        };
        let together = |standing_s: f64| {
            blocking.windows(2).position(|pair| !near(pair, standing_s)).map_or(blocking.len(), |k| k + 1)
        };
        let [most, least] = [BETWEEN_S, 0.0].map(together);
        let of = |count: usize| {
            let blocking = &blocking[..count];
            Self::of(rules, lane, (route, shape), (traffic, blocking), (start, place, target_mps))
        };
        let at_once = if most > least { of(most).filter(|passing| passing.may_open) } else { None };
        at_once.or_else(|| of(least))
    }

    /// Creates the pass of these road users.
    fn of(
        rules: Rules,
        lane: Lane<'a>,
        (route, shape): (&'a Route, &'a Shape),
        (traffic, blocking): (&'a Traffic, &[&'a Mover]),
        (start, place, target_mps): (&EgoState, &OnLine, f64),
    ) -> Option<Self> {
        let slowest = blocking.first()?;
        // The future place of a road user that moves over is not known yet, be it a vehicle that changes lanes or a
        // pedestrian who crosses; and an oncoming vehicle is met, not passed on its other side.
        if !rules.under_way
            && blocking.iter().any(|one| one.comes_over() || is_oncoming(one, route, shape.width_m))
        {
            return None;
        }
        let gain_mps = target_mps - slowest.motion(0.0).0.max(0.0);
        if slowest.is_vehicle() && !slowest.stands() && gain_mps < rules.gain_min_mps {
            return None;
        }
        // The ego passes on the left.
        let (speed_mps, front_m) = (start.speed_mps, shape.length_m - shape.rear_overhang_m);
        let may_walk = |one: &Mover| one.faces_across() && one.faces > 0.0 && speed_mps > BEFORE_FACE_MPS;
        let is_uncertain = |one: &&Mover| brakes(one) || has_stopped(one) || may_walk(one);
        let stays_behind = |one: &&Mover| {
            let gap_m = one.knots[0].from_m - place.s_m - front_m - STAYS_BEHIND_M;
            gap_m > 0.0 && needed_mps2(speed_mps, one.motion(0.0).0, 0.0, gap_m) < STAYS_BEHIND_MPS2
        };
        let may_pull_out = |one: &&Mover| may_pull_out(one, &lane, &traffic.movers);
        let waits = (!rules.under_way && blocking.iter().any(is_uncertain))
            || blocking.iter().filter(|one| stays_behind(one)).any(may_pull_out);
        let others = traffic.movers.iter().filter(|one| !blocking.iter().any(|b| core::ptr::eq(*b, *one)));
        let others = others.collect();
        let room_m = route.left_m(place.s_m) - 0.5 * shape.width_m;
        let offset_m = blocking.iter().map(|one| clear_offset_m(one, &lane, room_m)).fold(0.0, f64::max);
        let has_room = offset_m <= room_m;
        if !has_room {
            return None;
        }
        let blocking = blocking.to_vec();
        let moves = blocking.iter().any(|one| !one.stands());
        let unseen = traffic.unseen.as_ref().filter(|_| moves && !rules.under_way);
        let passing = Self {
            rules,
            lane,
            route,
            shape,
            blocking,
            others,
            unseen,
            target_mps,
            offset_m,
            waits,
            may_open: false,
        };
        Some(Self { may_open: passing.is_open_at_once(start, place), ..passing })
    }

    /// The same pass for an ego that can no longer stay behind: with another smallest time to collision, seconds, to
    /// road users at their own places.
    pub(crate) fn committed(&self, ttc_min_s: f64) -> Self {
        Self { rules: Rules { ttc_min_s, whole_lane: false, ..self.rules }, ..self.clone() }
    }

    /// Returns true if moving out now may be possible, whatever the plan: a check without a search.
    fn is_open_at_once(&self, start: &EgoState, place: &OnLine) -> bool {
        let next = LineState { s_m: place.s_m, d_m: self.offset_m, speed_mps: start.speed_mps.max(0.0) };
        self.is_open(Motion { plan: None, next, target_mps: self.target_mps }, start)
    }

    /// Returns true if the plan may be driven: all road users in the other lane keep the time to collision from when
    /// the ego is over the line until it is back, and that time is short enough.
    pub(crate) fn may(&self, plan: &Plan, line: &Line, start: &EgoState, place: &OnLine) -> bool {
        let next = LineState { s_m: place.s_m, d_m: place.d_m, speed_mps: start.speed_mps.max(0.0) };
        self.is_open(Motion { plan: Some((plan, line)), next, target_mps: self.target_mps }, start)
    }

    fn is_open(&self, mut motion: Motion<'_>, start: &EgoState) -> bool {
        if self.waits {
            return false;
        }
        let (mut over_since, mut widest_m, mut passed_s) = (None, f64::NEG_INFINITY, None::<f64>);
        let [over_line_max_s, over_line_max_m] = self.over_line_max();
        let count = ((HORIZON_S + over_line_max_s) / LOOK_S) as usize;
        for k in 0..=count {
            let t_s = k as f64 * LOOK_S;
            let at = motion.next(start.stamp + Span::from_secs(t_s));
            widest_m = widest_m.max(at.d_m + 0.5 * self.shape.width_m);
            if over_since.is_none() && self.lane.is_over(at.s_m, at.d_m) {
                over_since = Some((t_s, at.s_m));
            }
            let Some((since_s, since_m)) = over_since else { continue };
            let returned = passed_s.map_or(0.0, |passed_s| ((t_s - passed_s) / RETURN_S).min(1.0));
            let at = LineState { d_m: at.d_m * (1.0 - returned), ..at };
            let mut others = self.others.iter().chain(&self.unseen);
            if others.any(|one| self.is_near(&one.at(t_s), one.motion(t_s).0, &at, widest_m)) {
                return false;
            }
            if passed_s.is_none() && self.is_past(&at, t_s) {
                passed_s = Some(t_s);
            }
            if passed_s.is_some_and(|passed_s| t_s > passed_s + RETURN_S) {
                return t_s - since_s <= over_line_max_s && at.s_m - since_m <= over_line_max_m;
            }
        }
        // In the own lane throughout.
        over_since.is_none()
    }

    /// Longest time over the line, seconds, and distance, metres: longer if all passed road users stand, as waiting
    /// gains nothing. A pass under way is limited by its time alone.
    fn over_line_max(&self) -> [f64; 2] {
        let Rules { over_line_max_s, over_line_max_m, under_way, .. } = self.rules;
        let stands = self.blocking.iter().all(|one| one.stands());
        let way_m = if stands || under_way { f64::INFINITY } else { over_line_max_m };
        [over_line_max_s * if stands { STANDING_SHARE } else { 1.0 }, way_m]
    }

    /// Returns true if a plan that abandons the pass may be driven: all road users in the other lane keep the time to
    /// collision until it is back in the own lane. For an ego that [meets a vehicle](Self::meets_vehicle) the outline
    /// counts with its heading, as its nose is over the line before its rear axle, and an ego that comes to rest there
    /// stays.
    pub(crate) fn may_give_up(&self, plan: &Plan, line: &Line, start: &EgoState, place: &OnLine) -> bool {
        let next = LineState { s_m: place.s_m, d_m: place.d_m, speed_mps: start.speed_mps.max(0.0) };
        let meets = self.meets_vehicle(start, line, place);
        let rests = meets && plan.points.last().is_some_and(|end| end.speed_mps < STANDS_MPS);
        let (target_mps, horizon_s) = if rests { (0.0, RESTS_S) } else { (self.target_mps, HORIZON_S) };
        let mut motion = Motion { plan: Some((plan, line)), next, target_mps };
        let count = (horizon_s / LOOK_S) as usize;
        let (mut widest_m, mut was_over) = (f64::NEG_INFINITY, !meets);
        for k in 0..=count {
            let t_s = k as f64 * LOOK_S;
            let now = start.stamp + Span::from_secs(t_s);
            let at = motion.next(now);
            let pose = plan.at(now.min(plan.end())).map(|p| p.pose).filter(|_| meets);
            let swing_m = pose.map_or(0.0, |pose| self.nose_m(line, &at, pose));
            let at = LineState { d_m: at.d_m + swing_m, ..at };
            widest_m = widest_m.max(at.d_m + 0.5 * self.shape.width_m);
            if !self.lane.is_over(at.s_m, at.d_m) {
                if was_over {
                    return true;
                }
                continue;
            }
            was_over = true;
            if self.others.iter().any(|one| self.is_near(&one.at(t_s), one.motion(t_s).0, &at, widest_m)) {
                return false;
            }
        }
        true
    }

    /// Returns true if a vehicle is oncoming and the ego has begun to move out.
    pub(crate) fn meets_vehicle(&self, start: &EgoState, line: &Line, place: &OnLine) -> bool {
        let at = LineState { s_m: place.s_m, d_m: place.d_m, speed_mps: start.speed_mps };
        let comes = |one: &&Mover| one.is_vehicle() && is_oncoming(one, self.route, self.shape.width_m);
        place.d_m + self.nose_m(line, &at, start.pose) > MOVES_OUT_M && self.others.iter().any(comes)
    }

    /// Distance by which the front left corner of the outline at a pose is further left than the left side of an
    /// outline along the line, metres; at least 0.
    fn nose_m(&self, line: &Line, at: &LineState, pose: Pose2) -> f64 {
        let node = line.at(at.s_m);
        let (sin, cos) = math::sin_cos(pose.heading_rad);
        let [turn_cos, turn_sin] = [node.cos * cos + node.sin * sin, node.cos * sin - node.sin * cos];
        let front_m = self.shape.length_m - self.shape.rear_overhang_m;
        (front_m * turn_sin - 0.5 * self.shape.width_m * (1.0 - turn_cos)).max(0.0)
    }

    /// Returns true if the ego is over the line and its rear will not be ahead of all passed road users in a second.
    pub(crate) fn is_beside(&self, place: &OnLine, speed_mps: f64) -> bool {
        let over = self.lane.is_over(place.s_m, place.d_m);
        let rear_m = place.s_m + speed_mps - self.shape.rear_overhang_m;
        over && self.blocking.iter().any(|one| one.at(1.0).to_m > rear_m)
    }

    /// Returns true if the road user is passed by this pass.
    pub(crate) fn passes(&self, one: &Mover) -> bool {
        self.blocking.iter().any(|blocking| core::ptr::eq(*blocking, one))
    }

    /// Returns true if nothing stands beside the blockage: a way past it may become free.
    pub(crate) fn is_possible(&self) -> bool {
        let (Some(first), Some(last)) = (self.blocking.first(), self.blocking.last()) else { return false };
        let (from_m, to_m) = (first.knots[0].from_m - BETWEEN_M, last.knots[0].to_m + BETWEEN_M);
        let strip_m = [-self.lane.borders.right_m(from_m), self.offset_m + 0.5 * self.shape.width_m];
        !self.others.iter().any(|one| {
            let now = one.knots[0];
            let beside = now.to_m > from_m && now.from_m < to_m;
            one.stands() && beside && now.right_m < strip_m[1] && now.left_m > strip_m[0]
        })
    }

    /// Returns true if the ego is past the whole blockage by its return gap.
    fn is_past(&self, ego: &LineState, t_s: f64) -> bool {
        let rear_m = ego.s_m - self.shape.rear_overhang_m;
        self.blocking.iter().all(|one| {
            let speed_mps = one.motion(t_s).0.max(0.0);
            rear_m > one.at(t_s).to_m + RETURN_GAP_M + RETURN_GAP_S * speed_mps
        })
    }

    /// Returns true if a road user is beside the ego in the strip that it uses, or nearer than the time to collision.
    fn is_near(&self, other: &Knot, other_mps: f64, ego: &LineState, widest_m: f64) -> bool {
        let beyond_m = self.lane.borders.left_m(ego.s_m);
        let (stands, reach_m) = (other_mps.abs() < STANDS_MPS, widest_m + self.lane.clearance_m.min(0.3));
        // A moving road user occupies the whole lane; a standing one only its place.
        let strip_m = if stands {
            reach_m
        } else if self.rules.whole_lane {
            self.route.left_m(ego.s_m)
        } else {
            ego.d_m + 0.5 * self.shape.width_m + self.lane.clearance_m
        };
        if other.left_m < beyond_m || other.right_m > strip_m {
            return false;
        }
        let rear_m = ego.s_m - self.shape.rear_overhang_m;
        let front_m = rear_m + self.shape.length_m;
        let (gap_m, closing_mps) = if other.from_m > front_m {
            (other.from_m - front_m, ego.speed_mps - other_mps)
        } else if other.to_m < rear_m {
            (rear_m - other.to_m, other_mps - ego.speed_mps)
        } else {
            return true;
        };
        // Standing obstacles beyond the place of return are not approached.
        !stands && closing_mps > 0.0 && gap_m < self.rules.ttc_min_s * closing_mps
    }
}

/// True for an oncoming vehicle; a cycle only if the road leaves room for an ego of this width on the right of it.
pub(crate) fn is_oncoming(one: &Mover, route: &Route, width_m: f64) -> bool {
    let now = one.knots[0];
    let right_m = route.right_m(0.5 * (now.from_m + now.to_m));
    let leaves_room = one.is_vehicle() && now.right_m + right_m > width_m + MEETS_M;
    one.motion(0.0).0 < -STANDS_MPS && (!one.kind.is_person() || leaves_room)
}

/// Least room to meet a cycle on the right of it, beside the ego's width, metres.
const MEETS_M: f64 = 0.45;

/// True for a vehicle that brakes and is still moving.
fn brakes(one: &Mover) -> bool {
    let (speed_mps, brake_mps2) = one.motion(0.0);
    one.is_vehicle() && speed_mps > STANDS_MPS && brake_mps2 > BRAKES_MPS2
}

/// True for a vehicle that has stopped only recently.
fn has_stopped(one: &Mover) -> bool {
    one.is_vehicle() && one.changed_lately && one.motion(0.0).0.abs() <= STANDS_MPS
}

/// True for a moving vehicle that will soon reach something that stands in the lane, and may pull out to pass it.
fn may_pull_out(one: &Mover, lane: &Lane<'_>, movers: &[Mover]) -> bool {
    let speed_mps = one.motion(0.0).0;
    let reaches = |other: &Mover| {
        let gap_m = other.knots[0].from_m - one.knots[0].to_m;
        other.stands() && lane.is_blocked(&other.knots[0]) && (0.0..PULLS_OUT_S * speed_mps).contains(&gap_m)
    };
    one.is_vehicle() && speed_mps > STANDS_MPS && movers.iter().any(reaches)
}

/// A vehicle may pull out this long before it reaches what stands in its lane, seconds.
const PULLS_OUT_S: f64 = 10.0;

/// An ego that could stay this far behind it, metres, with less than this deceleration, m/s², gives up the pass.
const STAYS_BEHIND_M: f64 = 2.0;
const STAYS_BEHIND_MPS2: f64 = 2.5;

/// Above this speed the ego does not move out to pass in front of a pedestrian, m/s: 23 km/h.
const BEFORE_FACE_MPS: f64 = 6.5;

/// A vehicle that decelerates by more than this is braking, m/s².
const BRAKES_MPS2: f64 = 0.3;

/// Offset at which a road user is passed on its left, metres. A pedestrian may move anywhere: the ego may then use all
/// of `room_m`.
fn clear_offset_m(one: &Mover, lane: &Lane<'_>, room_m: f64) -> f64 {
    let blocking = one.knots.iter().filter(|knot| lane.is_blocked(knot));
    let least_m = blocking
        .map(|knot| knot.left_m + lane.clearance_m + 0.5 * lane.width_m + SPARE_M)
        .fold(0.0, f64::max);
    if one.kind == ActorKind::Pedestrian { least_m.max(PEDESTRIAN_OFFSET_M.min(room_m)) } else { least_m }
}

/// Largest offset for passing a pedestrian, metres.
const PEDESTRIAN_OFFSET_M: f64 = 4.0;

/// Added to an offset, for the lattice step and the rotation of the outline, metres.
const SPARE_M: f64 = 0.2;

/// The ego along the line at one instant.
#[derive(Clone, Copy, PartialEq, Debug)]
struct LineState {
    s_m: f64,
    d_m: f64,
    speed_mps: f64,
}

/// Places of the ego along the line at instants [`LOOK_S`] apart: as planned, and after the end towards the target
/// speed.
struct Motion<'a> {
    plan: Option<(&'a Plan, &'a Line)>,
    next: LineState,
    target_mps: f64,
}

impl Motion<'_> {
    /// State at the next instant, `at`.
    fn next(&mut self, at: Time) -> LineState {
        let mut now = self.next;
        if let Some((plan, line)) = self.plan
            && let Some(p) = plan.at(at).filter(|_| at <= plan.end())
        {
            let (s_m, d_m) = line.project(p.pose.point(), now.s_m);
            now = LineState { s_m, d_m, speed_mps: p.speed_mps };
        }
        let faster_mps = (now.speed_mps + ACCEL_MPS2 * LOOK_S).min(self.target_mps.max(now.speed_mps));
        self.next = LineState { s_m: now.s_m + faster_mps * LOOK_S, speed_mps: faster_mps, ..now };
        now
    }
}
