//! From ROS messages, live or recorded, to what the graph takes in.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde::Serialize;
use swerve_core::{Span, Time};
use swerve_flow::PlaybackRecord;
use swerve_geom::{Ego, Point, Transform};
use swerve_msg::{
    CameraInfo, EgoState, Gnss, Image, Imu, Obstacle, ObstacleList, PointCloud, Switch, VehicleReport,
    WheelOdometry, WireAlarm,
};
use swerve_ros2::AnyMessage;
use swerve_ros2::clock::{ClockParams, StampVerdict};
use swerve_ros2::convert::{
    self, Beside, ConvertError, Epoch, Identities, camera_from_ros, cloud_from_ros, ego_from_pose,
    ego_from_ros, gnss_from_ros, image_from_ros, imu_from_ros, objects_from_ros,
};
use swerve_ros2::mapping::{Mapping, Role};
use swerve_ros2::msg::geometry_msgs as geo;
use swerve_ros2::msg::std_msgs::Header;
use swerve_stack::config::Config;
use swerve_stack::config::perception::image_camera;

use super::feed::TopicState;
use super::time::TopicClock;
use super::vehicle::{Car, VehicleInterface};

/// How much of a new difference of speeds goes into the acceleration: speeds are noisy.
const ACCEL_SHARE: f64 = 0.2;
/// Accelerations are not told from speeds that are further apart than this.
const ACCEL_GAP: Span = Span::from_ms(500);

/// A topic's message as the graph takes it in.
#[derive(Clone, PartialEq, Debug)]
pub enum Input {
    /// Where the ego is.
    Pose(EgoState),
    /// The objects around it, as others see them.
    Objects(ObstacleList),
    /// An inertial reading.
    Imu(Imu),
    /// A satellite fix.
    Gnss(Gnss),
    /// An image of the camera of this name.
    Image(String, Image),
    /// A point cloud of the lidar of this name.
    Cloud(String, PointCloud),
    /// The vehicle's report of itself.
    Report(VehicleReport),
    /// The person's switch.
    Switch(Switch),
    /// What is wrong with the wire.
    Wire(WireAlarm),
    /// How the topics are, for the log.
    Topics(Vec<TopicState>),
}

/// Names of the graph's sources, but for cameras and lidars, which have their topics' names.
pub mod names {
    /// [`super::Input::Pose`].
    pub const POSE: &str = "pose";
    /// [`super::Input::Objects`].
    pub const OBJECTS: &str = "objects";
    /// [`super::Input::Imu`].
    pub const IMU: &str = "imu";
    /// [`super::Input::Gnss`].
    pub const GNSS: &str = "gnss";
    /// [`super::Input::Report`].
    pub const REPORT: &str = "vehicle";
    /// [`super::Input::Switch`].
    pub const SWITCH: &str = "switch";
    /// [`super::Input::Wire`].
    pub const WIRE: &str = "wire";
    /// [`super::Input::Topics`].
    pub const TOPICS: &str = "topics";
}

/// Something for the graph.
#[derive(Clone, PartialEq, Debug)]
pub struct Arrived {
    /// When it came.
    pub at: Time,
    /// Which instant it describes, later than that of the one before it on its stream.
    pub stamp: Time,
    /// The message.
    pub input: Input,
}

impl Arrived {
    /// The source that it is for.
    pub fn source(&self) -> &str {
        match &self.input {
            Input::Pose(_) => names::POSE,
            Input::Objects(_) => names::OBJECTS,
            Input::Imu(_) => names::IMU,
            Input::Gnss(_) => names::GNSS,
            Input::Image(name, _) | Input::Cloud(name, _) => name,
            Input::Report(_) => names::REPORT,
            Input::Switch(_) => names::SWITCH,
            Input::Wire(_) => names::WIRE,
            Input::Topics(_) => names::TOPICS,
        }
    }

    /// The same for [`swerve_flow::Graph::playback`] of the source: what virtual time is fed with.
    pub fn record(self) -> PlaybackRecord {
        let Self { at, stamp, input } = self;
        match input {
            Input::Pose(x) => PlaybackRecord::message(at, stamp, x),
            Input::Objects(x) => PlaybackRecord::message(at, stamp, x),
            Input::Imu(x) => PlaybackRecord::message(at, stamp, x),
            Input::Gnss(x) => PlaybackRecord::message(at, stamp, x),
            Input::Image(_, x) => PlaybackRecord::message(at, stamp, x),
            Input::Cloud(_, x) => PlaybackRecord::message(at, stamp, x),
            Input::Report(x) => PlaybackRecord::message(at, stamp, x),
            Input::Switch(x) => PlaybackRecord::message(at, stamp, x),
            Input::Wire(x) => PlaybackRecord::message(at, stamp, x),
            Input::Topics(x) => PlaybackRecord::message(at, stamp, x),
        }
    }
}

