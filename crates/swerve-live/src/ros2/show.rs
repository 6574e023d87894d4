//! Observer that publishes a simulated run on ROS 2 topics.

use std::collections::BTreeMap;
use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_flow::{Dispatcher, Event, Observer, Payload};
use swerve_map::Map;
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{
    Command, EgoState, GateOutput, Gnss, Image, Imu, Obstacle, ObstacleList, Pixels, Plan, PointCloud,
    PredictionList, Track, TrackList, WheelOdometry,
};
use swerve_ros2::bridge::EndpointId;
use swerve_ros2::convert::{
    self, Epoch, SteeringGear, VehicleState, accel_to_ros, camera_to_ros, cloud_to_ros, ego_to_ros,
    ego_to_transform, gnss_to_ros, image_to_ros, imu_to_ros, map_to_markers, objects_to_ros,
    obstacles_to_markers, plan_to_marker, plan_to_ros, report_to_ros,
};
use swerve_ros2::mapping::{Mapping, Purpose, Role, Side};
use swerve_ros2::msg::geometry_msgs as geo;
use swerve_ros2::msg::rosgraph_msgs::Clock;
use swerve_ros2::msg::sensor_msgs::CompressedImage;
use swerve_ros2::msg::visualization_msgs::MarkerArray;
use swerve_ros2::{AnyMessage, Kind};
use swerve_sim::sense::rolling_speeds_radps;
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;
use swerve_vehicle::VehicleParams;

use super::drive::{Moment, Shared};
use super::mounts::{Mount, Mounts, frame_of};
use super::outbox::Outbox;
use super::streams::Streams;
use crate::shared::lock;

/// Period of messages on `/clock`.
const CLOCK_PERIOD: Span = Span::from_ms(10);
/// Period of reports of the vehicle.
const REPORT_PERIOD: Span = Span::from_ms(20);
/// Period of messages about other road users.
const OBJECTS_PERIOD: Span = Span::from_ms(100);
/// Topics use simulated time: run time zero is zero on the ROS clock.
const EPOCH: Epoch = Epoch { ns: 0 };

/// Returns true if a run of this configuration has data for a topic.
pub(super) fn is_fed(
    config: &Setup,
    streams: &Streams,
    mapping: &Mapping,
    mounts: &Mounts,
    topic: &str,
) -> bool {
    let Some(role) = mapping.topic(topic).map(|topic| topic.role) else { return false };
    match (role, role.purpose()) {
        (Role::Imu, _) => true,
        (Role::Gnss, _) => streams.carry::<Gnss>(),
        (_, Purpose::Sensor) => mounts.feed(topic),
        // A simulated car has no physical switch.
        (_, Purpose::Switch) => false,
        // The plans of an external stack are not known here.
        (_, Purpose::Display) => is_of_the_world(role) || !config.is_driven_over_ros2(),
        _ => role.side() == Side::Vehicle,
    }
}

/// Returns true for visualisation that is not of the stack: the objects on the road, and its lanes.
pub(super) fn is_of_the_world(role: Role) -> bool {
    matches!(role, Role::Markers | Role::Lanes)
}

/// A topic for sending.
#[derive(Clone, Debug)]
struct Topic {
    id: EndpointId,
    kind: Kind,
    role: Role,
    frame: Arc<str>,
}

/// Rate limiter with a regular period.
#[derive(Default)]
struct Throttle {
    next: Option<Time>,
}

impl Throttle {
    fn is_due(&mut self, now: Time, period: Span) -> bool {
        let is_due = self.next.is_none_or(|next| now >= next);
        if is_due {
            self.next = Some(self.next.map_or(now, |next| next + period).max(now));
        }
        is_due
    }
}

/// Publishes the events of a run on ROS 2 topics.
pub(super) struct Show(Dispatcher<Car>);

/// State of the simulated car for its topics.
struct Car {
    outbox: Outbox,
    mapping: Mapping,
    mounts: Mounts,
    vehicle: VehicleParams,
    /// Lanes of the road or map.
    map: Arc<Map>,
    jpeg_quality: u8,
    streams: Streams,
    /// Topics of each camera and lidar.
    sensors: BTreeMap<String, Vec<Topic>>,
    topics: BTreeMap<Role, Vec<Topic>>,
    gear: SteeringGear,
    state: VehicleState,
    has_begun: bool,
    /// True if the vehicle's reports are made from wheel odometry.
    has_odometry: bool,
    engaged_before: Option<bool>,
    /// State for the reader of commands.
    driven: Option<Shared>,
    clock: Throttle,
    reports: Throttle,
    objects: Throttle,
}

