//! Intake: from live or recorded ROS messages to inputs of the graph.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use serde::Serialize;
use swerve_core::{Span, Time};
use swerve_geom::{Ego, Point, Pose2, Transform, math};
use swerve_msg::{CameraInfo, EgoState, Gnss, Image, Imu, Obstacle, ObstacleList, PointCloud, WheelOdometry};
use swerve_ros2::AnyMessage;
use swerve_ros2::clock::{ClockParams, StampVerdict};
use swerve_ros2::convert::{
    self, Beside, ConvertError, Epoch, Identities, camera_from_ros, cloud_from_ros, ego_from_pose,
    ego_from_ros, gnss_from_ros, image_from_ros, imu_from_ros, objects_from_ros,
};
use swerve_ros2::mapping::{Mapping, Role};
use swerve_ros2::msg::geometry_msgs as geo;
use swerve_ros2::msg::std_msgs::Header;
use swerve_stack::Setup;
use swerve_stack::config::perception::image_camera;

pub use super::input::{Arrived, Input, names};
use super::shared::lock;
use super::simulated::DriveClock;
use super::time::TopicClock;
use super::vehicle::{Car, VehicleInterface};

/// Low-pass weight of a new speed difference in the acceleration, since speeds are noisy.
const ACCEL_SHARE: f64 = 0.2;
/// Largest time between two speeds from which an acceleration is computed.
const ACCEL_GAP: Span = Span::from_ms(500);

/// Number of rejected messages by reason.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Refusals {
    /// Implausible numbers, sizes or names.
    pub implausible: u64,
    /// Stamp older than the newest one before.
    pub backwards: u64,
    /// Stamp in the future.
    pub ahead: u64,
    /// Stamp in the distant past.
    pub behind: u64,
    /// Stamp not set.
    pub unset: u64,
    /// Unusable content: another frame, another pixel format, no fix.
    pub not_usable: u64,
}

impl Refusals {
    /// Adds other counts.
    pub fn add(&mut self, others: &Self) {
        let Self { implausible, backwards, ahead, behind, unset, not_usable } = *others;
        self.implausible += implausible;
        self.backwards += backwards;
        self.ahead += ahead;
        self.behind += behind;
        self.unset += unset;
        self.not_usable += not_usable;
    }

    /// Sum over all reasons.
    pub fn total(&self) -> u64 {
        let Self { implausible, backwards, ahead, behind, unset, not_usable } = *self;
        implausible + backwards + ahead + behind + unset + not_usable
    }
}

/// Message counts of a topic.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct TopicTally {
    /// Messages received.
    pub received: u64,
    /// Messages used.
    pub used: u64,
    /// Messages rejected.
    pub refused: Refusals,
    /// Reason for the latest rejection.
    pub last_refusal: Option<String>,
    /// Arrival of the newest message that was used.
    pub heard: Option<Time>,
}

/// Instants of a message, in run time.
#[derive(Clone, Copy)]
struct Instants {
    /// Instant of arrival.
    at: Time,
    /// Instant that the message describes.
    stamp: Time,
}

/// Counts and clock of a topic.
#[derive(Clone, Copy)]
pub struct TopicSummary<'a> {
    /// Name of the topic in the mapping.
    pub name: &'a str,
    /// Role of the topic.
    pub role: Role,
    /// Message counts.
    pub tally: &'a TopicTally,
    /// Clock of its stamps.
    pub clock: &'a TopicClock,
}

/// State of a topic.
struct Topic {
    role: Role,
    frame: String,
    clock: TopicClock,
    tally: TopicTally,
}

/// Reason why the content of a message cannot be used.
struct Unusable(String);

impl From<ConvertError> for Unusable {
    fn from(error: ConvertError) -> Self {
        Self(error.to_string())
    }
}

/// Refuses a cloud most of whose points are farther away than any lidar of a car measures: its unit is another.
fn in_metres(cloud: PointCloud) -> Result<PointCloud, Unusable> {
    const FAR_M: f32 = 500.0;
    let far = |k: &usize| cloud.x_m[*k].abs().max(cloud.y_m[*k].abs()) > FAR_M;
    let count = (0..cloud.len()).filter(far).count();
    if 2 * count <= cloud.len() {
        return Ok(cloud);
    }
    let (points, far_m) = (cloud.len(), FAR_M);
    Err(Unusable(format!(
        "{count} of {points} points are farther than {far_m} m: expected coordinates in metres"
    )))
}

/// A user's request, received on a topic.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Request {
    /// Drive with the stack (true) or stop doing so (false).
    Drive(bool),
    /// Stop the car at once (true), or clear that (false).
    Emergency(bool),
}

