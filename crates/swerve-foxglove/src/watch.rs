//! Observes a run: the view, rate and topic of each payload type.

use std::collections::VecDeque;
use std::sync::Arc;

use foxglove::messages::LocationFix;
use foxglove::messages::location_fix::PositionCovarianceType;
use swerve_core::{Span, Time};
use swerve_flow::{Dispatcher, Event, Payload, Publication};
use swerve_geom::{Ego, Map, Point, Pose2, Transform, Vector2};
use swerve_log::{View, Views};
use swerve_msg::truth::WorldState;
use swerve_msg::{
    Command, Decision, Detections, Driving, EgoState, Encoding, GateMode, GateOutput, Gnss, Image, Lanes,
    ObstacleList, Pixels, Plan, PlanStatus, PointCloud, PredictionList, RadarScan, TrackList, TrafficLights,
};

use crate::camera::{self, Believed, Header};
use crate::cloud::{self, Motion};
use crate::figures::Figures;
use crate::form::{MAP, Outbox, When, name_of, timestamp};
use crate::setup::Setup;
use crate::words::Line;
use crate::{scene, words};

/// Period of ego poses and of rows of figures.
const POSE_PERIOD: Span = Span::from_ms(20);
/// Period of views of the other actors.
const ACTORS_PERIOD: Span = Span::from_ms(50);
/// Duration for which poses and obstacles are kept, for images and points that arrive after they were measured.
const MEMORY: Span = Span::from_ms(1000);

/// Observer of a run that publishes its messages as views.
pub struct Foxglove {
    watch: Dispatcher<Watch>,
}

/// State of the observed run, and the resulting messages.
pub(crate) struct Watch {
    setup: Setup,
    pub(crate) out: Outbox,
    poses: Throttle,
    actors: Throttle,
    /// Recent poses of the ego, oldest first.
    past: VecDeque<(Time, Transform<Map, Ego>)>,
    /// Recent reports of the obstacle sensor, oldest first.
    seen: VecDeque<Arc<ObstacleList>>,
    plan: Option<Plan>,
    status: Option<PlanStatus>,
    driving: Driving,
    gate: Option<GateMode>,
    command: Command,
    /// Commands that no world step has applied yet: instant of visibility, and stamp of the sensor frame.
    waiting: VecDeque<(Time, Option<Time>)>,
    response_ms: f64,
    has_ended: bool,
}

/// Rate limiter with a regular period.
#[derive(Default)]
struct Throttle {
    next: Time,
}

impl Throttle {
    /// Returns true if the period has passed.
    fn is_due(&mut self, now: Time, period: Span) -> bool {
        let is_due = now >= self.next;
        if is_due {
            self.next = now + period;
        }
        is_due
    }
}

impl Foxglove {
    /// Creates the observer of a run with these properties.
    pub fn new(setup: Setup) -> Self {
        let shows_images = setup.images.is_some();
        let mut watch = Dispatcher::new(Watch::new(setup))
            .on::<WorldState>(Watch::world)
            .on::<EgoState>(Watch::localized)
            .on::<Command>(Watch::command)
            .on::<Decision>(Watch::decision)
            .on::<GateOutput>(Watch::gate)
            .on::<ObstacleList>(Watch::obstacles)
            .on::<Plan>(Watch::plan)
            .on::<TrackList>(|watch, p, list| watch.scene("tracks", list, scene::tracks, When::new(p)))
            .on::<PredictionList>(|watch, p, list| {
                watch.scene("predictions", list, scene::predictions, When::new(p));
            })
            .on::<Lanes>(|watch, p, lanes| watch.scene(p.operator, lanes, scene::lanes, When::new(p)))
            .on::<Gnss>(|watch, p, fix| {
                let fix = *fix;
                watch.out.show("gnss", When::new(p), 0, move || Some(location(&fix)));
            })
            .on::<RadarScan>(Watch::radar)
            .on::<Detections>(|watch, p, found| watch.in_image(p, found, "detections", camera::detections))
            .on::<TrafficLights>(|watch, p, seen| {
                watch.in_image(p, seen, "traffic_lights", camera::traffic_lights);
            });
        if shows_images {
            // Not registered without viewers of images, so that the run does not wait for rendering.
            watch = watch.on::<PointCloud>(Watch::lidar).on::<Image>(Watch::image);
        }
        Self { watch }
    }

