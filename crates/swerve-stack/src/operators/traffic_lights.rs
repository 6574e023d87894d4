//! Traffic lights in a camera's images.

use serde::{Deserialize, Serialize};
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port, Window};
use swerve_msg::{EgoState, Image, Route, TrafficLights};
use swerve_perception::LightWatch;
use swerve_perception::camera::Shot;
use swerve_perception::traffic_lights::{LightPlace, Params};
use swerve_scenario::{Road, TrafficLight};
use swerve_vehicle::VehicleParams;
use swerve_vision::traffic_light::LightSettings;

use super::behaviour::RouteNews;
use super::camera_objects::pitch_rad;
use crate::kind::{Heavy, Kind, Node};
use crate::problems::KeyProblems;
use crate::site::Site;

/// Past poses kept to find the one at an image's stamp and to estimate the body's pitch until then: at 100 Hz.
const POSES: usize = 256;

/// Detects the signals of traffic lights in each image, without neural networks.
pub(super) struct Lights {
    watch: LightWatch,
    params: Params,
    /// The road, if its lights are known from the map.
    road: Option<Road>,
    news: RouteNews,
    vehicle: VehicleParams,
    /// The scenario's lights, if their true signals are used.
    truth: Option<Vec<TrafficLight>>,
}

/// Keys of the traffic light detector.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Table {
    /// Uses the true signals of the scenario's lights in place of the pixels.
    truth: bool,
    /// Uses a map with the positions of lights; without it they are found by colour and shape.
    map: bool,
    head_m: [f64; 2],
    top_m: f64,
    within_m: f64,
    search_m: f64,
    confirm_frames: u32,
    forget_frames: u32,
}

impl Default for Table {
    fn default() -> Self {
        let Params { head_m, top_m, within_m, search_m, light } = Params::default();
        let LightSettings { confirm_frames, forget_frames } = light;
        Self { truth: false, map: true, head_m, top_m, within_m, search_m, confirm_frames, forget_frames }
    }
}

impl Table {
    fn params(&self) -> Params {
        let Self { head_m, top_m, within_m, search_m, confirm_frames, forget_frames, .. } = *self;
        Params { head_m, top_m, within_m, search_m, light: LightSettings { confirm_frames, forget_frames } }
    }
}

/// An image, and past poses of the ego.
#[derive(Inputs)]
pub(super) struct In {
    /// Colour image of the camera.
    image: At<Image>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
    /// Route of the ego, on which the stop lines are.
    route: Option<Latest<Route>>,
}

impl Kind for Lights {
    const NODE: Node =
        Node::new("traffic_lights", "what the traffic lights in a camera's images show").heavy(Heavy::Yes);
    type Table = Table;

    fn problems(table: &Table) -> KeyProblems {
        let mut told = table.params().problems();
        if table.truth && !table.map {
            told.push((
                "truth".to_owned(),
                "expected `map = true` beside it: it uses the map's lights".to_owned(),
            ));
        }
        told
    }

    fn new(table: Table, site: &Site<'_>) -> anyhow::Result<Self> {
        let around = site.surroundings();
        let road = &around.scenario.road;
        let known = table.map.then(|| road.clone());
        let places = known.as_ref().map(|road| places(road, &road.route())).unwrap_or_default();
        let params = table.params();
        Ok(Self {
            watch: LightWatch::new(params, places),
            params,
            road: known,
            news: RouteNews::default(),
            vehicle: around.vehicle.clone(),
            truth: table.truth.then(|| road.lights.clone()),
        })
    }
}

/// Positions of the lights that the ego obeys on a route, as in a map.
fn places(road: &Road, route: &Route) -> Vec<LightPlace> {
    let place = |light: &TrafficLight| {
        let stop_s_m = road.stop_s_m(light, route)?;
        Some(LightPlace { name: light.name.clone(), pose: light.pose, stop_s_m })
    };
    road.lights.iter().filter_map(place).collect()
}

impl Operator for Lights {
    type In = In;
    type Out = Port<TrafficLights>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Port<TrafficLights>) {
        if let (Some(route), Some(road)) = (self.news.take(input.route.as_ref()), &self.road) {
            self.watch = LightWatch::new(self.params, places(road, route));
        }
        let Some(image) = input.image.get() else { return };
        let poses: Vec<EgoState> = input.poses.get().iter().map(|pose| **pose).collect();
        let before = poses.partition_point(|pose| pose.stamp <= image.stamp);
        let Some(measured) = poses[..before].last().or(poses.first()) else { return };
        let ego = measured.pose_after((image.stamp - measured.stamp).as_secs());
        let pitch_rad = pitch_rad(&poses[..before], &self.vehicle);
        let mut seen = TrafficLights::default();
        if let Err(why) = self.watch.look(&Shot { image, ego, pitch_rad, route: None }, &mut seen) {
            return cx.stop_run(format!("{}: {why}", cx.name()));
        }
        self.tell_truth(&mut seen);
        out.send(seen);
    }
}

impl Lights {
    /// With truth, keeps the lights in the image and their positions, and sets their true signals.
    fn tell_truth(&self, seen: &mut TrafficLights) {
        for light in &mut seen.lights {
            let known = self.truth.iter().flatten().find(|known| Some(&known.name) == light.name.as_ref());
            if let Some(known) = known {
                let signal = Some(known.signal(seen.stamp));
                (light.signal, light.seen, light.score) = (signal, signal, 1.0);
            }
        }
    }
}
