use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_flow::{Event, Observer, Publication};
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{
    Command, EgoState, GateOutput, Gnss, Image, Imu, Obstacle, ObstacleList, Pixels, Plan, PointCloud,
    PredictionList, Track, TrackList, WheelOdometry,
};
use swerve_ros2::bridge::EndpointId;
use swerve_ros2::convert::{
    self, Epoch, SteeringGear, VehicleState, accel_to_ros, camera_to_ros, cloud_to_ros, ego_to_ros,
    ego_to_transform, gnss_to_ros, image_to_ros, imu_to_ros, objects_to_ros, obstacles_to_markers,
    plan_to_marker, plan_to_ros, report_to_ros,
};
use swerve_ros2::mapping::{Mapping, Role, Side};
use swerve_ros2::msg::geometry_msgs as geo;
use swerve_ros2::msg::rosgraph_msgs::Clock;
use swerve_ros2::msg::sensor_msgs::CompressedImage;
use swerve_ros2::msg::visualization_msgs::MarkerArray;
use swerve_ros2::{AnyMessage, Kind};
use swerve_sim::sense::rolling_speeds_radps;
use swerve_vehicle::VehicleParams;

use super::drive::{Moment, Shared, lock};
use super::mounts::{Mount, Mounts, frame_of};
use super::{Outbox, STACK};
use crate::config::Config;
use crate::pipeline::Pipeline;

/// Between two messages on `/clock`.
const CLOCK_PERIOD: Span = Span::from_ms(10);
/// Between two reports of the vehicle.
const REPORT_PERIOD: Span = Span::from_ms(20);
/// Between two messages about the others on the road.
const OBJECTS_PERIOD: Span = Span::from_ms(100);
/// Simulated time is the time of the topics: the run's zero is the clock's.
const EPOCH: Epoch = Epoch { ns: 0 };

/// Whether there is something to say on a topic in a run of this configuration.
pub(super) fn is_fed(config: &Config, mapping: &Mapping, mounts: &Mounts, topic: &str) -> bool {
    match mapping.topic(topic).map(|topic| topic.role) {
        Some(Role::Camera | Role::CameraCompressed | Role::CameraInfo | Role::Lidar) => mounts.feed(topic),
        Some(Role::Gnss) => config.runs("gnss"),
        // Nobody presses it in a simulated car.
        Some(Role::Emergency) => false,
        Some(role) => {
            role.side() == Side::Vehicle
                || (STACK.contains(&role.name()) && (role == Role::Markers || !config.is_driven_over_ros2()))
        }
        None => false,
    }
}

/// A topic that is sent.
#[derive(Clone, Debug)]
struct Topic {
    id: EndpointId,
    kind: Kind,
    role: Role,
    frame: Arc<str>,
}

/// What an operator's messages are shown as.
#[derive(Clone, Debug)]
enum Shown {
    World,
    Pose,
    Imu,
    Gnss,
    Odometry,
    Plan,
    Command,
    Gate,
    /// Colour images, on these topics.
    Camera(Vec<Topic>),
    /// Point clouds, on these topics.
    Lidar(Vec<Topic>),
}

/// Lets something through at regular instants.
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

/// Says on ROS 2's topics what happens in a run.
pub(super) struct Show {
    outbox: Outbox,
    mapping: Mapping,
    mounts: Mounts,
    vehicle: VehicleParams,
    jpeg_quality: u8,
    /// By operator.
    shown: BTreeMap<String, Shown>,
    topics: BTreeMap<Role, Vec<Topic>>,
    gear: SteeringGear,
    state: VehicleState,
    has_begun: bool,
    /// Whether the vehicle's reports are made from its wheel odometry.
    has_odometry: bool,
    told_engaged: Option<bool>,
    /// What who reads commands has to know of the car.
    driven: Option<Shared>,
    clock: Throttle,
    reports: Throttle,
    objects: Throttle,
}

impl Show {
    pub(super) fn new(
        config: &Config,
        pipeline: &Pipeline,
        mapping: &Mapping,
        mounts: &Mounts,
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
        // Where faults befall a stream, what is shown is what its readers get.
        let shown_by = |stream: &str, operator: &str| {
            config.faults_of(stream).last().map_or(operator, |(fault, _)| fault).to_owned()
        };
        let mut shown = BTreeMap::new();
        for (operator, what) in [
            ("world", Shown::World),
            ("pose", Shown::Pose),
            ("imu", Shown::Imu),
            ("gnss", Shown::Gnss),
            ("odometry", Shown::Odometry),
            ("planner", Shown::Plan),
            ("controller", Shown::Command),
            ("pedals", Shown::Command),
            ("gate", Shown::Gate),
        ] {
            shown.insert(shown_by(operator, operator), what);
        }
        let of = |mount: &Mount| mount.topics.iter().filter_map(|name| topic(name)).collect::<Vec<_>>();
        for mount in &mounts.cameras {
            let stream = format!("{}.rgb", mount.sensor);
            shown.insert(shown_by(&stream, &mount.sensor), Shown::Camera(of(mount)));
        }
        for mount in &mounts.lidars {
            let stream = format!("{}.points", mount.sensor);
            shown.insert(shown_by(&stream, &mount.sensor), Shown::Lidar(of(mount)));
        }
        Self {
            outbox,
            mapping: mapping.clone(),
            mounts: mounts.clone(),
            vehicle: pipeline.vehicle.clone(),
            jpeg_quality: config.log.jpeg_quality,
            shown,
            topics,
            gear: SteeringGear::default(),
            state: VehicleState { is_engaged: true, ..VehicleState::default() },
            has_begun: false,
            has_odometry: config.runs("odometry"),
            told_engaged: None,
            driven: None,
            clock: Throttle::default(),
            reports: Throttle::default(),
            objects: Throttle::default(),
        }
    }

