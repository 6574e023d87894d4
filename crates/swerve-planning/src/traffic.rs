//! Other road users along a line over time, and the followers among them.

use std::borrow::Cow;

use swerve_core::{Span, Time};
use swerve_geom::{FrenetPoint, Point2, Pose2, angle_between, math};
use swerve_msg::{ActorKind, Plan, PredictedPose, Prediction, Route};
use swerve_vehicle::Shape;

use crate::cut_in::with_gaps;
use crate::fot::line::Line;
use crate::request::{Budget, Planner, Request};

/// Time step at which a road user is projected onto the line, seconds.
const KNOT_S: f64 = 0.5;

/// Predictions of vehicles are extended until this long after the request's stamp, seconds.
pub(crate) const HORIZON_S: f64 = 9.0;

/// Interval over which the final motion of a prediction is measured, seconds.
const END_S: f64 = 0.5;

/// Below this speed a vehicle stands, m/s.
pub(crate) const STANDS_MPS: f64 = 0.3;

/// Largest distance along the line at which road users are projected, metres.
const REACH_M: f64 = 200.0;

/// Places of a point along the line further apart than this are on different parts of it, metres.
const APART_M: f64 = 15.0;

/// Additional search distance for places on other parts of the line, beyond the distance that the ego drives within the
/// horizon, metres.
const FURTHER_M: f64 = 30.0;

/// Tolerance of the inverse projection for a place beside the line, metres.
const LEADS_BACK_M: f64 = 0.5;

/// Time before and after a crossing vehicle without covariances for which its path is kept free, seconds.
const CROSS_S: f64 = 0.5;

/// Length of a car that is supposed, metres.
const CAR_M: f64 = 4.5;

/// Largest angle to the road of a motion along it, radians.
const ALONG_RAD: f64 = 0.5;

/// Sine of the angle to the road above which a pedestrian faces across it.
const ACROSS: f64 = 0.5;

/// A road user behind the ego in its own lane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Behind {
    /// Gap from its front to the ego's rear, metres.
    pub(crate) gap_m: f64,
    /// Speed along the road, m/s.
    pub(crate) speed_mps: f64,
}

/// Arc lengths of the places ahead of an ego at `s_m` and `speed_mps` that a road user touches now: a road that comes
/// near itself has more than one. Excludes the place at `but_m`.
fn stretches_ahead<'a>(
    one: &'a Prediction,
    route: &'a Route,
    (s_m, speed_mps): (f64, f64),
    but_m: f64,
) -> impl Iterator<Item = f64> + 'a {
    let half_m = 0.5 * (FURTHER_M + HORIZON_S * speed_mps.max(0.0)).min(REACH_M);
    let radius_m = 0.5 * math::hypot(one.extent.length_m, one.extent.width_m);
    let first = one.path.first().map(|first| first.pose.point());
    let places = first.into_iter().flat_map(move |point| {
        let is_beside = move |place: &FrenetPoint| {
            let on_ground = (-route.right_m(place.s_m) - radius_m..route.left_m(place.s_m) + radius_m)
                .contains(&place.d_m);
            // The ends of the searched range are not beside the line.
            on_ground && route.unproject(*place).distance(point) < LEADS_BACK_M
        };
        route.line().places_near(point, s_m + half_m, half_m).filter(is_beside)
    });
    let mut before_m = f64::NEG_INFINITY;
    places.map(|place| place.s_m).filter(move |&at_m| {
        let is_new = at_m > s_m && (at_m - but_m).abs() > APART_M && at_m - before_m > APART_M;
        if is_new {
            before_m = at_m;
        }
        is_new
    })
}

