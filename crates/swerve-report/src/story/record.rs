//! Recording of a run for its story.

use swerve_core::{Span, Time};
use swerve_eval::{ActorMetrics, DecidedBy, LightCourse, Metrics, Outline, Why};
use swerve_flow::{Event, Observer};
use swerve_geom::{Obb, Point2, Polyline, Pose2, angle_between};
use swerve_msg::truth::WorldState;
use swerve_msg::{
    ActorId, ActorKind, EgoState, Extent, Plan, PlanStatus, PredictionList, Route, Track, TrackList,
};

use crate::halved::push_within;

/// Minimum time between recorded track lists.
const TRACKS_EVERY: Span = Span::from_ms(250);
/// Distance from all actors' outlines beyond which a track is stale, metres.
const STALE_M: f64 = 1.5;
/// Minimum spacing of ego states; closer ones are left out.
const EGO_EVERY: Span = Span::from_ms(20);
/// Minimum movement between actor poses, metres and radians; closer ones are left out.
const ACTOR_MOVED: f64 = 0.01;
/// Maximum number of ego states, and of poses of one actor: 80 seconds. In longer runs every second one is dropped.
const EGO_MAX: usize = 1 << 12;
const POSES_MAX: usize = 1 << 14;
/// Maximum number of plans, and of track positions.
const PLANS_MAX: usize = 1 << 8;
const TRACKS_MAX: usize = 1 << 12;
/// Lateral deviation from the previous plan, or from the last recorded one, beyond which a plan counts as changed,
/// metres.
const CHANGE_OF_MIND_M: f64 = 0.3;

/// Recorded data of a run for its figure. Fill it during the run, then call [`conclude`](Self::conclude).
#[derive(Clone, Debug)]
pub struct Story {
    /// Title of the figure.
    pub title: String,
    /// Newest route of the ego, with the drivable area beside it.
    pub route: Route,
    /// Outlines of the drivable lanes of a map.
    pub lanes: Vec<Vec<Point2>>,
    /// Outlines of slippery patches.
    pub slippery: Vec<Vec<Point2>>,
    /// Width of a lane, metres; lane borders are drawn when it is known.
    pub lane_width_m: Option<f64>,
    /// The ego's outline.
    pub outline: Outline,
    /// Traffic lights of the ego's lane.
    pub lights: Vec<LightCourse>,
    /// Ego states, in order of time.
    pub ego: Vec<EgoState>,
    /// Actors, ordered by identity.
    pub actors: Vec<ActorTrace>,
    /// Plan changes, in order of time.
    pub plans: Vec<PlanMark>,
    /// Track positions, every quarter of a second.
    pub tracks: Vec<TrackMark>,
    /// Latest predictions.
    predicted: Vec<Vec<Point2>>,
    /// Latest plan, recorded or not.
    newest: Option<Plan>,
    /// Plan status, at each change.
    statuses: Vec<(Time, PlanStatus)>,
    /// Result of the run; `None` until it is over.
    pub metrics: Option<Metrics>,
    /// Causal chain of the actor that decided the verdict.
    pub why: Option<Why>,
}

/// Path of one actor.
#[derive(Clone, Debug)]
pub struct ActorTrace {
    /// Identity.
    pub id: ActorId,
    /// Type.
    pub kind: ActorKind,
    /// Size.
    pub extent: Extent,
    /// Poses of its centre, recorded when it moves.
    pub poses: Vec<(Time, Pose2)>,
}

/// A plan that differs from the previous one.
#[derive(Clone, Debug)]
pub struct PlanMark {
    /// Time at which it became visible.
    pub at: Time,
    /// The plan.
    pub plan: Plan,
    /// Latest predicted paths of the other road users at that time.
    pub predicted: Vec<Vec<Point2>>,
}

/// A track at an instant.
#[derive(Clone, Copy, Debug)]
pub struct TrackMark {
    /// Stamp of the list.
    pub at: Time,
    /// Position.
    pub point: Point2,
    /// True if no actor was there.
    pub is_stale: bool,
}

impl Story {
    /// Creates an empty recording.
    pub fn new(title: impl Into<String>, route: Route, lane_width_m: Option<f64>, outline: Outline) -> Self {
        Self {
            title: title.into(),
            route,
            lanes: Vec::new(),
            slippery: Vec::new(),
            lane_width_m,
            outline,
            lights: Vec::new(),
            ego: Vec::new(),
            actors: Vec::new(),
            plans: Vec::new(),
            tracks: Vec::new(),
            predicted: Vec::new(),
            newest: None,
            statuses: Vec::new(),
            metrics: None,
            why: None,
        }
    }