    /// Registers a handler for another payload type, or an additional one for a known type.
    pub(crate) fn also<T: Payload>(
        self,
        handler: impl FnMut(&mut Watch, &Publication<'_>, &T) + Send + 'static,
    ) -> Self {
        Self { watch: self.watch.on::<T>(handler) }
    }
}

impl Watch {
    fn new(setup: Setup) -> Self {
        Self {
            setup,
            out: Outbox::default(),
            poses: Throttle::default(),
            actors: Throttle::default(),
            past: VecDeque::new(),
            seen: VecDeque::new(),
            plan: None,
            status: None,
            driving: Driving::default(),
            gate: None,
            command: Command::default(),
            waiting: VecDeque::new(),
            response_ms: f64::NAN,
            has_ended: false,
        }
    }

    fn command(&mut self, p: &Publication<'_>, command: &Command) {
        self.command = *command;
        self.waiting.push_back((p.visible_at, p.origin));
    }

    fn decision(&mut self, p: &Publication<'_>, decision: &Decision) {
        if let (true, Some(state)) = (self.driving.take(decision), self.driving.state) {
            let because = self.driving.because_name(&self.setup.tracks);
            let line = words::behaviour(p.operator, When::new(p).stamp, state, because.as_deref());
            self.line(line, p.visible_at);
        }
    }

    fn gate(&mut self, p: &Publication<'_>, gate: &GateOutput) {
        if self.gate.replace(gate.mode) != Some(gate.mode) {
            self.line(words::gate(p.operator, When::new(p).stamp, gate.mode), p.visible_at);
        }
    }

    fn obstacles(&mut self, p: &Publication<'_>, list: &ObstacleList) {
        let stamp = When::new(p).stamp;
        self.seen.push_back(Arc::new(list.clone()));
        while self.seen.front().is_some_and(|old| stamp - old.stamp > MEMORY) {
            self.seen.pop_front();
        }
    }

    fn radar(&mut self, p: &Publication<'_>, scan: &RadarScan) {
        let (scan, sensor) = (scan.clone(), p.operator.to_owned());
        let topic = format!("{sensor}/points");
        self.out.show(&topic, When::new(p), 0, move || Some(cloud::radar(&sensor, &scan)));
    }

    fn lidar(&mut self, p: &Publication<'_>, cloud: &PointCloud) {
        let (cloud, sensor, motion) = (cloud.clone(), p.operator.to_owned(), self.motion(p.operator, cloud));
        let (topic, bytes) = (format!("{sensor}/points"), 22 * cloud.len());
        self.out.show(&topic, When::new(p), bytes, move || cloud::lidar(&sensor, &cloud, &motion));
    }

    /// Publishes the results of an operator in the images of a camera as an overlay.
    fn in_image<T: Clone + Send + 'static>(
        &mut self,
        p: &Publication<'_>,
        of: &T,
        name: &str,
        show: fn(&T) -> foxglove::messages::ImageAnnotations,
    ) {
        let camera = self.setup.detectors.iter().find(|(detector, _)| detector == p.operator);
        let Some((_, camera)) = camera.filter(|_| self.setup.images.is_some()) else { return };
        let (topic, of) = (format!("{camera}/{name}"), of.clone());
        self.out.show(&topic, When::new(p), 0, move || Some(show(&of)));
    }

