//! Appearance of a scenario's world: its road, scenery and actors, as a scene for rendering.
//!
//! Images show the simulated world with scenery around it: houses, trees and lamps beyond the drivable ground and clear
//! of all actors' starts and paths. The scenery is drawn from the seed; it collides with nothing and occludes nothing
//! for truth sensing.

mod scenery;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::sync::Arc;

use swerve_core::Rng;
use swerve_geom::{Point, Point2, Polyline, Transform};
use swerve_msg::truth::{Actor, EgoTruth, WorldState};
use swerve_msg::{ActorId, ActorKind};
use swerve_scenario::{Aspect, Course, PAVEMENT_M, Scenario, Strip, TrafficLight};
use swerve_scene::{
    Instance, Kind, Light, Model, Motion, RoadLayout, Scene, SideOfRoad, Size, WeatherPreset, add_map, lamps,
    road_pieces, walk_phase,
};
use swerve_vehicle::Shape;

/// Id of the ego in instance images; actors have other ids.
pub const EGO_INSTANCE: u32 = 0xffff;

/// Length of the road beyond both ends, metres.
const BEYOND_M: f64 = 80.0;
/// Speed below which a person stands, m/s.
const STANDS_MPS: f64 = 0.15;

/// A scenario's world as a scene.
pub struct Street {
    /// Shared with renderers of earlier states.
    scene: Arc<Scene>,
    /// Random bits of each actor's look, and its start position.
    actors: BTreeMap<ActorId, (u64, Point2)>,
    ego: Model,
    /// Traffic lights with their lamps off, and the signals that switch them.
    lights: Vec<(Instance, TrafficLight)>,
    /// Distance from the ego's origin to the middle of its body, metres.
    ego_ahead_m: f64,
    /// Number of lights along the road; lights of vehicles follow.
    fixed_lights: usize,
}

impl Street {
    /// Builds the road and its scenery; `show` adds the actors.
    pub fn new(scenario: &Scenario, ego: &Shape, weather: WeatherPreset, seed: u64) -> Self {
        let mut scene = Scene::new(weather);
        let line = scenario.road.line();
        let look = |id: ActorId| Rng::keyed(seed, "look", &[i64::from(id.0)]).bits();
        let actors = scenario.actors.iter().map(|a| (a.id, (look(a.id), a.pose(&line).point()))).collect();
        match &scenario.road.course {
            Course::Strip(strip) => {
                road(&mut scene, strip, &scenario.road.lights, seed);
                scenery::add(&mut scene, scenario, strip, seed);
            }
            Course::Map(course) => add_map(&mut scene, &course.map, seed),
        }
        let size = Size::from_m(ego.length_m, ego.width_m, ego.height_m);
        let model = scene.meshes.model_sized(Kind::Sedan, size, look(ActorId::EGO));
        let fixed_lights = scene.lights.len();
        let lights = traffic_lights(&mut scene, scenario);
        let scene = Arc::new(scene);
        Self { scene, actors, ego: model, lights, ego_ahead_m: ego.center_ahead_m(), fixed_lights }
    }

    /// Scene of the state shown last.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The same, for rendering while later states are shown.
    pub(crate) fn shared(&self) -> Arc<Scene> {
        self.scene.clone()
    }

    /// Moves everything to its pose in `world`: a function of that state only.
    pub fn show(&mut self, world: &WorldState) {
        let scene = Arc::make_mut(&mut self.scene);
        scene.dynamics.clear();
        scene.lights.truncate(self.fixed_lights);
        let ego = &world.ego;
        let middle: Transform<swerve_geom::Ego, swerve_scene::Body> =
            Transform::from_roll_pitch_yaw(Point::new(self.ego_ahead_m, 0.0, 0.0), 0.0, 0.0, 0.0);
        let mut instance = Instance::placed(&self.ego, ego.map_from_ego * middle).with_id(EGO_INSTANCE);
        instance.motion = motion_of(ego);
        put_vehicle(scene, instance, self.ego);
        for (light, switch) in &self.lights {
            let lamps: &[u8] = match switch.aspect(world.stamp) {
                Aspect::Green => &[lamps::GREEN],
                Aspect::Yellow => &[lamps::YELLOW],
                Aspect::Red => &[lamps::RED],
                Aspect::RedYellow => &[lamps::RED, lamps::YELLOW],
                Aspect::Off => &[],
            };
            let look = lamps.iter().fold(light.look, |look, lamp| look.with_lamp(*lamp, true));
            scene.dynamics.push(Instance { look, ..*light });
        }
        for actor in &world.actors {
            put(scene, actor, self.actors.get(&actor.id).copied().unwrap_or((0, actor.pose.point())));
        }
    }
}

