//! Mounting poses and topics of the sensors of a run.

use swerve_core::Time;
use swerve_geom::{Ego, Point, Transform};
use swerve_msg::{Gnss, Imu};
use swerve_ros2::convert::{Epoch, Sensor, edge_to_ros};
use swerve_ros2::mapping::{Mapping, Role, TopicMap};
use swerve_ros2::msg::tf2_msgs::TFMessage;
use swerve_stack::Assembly;
use swerve_stack::Setup;

/// A sensor of the run with its topics.
#[derive(Clone, Debug)]
pub(super) struct Mount {
    /// Name in the configuration.
    pub(super) sensor: String,
    /// ROS frame.
    pub(super) frame: String,
    /// Names of its topics in the mapping.
    pub(super) topics: Vec<String>,
    ego_from_sensor: Transform<Ego, Sensor>,
}

/// Sensors of a run with a mounting pose.
#[derive(Clone, Debug, Default)]
pub(super) struct Mounts {
    pub(super) cameras: Vec<Mount>,
    pub(super) lidars: Vec<Mount>,
    others: Vec<Mount>,
    left_over: Vec<String>,
}

impl Mounts {
    pub(super) fn new(config: &Setup, assembly: &Assembly, mapping: &Mapping) -> Self {
        let shape = &config.sim.vehicle.shape;
        let cameras = config.camera.iter().filter(|(name, camera)| config.runs(name) && camera.wanted().rgb);
        let cameras = cameras.map(|(name, camera)| (name.as_str(), unnamed(camera.ego_from_camera())));
        let lidars = config.lidar.iter().filter(|(name, _)| config.runs(name));
        let lidars = lidars.map(|(name, lidar)| (name.as_str(), unnamed(lidar.ego_from_lidar(shape))));
        let mut left_over = Vec::new();
        let roles = [Role::Camera, Role::CameraCompressed, Role::CameraInfo];
        let cameras = assigned(mapping, &roles, cameras.collect(), &mut left_over);
        let lidars = assigned(mapping, &[Role::Lidar], lidars.collect(), &mut left_over);
        let upright = |at| Transform::from_roll_pitch_yaw(at, 0.0, 0.0, 0.0);
        let vehicle = &config.sim.vehicle;
        let of_gravity = Point::new(vehicle.cg_to_rear_m(), 0.0, vehicle.body.cg_height_m);
        let imu = assembly.publisher::<Imu>().map(|imu| (imu, Role::Imu, upright(of_gravity)));
        let origin = Point::new(0.0, 0.0, 0.0);
        let gnss = assembly.publisher::<Gnss>().map(|gnss| (gnss, Role::Gnss, upright(origin)));
        let others = imu.into_iter().chain(gnss).flat_map(|(sensor, role, ego_from_sensor)| {
            mapping.with_role(role).map(move |topic| Mount {
                sensor: sensor.to_owned(),
                frame: frame_of(topic).to_owned(),
                topics: vec![topic.name.clone()],
                ego_from_sensor,
            })
        });
        Self { cameras, lidars, others: others.collect(), left_over }
    }

    /// Names of cameras and lidars without a topic.
    pub(super) fn without_topic(&self) -> &[String] {
        &self.left_over
    }

    /// Returns true if a topic of a camera or lidar has a sensor.
    pub(super) fn feed(&self, topic: &str) -> bool {
        self.cameras.iter().chain(&self.lidars).any(|mount| mount.topics.iter().any(|name| name == topic))
    }

    /// Static transforms of all sensors.
    pub(super) fn edges(&self, base_link: &str, at: Time, epoch: Epoch) -> TFMessage {
        let mounts = self.cameras.iter().chain(&self.lidars).chain(&self.others);
        let edges = mounts.filter(|mount| mount.frame != base_link);
        let edge = |mount: &Mount| edge_to_ros(&mount.ego_from_sensor, base_link, &mount.frame, at, epoch);
        TFMessage { transforms: edges.map(edge).collect() }
    }
}

