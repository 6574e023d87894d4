//! Ride at a given speed along a straight road between pedestrians, and its perception.

use std::collections::BTreeMap;
use swerve_stack::config::Config;

use anyhow::{Context as _, anyhow, bail, ensure};
use swerve_camera::{Camera, Frame, Outputs, Renderer, View};
use swerve_core::{Rng, Time};
use swerve_geom::{Ego, Point, Point2, Pose2, Transform, Vector};
use swerve_measure::labels::{VISIBLE_SHARE_MIN, street_mask_of, true_box};
use swerve_msg::truth::{EgoTruth, Surroundings, WorldState};
use swerve_msg::{ActorId, ActorKind, Command, DetectedBox, Detections, Extent, Image};
use swerve_perception::Detector;
use swerve_perception::camera::CameraDetector;
use swerve_perception::camera::Shot;
use swerve_perception::detector::Sensing;
use swerve_perception::image_box::ImageCamera;
use swerve_perception::image_plane::{ByteTrack, ImageDetection, ImageTracker, Sort};
use swerve_scenario::{Actor, Course, Direction, Motion, PAVEMENT_M, Scenario, Segment, Strip, Vary};
use swerve_sim::{SimParams, Simulator};
use swerve_stack::Setup;
use swerve_stack::config::camera::CameraConfig;
use swerve_stack::config::camera_detectors::{self, CameraObjectsTable};
use swerve_stack::config::perception::image_camera;
use swerve_stack::street::{EGO_INSTANCE, Street};
use swerve_stack::{ObstacleSight, span_of_ms};
use swerve_text::{in_one_line, number};
use swerve_vision::Rgb;
use swerve_vision::segmentation::Segmenter;

use crate::tables::{Measure, Timely};

/// Walking speed: that of Pylot's `ManyPedestrians`.
const WALK_MPS: f64 = 1.4;
/// Distance of pedestrians from the edges of the pavement, metres.
const FROM_EDGE_M: f64 = 0.4;

/// The road of a scenario made straight, with pedestrians on its pavements and no other actors.
///
/// Their positions, sides and directions are drawn from the seed, all uniformly.
pub(super) fn crowd(scenario: &Scenario, timely: &Timely, seed: u64) -> Scenario {
    let mut straight = scenario.clone();
    let (route, s_m) = (scenario.road.route(), scenario.ego.s_m);
    let (left_m, right_m) = (route.left_m(s_m), route.right_m(s_m));
    straight.road.course = Course::Strip(Strip {
        segments: vec![Segment { length_m: timely.length_m, curvature_1pm: 0.0 }],
        lane_width_m: scenario.road.lane_width_m(s_m),
        left_m,
        right_m,
    });
    straight.road.lights.clear();
    (straight.expect, straight.draws, straight.end.standstill) = (Vec::new(), None, None);
    let ego = &mut straight.ego;
    (ego.s_m, ego.d_m, ego.heading_rad, ego.start_speed_mps) = (0.0, 0.0, 0.0, Some(0.0));
    ego.end_m = timely.length_m;
    let person = |k: u32| {
        let mut rng = Rng::keyed(seed, "walker", &[i64::from(k)]);
        let s_m = rng.uniform(0.0, timely.length_m);
        let beyond_m = rng.uniform(FROM_EDGE_M, PAVEMENT_M - FROM_EDGE_M);
        let d_m = if rng.below(2) == 0 { left_m + beyond_m } else { -right_m - beyond_m };
        let direction = if rng.below(2) == 0 { Direction::Ahead } else { Direction::Back };
        Actor {
            id: ActorId(k + 1),
            name: format!("walker {}", k + 1),
            kind: ActorKind::Pedestrian,
            extent: Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 },
            mass_kg: 75.0,
            line: None,
            s_m,
            d_m,
            heading_rad: 0.0,
            trigger: None,
            motion: vec![Motion::Walk { speed_mps: WALK_MPS, distance_m: 1e4, direction, turn_rad: 0.0 }],
            vary: Vary::default(),
        }
    };
    straight.actors = (0..timely.walkers).map(person).collect();
    straight
}

