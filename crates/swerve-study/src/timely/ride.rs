//! A ride at a given speed along a straight between people who walk, and what is seen on it.

use std::collections::BTreeMap;

use anyhow::{Context as _, anyhow, bail, ensure};
use swerve_camera::{Camera, Frame, Outputs, Renderer, View};
use swerve_core::{Rng, Time};
use swerve_geom::{Ego, Point, Point2, Pose2, Transform, Vector};
use swerve_msg::truth::{EgoTruth, Surroundings, WorldState};
use swerve_msg::{ActorKind, Command, DetectedBox, Extent};
use swerve_perception::Detector;
use swerve_perception::detector::Sensing;
use swerve_perception::image_box::ImageCamera;
use swerve_perception::image_plane::{ByteTrack, ImageDetection, ImageTracker, Sort};
use swerve_scenario::{Actor, Direction, Motion, PAVEMENT_M, Scenario, Segment};
use swerve_sim::{SimParams, Simulator};
use swerve_stack::config::Config;
use swerve_stack::config::camera::RenderConfig;
use swerve_stack::config::perception::image_camera;
use swerve_stack::street::{EGO_INSTANCE, Street};
use swerve_stack::{ObstacleSight, span_of_ms};

use super::{Measure, Timely, speed_mps};
use crate::calibrate::detector::{VISIBLE_SHARE_MIN, true_box};

/// Speed of the people: Pylot's `ManyPedestrians`.
const WALK_MPS: f64 = 1.4;
/// A person keeps this far from the edges of the pavement, metres.
const FROM_EDGE_M: f64 = 0.4;

/// The road of a scenario made straight, with people on its pavements and nobody else.
///
/// Their places, sides and ways are drawn from the seed, each uniformly.
pub(super) fn crowd(scenario: &Scenario, timely: &Timely, seed: u64) -> Scenario {
    let mut straight = scenario.clone();
    straight.road.segments = vec![Segment { length_m: timely.length_m, curvature_1pm: 0.0 }];
    straight.road.lights.clear();
    (straight.expect, straight.draws, straight.end.standstill) = (Vec::new(), None, None);
    let ego = &mut straight.ego;
    (ego.s_m, ego.d_m, ego.heading_rad, ego.start_speed_mps) = (0.0, 0.0, 0.0, Some(0.0));
    ego.end_m = timely.length_m;
    let (left_m, right_m) = (straight.road.left_m, straight.road.right_m);
    let person = |k: usize| {
        let mut rng = Rng::keyed(seed, "walker", &[k as i64]);
        let s_m = rng.uniform(0.0, timely.length_m);
        let beyond_m = rng.uniform(FROM_EDGE_M, PAVEMENT_M - FROM_EDGE_M);
        let d_m = if rng.below(2) == 0 { left_m + beyond_m } else { -right_m - beyond_m };
        let direction = if rng.below(2) == 0 { Direction::Ahead } else { Direction::Back };
        Actor {
            name: format!("walker {}", k + 1),
            kind: ActorKind::Pedestrian,
            extent: Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 },
            mass_kg: 75.0,
            s_m,
            d_m,
            heading_rad: 0.0,
            trigger: None,
            motion: vec![Motion::Walk { speed_mps: WALK_MPS, distance_m: 1e4, direction }],
        }
    };
    straight.actors = (0..timely.walkers).map(person).collect();
    straight
}

/// The world from frame to frame. People move as the simulator has them; the ego is where its speed puts it.
pub(super) struct Ride {
    simulator: Simulator,
    started: bool,
    speed_mps: f64,
    /// The instants of its frames: every step of the world until the ego has come to the end of the road.
    pub(super) frames: Vec<Time>,
}

impl Ride {
    pub(super) fn new(timely: &Timely, config: &Config, scenario: &Scenario) -> anyhow::Result<Self> {
        let speed_mps = speed_mps(config, scenario)?;
        let params = SimParams { dt: span_of_ms(config.sim.dt_ms), vehicle: config.sim.vehicle.clone() };
        let scenario = crowd(scenario, timely, config.seed);
        let simulator = Simulator::exact(scenario, &params)?;
        let steps = (timely.length_m / speed_mps / params.dt.as_secs()) as i64;
        let frames = (0..=steps).map(|k| Time::ZERO + params.dt * k).collect();
        Ok(Self { simulator, started: false, speed_mps, frames })
    }

