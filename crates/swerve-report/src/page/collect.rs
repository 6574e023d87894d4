//! Collection of a run's page data, live or from a log.

use core::any::Any;
use std::collections::BTreeMap;

use swerve_core::{Span, Time};
use swerve_eval::{Localization, Outline};
use swerve_flow::{Event, Observer};
use swerve_geom::{FrenetPoint, Pose2, angle_between};
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorNames, Command, EgoState, Image, Plan, PoseQuality, PredictionList, Route, TrackList};

use super::bound::Fill;
use super::picture::photo;
use super::run::{self, EgoShape, Input, Light, Marks, Operator, Road, RunPage};

/// Minimum spacing of ego states; closer ones are left out.
const EGO_EVERY: Span = Span::from_ms(20);
/// Minimum spacing of pictures of one camera; closer ones are left out.
const PHOTO_EVERY: Span = Span::from_ms(1000);
/// Minimum movement between actor poses, metres and radians; closer ones are left out.
const ACTOR_MOVED: f64 = 0.01;
/// Maximum number of points of a plan or a predicted path.
const POINTS: usize = 24;
/// Spacing of road points, metres.
const ROAD_STEP_M: f64 = 2.0;

/// Stream, publisher and times of a message.
#[derive(Clone, Copy, Debug)]
pub struct Message<'a> {
    /// Its stream.
    pub stream: &'a str,
    /// Operator that published it.
    pub operator: &'a str,
    /// Instant that it describes.
    pub stamp: Time,
    /// Time of publication.
    pub at: Time,
    /// The stamp of the newest sensor frame that it derives from.
    pub origin: Option<Time>,
}

/// Page data of a run, collected so far.
#[derive(Clone, Debug, Default)]
pub struct Collector {
    page: RunPage,
    names: ActorNames,
    operators: BTreeMap<String, usize>,
    streams: BTreeMap<String, usize>,
    /// Stream shown for each message type. A second stream of the type, such as one with injected faults, is not shown.
    shown: BTreeMap<&'static str, usize>,
    ego_due: Time,
    localization: Localization,
    has_world: bool,
    photographed: BTreeMap<usize, Time>,
    with_photos: bool,
    fill: Fill,
}

impl Collector {
    /// Creates an empty collector.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the road that is driven on and the ego's outline.
    pub fn set_ground(&mut self, route: &Route, lane_width_m: f64, outline: Outline) {
        let length_m = route.line().length();
        let n = (length_m / ROAD_STEP_M).ceil().max(1.0) as usize;
        let along = |beside: &dyn Fn(f64) -> f64| {
            let place = |k: usize| {
                let s_m = length_m * k as f64 / n as f64;
                let point = route.unproject(FrenetPoint { s_m, d_m: beside(s_m) });
                [cm(point.x_m), cm(point.y_m)]
            };
            (0..=n).flat_map(place).collect()
        };
        self.page.road = Some(Road {
            line: along(&|_| 0.0),
            left: along(&|s_m| route.left_m(s_m)),
            right: along(&|s_m| -route.right_m(s_m)),
            lane: cm(lane_width_m),
            lights: Vec::new(),
        });
        self.page.shape = EgoShape {
            length: cm(outline.length_m),
            width: cm(outline.width_m),
            ahead: cm(outline.center_ahead_m),
        };
    }

    /// Sets the traffic lights along the road.
    pub fn set_lights(&mut self, lights: Vec<Light>) {
        if let Some(road) = &mut self.page.road {
            road.lights = lights;
        }
    }

    /// Sets the names of the actors.
    pub fn set_names(&mut self, names: ActorNames) {
        self.names = names;
    }

    /// Adds an operator with its inputs. Operators are shown in the order of these calls.
    pub fn set_inputs(&mut self, operator: &str, inputs: Vec<Input>) {
        let index = self.operator(operator);
        self.page.operators[index].inputs = inputs;
    }

    /// Enables or disables camera pictures.
    pub fn keep_photos(&mut self, keep: bool) {
        self.with_photos = keep;
    }