impl Show {
    pub(super) fn new(
        config: &Setup,
        pipeline: &Pipeline,
        mapping: &Mapping,
        mounts: &Mounts,
        streams: Streams,
        outbox: Outbox,
    ) -> Self {
        let car = Car::new(config, pipeline, mapping, mounts, streams, outbox);
        // For a stream with injected faults, publishes the faulty stream that its readers receive.
        let watch = Watch(Dispatcher::new(car));
        let watch = watch
            .on::<WorldState>(|car, _, world| car.world(world))
            .on::<EgoState>(|car, _, ego| car.pose(*ego))
            .on::<Imu>(|car, _, imu| car.imu(*imu))
            .on::<Gnss>(|car, _, fix| car.gnss(*fix))
            .on::<WheelOdometry>(|car, _, wheels| car.report(*wheels))
            .on::<Plan>(|car, _, plan| car.plan(plan))
            .on::<Command>(|car, _, command| car.state.pedals = *command)
            .on::<GateOutput>(|car, _, gate| car.gate(gate))
            .on::<Image>(Car::image)
            .on::<PointCloud>(Car::cloud);
        Self(watch.0)
    }

    /// Enables driving by an external stack; returns the state that is updated from here on.
    pub(super) fn is_driven(&mut self) -> Shared {
        let car = self.0.state_mut();
        car.state.is_engaged = false;
        Arc::clone(car.driven.insert(Shared::default()))
    }

    /// Ends publishing; returns the number of dropped messages by endpoint.
    pub(super) fn finish(self) -> Vec<u64> {
        self.0.into_state().outbox.dropped
    }
}

/// Registers handlers for streams that readers receive; a handler gets the name of the operator that measured the
/// data.
struct Watch(Dispatcher<Car>);

impl Watch {
    fn on<T: Payload>(self, show: impl Fn(&mut Car, &str, &T) + Send + 'static) -> Self {
        Self(self.0.on::<T>(move |car, publication, payload| {
            if let Some(source) = car.streams.source(publication.stream).map(str::to_owned) {
                show(car, &source, payload);
            }
        }))
    }
}

impl Car {
    fn new(
        config: &Setup,
        pipeline: &Pipeline,
        mapping: &Mapping,
        mounts: &Mounts,
        streams: Streams,
        outbox: Outbox,
    ) -> Self {
        let topic = |name: &str| {
            let map = mapping.topic(name)?;
            let id = outbox.bridge.endpoint(name)?;
            Some(Topic { id, kind: map.kind, role: map.role, frame: frame_of(map).into() })
        };
        let mut topics: BTreeMap<Role, Vec<Topic>> = BTreeMap::new();
        for endpoint in outbox.bridge.endpoints() {
            if let Some(topic) = topic(&endpoint.name) {
                topics.entry(topic.role).or_default().push(topic);
            }
        }
        let of = |mount: &Mount| mount.topics.iter().filter_map(|name| topic(name)).collect();
        let sensors = mounts.cameras.iter().chain(&mounts.lidars);
        let sensors = sensors.map(|mount| (mount.sensor.clone(), of(mount))).collect();
        Self {
            outbox,
            mapping: mapping.clone(),
            mounts: mounts.clone(),
            vehicle: pipeline.vehicle.clone(),
            map: pipeline.scenario.road.map(),
            jpeg_quality: config.log.jpeg_quality,
            has_odometry: streams.carry::<WheelOdometry>(),
            streams,
            sensors,
            topics,
            gear: super::gear(config),
            state: VehicleState { is_engaged: true, ..VehicleState::default() },
            has_begun: false,
            engaged_before: None,
            driven: None,
            clock: Throttle::default(),
            reports: Throttle::default(),
            objects: Throttle::default(),
        }
    }

    /// Sends a small message on every topic of a role; `make` is called for each on the sender's thread.
    fn say<M>(&mut self, role: Role, make: M)
    where
        M: Fn(&Topic) -> Option<AnyMessage> + Clone + Send + 'static,
    {
        for topic in self.topics.get(&role).into_iter().flatten() {
            let (make, topic) = (make.clone(), topic.clone());
            self.outbox.small(topic.id, move || make(&topic));
        }
    }