    /// The world at the next frame.
    pub(super) fn next(&mut self) -> WorldState {
        if self.started {
            self.simulator.step(Command::default());
        }
        self.started = true;
        let mut world = self.simulator.state().clone();
        forced(&mut world, self.speed_mps);
        world
    }
}

/// Puts the ego where it is at a constant speed from the road's start.
fn forced(world: &mut WorldState, speed_mps: f64) {
    let x_m = speed_mps * world.stamp.as_secs();
    let EgoTruth { state, .. } = &mut world.ego;
    (state.pose, state.speed_mps) = (Pose2::new(x_m, 0.0, 0.0), speed_mps);
    world.ego.map_from_ego = Transform::from_roll_pitch_yaw(Point::new(x_m, 0.0, 0.0), 0.0, 0.0, 0.0);
    world.ego.velocity_mps = Vector::new(speed_mps, 0.0, 0.0);
}

/// An identity and the edges of its box: left, top, right, bottom, pixels.
pub(super) type Boxed = (u64, [f64; 4]);

/// What is seen of one frame; what no measure asks for is empty.
#[derive(Default)]
pub(super) struct Sight {
    /// Class of each pixel.
    pub(super) labels: Vec<u8>,
    /// People's pixels, boxed.
    pub(super) people: Vec<Boxed>,
    /// People by their true boxes, and whether they count.
    pub(super) wanted: Vec<(Boxed, bool)>,
    /// What the emulated detector reports, and whether that counts.
    pub(super) found: Vec<(ImageDetection, bool)>,
    /// Tracks of SORT and of ByteTrack.
    pub(super) tracks: [Vec<Boxed>; 2],
}

/// What looks: at rendered truth, at the emulated detector's boxes, or at both.
pub(super) struct Eyes {
    pixels: Option<Pixels>,
    emulated: Option<Emulated>,
    within_m: f64,
}

struct Pixels {
    street: Street,
    renderer: Renderer,
    camera: Camera,
    ego_from_camera: Transform<Ego, swerve_geom::Camera>,
    frame: Frame,
}

struct Emulated {
    sight: ObstacleSight,
    camera: ImageCamera,
    detector: Detector,
    trackers: Option<(Sort, ByteTrack)>,
}

impl Eyes {
    pub(super) fn new(timely: &Timely, config: &Config, ride: &Ride) -> anyhow::Result<Self> {
        let asks = |of: &[Measure]| timely.measures.iter().any(|measure| of.contains(measure));
        let tracks = asks(&[Measure::Sort, Measure::Bytetrack]);
        let pixels = asks(&[Measure::Miou, Measure::Ap50]).then(|| Pixels::new(config, ride)).transpose()?;
        let emulated =
            (tracks || asks(&[Measure::DetectorAp50])).then(|| Emulated::new(config, tracks)).transpose()?;
        Ok(Self { pixels, emulated, within_m: timely.within_m })
    }

    /// What there is to see. Frames come in their order; trackers go on at those that are due.
    pub(super) fn look(&mut self, world: &WorldState, is_due: bool) -> anyhow::Result<Sight> {
        let mut sight = Sight::default();
        if let Some(pixels) = &mut self.pixels {
            pixels.look(world, self.within_m, &mut sight)?;
        }
        if let Some(emulated) = &mut self.emulated {
            emulated.look(world, self.within_m, &mut sight);
            if is_due {
                emulated.track(&mut sight);
            }
        }
        Ok(sight)
    }
}

impl Pixels {
    fn new(config: &Config, ride: &Ride) -> anyhow::Result<Self> {
        let mut cameras = config.camera.values();
        let (Some(mounted), None) = (cameras.next(), cameras.next()) else {
            bail!("camera: expected one camera for rendered truth, found {}", config.camera.len());
        };
        let shape = &config.sim.vehicle.shape;
        let street = Street::new(ride.simulator.scenario(), shape, config.render.weather, config.seed);
        let renderer = RenderConfig { threads: 1, ..config.render }.renderer()?;
        let camera = mounted.camera(0)?;
        let frame = Frame::new(&camera, Outputs::GEOMETRY);
        Ok(Self { street, renderer, camera, ego_from_camera: mounted.ego_from_camera(), frame })
    }

