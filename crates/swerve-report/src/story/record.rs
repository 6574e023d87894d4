//! What a story keeps of a run.

use swerve_core::{Span, Time};
use swerve_eval::{ActorMetrics, DecidedBy, LightCourse, Metrics, Outline, Why};
use swerve_flow::{Event, Observer};
use swerve_geom::{Obb, Point2, Polyline, Pose2, angle_between};
use swerve_msg::truth::WorldState;
use swerve_msg::{
    ActorId, ActorKind, EgoState, Extent, Plan, PlanStatus, PredictionList, Route, Track, TrackList,
};

use crate::halved::push_within;

/// Tracks are kept every so often.
const TRACKS_EVERY: Span = Span::from_ms(250);
/// A track farther than this from the outline of everybody is stale, metres.
const STALE_M: f64 = 1.5;
/// Ego states nearer to each other than this are left out.
const EGO_EVERY: Span = Span::from_ms(20);
/// Actor poses nearer to each other than this are left out, metres and radians.
const ACTOR_MOVED: f64 = 0.01;
/// Most states of the ego, and poses of an actor: 80 seconds. Of a longer run every second one goes.
const EGO_MAX: usize = 1 << 12;
const POSES_MAX: usize = 1 << 14;
/// Most plans that are kept, and places of tracks.
const PLANS_MAX: usize = 1 << 8;
const TRACKS_MAX: usize = 1 << 12;
/// A plan that deviates sideways by more than this from the one before it, or from the one kept last, is a
/// changed plan, metres.
const CHANGE_OF_MIND_M: f64 = 0.3;

/// A run, as far as its figure shows it. Fill it while the run goes on, then [`conclude`](Self::conclude).
#[derive(Clone, Debug)]
pub struct Story {
    /// Title of the figure.
    pub title: String,
    /// The way of the ego and the drivable ground beside it.
    pub route: Route,
    /// Width of a lane, metres; lane borders are drawn when it is known.
    pub lane_width_m: Option<f64>,
    /// The ego's outline.
    pub outline: Outline,
    /// The traffic lights of the ego's lane.
    pub lights: Vec<LightCourse>,
    /// The ego's states, in order of time.
    pub ego: Vec<EgoState>,
    /// The actors, in order of identity.
    pub actors: Vec<ActorTrace>,
    /// The plans at the changes, in order of time.
    pub plans: Vec<PlanMark>,
    /// Where tracks were, every quarter of a second.
    pub tracks: Vec<TrackMark>,
    /// The newest predictions.
    predicted: Vec<Vec<Point2>>,
    /// The newest plan, kept or not.
    newest: Option<Plan>,
    /// How plans came about, each time that this changed.
    statuses: Vec<(Time, PlanStatus)>,
    /// The result of the run; none before it is over.
    pub metrics: Option<Metrics>,
    /// The chain of the actor that decided the verdict.
    pub why: Option<Why>,
}

/// The way of one actor.
#[derive(Clone, Debug)]
pub struct ActorTrace {
    /// Identity.
    pub id: ActorId,
    /// What it is.
    pub kind: ActorKind,
    /// Size.
    pub extent: Extent,
    /// Poses of its centre, whenever it had moved.
    pub poses: Vec<(Time, Pose2)>,
}

/// A plan that changed the ego's mind.
#[derive(Clone, Debug)]
pub struct PlanMark {
    /// When it became visible.
    pub at: Time,
    /// The plan.
    pub plan: Plan,
    /// The newest predicted ways of the others then.
    pub predicted: Vec<Vec<Point2>>,
}

/// A track at an instant.
#[derive(Clone, Copy, Debug)]
pub struct TrackMark {
    /// Stamp of the list.
    pub at: Time,
    /// Where it was.
    pub point: Point2,
    /// Whether nobody was there.
    pub is_stale: bool,
}

