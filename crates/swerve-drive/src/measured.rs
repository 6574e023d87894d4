//! Metrics of a run, from the engine's events.

use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_eval::{Directions, Evaluation, Metrics, Norm, Outline};
use swerve_flow::{Event, Observer};
use swerve_geom::{LineTracker, Point2, Pose2, angle_between};
use swerve_map::{LanePlace, Map};
use swerve_msg::truth::WorldState;
use swerve_msg::{
    ActorNames, Command, Decision, Detections, EgoState, GateMode, GateOutput, Imu, ObstacleList, Plan,
    PoseQuality, Route, TrackList,
};
use swerve_scenario::{Course, Road, Scenario};
use swerve_stack::Assembly;
use swerve_stack::pipeline::{Pipeline, Stack};
use swerve_vehicle::Shape;

use crate::lights::light_courses;
use crate::rungs::Rungs;
use crate::scored::Scored;

/// Operators whose messages are measured. A fault injector's copy of a message is not counted again.
struct Publishers {
    imu: Option<String>,
    pose: Option<String>,
    /// Last fault injector of the pose stream, whose poses the readers get.
    pose_heard: Option<String>,
    obstacles: Option<String>,
    plan: Option<String>,
    decision: Option<String>,
    tracks: Option<String>,
    /// Operator that commands the car's pedals; `None` if a gate passes commands through.
    pedals: Option<String>,
}

impl Publishers {
    fn new(stack: &Stack<'_>) -> Self {
        let assembly = stack.assembly;
        let pedals = assembly.publisher::<Command>().filter(|_| assembly.publisher::<GateOutput>().is_none());
        Self {
            imu: assembly.publisher::<Imu>().map(str::to_owned),
            pose: assembly.publisher::<EgoState>().map(str::to_owned),
            pose_heard: stack.publisher_after_faults::<EgoState>().map(str::to_owned),
            obstacles: assembly.publisher::<ObstacleList>().map(str::to_owned),
            plan: assembly.publisher::<Plan>().map(str::to_owned),
            decision: assembly.publisher::<Decision>().map(str::to_owned),
            tracks: assembly.publisher::<TrackList>().map(str::to_owned),
            pedals: pedals.map(str::to_owned),
        }
    }
}

/// Search range for the corners of the ego's outline along the route, metres.
const CORNER_REACH_M: f64 = 15.0;

/// Feeds the evaluation with the engine's events.
pub(crate) struct Measured {
    evaluation: Evaluation,
    /// Driving scores; `None` without a map.
    scored: Option<Scored>,
    operators: Vec<String>,
    publishers: Publishers,
    track_names: ActorNames,
    /// The road and the end of the run, for the lights along other routes.
    road: Road,
    until: Time,
    route: Route,
    /// Position of the ego along the route.
    place: LineTracker,
    shape: Shape,
    pub(crate) road_margin_m: f64,
    pub(crate) rungs: Rungs,
}

/// Outline of a vehicle for the evaluation.
pub fn outline(shape: &Shape) -> Outline {
    Outline { length_m: shape.length_m, width_m: shape.width_m, center_ahead_m: shape.center_ahead_m() }
}

/// Speed and lane that a scenario requires of its ego.
pub fn norm(scenario: &Scenario) -> Norm {
    let directions = match &scenario.road.course {
        Course::Strip(_) => None,
        Course::Map(course) => {
            let map = Arc::clone(&course.map);
            Some(Directions::new(move |point, heading_rad| is_against(&map, point, heading_rad)))
        }
    };
    Norm { target_speed_mps: Some(scenario.ego.target_speed_mps), directions }
}

/// True for a point on drivable lanes that all lead against a heading.
fn is_against(map: &Map, point: Point2, heading_rad: f64) -> bool {
    let off_rad = |at: LanePlace| {
        let lane = map.lane(at.lane).filter(|lane| lane.kind.is_drivable())?;
        Some(angle_between(heading_rad, lane.line.at(at.place.s_m).pose.heading_rad).abs())
    };
    let least_rad = map.at(point).filter_map(off_rad).reduce(f64::min);
    least_rad.is_some_and(|off_rad| off_rad > core::f64::consts::FRAC_PI_2)
}

/// Names of the road users by the identity of their tracks; empty if a tracker numbers its tracks itself.
pub fn track_names(assembly: &Assembly, scenario: &Scenario) -> ActorNames {
    match assembly.publisher::<Detections>() {
        None => scenario.names(),
        Some(_) => ActorNames::new(),
    }
}

