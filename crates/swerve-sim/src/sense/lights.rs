//! Traffic lights visible to a sensor on the ego, with their signals, by the visibility rule of obstacles.

use swerve_geom::{Map, Point, Point2, Vector2};
use swerve_msg::truth::WorldState;
use swerve_msg::{Route, TrafficLight, TrafficLights};
use swerve_scenario::{Road, TrafficLight as Light};

use super::obstacles::{SensorMount, SensorParams, View};
use super::occluders::Occluders;

/// Height of the centre of a head over the road, metres: heads are 1 m high with their tops at 3.4 m.
const MIDDLE_M: f64 = 2.9;

/// Perfect perception of traffic lights.
///
/// A light is listed with its signal, in the order along the road, if the centre of its head is within range on the
/// ground and in the field of view, faces the sensor, and is not occluded by an actor.
#[derive(Clone, Debug)]
pub struct TrafficLightSensor {
    road: Road,
    /// Centres of the heads, and the directions from which their faces are visible.
    heads: Vec<(Point<Map>, Vector2)>,
    /// Stop lines along the route, metres.
    stops_m: Vec<Option<f64>>,
}

impl TrafficLightSensor {
    /// Creates a sensor for the lights of this road (of a checked scenario), on its first route.
    pub fn new(road: &Road) -> Self {
        let placed = |light: &Light| {
            let head = Point::new(light.pose.x_m, light.pose.y_m, MIDDLE_M);
            (head, light.pose.direction())
        };
        let heads = road.lights.iter().map(placed).collect();
        let stops_m = road.lights.iter().map(|light| light.stop_s_m).collect();
        Self { road: road.clone(), heads, stops_m }
    }

    /// Takes another route of the ego.
    pub fn follow(&mut self, route: &Route) {
        self.stops_m = self.road.lights.iter().map(|light| self.road.stop_s_m(light, route)).collect();
    }

    /// Lights visible in this state. Image positions are zero.
    pub fn sense(&self, world: &WorldState, mount: &SensorMount, params: &SensorParams) -> TrafficLights {
        let view = View::new(world, mount, params);
        let eye = Point2::new(view.eye.coords.x, view.eye.coords.y);
        let occluders = Occluders::new(world, view.eye);
        let seen = |(light, (head, towards), stop_s_m): (&Light, &(Point<Map>, Vector2), &Option<f64>)| {
            let at = Point2::new(head.coords.x, head.coords.y);
            let is_blocked = || occluders.hide(*head, None);
            let is_seen = eye.distance(at) <= params.range_m
                && (at - eye).dot(*towards) > 0.0
                && view.in_field(*head)
                && !(params.occlusion && is_blocked());
            let signal = Some(light.signal(world.stamp));
            is_seen.then(|| TrafficLight {
                name: Some(light.name.clone()),
                signal,
                seen: signal,
                score: 1.0,
                distance_m: world.ego.state.pose.point().distance(at),
                stop_s_m: *stop_s_m,
                ..TrafficLight::default()
            })
        };
        let lights = self.road.lights.iter().zip(&self.heads).zip(&self.stops_m);
        let lights = lights.map(|((light, head), stop_s_m)| (light, head, stop_s_m));
        TrafficLights { stamp: world.stamp, lights: lights.filter_map(seen).collect() }
    }
}

#[cfg(test)]
mod tests;