    /// Takes in a message; payloads of types that the page does not show are ignored.
    pub fn message(&mut self, about: Message<'_>, payload: Option<&dyn Any>) {
        self.fill.make_room(&mut self.page);
        let operator = self.operator(about.operator);
        let stream = self.stream(about.stream);
        let messages = &mut self.page.messages;
        messages.stream.push(stream);
        messages.operator.push(operator);
        messages.stamp.push(us(about.stamp));
        messages.at.push(us(about.at));
        messages.origin.push(about.origin.map_or(-1, us));
        self.page.end = self.page.end.max(us(about.at));
        let Some(payload) = payload else { return };
        if let Some(world) = payload.downcast_ref::<WorldState>() {
            self.world(world);
        } else if let Some(ego) = payload.downcast_ref::<EgoState>() {
            if self.shows("ego", stream) {
                if self.has_world { self.located(ego) } else { self.ego(ego) }
            }
        } else if let Some(quality) = payload.downcast_ref::<PoseQuality>() {
            self.sure(quality);
        } else if let Some(tracks) = payload.downcast_ref::<TrackList>() {
            if self.shows("tracks", stream) {
                self.fill.tracked += 8 * tracks.tracks.len();
                self.page.tracks.push(tracks_of(about.at, tracks));
            }
        } else if let Some(predictions) = payload.downcast_ref::<PredictionList>() {
            if self.shows("predictions", stream) {
                let predictions = predictions_of(about.at, predictions);
                self.fill.predicted += predictions.of.iter().map(Vec::len).sum::<usize>();
                self.page.predictions.push(predictions);
            }
        } else if let Some(plan) = payload.downcast_ref::<Plan>() {
            if self.shows("plan", stream) {
                self.page.plans.push(plan_of(about.at, plan));
            }
        } else if let Some(command) = payload.downcast_ref::<Command>() {
            if self.shows("command", stream) {
                self.command(about.at, command);
            }
        } else if let Some(image) = payload.downcast_ref::<Image>() {
            self.photo(about.stream, image.stamp, || photo(image));
        }
    }

    /// Takes in a camera picture as a data URI, if pictures are enabled and the last one of the stream is old enough.
    pub fn photo(&mut self, name: &str, stamp: Time, make: impl FnOnce() -> Option<String>) {
        let stream = self.stream(name);
        let due = self.photographed.get(&stream).is_none_or(|last| stamp - *last >= PHOTO_EVERY);
        if let Some(data) = (self.with_photos && due).then(make).flatten() {
            self.photographed.insert(stream, stamp);
            self.page.photos.push(run::Photo { t: us(stamp), stream: name.into(), data });
        }
    }

    /// Takes in a finished step.
    pub fn step(&mut self, operator: &str, stamp: Time, start: Time, end: Time, late: bool) {
        let operator = self.operator(operator);
        let steps = &mut self.page.steps;
        if late {
            steps.late.push(steps.start.len());
        }
        steps.operator.push(operator);
        steps.stamp.push(us(stamp));
        steps.start.push(us(start));
        steps.took.push(us(end) - us(start));
    }

    /// Takes in a missed deadline.
    pub fn miss(&mut self, operator: &str, stamp: Time, at: Time, reaction: impl Into<String>) {
        let operator = self.operator(operator);
        mark(&mut self.page.misses, operator, (stamp, at), reaction.into());
    }

    /// Takes in a dropped frame or result.
    pub fn dropped(&mut self, operator: &str, stamp: Time, at: Time, reason: impl Into<String>) {
        let operator = self.operator(operator);
        mark(&mut self.page.drops, operator, (stamp, at), reason.into());
    }

    /// The page data collected so far.
    pub fn so_far(&self) -> &RunPage {
        &self.page
    }

    /// Sentences about the data that the page of a long run leaves out.
    pub fn notes(&self) -> impl Iterator<Item = String> {
        self.fill.notes()
    }

    /// Returns the page data; the caller adds the results of the run as a whole.
    pub fn finish(self) -> RunPage {
        self.page
    }

    #[cfg(test)]
    pub(super) fn limit(&mut self, limits: super::bound::Limits) {
        self.fill.limits = limits;
    }