impl Story {
    /// Nothing has happened yet.
    pub fn new(title: impl Into<String>, route: Route, lane_width_m: Option<f64>, outline: Outline) -> Self {
        Self {
            title: title.into(),
            route,
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

    /// Takes in the state of the world after one step.
    pub fn world(&mut self, world: &WorldState) {
        let due = self.ego.last().is_none_or(|last| world.stamp - last.stamp >= EGO_EVERY);
        let eventful = world.ended.is_some() || !world.collisions.is_empty();
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

    /// Takes in a plan that became visible at `at`; only changes are kept.
    pub fn plan(&mut self, at: Time, plan: &Plan) {
        // The one before shows a jump even where the one kept last does not reach any more; the one kept last
        // shows a slow drift.
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

    /// When the planner itself led, as no comfortable plan was free; nothing where there is no comfortable layer.
    pub(crate) fn without_comfort(&self) -> Vec<(Time, Time)> {
        if self.statuses.iter().all(|(_, status)| *status != PlanStatus::Comfortable) {
            return Vec::new();
        }
        let end = self.ego.last().map_or(Time::MAX, |e| e.stamp);
        let until = self.statuses.iter().skip(1).map(|(at, _)| *at).chain([end]);
        let spans = self.statuses.iter().zip(until);
        let led = spans.filter(|((_, s), _)| !matches!(s, PlanStatus::Comfortable | PlanStatus::Route));
        // Neighbours, say a path found and one kept, are one span.
        led.fold(Vec::new(), |mut joined: Vec<(Time, Time)>, (&(from, _), until)| {
            match joined.last_mut().filter(|last| last.1 == from) {
                Some(last) => last.1 = until,
                None => joined.push((from, until)),
            }
            joined
        })
    }

    /// Takes in what is tracked.
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

    /// Takes in where the others are predicted to be.
    pub fn predicted(&mut self, list: &PredictionList) {
        let way = |p: &swerve_msg::Prediction| p.path.iter().map(|place| place.pose.point()).collect();
        self.predicted = list.predictions.iter().map(way).collect();
    }

    /// The run is over, this came of it, for this reason.
    pub fn conclude(&mut self, metrics: &Metrics, why: Option<&Why>) {
        self.metrics = Some(metrics.clone());
        self.why = why.cloned();
    }

    /// The ego at an instant, between the states that were kept.
    pub fn ego_at(&self, at: Time) -> Option<EgoState> {
        let after = self.ego.partition_point(|e| e.stamp <= at);
        let before = self.ego.get(after.checked_sub(1)?)?;
        let Some(next) = self.ego.get(after) else { return (before.stamp == at).then_some(*before) };
        let share = (at - before.stamp).as_secs() / (next.stamp - before.stamp).as_secs();
        Some(EgoState { stamp: at, pose: between(before.pose, next.pose, share), ..*before })
    }

    /// How far along the route the ego's front is, metres.
    pub(crate) fn front_s_m(&self, ego: &EgoState) -> f64 {
        let front_m = self.outline.center_ahead_m + 0.5 * self.outline.length_m;
        self.route.project(ego.pose.ahead(front_m).point()).s_m
    }

    /// The actor that the story is about: the one that decided the verdict; none where something else did.
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
    /// Takes in world states, tracks, predictions and plans, by their types, as the engine publishes them.
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

    /// Where it was at an instant; its first or last pose outside its life.
    pub fn pose_at(&self, at: Time) -> Option<Pose2> {
        let after = self.poses.partition_point(|(t, _)| *t <= at);
        let &(since, from) = self.poses.get(after.saturating_sub(1))?;
        let Some(&(until, to)) = self.poses.get(after).filter(|_| after > 0) else { return Some(from) };
        Some(between(from, to, (at - since).as_secs() / (until - since).as_secs()))
    }

    /// Whether it ever moved.
    pub fn moves(&self) -> bool {
        self.poses.len() > 1
    }

    /// Its outline at a pose.
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
    /// The nearest points of the ego's outline and of this one.
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

/// Whether `new` leads elsewhere than `old` did, or came about in another way.
fn is_change_of_mind(old: &Plan, new: &Plan) -> bool {
    if old.status != new.status {
        return true;
    }
    // Following the route needs no figure, however its points are cut.
    if new.status == PlanStatus::Route {
        return false;
    }
    let points: Vec<Point2> = old.points.iter().map(|p| p.pose.point()).collect();
    let Ok(line) = Polyline::new(&points) else { return false };
    new.points.iter().any(|p| {
        let place = line.project(p.pose.point());
        (0.0..=line.length()).contains(&place.s_m) && place.d_m.abs() > CHANGE_OF_MIND_M
    })
}