/// Converts messages to inputs of the graph. Reads no clock: the instant of arrival is passed in.
pub struct Intake {
    epoch_ns: i64,
    /// Distance of reported poses ahead of the centre of the rear axle, metres.
    pose_ahead_m: f64,
    ignores_stamps: bool,
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

/// Acceleration of the ego: reported, or estimated from its speeds.
#[derive(Default)]
struct Acceleration {
    reported: Option<(Time, f64)>,
    before: Option<(Time, f64)>,
    from_speeds_mps2: f64,
}

impl Acceleration {
    /// Acceleration at `now`, given the present speed.
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

impl Intake {
    /// Creates an intake for the topics of a mapping and the interface `vehicle`; run time zero is `epoch_ns` on
    /// the host's clock.
    ///
    /// Cameras and lidars are those with a table in the configuration, which contains their mounting poses.
    pub fn new(mapping: &Mapping, vehicle: Box<dyn VehicleInterface>, config: &Setup, epoch_ns: i64) -> Self {
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
            pose_ahead_m: live.pose_ahead_m,
            ignores_stamps: false,
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

    /// Sets the clock of the drive: by simulated time, no offsets of stamps are estimated.
    #[must_use]
    pub fn judged_by(mut self, clock: &DriveClock) -> Self {
        if clock.simulated().is_some() {
            self.topics.values_mut().for_each(|topic| topic.clock.use_simulated_time());
        }
        self
    }

    /// Accepts messages with any stamp from now on: simulated time has failed, but the sink needs the vehicle's speed.
    pub fn ignore_stamps(&mut self) {
        self.ignores_stamps = true;
    }

    /// State of the vehicle, shared with the sink.
    pub fn car(&self) -> Arc<Mutex<Car>> {
        self.car.clone()
    }

    /// Roles of the topics required to know the state of the vehicle.
    pub fn needs(&self) -> &'static [Role] {
        self.vehicle.needs()
    }

    /// Instant of the ROS clock at run time zero.
    pub fn epoch(&self) -> Epoch {
        Epoch { ns: self.epoch_ns }
    }

    /// Message counts by topic.
    pub fn tallies(&self) -> impl Iterator<Item = TopicSummary<'_>> {
        self.topics.iter().map(|(name, topic)| {
            let Topic { role, tally, clock, .. } = topic;
            TopicSummary { name, role: *role, tally, clock }
        })
    }

    /// Requests of users since the last call.
    pub fn requests(&mut self) -> Vec<Request> {
        std::mem::take(&mut self.requests)
    }

    /// Processes a message of the topic `name` of the mapping, received at `now`, and appends the resulting inputs
    /// to `out`. Validates the message first, because recorded messages have not been validated.
    pub fn take(&mut self, name: &str, message: &AnyMessage, now: Time, out: &mut Vec<Arrived>) {
        let Some(mut topic) = self.topics.remove(name) else { return };
        topic.tally.received += 1;
        let taken = self.judge(&mut topic, message, now).and_then(|stamp| {
            self.convert(name, &topic, message, Instants { at: now, stamp }, out).map_err(|Unusable(why)| {
                topic.tally.refused.not_usable += 1;
                why
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

    /// Instant that a message describes, if the message is plausible.
    fn judge(&self, topic: &mut Topic, message: &AnyMessage, now: Time) -> Result<Time, String> {
        let refused = &mut topic.tally.refused;
        message.check().map_err(|invalid| {
            refused.implausible += 1;
            invalid.to_string()
        })?;
        let Some(stamp) = message.stamp().filter(|_| !self.ignores_stamps) else {
            return Ok(topic.clock.unstamped(now));
        };
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
    ) -> Result<(), Unusable> {
        self.take_vehicle(topic.role, message, Instants { at, stamp }, out);
        let input = match message {
            AnyMessage::Odometry(odometry) => {
                let speed_mps = odometry.twist.twist.linear.x;
                let accel_mps2 = self.accel.at(stamp, speed_mps);
                let beside = Beside { accel_mps2, steering_rad: self.steering_rad() };
                let ego = ego_from_ros(odometry, self.epoch(), &self.map, &self.base_link, beside)?;
                Input::Pose(EgoState { stamp, pose: self.rear_axle(ego.pose), ..ego })
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
                // The camera's topic is the one with the same frame, or the only one if there is a single camera.
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
                let cloud = in_metres(cloud_from_ros(cloud, self.epoch())?)?;
                Input::Cloud(name.to_owned(), PointCloud { stamp, ..cloud })
            }
            _ => return Ok(()),
        };
        out.push(Arrived { at, stamp, input });
        Ok(())
    }

    /// Processes reports of the vehicle and requests of users.
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
        // One report per round of messages, and immediately when the driver takes over or releases.
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
        Ok(Input::Pose(EgoState { stamp, pose: self.rear_axle(ego.pose), ..ego }))
    }

    /// Pose of the centre of the rear axle for a reported pose.
    fn rear_axle(&self, reported: Pose2) -> Pose2 {
        let (sin, cos) = math::sin_cos(reported.heading_rad);
        let (x_m, y_m) = (reported.x_m - self.pose_ahead_m * cos, reported.y_m - self.pose_ahead_m * sin);
        Pose2::new(x_m, y_m, reported.heading_rad)
    }
}