/// Messages that were not used, by reason.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Refusals {
    /// Numbers, sizes or names that cannot be.
    pub implausible: u64,
    /// The stamp is older than the newest before it.
    pub backwards: u64,
    /// The stamp is from the future.
    pub ahead: u64,
    /// The stamp is from long ago.
    pub behind: u64,
    /// There is no stamp.
    pub unset: u64,
    /// It says nothing that can be used: another frame, other pixels, no fix.
    pub not_usable: u64,
}

impl Refusals {
    /// Adds others to these.
    pub fn add(&mut self, others: &Self) {
        let Self { implausible, backwards, ahead, behind, unset, not_usable } = *others;
        self.implausible += implausible;
        self.backwards += backwards;
        self.ahead += ahead;
        self.behind += behind;
        self.unset += unset;
        self.not_usable += not_usable;
    }

    /// All together.
    pub fn total(&self) -> u64 {
        let Self { implausible, backwards, ahead, behind, unset, not_usable } = *self;
        implausible + backwards + ahead + behind + unset + not_usable
    }
}

/// Counts of a topic's messages.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct TopicTally {
    /// Messages that came here.
    pub received: u64,
    /// Messages that were used.
    pub used: u64,
    /// Messages that were not.
    pub refused: Refusals,
    /// Why the newest of them was not.
    pub last_refusal: Option<String>,
    /// When the newest that was used came.
    pub heard: Option<Time>,
}

/// The instants of a message, in the time of the run.
#[derive(Clone, Copy)]
struct Instants {
    /// When it came.
    at: Time,
    /// The instant that it describes.
    stamp: Time,
}

/// A topic's counts and clock.
#[derive(Clone, Copy)]
pub struct TopicSummary<'a> {
    /// Its name in the mapping.
    pub name: &'a str,
    /// Its role.
    pub role: Role,
    /// Counts of its messages.
    pub tally: &'a TopicTally,
    /// The clock of its stamps.
    pub clock: &'a TopicClock,
}

/// The state of a topic.
struct Topic {
    role: Role,
    frame: String,
    clock: TopicClock,
    tally: TopicTally,
}

/// A person's request that a topic brought.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Request {
    /// The stack is to drive, or no longer.
    Drive(bool),
    /// The car is to be stopped at once, or no longer.
    Emergency(bool),
}

/// Turns messages into what the graph takes in. Reads no clock: when a message came is said with it.
pub struct Intake {
    epoch_ns: i64,
    map: String,
    base_link: String,
    topics: BTreeMap<String, Topic>,
    vehicle: Box<dyn VehicleInterface>,
    car: Arc<Mutex<Car>>,
    reported: TopicClock,
    identities: Identities,
    cameras: BTreeMap<String, CameraInfo>,
    lidars: Vec<String>,
    accel: Acceleration,
    requests: Vec<Request>,
}

/// The ego's acceleration, from where it is reported or from its speeds.
#[derive(Default)]
struct Acceleration {
    reported: Option<(Time, f64)>,
    before: Option<(Time, f64)>,
    from_speeds_mps2: f64,
}

impl Acceleration {
    /// At `now`, when the speed is `speed_mps`.
    fn at(&mut self, now: Time, speed_mps: f64) -> f64 {
        if let Some((before, before_mps)) = self.before.replace((now, speed_mps))
            && now > before
        {
            let dt = now - before;
            if dt > ACCEL_GAP {
                self.from_speeds_mps2 = 0.0;
            } else {
                let new = (speed_mps - before_mps) / dt.as_secs();
                self.from_speeds_mps2 += ACCEL_SHARE * (new - self.from_speeds_mps2);
            }
        }
        match self.reported {
            Some((at, accel_mps2)) if now - at <= ACCEL_GAP => accel_mps2,
            _ => self.from_speeds_mps2,
        }
    }
}