/// Adds an actor, given the random bits of its look and its start position.
fn put(scene: &mut Scene, actor: &Actor, (look, start): (u64, Point2)) {
    let (kind, size) = shape(actor, look, start);
    let model = match size {
        Some(size) => scene.meshes.model_sized(kind, size, look),
        None => scene.meshes.model(kind, look),
    };
    let at = Point::new(actor.pose.x_m, actor.pose.y_m, actor.z_m);
    let pose = Transform::from_roll_pitch_yaw(at, 0.0, 0.0, actor.pose.heading_rad);
    let mut instance = Instance::placed(&model, pose).with_id(actor.id.0);
    instance.motion.linear_mps = [actor.velocity_mps.x, actor.velocity_mps.y, 0.0];
    match actor.kind {
        ActorKind::Car | ActorKind::Truck | ActorKind::Motorcycle => put_vehicle(scene, instance, model),
        _ => scene.dynamics.push(instance),
    }
}

/// Adds a vehicle, with its lamps on if the weather requires it.
fn put_vehicle(scene: &mut Scene, mut instance: Instance, model: Model) {
    let on = scene.weather.lamps_on;
    instance.look = instance.look.with_lamp(lamps::HEAD, on).with_lamp(lamps::TAIL, on);
    if on {
        let front_m = 0.5 * f64::from(model.size.metres()[0]);
        scene.lights.extend(Light::head_lamps(&instance.map_from_body, front_m, 0.7));
    }
    scene.dynamics.push(instance);
}

/// Motion of the ego and of the cameras on it, in the map.
pub fn motion_of(ego: &EgoTruth) -> Motion {
    Motion {
        linear_mps: ego.velocity_mps.coords.into(),
        angular_radps: (ego.map_from_ego * ego.angular_velocity_radps).coords.into(),
    }
}

/// Shape of an actor. The gait of people follows the distance from their start.
fn shape(actor: &Actor, look: u64, start: Point2) -> (Kind, Option<Size>) {
    let extent = actor.extent;
    let size = Size::from_m(extent.length_m, extent.width_m, extent.height_m);
    let speed_mps = actor.velocity_mps.norm();
    let phase = walk_phase(start.distance(actor.pose.point()), extent.height_m);
    match actor.kind {
        ActorKind::Car if extent.height_m > 2.0 => (Kind::Van, Some(size)),
        ActorKind::Car => {
            let kinds = [Kind::Sedan, Kind::Hatchback, Kind::Suv];
            (kinds[(look % 3) as usize], Some(size))
        }
        ActorKind::Truck if extent.length_m > 9.5 => (Kind::Bus, Some(size)),
        ActorKind::Truck => (Kind::BoxTruck, Some(size)),
        ActorKind::Motorcycle => (Kind::Motorcycle, Some(size)),
        ActorKind::Cyclist => (Kind::Cyclist { phase }, Some(size)),
        ActorKind::Pedestrian => {
            let height_m = extent.height_m;
            let size = Size::from_m(0.62 * height_m, 0.36 * height_m, height_m);
            (if speed_mps < STANDS_MPS { Kind::Standing } else { Kind::Pedestrian { phase } }, Some(size))
        }
        ActorKind::Static => (Kind::Block, Some(size)),
    }
}

/// Traffic lights, facing the vehicles that they are for.
fn traffic_lights(scene: &mut Scene, scenario: &Scenario) -> Vec<(Instance, TrafficLight)> {
    let model = scene.meshes.model(Kind::TrafficLight, 1);
    let placed = |light: &TrafficLight| {
        let yaw_rad = light.pose.heading_rad + core::f64::consts::PI;
        (Instance::new(&model, light.pose.x_m, light.pose.y_m, yaw_rad), light.clone())
    };
    scenario.road.lights.iter().map(placed).collect()
}

/// The road with its markings, a lane's width apart, and the pavements beside it.
fn road(scene: &mut Scene, strip: &Strip, lights: &[TrafficLight], seed: u64) {
    let (left_m, right_m) = (strip.left_m as f32, strip.right_m as f32);
    let mut layout = RoadLayout::street(extended(&strip.line()), left_m, right_m);
    let dashes = layout.lines.pop().expect("a street has a middle line");
    let mut between_m =
        0.5 * strip.lane_width_m - strip.lane_width_m * ((strip.right_m / strip.lane_width_m).floor());
    while between_m < strip.left_m - 0.5 * strip.lane_width_m {
        if between_m > 0.5 * strip.lane_width_m - strip.right_m {
            layout.lines.push(swerve_scene::LaneLine { offset_m: between_m as f32, ..dashes });
        }
        between_m += strip.lane_width_m;
    }
    layout.left_side = SideOfRoad::Pavement { width_m: PAVEMENT_M as f32 };
    layout.right_side = layout.left_side;
    let stop_lines = lights.iter().filter_map(|light| light.stop_s_m);
    layout.stop_lines_m = stop_lines.map(|stop_s_m| (BEYOND_M + stop_s_m) as f32).collect();
    for piece in road_pieces(&layout, seed) {
        scene.add_piece(piece);
    }
}

/// Centre line, extended straight beyond both ends.
fn extended(line: &Polyline) -> Vec<Point2> {
    let beyond = |s_m: f64| line.at(s_m).pose.point();
    let mut points = vec![beyond(-BEYOND_M)];
    points.extend_from_slice(line.points());
    points.push(beyond(line.length() + BEYOND_M));
    points
}