/// World from frame to frame. The simulator moves the pedestrians; the ego moves at the given speed.
pub(super) struct Ride {
    simulator: Simulator,
    started: bool,
    speed_mps: f64,
    /// Stamps of the frames: every step of the world until the ego reaches the end of the road.
    pub(super) frames: Vec<Time>,
}

impl Ride {
    pub(super) fn new(timely: &Timely, config: &Setup, scenario: &Scenario) -> anyhow::Result<Self> {
        let speed_mps = speed_mps(config, scenario)?;
        let params = SimParams { dt: span_of_ms(config.sim.dt_ms), vehicle: config.sim.vehicle.clone() };
        let scenario = crowd(scenario, timely, config.seed);
        let simulator = Simulator::exact(scenario, &params)?;
        let steps = (timely.length_m / speed_mps / params.dt.as_secs()) as i64;
        let frames = (0..=steps).map(|k| Time::ZERO + params.dt * k).collect();
        Ok(Self { simulator, started: false, speed_mps, frames })
    }

    /// Returns the world at the next frame.
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

/// Places the ego as at a constant speed from the start of the road.
fn forced(world: &mut WorldState, speed_mps: f64) {
    let x_m = speed_mps * world.stamp.as_secs();
    let EgoTruth { state, .. } = &mut world.ego;
    (state.pose, state.speed_mps) = (Pose2::new(x_m, 0.0, 0.0), speed_mps);
    world.ego.map_from_ego = Transform::from_roll_pitch_yaw(Point::new(x_m, 0.0, 0.0), 0.0, 0.0, 0.0);
    world.ego.velocity_mps = Vector::new(speed_mps, 0.0, 0.0);
}

/// Identity and box edges: left, top, right, bottom, pixels.
pub(super) type Boxed = (u64, [f64; 4]);

/// Perception of one frame; parts that no measure needs are empty.
#[derive(Default)]
pub(super) struct Sight {
    /// Class of each pixel.
    pub(super) labels: Vec<u8>,
    /// Class of each pixel, in the classes of the segmentation.
    pub(super) grouped: Vec<u8>,
    /// Output of the segmentation.
    pub(super) segmented: Vec<u8>,
    /// Boxes around the pixels of pedestrians.
    pub(super) people: Vec<Boxed>,
    /// True boxes of pedestrians, and true for those that count.
    pub(super) wanted: Vec<(Boxed, bool)>,
    /// Boxes of the detector, and true for those that count.
    pub(super) found: Vec<(ImageDetection, bool)>,
    /// Tracks of SORT and of ByteTrack.
    pub(super) tracks: [Vec<Boxed>; 2],
}

/// Sensors and perception: rendered truth, a detector's boxes, or both.
pub(super) struct Eyes {
    pixels: Option<Pixels>,
    boxes: Option<Boxes>,
    within_m: f64,
}

struct Pixels {
    street: Street,
    renderer: Renderer,
    camera: Camera,
    ego_from_camera: Transform<Ego, swerve_geom::Camera>,
    frame: Frame,
    /// Group id of each Cityscapes id, if groups are needed.
    mask_of: Option<[u8; 256]>,
    forest: Option<Segmenter>,
}

struct Boxes {
    sight: ObstacleSight,
    camera: ImageCamera,
    source: Source,
    trackers: Option<(Sort, ByteTrack)>,
}

/// Source of the boxes.
enum Source {
    /// Detector that `perception.detector` emulates.
    Emulated(Box<Detector>),
    /// Operator of the kind `camera_objects`, on the colours of its camera.
    Images(Box<(Box<dyn CameraDetector>, Pixels)>),
}

impl Eyes {
    pub(super) fn new(timely: &Timely, config: &Setup, ride: &Ride) -> anyhow::Result<Self> {
        let asks = |of: &[Measure]| timely.measures.iter().any(|measure| of.contains(measure));
        let tracks = asks(&[Measure::Sort, Measure::Bytetrack]);
        let forest = asks(&[Measure::ForestMiou]);
        let groups = forest || asks(&[Measure::GroupedMiou]);
        let pixels = (groups || asks(&[Measure::Miou, Measure::Ap50]))
            .then(|| Pixels::new(config, ride, groups, forest))
            .transpose()?;
        let boxes = (tracks || asks(&[Measure::DetectorAp50]))
            .then(|| Boxes::new(config, ride, tracks))
            .transpose()?;
        Ok(Self { pixels, boxes, within_m: timely.within_m })
    }