/// The road user as a follower of the ego: behind it and in its strip of the road now, and at no other place ahead of
/// it.
fn behind(
    one: &Prediction,
    route: &Route,
    (place, ego_mps): (FrenetPoint, f64),
    shape: &Shape,
) -> Option<Behind> {
    let first = one.path.first()?;
    let at = route.project_near(first.pose.point(), place.s_m, REACH_M);
    // Most are ahead, or farther beside than half of their diagonal.
    let radius_m = 0.5 * (one.extent.length_m + one.extent.width_m);
    let is_apart = (at.d_m - place.d_m).abs() >= 0.5 * shape.width_m + radius_m;
    if is_apart || place.s_m - shape.rear_overhang_m - at.s_m <= 0.0 {
        return None;
    }
    let road = route.line().at(at.s_m).pose;
    let (along_m, across_m) = half_sizes(one, angle_between(road.heading_rad, first.pose.heading_rad));
    let gap_m = place.s_m - shape.rear_overhang_m - at.s_m - along_m;
    let overlaps = (at.d_m - place.d_m).abs() < 0.5 * shape.width_m + across_m;
    let speed_mps = one.path.get(1).map_or(0.0, |next| {
        (next.pose.point() - first.pose.point()).dot(road.direction()) / (next.at - first.at).as_secs()
    });
    let is_ahead = || stretches_ahead(one, route, (place.s_m, ego_mps), at.s_m).next().is_some();
    (gap_m > 0.0 && overlaps && !is_ahead()).then_some(Behind { gap_m, speed_mps })
}

/// Predictions without the road users behind the ego in its own lane, which keep their distance themselves, and the
/// follower that would reach an ego at `speed_mps` first.
pub(crate) fn without_followers<'a>(
    predictions: &'a [Prediction],
    (route, place, shape): (&Route, FrenetPoint, &Shape),
    speed_mps: f64,
) -> (Cow<'a, [Prediction]>, Option<Behind>) {
    let follows = |one: &Prediction| behind(one, route, (place, speed_mps), shape);
    let reaches_s = |one: &Behind| one.gap_m / (one.speed_mps - speed_mps).max(1e-3);
    let first = predictions.iter().filter_map(follows).min_by(|a, b| reaches_s(a).total_cmp(&reaches_s(b)));
    match first {
        Some(_) => {
            let ahead = predictions.iter().filter(|one| follows(one).is_none());
            (Cow::Owned(ahead.cloned().collect()), first)
        }
        None => (Cow::Borrowed(predictions), None),
    }
}

/// A planner that does not brake for road users behind the ego in its own lane, and does not change right before others.
pub struct Ahead(pub Box<dyn Planner>);

impl Planner for Ahead {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let Request { route, start, shape, .. } = *request;
        let ego = (route, request.place(), shape);
        let (predictions, _) = without_followers(request.predictions, ego, start.speed_mps);
        let predictions = with_gaps(predictions, ego, start.speed_mps);
        self.0.plan(&Request { predictions: &predictions, ..*request }, budget)
    }
}

/// Half sizes of a footprint rotated by `turn_rad` relative to the line: along and across it, metres.
fn half_sizes(one: &Prediction, turn_rad: f64) -> (f64, f64) {
    let (sin, cos) = math::sin_cos(turn_rad);
    let (length_m, width_m) = (one.extent.length_m, one.extent.width_m);
    (0.5 * (length_m * cos.abs() + width_m * sin.abs()), 0.5 * (length_m * sin.abs() + width_m * cos.abs()))
}

/// A road user along the line at one instant.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Knot {
    /// Time since the start of the plan, seconds.
    pub(crate) t_s: f64,
    /// Rear and front along the line, metres.
    pub(crate) from_m: f64,
    pub(crate) to_m: f64,
    /// Right and left edge beside the line, metres to its left.
    pub(crate) right_m: f64,
    pub(crate) left_m: f64,
}

/// A road user's predicted motion along the line.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Mover {
    pub(crate) kind: ActorKind,
    /// Index of its prediction in the [`Traffic`].
    pub(crate) index: usize,
    /// True if it stopped, set off or came into sight crossing in the last seconds.
    pub(crate) changed_lately: bool,
    /// Arc length of the route around which it is searched, and search radius, metres.
    near_m: [f64; 2],
    /// Sine of the angle from the line to its heading: 1 if it faces left across the road.
    pub(crate) faces: f64,
    /// Knots at increasing, equidistant instants.
    pub(crate) knots: Vec<Knot>,
}

impl Mover {
    /// Returns true for a vehicle.
    pub(crate) fn is_vehicle(&self) -> bool {
        is_vehicle(self.kind)
    }

    /// Returns true for an object that leaves no room of `width_m` on the drivable ground: a barrier, a red light's
    /// stop line.
    pub(crate) fn closes(&self, route: &Route, width_m: f64) -> bool {
        let at = self.knots[0];
        let s_m = 0.5 * (at.from_m + at.to_m);
        let room_m = (route.left_m(s_m) - at.left_m).max(at.right_m + route.right_m(s_m));
        self.kind == ActorKind::Static && room_m < width_m
    }