    fn imu(&mut self, imu: Imu) {
        self.say(Role::Imu, move |topic| Some(AnyMessage::Imu(imu_to_ros(&imu, EPOCH, &topic.frame))));
    }

    fn gnss(&mut self, fix: Gnss) {
        self.say(Role::Gnss, move |topic| {
            Some(AnyMessage::NavSatFix(gnss_to_ros(&fix, EPOCH, &topic.frame)))
        });
    }

    fn gate(&mut self, gate: &GateOutput) {
        self.state.is_engaged = gate.engaged;
        if let Some(driven) = &self.driven {
            lock(driven).mode = gate.mode;
        }
    }

    fn world(&mut self, world: &WorldState) {
        let now = world.stamp;
        if let Some(driven) = &self.driven {
            let mut moment = lock(driven);
            *moment = Moment { now, speed_mps: world.ego.state.speed_mps, ..*moment };
        }
        if !self.has_begun {
            self.has_begun = true;
            let edges = self.mounts.edges(&self.mapping.base_frame, now, EPOCH);
            self.say(Role::TfStatic, move |_| Some(AnyMessage::Tf(edges.clone())));
            let map = Arc::clone(&self.map);
            self.say(Role::Lanes, move |topic| {
                Some(AnyMessage::MarkerArray(map_to_markers(&map, now, EPOCH, &topic.frame)))
            });
        }
        if self.clock.is_due(now, CLOCK_PERIOD) {
            self.say(Role::Clock, move |_| Some(AnyMessage::Clock(Clock { clock: EPOCH.stamp(now) })));
        }
        if !self.has_odometry && self.reports.is_due(now, REPORT_PERIOD) {
            let EgoState { speed_mps, yaw_rate_radps, steering_rad, .. } = world.ego.state;
            let wheel_speeds_radps = rolling_speeds_radps(&world.ego, &self.vehicle);
            let counts = [0; 4];
            self.report(WheelOdometry {
                stamp: now,
                counts,
                wheel_speeds_radps,
                speed_mps,
                yaw_rate_radps,
                steering_rad,
            });
        }
        if self.objects.is_due(now, OBJECTS_PERIOD) {
            self.others(now, &world.actors);
        }
    }

    /// Publishes the ground truth of other road users.
    fn others(&mut self, stamp: Time, actors: &[Actor]) {
        let track = |actor: &Actor| Track {
            id: actor.id,
            kind: actor.kind,
            pose: actor.pose,
            extent: actor.extent,
            velocity_mps: actor.velocity_mps,
            history: Vec::new(),
        };
        let tracks = TrackList { stamp, tracks: actors.iter().map(track).collect() };
        let none = PredictionList { stamp, ..PredictionList::default() };
        self.say(Role::Objects, move |topic| {
            Some(AnyMessage::PredictedObjects(objects_to_ros(&tracks, &none, EPOCH, &topic.frame)))
        });
        let obstacle = |actor: &Actor| Obstacle {
            id: actor.id,
            kind: actor.kind,
            pose: actor.pose,
            extent: actor.extent,
            velocity_mps: actor.velocity_mps,
            visible_share: 1.0,
        };
        let obstacles = ObstacleList { stamp, obstacles: actors.iter().map(obstacle).collect() };
        self.say(Role::Markers, move |topic| {
            Some(AnyMessage::MarkerArray(obstacles_to_markers(&obstacles, EPOCH, &topic.frame)))
        });
    }

    /// Publishes the pose of localization.
    fn pose(&mut self, ego: EgoState) {
        let (map, base) = (self.mapping.map_frame.clone(), self.mapping.base_frame.clone());
        let base_link = base.clone();
        self.say(Role::Odometry, move |topic| {
            let header = EPOCH.header(ego.stamp, &topic.frame);
            let pose = convert::pose_to_ros(ego.pose);
            Some(match topic.kind {
                Kind::PoseStamped => AnyMessage::PoseStamped(geo::PoseStamped { header, pose }),
                Kind::PoseWithCovarianceStamped => {
                    let pose = geo::PoseWithCovariance { pose, ..geo::PoseWithCovariance::default() };
                    AnyMessage::PoseWithCovarianceStamped(geo::PoseWithCovarianceStamped { header, pose })
                }
                _ => AnyMessage::Odometry(ego_to_ros(&ego, EPOCH, &topic.frame, &base_link)),
            })
        });
        self.say(Role::Acceleration, {
            let base = base.clone();
            move |_| Some(AnyMessage::AccelWithCovarianceStamped(accel_to_ros(&ego, EPOCH, &base)))
        });
        self.say(Role::Tf, move |_| Some(AnyMessage::Tf(ego_to_transform(&ego, EPOCH, &map, &base))));
    }