    fn scene<T: Clone + Send + 'static>(
        &mut self,
        name: &str,
        of: &T,
        show: fn(&T) -> foxglove::messages::SceneUpdate,
        when: When,
    ) {
        let of = of.clone();
        self.out.show(name, when, 0, move || Some(show(&of)));
    }

    /// Publishes the ego at the pose of localization.
    fn localized(&mut self, p: &Publication<'_>, ego: &EgoState) {
        if !self.setup.ego_from_pose {
            return;
        }
        let when = When::new(p);
        let place = Point::new(ego.pose.x_m, ego.pose.y_m, 0.0);
        let pose = Transform::from_roll_pitch_yaw(place, 0.0, 0.0, ego.pose.heading_rad);
        self.is_at(pose, when);
        if self.poses.is_due(when.stamp, POSE_PERIOD) {
            self.out.show("ego", when, 0, move || Some(scene::map_from_ego(when.stamp, pose)));
            let row = self.figures_of(ego, when.stamp);
            self.out.show("figures", when, 0, move || Some(row));
        }
    }

    /// Stores the pose of the ego; at the first pose, also publishes the static scene.
    fn is_at(&mut self, pose: Transform<Map, Ego>, when: When) {
        if self.past.is_empty() {
            let (setup, mounts, stamp) = (self.setup.clone(), self.setup.mounts.clone(), when.stamp);
            self.out.show("ground", when, 0, move || Some(scene::ground(stamp, &setup)));
            self.out.show("sensors", when, 0, move || Some(scene::ego_from_sensors(stamp, &mounts)));
        }
        self.past.push_back((when.stamp, pose));
        while self.past.front().is_some_and(|(old, _)| when.stamp - *old > MEMORY) {
            self.past.pop_front();
        }
    }

    fn world(&mut self, p: &Publication<'_>, world: &WorldState) {
        let (when, pose) = (When::new(p), world.ego.map_from_ego);
        self.is_at(pose, when);
        let taken = self.waiting.partition_point(|(visible_at, _)| *visible_at < when.stamp);
        if let Some((_, Some(origin))) = self.waiting.drain(..taken).next_back() {
            self.response_ms = (when.stamp + self.setup.dead_time - origin).as_ms();
        }
        if self.poses.is_due(when.stamp, POSE_PERIOD) {
            self.out.show("ego", when, 0, move || Some(scene::map_from_ego(when.stamp, pose)));
            let row = self.figures(world);
            self.out.show("figures", when, 0, move || Some(row));
        }
        if self.actors.is_due(when.stamp, ACTORS_PERIOD) {
            let (actors, names) = (world.actors.clone(), self.setup.actors.clone());
            self.out.show("actors", when, 0, move || Some(scene::actors(when.stamp, &actors, &names)));
        }
        let lines = words::world((p.operator, world), &self.setup.actors, self.has_ended);
        self.has_ended |= world.ended.is_some();
        lines.into_iter().for_each(|line| self.line(line, when.visible_at));
    }

    fn figures(&self, world: &WorldState) -> Figures {
        let outline = self.setup.shape.footprint(world.ego.state.pose);
        let ego = world.ego.velocity_mps.coords;
        let gaps = world.actors.iter().map(|actor| actor.gap_m(&outline));
        let velocity = Vector2::new(ego.x, ego.y);
        let contacts = world.actors.iter().filter_map(|actor| actor.time_to_contact_s(&outline, velocity));
        let or_nan = |least: f64| if least.is_finite() { least } else { f64::NAN };
        Figures {
            distance_m: or_nan(gaps.fold(f64::INFINITY, f64::min)),
            time_to_collision_s: or_nan(contacts.fold(f64::INFINITY, f64::min)),
            ..self.figures_of(&world.ego.state, world.stamp)
        }
    }

    /// Figures that depend on the ego alone.
    fn figures_of(&self, ego: &EgoState, stamp: Time) -> Figures {
        let plan = self.plan.as_ref();
        Figures {
            speed_mps: ego.speed_mps,
            planned_speed_mps: plan.and_then(|plan| plan.at(stamp)).map_or(f64::NAN, |point| point.speed_mps),
            accel_mps2: ego.accel_mps2,
            lateral_accel_mps2: ego.lateral_accel_mps2,
            steering_deg: ego.steering_rad.to_degrees(),
            throttle: self.command.throttle,
            brake: self.command.brake,
            distance_m: f64::NAN,
            time_to_collision_s: f64::NAN,
            response_ms: self.response_ms,
            plan_age_ms: plan.map_or(f64::NAN, |plan| (stamp - plan.stamp).as_ms()),
        }
    }

    fn plan(&mut self, p: &Publication<'_>, plan: &Plan) {
        let when = When::new(p);
        self.scene("plan", plan, scene::plan, when);
        if self.status != Some(plan.status) {
            self.line(words::plan(p.operator, when.stamp, plan.status), when.visible_at);
        }
        self.status = Some(plan.status);
        self.plan = Some(plan.clone());
    }

    fn line(&mut self, line: Line, visible_at: Time) {
        let when = When { visible_at, stamp: line.stamp };
        self.out.show("log", when, 0, move || Some(line.message()));
    }

    fn image(&mut self, p: &Publication<'_>, image: &Image) {
        let Some(form) = self.setup.images.filter(|_| image.check().is_ok()) else { return };
        let (camera, when) = (p.operator, When::new(p));
        let (width_px, height_px, info) = (image.width_px, image.height_px, image.camera);
        let header = Header { camera: camera.to_owned(), stamp: image.stamp, width_px, height_px, info };
        let bytes = image.pixels.bytes().len();
        match &image.pixels {
            Pixels::Rgb8(rgb) => {
                let topic = |what: &str| format!("{camera}/{what}");
                let (rgb, of) = (rgb.to_vec(), header.clone());
                self.out.show(&topic("image"), when, bytes, move || camera::colours(&of, &rgb, form));
                let of = header.clone();
                self.out.show(&topic("calibration"), when, 0, move || camera::calibration(&of));
                let map_from_ego = self.pose_at(image.stamp);
                let believed = self.believed(image.stamp, map_from_ego);
                let camera_from_map = (map_from_ego * info.ego_from_camera).inverse();
                let show = move || Some(camera::annotations(&header, &camera_from_map, &believed));
                self.out.show(&topic("annotations"), when, 0, show);
            }
            Pixels::DepthF32M(_) | Pixels::ClassU8(_) if self.setup.raw_images => {
                let (name, encoding) = match image.encoding() {
                    Encoding::DepthF32M => ("depth", "32FC1"),
                    _ => ("classes", "mono8"),
                };
                let (topic, numbers) = (format!("{camera}/{name}"), image.pixels.bytes().to_vec());
                self.out.show(&topic, when, bytes, move || Some(camera::raw(&header, encoding, numbers)));
            }
            // Foxglove has no encoding for the numbers of instances, which are ground truth in any case.
            Pixels::DepthF32M(_) | Pixels::ClassU8(_) | Pixels::InstanceU32(_) => {}
        }
    }

    /// Pose of the ego in the nearest world step.
    fn pose_at(&self, instant: Time) -> Transform<Map, Ego> {
        let after = self.past.partition_point(|(at, _)| *at <= instant);
        let found = self.past.get(after.saturating_sub(1));
        found.map_or_else(
            || Transform::from_roll_pitch_yaw(swerve_geom::Point::default(), 0.0, 0.0, 0.0),
            |p| p.1,
        )
    }

    /// Other actors at an instant, extrapolated at constant velocity from the newest report not after it.
    fn believed(&self, instant: Time, map_from_ego: Transform<Map, Ego>) -> Vec<Believed> {
        let after = self.seen.partition_point(|list| list.stamp <= instant);
        let Some(list) = self.seen.get(after.saturating_sub(1)) else { return Vec::new() };
        let ego = map_from_ego.origin().coords;
        let ego = Pose2::new(ego.x, ego.y, 0.0).point();
        let passed_s = (instant - list.stamp).as_secs();
        let of = |obstacle: &swerve_msg::Obstacle| {
            let point = obstacle.pose.point() + obstacle.velocity_mps * passed_s;
            let kind = || name_of(obstacle.kind).to_owned();
            Believed {
                name: self.setup.actors.get(&obstacle.id).cloned().unwrap_or_else(kind),
                kind: obstacle.kind,
                pose: Pose2::new(point.x_m, point.y_m, obstacle.pose.heading_rad),
                extent: obstacle.extent,
                distance_m: ego.distance(point),
            }
        };
        list.obstacles.iter().map(of).collect()
    }

    /// Motion of a lidar during a turn.
    fn motion(&self, sensor: &str, cloud: &PointCloud) -> Motion {
        let Some(mount) = self.setup.mounts.iter().find(|mount| mount.name == sensor) else {
            return Vec::new();
        };
        let first_s = cloud.time_offset_s.iter().copied().fold(0.0, f32::min);
        let first = cloud.stamp + Span::from_secs(f64::from(first_s));
        let pose = |map_from_ego: Transform<Map, Ego>| map_from_ego * mount.ego_from_sensor;
        let now_from_map = pose(self.pose_at(cloud.stamp)).inverse();
        let after = self.past.partition_point(|(at, _)| *at <= first);
        let turn = self.past.range(after.saturating_sub(1)..);
        turn.filter(|(at, _)| *at <= cloud.stamp)
            .map(|(at, then)| (*at, now_from_map * pose(*then)))
            .collect()
    }
}

impl Views for Foxglove {
    fn event(&mut self, event: &Event<'_>, out: &mut Vec<View>) {
        match event {
            Event::Publication(publication) => self.watch.publication(publication),
            Event::Miss(miss) => {
                let line = words::miss(miss.operator, miss.stamp, miss.at, miss.reaction);
                self.watch.state_mut().line(line, miss.at);
            }
            Event::Drop(dropped) => self.watch.state_mut().line(words::dropped(dropped), dropped.at),
            Event::StepStart(_) | Event::StepEnd(_) | Event::Decision(_) | Event::End(_) => {}
        }
        out.append(&mut self.watch.state_mut().out.views);
    }
}

fn location(fix: &Gnss) -> LocationFix {
    // The altitude accuracy is not measured; use that of the horizontal position.
    let variance = fix.deviation_m * fix.deviation_m;
    LocationFix {
        timestamp: Some(timestamp(fix.stamp)),
        frame_id: MAP.into(),
        latitude: fix.latitude_deg,
        longitude: fix.longitude_deg,
        altitude: fix.altitude_m,
        position_covariance: vec![variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance],
        position_covariance_type: PositionCovarianceType::DiagonalKnown as i32,
        ..LocationFix::default()
    }
}