    /// A car that comes along the other lane from `from_m` of the line on, with its sides at these offsets.
    pub(crate) fn oncoming(from_m: f64, [right_m, left_m]: [f64; 2], speed_mps: f64) -> Self {
        let count = (HORIZON_S / KNOT_S) as usize;
        let knot = |k: usize| {
            let t_s = k as f64 * KNOT_S;
            let from_m = from_m - speed_mps * t_s;
            Knot { t_s, from_m, to_m: from_m + CAR_M, right_m, left_m }
        };
        let knots = (0..=count).map(knot).collect();
        let near_m = [from_m, REACH_M];
        Self { kind: ActorKind::Car, index: 0, changed_lately: false, near_m, faces: 0.0, knots }
    }

    /// Index of the knot before `t_s`.
    fn index(&self, t_s: f64) -> usize {
        ((t_s / KNOT_S).max(0.0) as usize).min(self.knots.len() - 2)
    }

    /// Place at `t_s`; its last motion is continued.
    pub(crate) fn at(&self, t_s: f64) -> Knot {
        let k = self.index(t_s);
        let (a, b) = (&self.knots[k], &self.knots[k + 1]);
        let u = (t_s - a.t_s) / (b.t_s - a.t_s);
        let mix = |from: f64, to: f64| from + (to - from) * u;
        Knot {
            t_s,
            from_m: mix(a.from_m, b.from_m),
            to_m: mix(a.to_m, b.to_m),
            right_m: mix(a.right_m, b.right_m),
            left_m: mix(a.left_m, b.left_m),
        }
    }

    /// Speed of its rear along the line, m/s, and its deceleration while moving forwards, m/s² (not negative).
    pub(crate) fn motion(&self, t_s: f64) -> (f64, f64) {
        let k = self.index(t_s);
        let speed_mps = |k: usize| (self.knots[k + 1].from_m - self.knots[k].from_m) / KNOT_S;
        // Interval speeds are those of the interval's middle.
        let (before, after) = if k + 2 < self.knots.len() { (k, k + 1) } else { (k.max(1) - 1, k) };
        let accel_mps2 = (speed_mps(after) - speed_mps(before)) / KNOT_S;
        let middle_s = self.knots[k].t_s + 0.5 * KNOT_S;
        let now_mps = speed_mps(k) + accel_mps2 * (t_s - middle_s).clamp(-0.5 * KNOT_S, 0.5 * KNOT_S);
        if now_mps <= 0.0 { (now_mps.min(0.0), 0.0) } else { (now_mps, (-accel_mps2).max(0.0)) }
    }

    /// Returns true if it moves across the line rather than along it.
    pub(crate) fn crosses(&self, t_s: f64) -> bool {
        let k = self.index(t_s);
        let (a, b) = (&self.knots[k], &self.knots[k + 1]);
        let across_m = (b.left_m + b.right_m - a.left_m - a.right_m).abs();
        let along_m = (b.from_m + b.to_m - a.from_m - a.to_m).abs();
        across_m > (2.0 * STANDS_MPS * KNOT_S).max(along_m)
    }

    /// Returns true if it moves sideways now.
    pub(crate) fn comes_over(&self) -> bool {
        let (a, b) = (&self.knots[0], &self.knots[1]);
        0.5 * (b.left_m + b.right_m - a.left_m - a.right_m).abs() > STANDS_MPS * KNOT_S
    }

    /// Returns true for a pedestrian facing across the road.
    pub(crate) fn faces_across(&self) -> bool {
        self.kind == ActorKind::Pedestrian && self.faces.abs() > ACROSS
    }

    /// Returns true for a road user that stands, or is predicted to come to rest.
    pub(crate) fn comes_to_rest(&self) -> bool {
        self.motion(HORIZON_S).0.abs() < STANDS_MPS
    }

    /// Returns true if it stands at all times.
    pub(crate) fn stands(&self) -> bool {
        let (first, last) = (&self.knots[0], &self.knots[self.knots.len() - 1]);
        (last.from_m - first.from_m).abs() < STANDS_MPS * (last.t_s - first.t_s)
            && (last.left_m - first.left_m).abs() < STANDS_MPS * (last.t_s - first.t_s)
    }
}