    /// Sends the reports of the vehicle in the types of its interface.
    fn report(&mut self, wheels: WheelOdometry) {
        self.state.wheels = wheels;
        let (state, gear) = (self.state, self.gear);
        let base = self.mapping.base_frame.clone();
        let is_news = self.engaged_before.replace(state.is_engaged) != Some(state.is_engaged);
        let reports = self.topics.keys().copied().filter(|role| role.purpose() == Purpose::Report);
        let reports: Vec<Role> = reports.collect();
        for role in reports {
            // Late joiners receive the latest message, so it need not be repeated.
            if role == Role::Enabled && !is_news {
                continue;
            }
            let base = base.clone();
            self.say(role, move |topic| report_to_ros(topic.kind, &state, &gear, EPOCH, &base));
        }
    }

    fn plan(&mut self, plan: &Plan) {
        let (plan, wheelbase_m) = (Arc::new(plan.clone()), self.vehicle.shape.wheelbase_m);
        self.say(Role::Trajectory, {
            let plan = Arc::clone(&plan);
            move |topic| Some(AnyMessage::Trajectory(plan_to_ros(&plan, EPOCH, &topic.frame, wheelbase_m)))
        });
        self.say(Role::Path, {
            let plan = Arc::clone(&plan);
            move |topic| Some(AnyMessage::Path(convert::path_to_ros(&plan, EPOCH, &topic.frame)))
        });
        self.say(Role::Markers, move |topic| {
            let line = plan_to_marker(&plan, EPOCH, &topic.frame);
            Some(AnyMessage::MarkerArray(MarkerArray { markers: vec![line] }))
        });
    }

    /// Topics of a sensor that have readers; expensive messages are not built without one.
    fn with_readers(&self, sensor: &str) -> Vec<Topic> {
        let topics = self.sensors.get(sensor).into_iter().flatten();
        topics.filter(|topic| self.outbox.bridge.matched(topic.id) > 0).cloned().collect()
    }

    fn image(&mut self, camera: &str, image: &Image) {
        if !matches!(image.pixels, Pixels::Rgb8(_)) {
            return;
        }
        let mut shared: Option<Arc<Image>> = None;
        for Topic { id, kind, frame, .. } in self.with_readers(camera) {
            if kind == Kind::CameraInfo {
                let (info, [width_px, height_px]) = (image.camera, [image.width_px, image.height_px]);
                let header = EPOCH.header(image.stamp, &frame);
                self.outbox.small(id, move || {
                    Some(AnyMessage::CameraInfo(camera_to_ros(&info, width_px, height_px, header)))
                });
                continue;
            }
            let image = Arc::clone(shared.get_or_insert_with(|| Arc::new(image.clone())));
            let quality = self.jpeg_quality;
            self.outbox.large(id, move || match kind {
                Kind::CompressedImage => {
                    let bytes = image.pixels.bytes();
                    let data = swerve_foxglove::jpeg(bytes, image.width_px, image.height_px, quality)?;
                    let header = EPOCH.header(image.stamp, &frame);
                    let format = "rgb8; jpeg compressed bgr8".to_owned();
                    Some(AnyMessage::CompressedImage(CompressedImage { header, format, data }))
                }
                _ => Some(AnyMessage::Image(image_to_ros(&image, EPOCH, &frame))),
            });
        }
    }

    fn cloud(&mut self, lidar: &str, cloud: &PointCloud) {
        let mut shared: Option<Arc<PointCloud>> = None;
        for Topic { id, frame, .. } in self.with_readers(lidar) {
            let cloud = Arc::clone(shared.get_or_insert_with(|| Arc::new(cloud.clone())));
            self.outbox.large(id, move || Some(AnyMessage::PointCloud2(cloud_to_ros(&cloud, EPOCH, &frame))));
        }
    }
}

impl Observer for Show {
    fn event(&mut self, event: &Event<'_>) {
        self.0.event(event);
    }
}