    /// Another stack drives: tells it of the car from here on.
    pub(super) fn is_driven(&mut self) -> Shared {
        self.state.is_engaged = false;
        Arc::clone(self.driven.insert(Shared::default()))
    }

    /// No more comes; how many messages were dropped, by endpoint.
    pub(super) fn finish(self) -> Vec<u64> {
        self.outbox.dropped
    }

    /// Has a small message sent on every topic of a role; `make` is called for each on the sender's thread.
    fn say<M>(&mut self, role: Role, make: M)
    where
        M: Fn(&Topic) -> Option<AnyMessage> + Clone + Send + 'static,
    {
        for topic in self.topics.get(&role).into_iter().flatten() {
            let (make, topic) = (make.clone(), topic.clone());
            self.outbox.small(topic.id, move || make(&topic));
        }
    }

    fn take(&mut self, what: &Shown, payload: &dyn Any) {
        match what {
            Shown::World => payload.downcast_ref().map(|world| self.world(world)),
            Shown::Pose => payload.downcast_ref().map(|ego| self.pose(*ego)),
            Shown::Imu => payload.downcast_ref().copied().map(|imu: Imu| {
                self.say(Role::Imu, move |topic| Some(AnyMessage::Imu(imu_to_ros(&imu, EPOCH, &topic.frame))))
            }),
            Shown::Gnss => payload.downcast_ref().copied().map(|fix: Gnss| {
                self.say(Role::Gnss, move |topic| {
                    Some(AnyMessage::NavSatFix(gnss_to_ros(&fix, EPOCH, &topic.frame)))
                })
            }),
            Shown::Odometry => payload.downcast_ref().map(|wheels| self.report(*wheels)),
            Shown::Plan => payload.downcast_ref().map(|plan| self.plan(plan)),
            Shown::Command => payload.downcast_ref().map(|command: &Command| self.state.pedals = *command),
            Shown::Gate => payload.downcast_ref().map(|gate| self.gate(gate)),
            Shown::Camera(topics) => payload.downcast_ref().map(|image| self.image(image, topics)),
            Shown::Lidar(topics) => payload.downcast_ref().map(|cloud| self.cloud(cloud, topics)),
        };
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

    /// The others on the road as they are.
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
        let none = PredictionList { stamp, predictions: Vec::new() };
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

    /// Where localization believes the ego to be.
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

    /// What the vehicle says of itself, in the words of its interface.
    fn report(&mut self, wheels: WheelOdometry) {
        self.state.wheels = wheels;
        let (state, gear) = (self.state, self.gear);
        let base = self.mapping.base_frame.clone();
        let is_news = self.told_engaged.replace(state.is_engaged) != Some(state.is_engaged);
        let reports: Vec<Role> = self.topics.keys().copied().filter(|role| is_report(*role)).collect();
        for role in reports {
            // Who comes late gets the newest of it: it need not be said again.
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

    /// The topics that anybody reads: what costs is not made for nobody.
    fn with_readers<'t>(&self, topics: &'t [Topic]) -> Vec<&'t Topic> {
        topics.iter().filter(|topic| self.outbox.bridge.matched(topic.id) > 0).collect()
    }

    fn image(&mut self, image: &Image, topics: &[Topic]) {
        if !matches!(image.pixels, Pixels::Rgb8(_)) {
            return;
        }
        let mut shared: Option<Arc<Image>> = None;
        for topic in self.with_readers(topics) {
            let frame = Arc::clone(&topic.frame);
            if topic.kind == Kind::CameraInfo {
                let (info, size) = (image.camera, (image.width_px, image.height_px));
                let header = EPOCH.header(image.stamp, &frame);
                self.outbox.small(topic.id, move || {
                    Some(AnyMessage::CameraInfo(camera_to_ros(&info, size, header)))
                });
                continue;
            }
            let image = Arc::clone(shared.get_or_insert_with(|| Arc::new(image.clone())));
            let (kind, quality) = (topic.kind, self.jpeg_quality);
            self.outbox.large(topic.id, move || match kind {
                Kind::CompressedImage => {
                    let size = (image.width_px, image.height_px);
                    let data = swerve_foxglove::jpeg(image.pixels.bytes(), size, quality)?;
                    let header = EPOCH.header(image.stamp, &frame);
                    let format = "rgb8; jpeg compressed bgr8".to_owned();
                    Some(AnyMessage::CompressedImage(CompressedImage { header, format, data }))
                }
                _ => Some(AnyMessage::Image(image_to_ros(&image, EPOCH, &frame))),
            });
        }
    }

    fn cloud(&mut self, cloud: &PointCloud, topics: &[Topic]) {
        let mut shared: Option<Arc<PointCloud>> = None;
        for topic in self.with_readers(topics) {
            let cloud = Arc::clone(shared.get_or_insert_with(|| Arc::new(cloud.clone())));
            let frame = Arc::clone(&topic.frame);
            self.outbox
                .large(topic.id, move || Some(AnyMessage::PointCloud2(cloud_to_ros(&cloud, EPOCH, &frame))));
        }
    }
}

/// Whether a topic of this role is the vehicle's report of itself.
fn is_report(role: Role) -> bool {
    (Role::Velocity..=Role::Miscellaneous).contains(&role) && role != Role::Emergency
}

impl Observer for Show {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(Publication { operator, payload: Some(payload), .. }) = event else { return };
        // Taken out while it is looked at, so that all else may change.
        let Some((operator, what)) = self.shown.remove_entry(*operator) else { return };
        self.take(&what, payload.as_any());
        self.shown.insert(operator, what);
    }
}