    /// Perceives a frame. Frames must be in order. Trackers are updated only at frames that are due; colours are
    /// rendered only for frames that are perceived, rather than used as ground truth alone.
    pub(super) fn look(&mut self, world: &WorldState, is_due: bool, is_seen: bool) -> anyhow::Result<Sight> {
        let mut sight = Sight::default();
        if let Some(pixels) = &mut self.pixels {
            pixels.look(world, self.within_m, &mut sight)?;
            if is_seen {
                pixels.segment(world, &mut sight)?;
            }
        }
        if let Some(boxes) = &mut self.boxes {
            boxes.look(world, self.within_m, is_seen, &mut sight)?;
            if is_due {
                boxes.track(&mut sight);
            }
        }
        Ok(sight)
    }
}

impl Pixels {
    fn new(config: &Setup, ride: &Ride, groups: bool, forest: bool) -> anyhow::Result<Self> {
        let mounted = the_camera(config)?;
        let shape = &config.sim.vehicle.shape;
        let street = Street::new(ride.simulator.scenario(), shape, config.render.weather, config.seed);
        let renderer = config.render.renderer(1)?;
        let camera = mounted.camera(0)?;
        let frame = Frame::new(&camera, Outputs::GEOMETRY);
        let forest = forest.then(|| segmenter(mounted)).transpose()?;
        let mask_of = groups.then(street_mask_of);
        let ego_from_camera = mounted.ego_from_camera();
        Ok(Self { street, renderer, camera, ego_from_camera, frame, mask_of, forest })
    }

    fn look(&mut self, world: &WorldState, within_m: f64, sight: &mut Sight) -> anyhow::Result<()> {
        self.street.show(world);
        let view = view(&self.camera, world, self.ego_from_camera);
        self.renderer.render(self.street.scene(), &view, self.frame.as_mut())?;
        sight.labels.clone_from(&self.frame.semantic);
        if let Some(mask_of) = &self.mask_of {
            sight.grouped = sight.labels.iter().map(|id| mask_of[usize::from(*id)]).collect();
        }
        sight.people = people(&self.frame, world, within_m);
        Ok(())
    }

    /// Runs the segmentation, if needed, on the colours of the world.
    fn segment(&mut self, world: &WorldState, sight: &mut Sight) -> anyhow::Result<()> {
        if self.forest.is_none() {
            return Ok(());
        }
        let colours = self.colours(world)?;
        sight.segmented = vec![0; sight.labels.len()];
        let Some(forest) = &mut self.forest else { return Ok(()) };
        let image = Rgb::new(self.camera.width_px(), self.camera.height_px(), &colours)?;
        Ok(forest.segment(image, &mut sight.segmented)?)
    }

    /// Red, green and blue of each pixel.
    fn colours(&mut self, world: &WorldState) -> anyhow::Result<Vec<u8>> {
        self.street.show(world);
        let mut colours = Frame::new(&self.camera, Outputs::RGB);
        let view = view(&self.camera, world, self.ego_from_camera);
        self.renderer.render(self.street.scene(), &view, colours.as_mut())?;
        Ok(colours.rgb)
    }
}

/// View from the camera, with the ego itself hidden.
fn view<'a>(
    camera: &'a Camera,
    world: &WorldState,
    ego_from_camera: Transform<Ego, swerve_geom::Camera>,
) -> View<'a> {
    let map_from_camera = world.ego.map_from_ego * ego_from_camera;
    View { hidden_instance: Some(EGO_INSTANCE), ..View::new(camera, map_from_camera) }
}

/// The only camera of the configuration.
fn the_camera(config: &Setup) -> anyhow::Result<&CameraConfig> {
    let mut cameras = config.camera.values();
    let (Some(mounted), None) = (cameras.next(), cameras.next()) else {
        bail!("camera: expected one camera to draw the images of, found {}", config.camera.len());
    };
    Ok(mounted)
}

