//! Behaviour planners: a kind of operator for each.

use std::sync::Arc;

use swerve_behaviour::{Roads, Situation};
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port, Window};
use swerve_geom::LineTracker;
use swerve_map::Map;
use swerve_msg::{Decision, EgoState, PredictionList, Route, TrafficLights};
use swerve_scenario::Course;
use swerve_vehicle::VehicleParams;

use super::planner::measured_at;
use crate::behaviours::NamedBehaviour;
use crate::kind::{Kind, Node};
use crate::problems::{KeyProblems, problems_of_ranges};
use crate::registry::Registry;
use crate::site::Site;

/// Past poses kept to find the one at a frame's stamp: up to the age of a frame, at 100 Hz.
const POSES: usize = 64;

impl Registry {
    /// Adds a behaviour planner: a kind of operator with its name, in place of an existing one of the same name.
    #[must_use]
    pub fn with_behaviour<B: NamedBehaviour>(self) -> Self {
        self.with::<Behaviour<B>>()
    }
}

/// Decides for each frame.
pub(crate) struct Behaviour<B> {
    planner: B,
    /// The map, if the planner reads it and its conflict zones.
    map: Option<Arc<Map>>,
    vehicle: VehicleParams,
    cruise_mps: f64,
    /// True if it stops at traffic lights.
    obeys_lights: bool,
    place: OnRoute,
}

/// Predictions, the route, and what the decision depends on.
#[derive(Inputs)]
pub(crate) struct In {
    /// Predictions of the other road users.
    predictions: At<PredictionList>,
    /// Route to follow.
    route: Latest<Route>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
    /// Signals of the traffic lights.
    lights: Option<Latest<TrafficLights>>,
}

/// Place of the ego along the newest route.
#[derive(Default)]
pub(super) struct OnRoute {
    number: u64,
    place: LineTracker,
}

impl OnRoute {
    /// Returns true if the route of this number is another one than the last.
    pub(super) fn is_new(&self, number: u64) -> bool {
        self.number != number
    }

    /// The tracker, which begins anew on a route of another number.
    pub(super) fn of(&mut self, number: u64) -> &mut LineTracker {
        if self.is_new(number) {
            *self = Self { number, place: LineTracker::default() };
        }
        &mut self.place
    }
}

/// Finds out whether a route is another one than the first, which an operator knows from the scenario.
#[derive(Default)]
pub(super) struct RouteNews(u64);

impl RouteNews {
    /// The newest route, if it was not taken before.
    pub(super) fn take<'a>(&mut self, routes: Option<&'a Latest<Route>>) -> Option<&'a Route> {
        let route = routes?.get().filter(|route| route.header().seq != self.0)?;
        self.0 = route.header().seq;
        Some(route)
    }
}

impl<B: NamedBehaviour> Kind for Behaviour<B> {
    const NODE: Node = Node::new(B::NAME, B::DOC).on_demand();
    type Table = B::Params;

    fn problems(table: &B::Params) -> KeyProblems {
        problems_of_ranges(table)
    }

    fn new(table: B::Params, site: &Site<'_>) -> anyhow::Result<Self> {
        let around = site.surroundings();
        // A road without junctions has no rights of way.
        let map = match &around.scenario.road.course {
            Course::Map(course) if B::READS_MAP => Some(Arc::clone(&course.map)),
            Course::Map(_) | Course::Strip(_) => None,
        };
        Ok(Self {
            planner: B::with_params(table),
            map,
            vehicle: around.vehicle.clone(),
            cruise_mps: around.scenario.ego.target_speed_mps,
            obeys_lights: site.config().stops_at_lights(),
            place: OnRoute::default(),
        })
    }
}

impl<B: NamedBehaviour> Operator for Behaviour<B> {
    type In = In;
    type Out = Port<Decision>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let (Some(predictions), Some(route)) = (input.predictions.get(), input.route.get()) else { return };
        let stamp = predictions.stamp;
        let Some(ego) = measured_at(stamp, &input.poses) else { return };
        let header = route.header();
        // Stop lines of earlier images are on the route before.
        let is_on_route = |lights: &&swerve_flow::Message<TrafficLights>| lights.stamp >= header.stamp;
        let lights = input.lights.as_ref().filter(|_| self.obeys_lights).and_then(|lights| lights.get());
        out.send(self.planner.decide(&Situation {
            stamp,
            ego,
            route,
            number: header.seq,
            place: self.place.of(header.seq).locate(route.line(), ego.pose),
            roads: self.map.as_ref().map(|map| Roads { map, conflicts: map.conflicts() }),
            cruise_mps: self.cruise_mps,
            predictions: &predictions.predictions,
            lights: lights.filter(is_on_route).map(|lights| &**lights),
            shape: &self.vehicle.shape,
            limits: &self.vehicle.limits,
        }));
    }
}
