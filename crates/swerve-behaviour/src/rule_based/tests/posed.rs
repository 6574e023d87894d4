//! Situations on the maps of the scenarios.

use std::path::Path;
use std::sync::Arc;

use core::f64::consts::FRAC_PI_2;

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Pose2, angle_between};
use swerve_map::conflict::Conflicts;
use swerve_map::router::{self, Stop};
use swerve_map::{Crossing, CrossingId, LaneKind, Map};
use swerve_map_io::MapFile;
use swerve_msg::{
    ActorId, ActorKind, Decision, EgoState, Extent, PredictedPose, Prediction, Route, TrafficLights,
};
use swerve_vehicle::{Limits, Shape};

use crate::{BehaviourPlanner, Roads, RuleBased, RuleBasedParams, Situation};

/// A map, the ego on a route over it, and the others.
pub(super) struct Posed {
    pub(super) map: Arc<Map>,
    pub(super) conflicts: Conflicts,
    pub(super) route: Route,
    /// Destination.
    pub(super) end: Pose2,
    pub(super) planner: RuleBased,
    now: Time,
    pub(super) others: Vec<Prediction>,
    pub(super) lights: Option<TrafficLights>,
    /// Arc length of the ego's front, and its speed.
    pub(super) front_m: f64,
    pub(super) speed_mps: f64,
    /// Speed on a free road, m/s.
    pub(super) cruise_mps: f64,
}

/// Pose on the right-hand lane of an arm of a crossing around the origin: traffic drives in with a heading of
/// `quarters`, and is beyond the centre by `ahead_m`.
pub(super) fn on_arm(quarters: i32, ahead_m: f64) -> Pose2 {
    let to: Pose2 = Pose2::new(0.0, 0.0, f64::from(quarters) * FRAC_PI_2);
    let point = to.point() + to.direction() * ahead_m - to.direction().left() * 1.75;
    Pose2::new(point.x_m, point.y_m, to.heading_rad)
}

/// A map of the scenarios with one more pedestrian crossing, a rectangle from its lowest to its highest corner.
pub(super) fn map_with_crossing(name: &str, [(x0_m, y0_m), (x1_m, y1_m)]: [(f64, f64); 2]) -> Arc<Map> {
    let (lanes, mut features) = Map::clone(&Posed::on(name).map).into_parts();
    let corners = [(x0_m, y0_m), (x1_m, y0_m), (x1_m, y1_m), (x0_m, y1_m)];
    features.crossings.push(Crossing {
        id: CrossingId(1),
        name: String::new(),
        outline: corners.map(|(x_m, y_m)| Point2::new(x_m, y_m)).to_vec(),
        lanes: Vec::new(),
    });
    Arc::new(Map::with_features(lanes, features).unwrap())
}

impl Posed {
    /// A map of the scenarios, without a route yet.
    pub(super) fn on(name: &str) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/maps").join(name);
        let text = std::fs::read_to_string(&path).unwrap();
        Self::with(MapFile::read(name, &text).unwrap().map)
    }

    pub(super) fn with(map: Arc<Map>) -> Self {
        let first = &map.lanes().iter().find(|lane| lane.kind == LaneKind::Driving).unwrap();
        let route = Route::along(&map, &[first.id]).unwrap();
        Self {
            conflicts: Conflicts::new(&map),
            map,
            route,
            end: Pose2::new(0.0, 0.0, 0.0),
            planner: RuleBased::new(RuleBasedParams::default()),
            now: Time::ZERO,
            others: Vec::new(),
            lights: None,
            front_m: 0.0,
            speed_mps: 0.0,
            cruise_mps: 10.0,
        }
    }

    /// Place on the lane at a pose.
    pub(super) fn place(&self, pose: Pose2) -> Stop {
        let along = |on: &swerve_map::LanePlace| {
            let lane = self.map.lane(on.lane).unwrap();
            let heading_rad = lane.line.at(on.place.s_m).pose.heading_rad;
            lane.kind == LaneKind::Driving && angle_between(heading_rad, pose.heading_rad).abs() < 0.5
        };
        let on = self.map.at(pose.point()).find(along).unwrap_or_else(|| panic!("no lane at {pose:?}"));
        Stop { lane: on.lane, s_m: on.place.s_m }
    }

    /// The ego's route between two poses.
    pub(super) fn route(mut self, from: Pose2, to: Pose2) -> Self {
        let way = router::find(&self.map, self.place(from), self.place(to), &[]).unwrap();
        self.route = Route::over(&self.map, &way, 50.0, 10.0).unwrap().0;
        self.end = to;
        self
    }

    /// Puts the front of the ego at this distance before the point of its route nearest to a pose.
    pub(super) fn ego(mut self, at: Pose2, before_m: f64, speed_mps: f64) -> Self {
        self.front_m = self.route.project(at.point()).s_m - before_m;
        self.speed_mps = speed_mps;
        self
    }

    /// Adds a road user that keeps its speed and heading; its identity counts up from 1.
    pub(super) fn other(mut self, kind: ActorKind, at: Pose2, speed_mps: f64) -> Self {
        let [length_m, width_m] = if kind == ActorKind::Pedestrian { [0.5, 0.5] } else { [4.5, 1.8] };
        let extent = Extent { length_m, width_m, height_m: 1.6 };
        let id = ActorId(self.others.len() as u32 + 1);
        let first = PredictedPose { at: self.now, pose: at };
        self.others.push(Prediction::single(id, kind, extent, vec![first]));
        self.aim(id.0, at, speed_mps);
        self
    }

    pub(super) fn car(self, at: Pose2, speed_mps: f64) -> Self {
        self.other(ActorKind::Car, at, speed_mps)
    }

    /// Gives a road user another pose and speed.
    pub(super) fn aim(&mut self, id: u32, at: Pose2, speed_mps: f64) {
        let path = (0..20).map(|k| PredictedPose {
            at: self.now + Span::from_ms(200 * k),
            pose: at.ahead(speed_mps * 0.2 * k as f64),
        });
        self.others[id as usize - 1].path = path.collect();
    }

    /// Decision of the next frame, 0.1 s after the last one; the others do not move by themselves.
    pub(super) fn decide(&mut self) -> Decision {
        self.now += Span::from_ms(100);
        for one in &mut self.others {
            let begin = one.path[0].at;
            for pose in &mut one.path {
                pose.at = self.now + (pose.at - begin);
            }
        }
        let (shape, limits) = (Shape::default(), Limits::default());
        let s_m = self.front_m - (shape.length_m - shape.rear_overhang_m);
        let ego = EgoState {
            pose: self.route.line().at(s_m).pose,
            speed_mps: self.speed_mps,
            ..EgoState::default()
        };
        self.planner.decide(&Situation {
            stamp: self.now,
            ego: &ego,
            route: &self.route,
            number: 1,
            place: swerve_geom::FrenetPoint { s_m, d_m: 0.0 },
            roads: Some(Roads { map: &self.map, conflicts: &self.conflicts }),
            cruise_mps: self.cruise_mps,
            predictions: &self.others,
            lights: self.lights.as_ref(),
            shape: &shape,
            limits: &limits,
        })
    }

    /// Decision after some frames in the same situation.
    pub(super) fn decide_after(&mut self, seconds: f64) -> Decision {
        let frames = (seconds * 10.0) as usize;
        (0..=frames).map(|_| self.decide()).last().unwrap()
    }
}