    fn look(&mut self, world: &WorldState, within_m: f64, sight: &mut Sight) -> anyhow::Result<()> {
        self.street.show(world);
        let view = View {
            hidden_instance: Some(EGO_INSTANCE),
            ..View::new(&self.camera, world.ego.map_from_ego * self.ego_from_camera)
        };
        self.renderer.render(self.street.scene(), &view, self.frame.as_mut())?;
        sight.labels.clone_from(&self.frame.semantic);
        sight.people = people(&self.frame, world, within_m);
        Ok(())
    }
}

/// Boxes of the pixels of people who have one that is no farther away than this.
fn people(frame: &Frame, world: &WorldState, within_m: f64) -> Vec<Boxed> {
    let mut edges = BTreeMap::<u32, [usize; 4]>::new();
    let width = frame.width_px.max(1);
    for (at, (&id, &depth_m)) in frame.instance.iter().zip(&frame.depth_m).enumerate() {
        if id != 0 && f64::from(depth_m) <= within_m {
            let (x, y) = (at % width, at / width);
            let [left, top, right, bottom] = edges.entry(id).or_insert([x, y, x + 1, y + 1]);
            (*left, *right, *top, *bottom) = (x.min(*left), (x + 1).max(*right), y.min(*top), y + 1);
        }
    }
    let is_person = |id: u32| world.actors.iter().any(|a| a.id.0 == id && a.kind == ActorKind::Pedestrian);
    let boxed = |(id, edges): (u32, [usize; 4])| {
        is_person(id).then(|| (u64::from(id), edges.map(|edge| edge as f64)))
    };
    edges.into_iter().filter_map(boxed).collect()
}

impl Emulated {
    fn new(config: &Config, tracks: bool) -> anyhow::Result<Self> {
        let emulated = config
            .perception
            .emulated()
            .map_err(|(key, message)| anyhow!("perception.{key}: {message}"))?
            .ok_or_else(|| anyhow!("perception.detector: expected one to emulate, found `truth`"))?;
        ensure!(
            emulated.sensing == Sensing::Camera,
            "perception.detector: expected one that looks with a camera"
        );
        let mounted = config.detector_camera(emulated.sensing).context("perception.camera: no camera")?;
        let camera = image_camera(&mounted).context("perception.camera: expected a camera with a lens")?;
        let detector = Detector::new(emulated.params, Some(camera), config.seed, "detector")?;
        let trackers = tracks.then(Default::default);
        Ok(Self { sight: ObstacleSight::new(config, Some(&mounted)), camera, detector, trackers })
    }

    fn look(&mut self, world: &WorldState, within_m: f64, sight: &mut Sight) {
        let seen = self.sight.surroundings(world);
        let is_near = |b: &DetectedBox| b.pose.point().distance(Point2::default()) <= within_m;
        sight.wanted = wanted(&seen, &self.camera, is_near);
        let found = self.detector.detect(&seen).boxes.into_iter();
        sight.found = found
            .filter(|b| b.kind == ActorKind::Pedestrian)
            .filter_map(|b| Some((ImageDetection { box_px: b.image_px?, score: b.score }, is_near(&b))))
            .collect();
    }

    fn track(&mut self, sight: &mut Sight) {
        if let Some((sort, byte_track)) = &mut self.trackers {
            let found: Vec<ImageDetection> = sight.found.iter().map(|(found, _)| *found).collect();
            let boxed = |tracker: &mut dyn ImageTracker| {
                tracker.update(&found).into_iter().map(|track| (track.id, track.box_px)).collect()
            };
            sight.tracks = [boxed(sort), boxed(byte_track)];
        }
    }
}

/// The true boxes of the people with a picture; those count that are near and not mostly hidden.
fn wanted(
    seen: &Surroundings,
    camera: &ImageCamera,
    is_near: impl Fn(&DetectedBox) -> bool,
) -> Vec<(Boxed, bool)> {
    let one = |obstacle: &swerve_msg::Obstacle| {
        let truth = true_box(obstacle, seen, Some(camera));
        let counts = is_near(&truth) && obstacle.visible_share >= VISIBLE_SHARE_MIN;
        Some(((u64::from(obstacle.id.0), truth.image_px?), counts))
    };
    seen.obstacles.iter().filter(|o| o.kind == ActorKind::Pedestrian).filter_map(one).collect()
}