    fn operator(&mut self, name: &str) -> usize {
        if let Some(&index) = self.operators.get(name) {
            return index;
        }
        let index = self.page.operators.len();
        self.page.operators.push(Operator { name: name.into(), inputs: Vec::new() });
        self.operators.insert(name.into(), index);
        index
    }

    fn stream(&mut self, name: &str) -> usize {
        if let Some(&index) = self.streams.get(name) {
            return index;
        }
        let index = self.page.streams.len();
        self.page.streams.push(name.into());
        self.streams.insert(name.into(), index);
        index
    }

    fn shows(&mut self, what: &'static str, stream: usize) -> bool {
        *self.shown.entry(what).or_insert(stream) == stream
    }

    fn world(&mut self, world: &WorldState) {
        self.has_world = true;
        if world.ended.is_some() || world.collisions_of_ego().next().is_some() {
            self.ego_due = world.stamp;
        }
        self.ego(&world.ego.state);
        self.localization.truth(&world.ego.state);
        for actor in &world.actors {
            let actors = &mut self.page.actors;
            let place = actors.binary_search_by_key(&actor.id.0, |a| a.id).unwrap_or_else(|place| {
                let name = self.names.get(&actor.id).cloned().unwrap_or_default();
                let (length, width) = (cm(actor.extent.length_m), cm(actor.extent.width_m));
                let (id, kind) = (actor.id.0, name_of(&actor.kind));
                actors.insert(place, run::Actor { id, name, kind, length, width, ..run::Actor::default() });
                place
            });
            self.fill.poses += usize::from(follow(&mut actors[place], world.stamp, actor.pose));
        }
    }

    fn ego(&mut self, state: &EgoState) {
        let ego = &mut self.page.ego;
        if state.stamp < self.ego_due || ego.t.last() == Some(&us(state.stamp)) {
            return;
        }
        self.ego_due = state.stamp + EGO_EVERY;
        ego.t.push(us(state.stamp));
        ego.x.push(cm(state.pose.x_m));
        ego.y.push(cm(state.pose.y_m));
        ego.h.push(thousandths(state.pose.heading_rad));
        ego.v.push(thousandths(state.speed_mps));
        ego.a.push(thousandths(state.accel_mps2));
        ego.lat.push(thousandths(state.lateral_accel_mps2));
        ego.steer.push(thousandths(state.steering_rad));
    }

    /// Takes in an estimated pose, if it differs from the true one.
    fn located(&mut self, found: &EgoState) {
        let off = self.localization.pose(found).map(thousandths).filter(|off| *off > 0);
        let located = &mut self.page.located;
        let is_due = located.t.last().is_none_or(|last| us(found.stamp) - last >= us(Time::ZERO + EGO_EVERY));
        if let Some(off) = off.filter(|_| is_due) {
            located.t.push(us(found.stamp));
            located.off.push(off);
            located.sigma.push(None);
        }
    }

    /// Takes in the uncertainty of the pose with the same stamp.
    fn sure(&mut self, quality: &PoseQuality) {
        let located = &mut self.page.located;
        if located.t.last() == Some(&us(quality.stamp))
            && let Some(sigma) = located.sigma.last_mut()
        {
            *sigma = Some(thousandths(quality.sigma_m()));
        }
    }

    fn command(&mut self, at: Time, command: &Command) {
        let commands = &mut self.page.commands;
        commands.t.push(us(at));
        commands.steer.push(thousandths(command.steering_rad));
        commands.throttle.push(thousandths(command.throttle));
        commands.brake.push(thousandths(command.brake));
    }
}

impl Observer for Collector {
    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::Publication(p) => {
                let Some(stamp) = p.stamp else { return };
                let (stream, operator, at, origin) = (p.stream, p.operator, p.visible_at, p.origin);
                // Reading a payload still in progress blocks, so that is done for photos only.
                let looked_at = p.payload.filter(|p| !p.is_promised() || self.with_photos && p.is::<Image>());
                let payload = looked_at.and_then(|p| p.payload()).map(|p| p.as_any());
                self.message(Message { stream, operator, stamp, at, origin }, payload);
            }
            Event::StepEnd(s) => self.step(s.operator, s.stamp, s.start, s.end, s.late),
            Event::Miss(m) => self.miss(m.operator, m.stamp, m.at, name_of(&m.reaction)),
            Event::Drop(d) => self.dropped(d.operator, d.stamp, d.at, name_of(&d.reason)),
            Event::StepStart(_) | Event::Decision(_) => {}
            Event::End(report) => self.page.end = us(report.at),
        }
    }
}