    /// Records the state of the world after one step.
    pub fn world(&mut self, world: &WorldState) {
        let due = self.ego.last().is_none_or(|last| world.stamp - last.stamp >= EGO_EVERY);
        let eventful = world.ended.is_some() || world.collisions_of_ego().next().is_some();
        if due || eventful {
            push_within(&mut self.ego, EGO_MAX, world.ego.state);
        }
        for actor in &world.actors {
            let place = self.actors.binary_search_by_key(&actor.id, |a| a.id).unwrap_or_else(|place| {
                let (id, kind, extent) = (actor.id, actor.kind, actor.extent);
                self.actors.insert(place, ActorTrace { id, kind, extent, poses: Vec::new() });
                place
            });
            self.actors[place].take(world.stamp, actor.pose);
        }
    }

    /// Records a plan that became visible at `at`, if it is a change.
    pub fn plan(&mut self, at: Time, plan: &Plan) {
        // The previous plan reveals a jump even beyond the end of the last recorded one; the last recorded one reveals
        // a slow drift.
        let before = self.newest.iter().chain(self.plans.last().map(|mark| &mark.plan));
        if self.plans.is_empty() || before.into_iter().any(|old| is_change_of_mind(old, plan)) {
            let mark = PlanMark { at, plan: plan.clone(), predicted: self.predicted.clone() };
            push_within(&mut self.plans, PLANS_MAX, mark);
        }
        if self.statuses.last().is_none_or(|(_, status)| *status != plan.status) {
            self.statuses.push((at, plan.status));
        }
        self.newest = Some(plan.clone());
    }

    /// Times at which the planner itself led because no comfortable plan was free; empty without a comfortable layer.
    pub(crate) fn without_comfort(&self) -> Vec<(Time, Time)> {
        if self.statuses.iter().all(|(_, status)| *status != PlanStatus::Comfortable) {
            return Vec::new();
        }
        let end = self.ego.last().map_or(Time::MAX, |e| e.stamp);
        let until = self.statuses.iter().skip(1).map(|(at, _)| *at).chain([end]);
        let spans = self.statuses.iter().zip(until);
        let led = spans.filter(|((_, s), _)| !matches!(s, PlanStatus::Comfortable | PlanStatus::Route));
        // Adjacent spans, such as of a path found and then kept, are joined.
        led.fold(Vec::new(), |mut joined: Vec<(Time, Time)>, (&(from, _), until)| {
            match joined.last_mut().filter(|last| last.1 == from) {
                Some(last) => last.1 = until,
                None => joined.push((from, until)),
            }
            joined
        })
    }

    /// Records the tracks, at most every `TRACKS_EVERY`.
    pub fn tracked(&mut self, list: &TrackList) {
        if self.tracks.last().is_some_and(|last| list.stamp - last.at < TRACKS_EVERY) {
            return;
        }
        let away_m = |actor: &ActorTrace, track: &Track| {
            let pose = actor.pose_at(list.stamp)?;
            Some(actor.extent.footprint(pose).distance_to_point(track.pose.point()))
        };
        let marks = list.tracks.iter().map(|track| {
            let is_someone = self.actors.iter().filter_map(|a| away_m(a, track)).any(|m| m <= STALE_M);
            TrackMark { at: list.stamp, point: track.pose.point(), is_stale: !is_someone }
        });
        for mark in marks.collect::<Vec<_>>() {
            push_within(&mut self.tracks, TRACKS_MAX, mark);
        }
    }

    /// Takes in the latest predictions.
    pub fn predicted(&mut self, list: &PredictionList) {
        let way = |p: &swerve_msg::Prediction| p.path.iter().map(|place| place.pose.point()).collect();
        self.predicted = list.predictions.iter().map(way).collect();
    }

    /// Records the result of the run and its cause.
    pub fn conclude(&mut self, metrics: &Metrics, why: Option<&Why>) {
        self.metrics = Some(metrics.clone());
        self.why = why.cloned();
    }

    /// Ego state at an instant, interpolated between the recorded ones.
    pub fn ego_at(&self, at: Time) -> Option<EgoState> {
        let after = self.ego.partition_point(|e| e.stamp <= at);
        let before = self.ego.get(after.checked_sub(1)?)?;
        let Some(next) = self.ego.get(after) else { return (before.stamp == at).then_some(*before) };
        let share = (at - before.stamp).as_secs() / (next.stamp - before.stamp).as_secs();
        Some(EgoState { stamp: at, pose: between(before.pose, next.pose, share), ..*before })
    }

    /// Arc length of the ego's front along the route, metres.
    pub(crate) fn front_s_m(&self, ego: &EgoState) -> f64 {
        let front_m = self.outline.center_ahead_m + 0.5 * self.outline.length_m;
        self.route.project(ego.pose.ahead(front_m).point()).s_m
    }

    /// Protagonist of the story: the actor that decided the verdict; `None` if something else did.
    pub(crate) fn protagonist(&self) -> Option<&ActorMetrics> {
        match self.metrics.as_ref()?.decided_by() {
            DecidedBy::Actor(actor) => Some(actor),
            _ => None,
        }
    }