fn is_vehicle(kind: ActorKind) -> bool {
    !matches!(kind, ActorKind::Pedestrian | ActorKind::Static)
}

/// All road users near the ego: their predictions, extended, and their motion along the line.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Traffic {
    /// Predictions, those of vehicles extended until [`HORIZON_S`], followed by crossing vehicles [`CROSS_S`] earlier
    /// and later if their uncertainty is unknown.
    pub(crate) predictions: Vec<Prediction>,
    /// For each prediction, true if it drives along the line in its direction.
    drives_along: Vec<bool>,
    pub(crate) movers: Vec<Mover>,
    /// Oncoming car that may be beyond the ego's sight of the other lane.
    pub(crate) unseen: Option<Mover>,
}

impl Traffic {
    /// Creates the traffic around an ego at `s_m` of `line`.
    pub(crate) fn new(request: &Request<'_>, line: &Line, s_m: f64) -> Self {
        let mut traffic = Self::default();
        let until = request.start.stamp + Span::from_secs(HORIZON_S);
        let mut crossing = Vec::new();
        for one in request.predictions {
            let one = continued(one, until, request.route, s_m);
            let movers = movers(&one, request, line, (s_m, traffic.predictions.len()));
            let drives_along =
                |one: &Mover| one.is_vehicle() && one.motion(0.0).0 > STANDS_MPS && !one.crosses(0.0);
            traffic.drives_along.push(movers.iter().any(drives_along));
            let is_crossing = movers.iter().any(|one| one.is_vehicle() && one.crosses(0.0));
            if is_crossing && one.covariances_m2.is_empty() {
                crossing.extend([-CROSS_S, CROSS_S].map(|late_s| later(&one, late_s)));
            }
            traffic.movers.extend(movers);
            traffic.predictions.push(one);
        }
        traffic.predictions.extend(crossing);
        traffic
    }
}

impl Traffic {
    /// Replaces a road user's prediction.
    pub(crate) fn replace(&mut self, k: usize, one: Prediction, request: &Request<'_>, line: &Line) {
        let Mover { index, near_m, .. } = self.movers[k];
        if let Some(mover) = mover(&one, request, line, (near_m, index)) {
            self.movers[k] = mover;
            self.predictions[index] = one;
        }
    }

    /// Those of `predictions`, the input of this traffic, that do not drive along the line in its direction.
    pub(crate) fn without_leads(&self, predictions: &[Prediction]) -> Vec<Prediction> {
        predictions
            .iter()
            .zip(&self.drives_along)
            .filter(|(_, ahead)| !**ahead)
            .map(|(one, _)| one.clone())
            .collect()
    }
}

/// A vehicle's prediction extended until `until` with its final speed, or with its final deceleration until it stands:
/// along the road if it moves along the road, otherwise straight.
fn continued(one: &Prediction, until: Time, route: &Route, s_m: f64) -> Prediction {
    let mut one = one.clone();
    let Some((end, speed_mps, accel_mps2)) = final_motion(&one).filter(|_| is_vehicle(one.kind)) else {
        return one;
    };
    if speed_mps < STANDS_MPS {
        return one;
    }
    let place = route.project_near(end.pose.point(), s_m, 2.0 * REACH_M);
    let turn_rad = angle_between(route.line().at(place.s_m).pose.heading_rad, end.pose.heading_rad);
    let against = turn_rad.abs() > core::f64::consts::FRAC_PI_2;
    let off_rad = if against { core::f64::consts::PI - turn_rad.abs() } else { turn_rad.abs() };
    let stop_s = if accel_mps2 < 0.0 { -speed_mps / accel_mps2 } else { f64::INFINITY };
    let mut at = end.at;
    while at < until {
        at += Span::from_secs(KNOT_S);
        let t_s = (at - end.at).as_secs().min(stop_s);
        let driven_m = speed_mps * t_s + 0.5 * accel_mps2 * t_s * t_s;
        let pose = if off_rad < ALONG_RAD {
            let s_m = place.s_m + if against { -driven_m } else { driven_m };
            let point = route.unproject(FrenetPoint { s_m, d_m: place.d_m });
            let road_rad = route.line().at(s_m).pose.heading_rad;
            Pose2::new(point.x_m, point.y_m, road_rad + if against { core::f64::consts::PI } else { 0.0 })
        } else {
            end.pose.ahead(driven_m)
        };
        one.path.push(PredictedPose { at, pose });
    }
    one
}