impl Measured {
    /// Measures the stack of one ego; its events have the names of its assembly.
    pub(crate) fn new(pipeline: &Pipeline, stack: &Stack<'_>) -> anyhow::Result<Self> {
        let shape = pipeline.vehicle.shape;
        let ego = outline(&shape);
        let graph = pipeline.graph.describe()?;
        let own = |name: &str| stack.names.own(name).map(str::to_owned);
        let operators: Vec<String> = graph.operators.iter().filter_map(|o| own(&o.name)).collect();
        let dead_time = Span::from_secs(pipeline.vehicle.dead_time_s);
        let Stack { scenario, route, .. } = *stack;
        let lights = light_courses(&scenario.road, route, pipeline.until);
        let params = swerve_eval::Params {
            ego,
            dead_time,
            operators: operators.clone(),
            actors: scenario.names(),
            route: Some(route.clone()),
            lights,
            norm: norm(scenario),
            tracks_boxes: stack.assembly.publisher::<Detections>().is_some(),
        };
        Ok(Self {
            evaluation: Evaluation::new(params),
            scored: Scored::new(scenario, route, shape),
            operators,
            publishers: Publishers::new(stack),
            track_names: track_names(stack.assembly, scenario),
            road: scenario.road.clone(),
            until: pipeline.until,
            route: route.clone(),
            place: LineTracker::default(),
            shape,
            road_margin_m: f64::INFINITY,
            rungs: Rungs::default(),
        })
    }

    /// Metrics so far, with the driving scores.
    pub(crate) fn metrics(&self) -> Metrics {
        Metrics { scores: self.scored.as_ref().map(Scored::scores), ..self.evaluation.metrics() }
    }

    /// Takes a route of the router, if it is another one.
    fn follow(&mut self, route: &Route) {
        if self.route != *route {
            self.evaluation.follow(route, light_courses(&self.road, route, self.until));
            (self.route, self.place) = (route.clone(), LineTracker::default());
        }
    }

    /// Smallest distance of the ego's outline from the border of the drivable ground, metres.
    fn margin_m(&mut self, pose: Pose2) -> f64 {
        let s_m = self.place.locate(self.route.line(), pose).s_m;
        let near = |corner: Point2| self.route.project_near(corner, s_m, CORNER_REACH_M);
        self.route.borders().margin_m(self.shape.footprint(pose).corners(), near)
    }

    fn operator(&self, name: &str) -> Option<usize> {
        self.operators.iter().position(|o| o == name)
    }
}

impl Observer for Measured {
    fn event(&mut self, event: &Event<'_>) {
        self.rungs.event(event);
        match event {
            Event::Publication(publication) => {
                let Some(payload) = publication.payload else { return };
                if let Some(route) = payload.downcast_ref::<Route>() {
                    return self.follow(route);
                }
                let evaluation = &mut self.evaluation;
                let is_of = |publisher: &Option<String>| publisher.as_deref() == Some(publication.operator);
                if let (Some(ego), true) = (payload.downcast_ref(), is_of(&self.publishers.pose_heard)) {
                    evaluation.pose_heard(ego);
                }
                if let Some(world) = payload.downcast_ref::<WorldState>() {
                    evaluation.world(world);
                    self.scored.iter_mut().for_each(|scored| scored.take(world));
                    let margin_m = self.margin_m(world.ego.state.pose);
                    self.road_margin_m = self.road_margin_m.min(margin_m);
                } else if let (Some(imu), true) = (payload.downcast_ref::<Imu>(), is_of(&self.publishers.imu))
                {
                    evaluation.imu(imu);
                } else if let (Some(ego), true) = (payload.downcast_ref(), is_of(&self.publishers.pose)) {
                    evaluation.pose(ego);
                } else if let (Some(quality), true) =
                    (payload.downcast_ref::<PoseQuality>(), is_of(&self.publishers.pose))
                {
                    evaluation.pose_quality(quality);
                } else if let (Some(list), true) = (payload.downcast_ref(), is_of(&self.publishers.obstacles))
                {
                    evaluation.seen(list);
                } else if let (Some(plan), true) =
                    (payload.downcast_ref::<Plan>(), is_of(&self.publishers.plan))
                {
                    evaluation.plan(plan);
                } else if let (Some(decision), true) =
                    (payload.downcast_ref::<Decision>(), is_of(&self.publishers.decision))
                {
                    evaluation.decision(publication.visible_at, decision, &self.track_names);
                } else if let (Some(list), true) =
                    (payload.downcast_ref::<TrackList>(), is_of(&self.publishers.tracks))
                {
                    evaluation.tracks(list, publication.visible_at);
                } else if let Some(gate) = payload.downcast_ref::<GateOutput>() {
                    evaluation.gate(publication.visible_at, gate);
                    if gate.mode == GateMode::Driving {
                        evaluation.command(publication.visible_at, publication.origin);
                    }
                } else if is_of(&self.publishers.pedals) && payload.is::<Command>() {
                    evaluation.command(publication.visible_at, publication.origin);
                }
            }
            Event::StepEnd(step) => {
                if let Some(operator) = self.operator(step.operator) {
                    self.evaluation.runtimes().step(operator, step.end - step.start);
                }
            }
            Event::Miss(miss) => {
                if let Some(operator) = self.operator(miss.operator) {
                    self.evaluation.runtimes().missed(operator);
                }
            }
            Event::Drop(dropped) => {
                if let Some(operator) = self.operator(dropped.operator) {
                    self.evaluation.runtimes().dropped(operator);
                }
            }
            Event::StepStart(_) | Event::Decision(_) | Event::End(_) => {}
        }
    }
}