/// Built-in segmentation for images of a camera.
fn segmenter(mounted: &CameraConfig) -> anyhow::Result<Segmenter> {
    let weights = camera_detectors::segmentation("street").map_err(|message| anyhow!(message))?;
    let camera = image_camera(mounted).context("camera: expected one with a lens")?;
    let size = [camera.width_px, camera.height_px].map(|px| px as usize);
    Ok(Segmenter::new(weights, size, camera_detectors::ground(&camera.info)))
}

/// Boxes around the pixels of pedestrians that are at most this far away.
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

impl Boxes {
    fn new(config: &Setup, ride: &Ride, tracks: bool) -> anyhow::Result<Self> {
        let trackers = tracks.then(Default::default);
        let lens = |mounted: &CameraConfig| image_camera(mounted).context("camera: expected one with a lens");
        if let Some(table) = CameraObjectsTable::first(config) {
            let mounted = the_camera(config)?;
            let objects = table.detector(&config.registry);
            let objects =
                objects.map_err(|found| anyhow!("operator.camera_objects: {}", in_one_line(&found)))?;
            let source = Source::Images(Box::new((objects, Pixels::new(config, ride, false, false)?)));
            let sight = ObstacleSight::new(config, Some(mounted));
            return Ok(Self { sight, camera: lens(mounted)?, source, trackers });
        }
        let emulated = config
            .perception
            .emulated()
            .map_err(|found| anyhow!("perception: {}", in_one_line(&found)))?
            .ok_or_else(|| anyhow!("perception.detector: expected one to emulate, found `truth`"))?;
        ensure!(
            emulated.sensing == Sensing::Camera,
            "perception.detector: expected one that looks with a camera"
        );
        let mounted = config.detector_camera(emulated.sensing).context("perception.camera: no camera")?;
        let camera = lens(&mounted)?;
        let source = Source::Emulated(Box::new(Detector::new(
            emulated.params,
            Some(camera),
            config.seed,
            "detector",
        )?));
        Ok(Self { sight: ObstacleSight::new(config, Some(&mounted)), camera, source, trackers })
    }

    fn look(
        &mut self,
        world: &WorldState,
        within_m: f64,
        is_seen: bool,
        sight: &mut Sight,
    ) -> anyhow::Result<()> {
        let seen = self.sight.surroundings(world);
        let is_near = |b: &DetectedBox| b.pose.point().distance(Point2::default()) <= within_m;
        sight.wanted = wanted(&seen, &self.camera, is_near);
        let found = match &mut self.source {
            Source::Emulated(detector) => detector.detect(&seen).boxes,
            Source::Images(_) if !is_seen => Vec::new(),
            Source::Images(eye) => {
                let (objects, pixels) = &mut **eye;
                let image = Image {
                    stamp: world.stamp,
                    width_px: self.camera.width_px,
                    height_px: self.camera.height_px,
                    camera: self.camera.info,
                    pixels: swerve_msg::Pixels::Rgb8(pixels.colours(world)?.into()),
                };
                let shot = Shot { image: &image, ego: world.ego.state.pose, pitch_rad: 0.0, route: None };
                let mut found = Detections::default();
                objects.detect(&shot, None, &mut found)?;
                found.boxes
            }
        };
        sight.found = found
            .into_iter()
            .filter(|b| b.kind == ActorKind::Pedestrian)
            .filter_map(|b| Some((ImageDetection { box_px: b.image_px?, score: b.score }, is_near(&b))))
            .collect();
        Ok(())
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

/// True boxes of the pedestrians in the image; those that are near and mostly visible count.
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

/// Speed imposed on the ego, m/s.
fn speed_mps(config: &Config, scenario: &Scenario) -> anyhow::Result<f64> {
    let speed_mps = config.ego.speed_mps.unwrap_or(scenario.ego.target_speed_mps);
    ensure!(speed_mps > 0.0, "ego.speed_mps: expected a speed above 0, found {}", number(speed_mps));
    Ok(speed_mps)
}