/// Frame of a topic; its name if it has no frame.
pub(super) fn frame_of(topic: &TopicMap) -> &str {
    if topic.frame.is_empty() { &topic.name } else { &topic.frame }
}

fn unnamed<F>(ego_from_sensor: Transform<Ego, F>) -> Transform<Ego, Sensor> {
    Transform::new(ego_from_sensor.origin(), ego_from_sensor.rotation())
}

/// Assigns topics to sensors. All topics of one frame belong to one sensor: the one named like a topic of the
/// frame; remaining frames are assigned to remaining sensors in order.
fn assigned(
    mapping: &Mapping,
    roles: &[Role],
    sensors: Vec<(&str, Transform<Ego, Sensor>)>,
    left_over: &mut Vec<String>,
) -> Vec<Mount> {
    let topics: Vec<&TopicMap> = roles.iter().flat_map(|role| mapping.with_role(*role)).collect();
    let mut frames: Vec<&str> = Vec::new();
    // The vehicle's standard topics are named after their roles; they come first.
    let own = |topic: &&&TopicMap| topic.name == topic.role.name();
    for topic in topics.iter().filter(own).chain(topics.iter().filter(|topic| !own(topic))) {
        if !frames.contains(&frame_of(topic)) {
            frames.push(frame_of(topic));
        }
    }
    let named = |sensor: &str| topics.iter().find(|topic| topic.name == sensor).map(|topic| frame_of(topic));
    let mut free: Vec<&str> = frames.clone();
    free.retain(|frame| !sensors.iter().any(|(sensor, _)| named(sensor) == Some(frame)));
    let mut free = free.into_iter();
    let mut mounts = Vec::new();
    for (sensor, ego_from_sensor) in sensors {
        let Some(frame) = named(sensor).or_else(|| free.next()) else {
            left_over.push(sensor.to_owned());
            continue;
        };
        let topics = topics.iter().filter(|topic| frame_of(topic) == frame);
        let topics = topics.map(|topic| topic.name.clone()).collect();
        mounts.push(Mount { sensor: sensor.to_owned(), frame: frame.to_owned(), topics, ego_from_sensor });
    }
    mounts
}

#[cfg(test)]
mod tests {
    use swerve_text::Document;

    use super::*;

    fn mounts(text: &str) -> Mounts {
        let config = Setup::from_document(&Document::parse("c.toml", text).unwrap(), &[]).unwrap();
        Mounts::new(&config, &Assembly::new(&config).unwrap(), &config.ros2_mapping().unwrap())
    }

    #[test]
    fn sensors_get_the_topics_of_their_name_or_the_remaining_ones() {
        let text = "[log]\nsensors = [\"a\", \"left\", \"z\", \"top\"]\n[camera.a]\n[camera.left]\n[camera.z]\n\
                    [camera.off]\n[lidar.top]\n[ros2.topics.left]\nrole = \"camera\"\ntopic = \"/left\"\n";
        let mounts = mounts(text);
        let camera = |i: usize| (mounts.cameras[i].sensor.as_str(), mounts.cameras[i].frame.as_str());
        assert_eq!([camera(0), camera(1)], [("a", "camera0/camera_optical_link"), ("left", "left")]);
        assert_eq!(mounts.cameras[0].topics, ["camera", "camera_compressed", "camera_info"]);
        assert_eq!(mounts.cameras[1].topics, ["left"]);
        assert_eq!(mounts.without_topic(), ["z"]);
        assert!(mounts.feed("lidar") && mounts.feed("left") && !mounts.feed("gnss"));
        let edges = mounts.edges("base_link", Time::ZERO, Epoch::default()).transforms;
        let frames: Vec<&str> = edges.iter().map(|edge| edge.child_frame_id.as_str()).collect();
        assert_eq!(frames, ["camera0/camera_optical_link", "left", "lidar_top", "imu_link"]);
    }
}