/// Works with what threads share. A panic while it was held would be a bug in plain bookkeeping: what is there is whole.
pub(super) fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Intake {
    /// For the topics of a mapping, heard by `vehicle`; the host's clock stood at `epoch_ns` at the run's time zero.
    ///
    /// Cameras and lidars are those that the configuration has a table for: it says where they sit.
    pub fn new(
        mapping: &Mapping,
        vehicle: Box<dyn VehicleInterface>,
        config: &Config,
        epoch_ns: i64,
    ) -> Self {
        let live = config.live.clone().unwrap_or_default();
        let params = ClockParams {
            ahead_max: Span::from_secs(live.stamp_ahead_max_ms * 1e-3),
            behind_max: Span::from_secs(live.stamp_behind_max_ms * 1e-3),
            ..ClockParams::default()
        };
        let topic = |topic: &swerve_ros2::mapping::TopicMap| {
            let known = Topic {
                role: topic.role,
                frame: topic.frame.clone(),
                clock: TopicClock::new(params),
                tally: TopicTally::default(),
            };
            (topic.name.clone(), known)
        };
        let camera = |(name, camera): (&String, &swerve_stack::config::camera::CameraConfig)| {
            Some((name.clone(), image_camera(camera)?.info))
        };
        Self {
            epoch_ns,
            map: mapping.map_frame.clone(),
            base_link: mapping.base_frame.clone(),
            topics: mapping.topics.iter().map(topic).collect(),
            vehicle,
            car: Arc::default(),
            reported: TopicClock::new(params),
            identities: Identities::default(),
            cameras: config.camera.iter().filter_map(camera).collect(),
            lidars: config.lidar.keys().cloned().collect(),
            accel: Acceleration::default(),
            requests: Vec::new(),
        }
    }

    /// The state of the vehicle, shared with who talks to it.
    pub fn car(&self) -> Arc<Mutex<Car>> {
        self.car.clone()
    }

    /// The topics without which too little is known of the vehicle.
    pub fn needs(&self) -> &'static [Role] {
        self.vehicle.needs()
    }

    /// Which instant of ROS's clock the run's time zero is.
    pub fn epoch(&self) -> Epoch {
        Epoch { ns: self.epoch_ns }
    }

    /// Counts of the messages, by topic.
    pub fn tallies(&self) -> impl Iterator<Item = TopicSummary<'_>> {
        self.topics.iter().map(|(name, topic)| {
            let Topic { role, tally, clock, .. } = topic;
            TopicSummary { name, role: *role, tally, clock }
        })
    }

    /// Requests of persons since the last call.
    pub fn requests(&mut self) -> Vec<Request> {
        std::mem::take(&mut self.requests)
    }

    /// Takes in a message of the topic called `name` in the mapping, received at `now`; what it comes to is added
    /// to `out`. It is checked first: a recorded message was not by anybody.
    pub fn take(&mut self, name: &str, message: &AnyMessage, now: Time, out: &mut Vec<Arrived>) {
        let Some(mut topic) = self.topics.remove(name) else { return };
        topic.tally.received += 1;
        let taken = self.judge(&mut topic, message, now).and_then(|stamp| {
            self.convert(name, &topic, message, Instants { at: now, stamp }, out).map_err(|error| {
                topic.tally.refused.not_usable += 1;
                error.to_string()
            })
        });
        match taken {
            Ok(()) => {
                topic.tally.used += 1;
                topic.tally.heard = Some(now);
            }
            Err(why) => topic.tally.last_refusal = Some(why),
        }
        self.topics.insert(name.to_owned(), topic);
    }

    /// The instant that a message describes, if it may be believed.
    fn judge(&self, topic: &mut Topic, message: &AnyMessage, now: Time) -> Result<Time, String> {
        let refused = &mut topic.tally.refused;
        message.check().map_err(|invalid| {
            refused.implausible += 1;
            invalid.to_string()
        })?;
        let Some(stamp) = message.stamp() else { return Ok(topic.clock.unstamped(now)) };
        topic.clock.time(stamp.ns(), now, self.epoch_ns).map_err(|verdict| {
            let (counter, why) = match verdict {
                StampVerdict::Backwards => {
                    (&mut refused.backwards, "its stamp is older than the one before it")
                }
                StampVerdict::Ahead => (&mut refused.ahead, "its stamp is from the future"),
                StampVerdict::Behind => (&mut refused.behind, "its stamp is from long ago"),
                _ => (&mut refused.unset, "it has no stamp"),
            };
            *counter += 1;
            why.to_owned()
        })
    }

    fn convert(
        &mut self,
        name: &str,
        topic: &Topic,
        message: &AnyMessage,
        Instants { at, stamp }: Instants,
        out: &mut Vec<Arrived>,
    ) -> Result<(), ConvertError> {
        self.take_vehicle(topic.role, message, Instants { at, stamp }, out);
        let input = match message {
            AnyMessage::Odometry(odometry) => {
                let speed_mps = odometry.twist.twist.linear.x;
                let accel_mps2 = self.accel.at(stamp, speed_mps);
                let beside = Beside { accel_mps2, steering_rad: self.steering_rad() };
                let ego = ego_from_ros(odometry, self.epoch(), &self.map, &self.base_link, beside)?;
                Input::Pose(EgoState { stamp, ..ego })
            }
            AnyMessage::PoseStamped(pose) => self.pose(&pose.header, &pose.pose, stamp)?,
            AnyMessage::PoseWithCovarianceStamped(pose) => self.pose(&pose.header, &pose.pose.pose, stamp)?,
            AnyMessage::AccelWithCovarianceStamped(accel) => {
                self.accel.reported = Some((stamp, accel.accel.accel.linear.x));
                return Ok(());
            }
            AnyMessage::PredictedObjects(objects) => {
                let (tracks, _) = objects_from_ros(objects, self.epoch(), &self.map, &mut self.identities)?;
                let obstacle = |track: swerve_msg::Track| Obstacle {
                    id: track.id,
                    kind: track.kind,
                    pose: track.pose,
                    extent: track.extent,
                    velocity_mps: track.velocity_mps,
                    visible_share: 1.0,
                };
                let obstacles = tracks.tracks.into_iter().map(obstacle).collect();
                Input::Objects(ObstacleList { stamp, obstacles })
            }
            AnyMessage::Imu(imu) => {
                let unturned =
                    Transform::<Ego, convert::Sensor>::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
                Input::Imu(Imu { stamp, ..imu_from_ros(imu, self.epoch(), &unturned)? })
            }
            AnyMessage::NavSatFix(fix) => Input::Gnss(Gnss { stamp, ..gnss_from_ros(fix, self.epoch())? }),
            AnyMessage::CameraInfo(info) => {
                // The topic of the camera is the one in the same frame; where there is one camera it is that.
                let of = self.cameras.len() == 1;
                let same_frame = |name: &String| {
                    self.topics.get(name).is_some_and(|camera| camera.frame == info.header.frame_id)
                };
                let name = self.cameras.keys().find(|name| of || same_frame(name)).cloned();
                if let Some(known) = name.and_then(|name| self.cameras.get_mut(&name)) {
                    *known = camera_from_ros(info, known.ego_from_camera)?;
                }
                return Ok(());
            }
            AnyMessage::Image(image) => {
                let Some(camera) = self.cameras.get(name) else { return Ok(()) };
                let image = image_from_ros(image, self.epoch(), *camera)?;
                Input::Image(name.to_owned(), Image { stamp, ..image })
            }
            AnyMessage::PointCloud2(cloud) => {
                if !self.lidars.iter().any(|lidar| lidar == name) {
                    return Ok(());
                }
                let cloud = cloud_from_ros(cloud, self.epoch())?;
                Input::Cloud(name.to_owned(), PointCloud { stamp, ..cloud })
            }
            _ => return Ok(()),
        };
        out.push(Arrived { at, stamp, input });
        Ok(())
    }

    /// Takes in reports of the vehicle and requests of persons.
    fn take_vehicle(
        &mut self,
        role: Role,
        message: &AnyMessage,
        Instants { at, stamp }: Instants,
        out: &mut Vec<Arrived>,
    ) {
        match (role, message) {
            (Role::Enable, AnyMessage::Empty(_)) => self.requests.push(Request::Drive(true)),
            (Role::Enable, AnyMessage::Engage(engage)) => self.requests.push(Request::Drive(engage.engage)),
            (Role::Enable, AnyMessage::RaptorGlobalEnableCmd(switch)) => {
                self.requests.push(Request::Drive(switch.global_enable));
            }
            (Role::Disable, _) => self.requests.push(Request::Drive(false)),
            (Role::Emergency, AnyMessage::Bool(stop)) => self.requests.push(Request::Emergency(stop.data)),
            _ => {}
        }
        let facts = self.vehicle.facts(message);
        let needs = self.vehicle.needs();
        let mut car = lock(&self.car);
        let driver_before = car.driver();
        car.hear(role, message.kind(), stamp, facts);
        // One report for each round of messages, and at once where the driver takes over or lets go.
        if needs.first() == Some(&role) || car.driver() != driver_before {
            let report = car.report(needs);
            drop(car);
            out.extend(report.map(|report| {
                let stamp = self.reported.unstamped(at);
                Arrived { at, stamp, input: Input::Report(report) }
            }));
        }
    }

    fn steering_rad(&self) -> f64 {
        lock(&self.car).steering_rad.unwrap_or(0.0)
    }

    fn pose(&mut self, header: &Header, pose: &geo::Pose, stamp: Time) -> Result<Input, ConvertError> {
        let (speed_mps, yaw_rate_radps, steering_rad) = {
            let car = lock(&self.car);
            (car.speed_mps.unwrap_or(0.0), car.yaw_rate_radps.unwrap_or(0.0), car.steering_rad.unwrap_or(0.0))
        };
        let wheels = WheelOdometry { speed_mps, yaw_rate_radps, steering_rad, ..WheelOdometry::default() };
        let accel_mps2 = self.accel.at(stamp, speed_mps);
        let ego = ego_from_pose(header, pose, self.epoch(), &self.map, &wheels, accel_mps2)?;
        Ok(Input::Pose(EgoState { stamp, ..ego }))
    }
}