/// Appends a pose of an actor if it has moved. Returns true if the pose was added.
fn follow(actor: &mut run::Actor, at: Time, pose: Pose2) -> bool {
    let moved = |k: usize| {
        let (x, y) = (actor.x[k] as f64 * 0.01, actor.y[k] as f64 * 0.01);
        let turned = angle_between(actor.h[k] as f64 * 0.001, pose.heading_rad).abs();
        (pose.x_m - x).abs() > ACTOR_MOVED || (pose.y_m - y).abs() > ACTOR_MOVED || turned > ACTOR_MOVED
    };
    let is_new = actor.t.len().checked_sub(1).is_none_or(moved);
    if is_new {
        actor.t.push(us(at));
        actor.x.push(cm(pose.x_m));
        actor.y.push(cm(pose.y_m));
        actor.h.push(thousandths(pose.heading_rad));
    }
    is_new
}

fn tracks_of(at: Time, list: &TrackList) -> run::Tracks {
    let one = |track: &swerve_msg::Track| {
        let (pose, extent, velocity) = (track.pose, track.extent, track.velocity_mps);
        let place = [i64::from(track.id.0), cm(pose.x_m), cm(pose.y_m), thousandths(pose.heading_rad)];
        let rest = [extent.length_m, extent.width_m].map(cm);
        let speed = [velocity.x, velocity.y].map(thousandths);
        [place[0], place[1], place[2], place[3], rest[0], rest[1], speed[0], speed[1]]
    };
    run::Tracks { t: us(at), stamp: us(list.stamp), of: list.tracks.iter().map(one).collect() }
}

fn predictions_of(at: Time, list: &PredictionList) -> run::Predictions {
    let one = |prediction: &swerve_msg::Prediction| {
        let path: Vec<[i64; 2]> = prediction.path.iter().map(|p| [cm(p.pose.x_m), cm(p.pose.y_m)]).collect();
        std::iter::once(thousandths(prediction.probability)).chain(thinned(path)).collect()
    };
    run::Predictions { t: us(at), of: list.predictions.iter().map(one).collect() }
}

fn plan_of(at: Time, plan: &Plan) -> run::Plan {
    let points: Vec<[i64; 2]> = plan.points.iter().map(|p| [cm(p.pose.x_m), cm(p.pose.y_m)]).collect();
    run::Plan { t: us(at), stamp: us(plan.stamp), status: name_of(&plan.status), line: thinned(points) }
}

/// At most [`POINTS`] of the points, including the first and the last; a stationary path is one point.
fn thinned(points: Vec<[i64; 2]>) -> Vec<i64> {
    let mut kept: Vec<[i64; 2]> = if points.len() <= POINTS {
        points
    } else {
        let last = points.len() - 1;
        (0..POINTS).map(|k| points[k * last / (POINTS - 1)]).collect()
    };
    kept.dedup();
    kept.into_iter().flatten().collect()
}

fn mark(marks: &mut Marks, operator: usize, (stamp, at): (Time, Time), why: String) {
    marks.operator.push(operator);
    marks.stamp.push(us(stamp));
    marks.at.push(us(at));
    marks.why.push(why);
}

/// Serialised name of a unit variant.
fn name_of(value: &impl serde::Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(name)) => name,
        Ok(other) => other.to_string(),
        Err(_) => String::new(),
    }
}

fn us(time: Time) -> i64 {
    time.ns().div_euclid(1000)
}

fn cm(metres: f64) -> i64 {
    (metres * 100.0).round() as i64
}

fn thousandths(value: f64) -> i64 {
    (value * 1000.0).round() as i64
}