    pub(crate) fn actor(&self, id: ActorId) -> Option<&ActorTrace> {
        self.actors.iter().find(|a| a.id == id)
    }
}

impl Observer for Story {
    /// Records world states, tracks, predictions, plans and routes as the engine publishes them.
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(world) = payload.downcast_ref::<WorldState>() {
            self.world(world);
        } else if let Some(plan) = payload.downcast_ref::<Plan>() {
            self.plan(publication.visible_at, plan);
        } else if let Some(list) = payload.downcast_ref::<TrackList>() {
            self.tracked(list);
        } else if let Some(list) = payload.downcast_ref::<PredictionList>() {
            self.predicted(list);
        } else if let Some(route) = payload.downcast_ref::<Route>() {
            self.route.clone_from(route);
        }
    }
}

impl ActorTrace {
    fn take(&mut self, at: Time, pose: Pose2) {
        let moved = |last: &Pose2| {
            last.point().distance(pose.point()) > ACTOR_MOVED
                || angle_between(last.heading_rad, pose.heading_rad).abs() > ACTOR_MOVED
        };
        if self.poses.last().is_none_or(|(_, last)| moved(last)) {
            push_within(&mut self.poses, POSES_MAX, (at, pose));
        }
    }

    /// Interpolated pose at an instant; the first or last pose outside the recorded time.
    pub fn pose_at(&self, at: Time) -> Option<Pose2> {
        let after = self.poses.partition_point(|(t, _)| *t <= at);
        let &(since, from) = self.poses.get(after.saturating_sub(1))?;
        let Some(&(until, to)) = self.poses.get(after).filter(|_| after > 0) else { return Some(from) };
        Some(between(from, to, (at - since).as_secs() / (until - since).as_secs()))
    }

    /// True if the actor ever moved.
    pub fn moves(&self) -> bool {
        self.poses.len() > 1
    }

    /// Outline at a pose.
    pub(crate) fn shape(&self, pose: Pose2) -> Shape {
        match self.kind {
            ActorKind::Pedestrian => Shape::Circle(pose.point(), 0.5 * self.extent.width_m),
            _ => Shape::Box(self.extent.footprint(pose)),
        }
    }
}

/// An actor's outline.
pub(crate) enum Shape {
    Circle(Point2, f64),
    Box(Obb),
}

impl Shape {
    /// Nearest points of the ego's outline and of this one.
    pub(crate) fn nearest(&self, ego: &Obb) -> (Point2, Point2) {
        match self {
            Self::Circle(center, radius_m) => {
                let on_ego = nearest_of(ego, *center);
                let away = on_ego - *center;
                let share = if away.norm() > *radius_m { *radius_m / away.norm() } else { 1.0 };
                (on_ego, *center + away * share)
            }
            Self::Box(other) => {
                let theirs = other.corners().map(|corner| (nearest_of(ego, corner), corner));
                let ours = ego.corners().map(|corner| (corner, nearest_of(other, corner)));
                let pairs = theirs.into_iter().chain(ours);
                let near = pairs.min_by(|a, b| a.0.distance(a.1).total_cmp(&b.0.distance(b.1)));
                near.expect("boxes have corners")
            }
        }
    }
}

fn nearest_of(obb: &Obb, point: Point2) -> Point2 {
    let local: Point2 = obb.center.to_local(point);
    obb.center.from_local::<swerve_geom::Map>(Point2::new(
        local.x_m.clamp(-obb.half_length_m, obb.half_length_m),
        local.y_m.clamp(-obb.half_width_m, obb.half_width_m),
    ))
}

fn between(a: Pose2, b: Pose2, share: f64) -> Pose2 {
    let point = a.point() + (b.point() - a.point()) * share;
    Pose2::new(point.x_m, point.y_m, a.heading_rad + angle_between(a.heading_rad, b.heading_rad) * share)
}

/// True if `new` deviates from `old` or has another status.
fn is_change_of_mind(old: &Plan, new: &Plan) -> bool {
    if old.status != new.status {
        return true;
    }
    // A plan that follows the route is not a change, even if its points differ.
    if new.status == PlanStatus::Route {
        return false;
    }
    let points: Vec<Point2> = old.points.iter().map(|p| p.pose.point()).collect();
    let Ok(line) = Polyline::new(&points) else { return false };
    let mut near_m = 0.0;
    new.points.iter().any(|p| {
        // A place of the line that is near enough suffices: the nearest one is no farther.
        let near = line.project_near(p.pose.point(), near_m, NEXT_M);
        near_m = near.s_m;
        if near.d_m.abs() <= CHANGE_OF_MIND_M {
            return false;
        }
        let place = line.project(p.pose.point());
        (0.0..=line.length()).contains(&place.s_m) && place.d_m.abs() > CHANGE_OF_MIND_M
    })
}

/// Distance along a plan within which its next point is searched first, metres.
const NEXT_M: f64 = 3.0;