/// A prediction delayed by `late_s`.
fn later(one: &Prediction, late_s: f64) -> Prediction {
    let late = |p: &PredictedPose| PredictedPose { at: p.at + Span::from_secs(late_s), ..*p };
    Prediction { path: one.path.iter().map(late).collect(), ..one.clone() }
}

/// The last pose of a prediction, with its speed, m/s, and its acceleration (negative or zero), m/s².
fn final_motion(one: &Prediction) -> Option<(PredictedPose, f64, f64)> {
    let end = *one.path.last()?;
    let before = |t_s: f64| one.path.iter().rev().find(|p| (end.at - p.at).as_secs() >= t_s - 1e-6);
    let (half, whole) = (before(0.5 * END_S)?, before(END_S)?);
    let mean_mps = |a: &PredictedPose, b: &PredictedPose| {
        a.pose.point().distance(b.pose.point()) / (b.at - a.at).as_secs()
    };
    let (earlier_mps, later_mps) = (mean_mps(whole, half), mean_mps(half, &end));
    let accel_mps2 = ((later_mps - earlier_mps) / (0.5 * (end.at - whole.at).as_secs())).min(0.0);
    // Rounding on a straight line must not appear as braking.
    let accel_mps2 = if accel_mps2 > -0.05 { 0.0 } else { accel_mps2 };
    let speed_mps = later_mps + 0.5 * accel_mps2 * (end.at - half.at).as_secs();
    Some((end, speed_mps.max(0.0), accel_mps2))
}

/// The road user along the line: at its nearest place, and at every other place ahead of the ego at `s_m` that it
/// touches.
fn movers(one: &Prediction, request: &Request<'_>, line: &Line, (s_m, index): (f64, usize)) -> Vec<Mover> {
    let Some(nearest) = mover(one, request, line, ([s_m, REACH_M], index)) else { return Vec::new() };
    let now = nearest.knots[0];
    let ego = (s_m, request.start.speed_mps);
    let others = stretches_ahead(one, request.route, ego, 0.5 * (now.from_m + now.to_m));
    let others = others.filter_map(|at_m| mover(one, request, line, ([at_m, 0.5 * APART_M], index)));
    core::iter::once(nearest).chain(others).collect()
}

/// The road user along the line, searched along the route as in [`Mover::near_m`]; `None` if it is far away.
fn mover(
    one: &Prediction,
    request: &Request<'_>,
    line: &Line,
    (near_m, index): ([f64; 2], usize),
) -> Option<Mover> {
    let first = one.path.first()?;
    let start = request.start;
    if first.pose.point().distance(start.pose.point()) > REACH_M {
        return None;
    }
    let mut guess_m = request.route.project_near(first.pose.point(), near_m[0], near_m[1]).s_m;
    let mut next = 0;
    let count = (HORIZON_S / KNOT_S) as usize;
    let mut faces = 0.0;
    let mut knots = Vec::with_capacity(count + 1);
    for k in 0..=count {
        let t_s = k as f64 * KNOT_S;
        let at = start.stamp + Span::from_secs(t_s);
        while next < one.path.len() && one.path[next].at < at {
            next += 1;
        }
        let pose = pose_at(&one.path, next, at);
        let (at_m, d_m) = line.project(Point2::new(pose.x_m, pose.y_m), guess_m);
        guess_m = at_m;
        let node = line.at(at_m);
        let turn_rad = pose.heading_rad - math::atan2(node.sin, node.cos);
        let (along_m, across_m) = half_sizes(one, turn_rad);
        if k == 0 {
            faces = math::sin_cos(turn_rad).0;
        }
        knots.push(Knot {
            t_s,
            from_m: at_m - along_m,
            to_m: at_m + along_m,
            right_m: d_m - across_m,
            left_m: d_m + across_m,
        });
    }
    let changed_lately = request.changed_lately.contains(&one.id);
    Some(Mover { kind: one.kind, index, changed_lately, near_m, faces, knots })
}

/// Pose at `at`; `next` is the first place not before it. The first motion is extrapolated backwards: a pose held there
/// for 5 ms would hide half of a deceleration of 1 m/s² at 25 m/s. The last pose is held.
fn pose_at(path: &[PredictedPose], next: usize, at: Time) -> Pose2 {
    let next = if path.len() > 1 { next.max(1) } else { next };
    match (path.get(next.wrapping_sub(1)), path.get(next)) {
        (Some(a), Some(b)) => {
            crate::collision::between(a.pose, b.pose, (at - a.at).as_secs() / (b.at - a.at).as_secs())
        }
        (None, Some(only)) | (Some(only), None) => only.pose,
        (None, None) => Pose2::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::World;

    #[test]
    fn object_closes_the_road_if_neither_side_has_room() {
        let closes = |kind, width_m: f64, y_m: f64| {
            let mut world = World::straight(20.0).with(kind, (0.5, width_m), (60.0, y_m), (0.0, 0.0));
            let line = world.route.line().clone();
            world.route = Route::uniform(line.clone(), 5.0, 2.0);
            let mut on = Line::default();
            on.set(&line);
            mover(&world.predictions[0], &world.request(), &on, ([0.0, REACH_M], 0))
                .unwrap()
                .closes(&world.route, 2.0)
        };
        // From 2 m on the right to 5 m on the left: 7 m. An object in the middle leaves half of the remaining width on
        // each side.
        assert!(closes(ActorKind::Static, 7.0, 1.5) && closes(ActorKind::Static, 3.1, 1.5));
        assert!(!closes(ActorKind::Static, 2.9, 1.5) && !closes(ActorKind::Static, 3.1, 1.0));
        assert!(!closes(ActorKind::Pedestrian, 7.0, 1.5));
    }

    #[test]
    fn deceleration_does_not_depend_on_how_late_a_prediction_begins() {
        let world = World::straight(20.0).with(ActorKind::Car, (4.5, 1.8), (60.0, 0.0), (0.0, 0.0));
        let mut line = Line::default();
        line.set(world.route.line());
        for late_ms in [0, 5, 20, 50] {
            let mut one = world.predictions[0].clone();
            for (k, place) in one.path.iter_mut().enumerate() {
                let t_s = 0.1 * k as f64 + 1e-3 * f64::from(late_ms);
                place.at = world.start.stamp + Span::from_secs(t_s);
                place.pose.x_m = 60.0 + 25.0 * t_s - 0.5 * t_s * t_s;
            }
            let mover = mover(&one, &world.request(), &line, ([0.0, REACH_M], 0)).unwrap();
            let (speed_mps, brake_mps2) = mover.motion(0.0);
            assert!(
                (speed_mps - 25.0).abs() < 0.1 && (brake_mps2 - 1.0).abs() < 0.1,
                "{late_ms} {brake_mps2}"
            );
        }
    }

    /// A ring of 25 m radius, 157 m round, with the ego at 130 m. A person at 150 m, 20 m ahead of it, is also 7 m
    /// behind the ring's beginning, where the line is extended straight: behind by 137 m and ahead by 20 m, so the
    /// person is ahead.
    #[test]
    fn ring_road_separates_road_users_ahead_from_followers() {
        let on_ring = |s_m: f64, d_m: f64| {
            let (sin, cos) = math::sin_cos(s_m / 25.0);
            Point2::new((25.0 - d_m) * sin, 25.0 - (25.0 - d_m) * cos)
        };
        let ring: Vec<Point2> = (0..=157).map(|k| on_ring(f64::from(k), 0.0)).collect();
        let (ego, mut line) = (on_ring(130.0, 0.0), Line::default());
        for (s_m, d_m, is_follower) in [(150.0, -1.3, false), (115.0, 0.0, true)] {
            let at = on_ring(s_m, d_m);
            let mut world = World::on(&ring, 6.0).with_person((at.x_m, at.y_m), (0.0, 0.0));
            line.set(world.route.line());
            world.start.pose = Pose2::new(ego.x_m, ego.y_m, 130.0 / 25.0);
            let request = Request { along_m: Some(130.0), ..world.request() };
            let (_, follower) =
                without_followers(request.predictions, (request.route, request.place(), request.shape), 6.0);
            assert_eq!(follower.is_some(), is_follower, "{s_m}");
            let traffic = Traffic::new(&request, &line, 130.0);
            let middles = traffic.movers.iter().map(|one| 0.5 * (one.knots[0].from_m + one.knots[0].to_m));
            assert_eq!(middles.filter(|at_m| (at_m - s_m).abs() < 0.2).count(), 1, "{s_m}");
        }
    }
}
