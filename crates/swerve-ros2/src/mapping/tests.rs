//! Tests of mappings from TOML.

use super::*;
use crate::message::Kind;

fn parse(text: &str) -> Result<Mapping, Problems> {
    let table: Table = text.parse().expect("the test's table is TOML");
    let empty = Table::new();
    let ros2 = table.get("ros2").map_or(&empty, |value| value.as_table().expect("a table"));
    Mapping::from_table(ros2, Network::default())
}

#[test]
fn built_in_mappings_are_complete() {
    for (name, vehicle) in Vehicle::NAMES {
        let mapping = Mapping::of(vehicle, Network::default());
        assert_eq!(vehicle.name(), name);
        for topic in &mapping.topics {
            assert!(topic.role.kinds().contains(&topic.kind), "{name} {}", topic.name);
            assert!(topic.topic.starts_with('/') && topic.qos.depth > 0);
            assert_eq!(
                mapping.topics.iter().filter(|other| other.topic == topic.topic).count(),
                1,
                "{}",
                topic.topic
            );
        }
        assert!(mapping.topic("lidar").is_some() && mapping.topic("clock").is_some());
        assert_eq!(mapping.topic("command").is_some(), matches!(vehicle, Vehicle::Autoware | Vehicle::Carla));
        assert_eq!(
            mapping.topic("steering_command").is_some(),
            matches!(vehicle, Vehicle::Dataspeed | Vehicle::Raptor)
        );
    }
    let autoware = Mapping::of(Vehicle::Autoware, Network::default());
    let command = autoware.topic("command").unwrap();
    assert_eq!((command.topic.as_str(), command.kind), ("/control/command/control_cmd", Kind::Control));
    assert_eq!(command.qos, Qos { reliable: true, transient_local: false, depth: 1 });
    assert!(!autoware.topic("lidar").unwrap().qos.reliable);
}

/// The bridge's writers are reliable and volatile, so that readers of either kind receive; its reader is reliable.
#[test]
fn carla_topics_have_the_names_types_and_frames_of_its_bridge() {
    let carla = Mapping::of(Vehicle::Carla, Network::default());
    for (name, topic, kind, is_reliable, frame) in [
        ("clock", "/clock", Kind::Clock, false, ""),
        ("odometry", "/carla/hero/odometry", Kind::Odometry, true, "map"),
        ("velocity", "/carla/hero/vehicle_status", Kind::CarlaEgoVehicleStatus, true, ""),
        ("command", "/carla/hero/vehicle_control_cmd", Kind::CarlaEgoVehicleControl, true, ""),
        ("imu", "/carla/hero/imu", Kind::Imu, false, "hero/imu"),
        ("gnss", "/carla/hero/gnss", Kind::NavSatFix, false, "hero/gnss"),
        ("lidar", "/carla/hero/lidar", Kind::PointCloud2, false, "hero/lidar"),
        ("camera", "/carla/hero/rgb_front/image", Kind::Image, false, "hero/rgb_front"),
        ("camera_info", "/carla/hero/rgb_front/camera_info", Kind::CameraInfo, false, "hero/rgb_front"),
    ] {
        let found = carla.topic(name).unwrap();
        assert_eq!(
            (found.topic.as_str(), found.kind, found.qos.reliable, found.frame.as_str()),
            (topic, kind, is_reliable, frame),
            "{name}"
        );
        assert!(!found.qos.transient_local, "{name}: the bridge's writers are volatile");
    }
}

#[test]
fn mapping_table_changes_only_the_named_keys() {
    let mapping = parse(
        r#"
        [ros2]
        vehicle = "dataspeed"
        node = "driver"
        domain = 7
        localhost_only = true
        service_mapping = "cyclone"
        [ros2.frames]
        map = "world"
        [ros2.topics.lidar]
        topic = "/os1/points"
        frame = "os1"
        qos = "default"
        rate_max_hz = 40
        [ros2.topics.velocity]
        type = "ds_dbw_msgs/msg/UlcReport"
        qos = { reliability = "best_effort", depth = 3 }
        [ros2.topics.camera_left]
        role = "camera"
        topic = "/left/image_raw"
        [ros2.topics.gear]
        enabled = false
        "#,
    )
    .unwrap();
    assert_eq!((mapping.node.as_str(), mapping.map_frame.as_str()), ("driver", "world"));
    assert_eq!(mapping.network, Network { domain: 7, localhost_only: true });
    assert_eq!(mapping.service_map, ServiceMap::Cyclone);
    let lidar = mapping.topic("lidar").unwrap();
    assert_eq!(
        (lidar.topic.as_str(), lidar.frame.as_str(), lidar.rate_max_hz),
        ("/os1/points", "os1", Some(40.0))
    );
    assert_eq!(lidar.qos, Qos::DEFAULT);
    let velocity = mapping.topic("velocity").unwrap();
    assert_eq!(
        (velocity.kind, velocity.qos.reliable, velocity.qos.depth),
        (Kind::DataspeedUlcReport, false, 3)
    );
    assert_eq!(mapping.with_role(Role::Camera).count(), 2);
    assert!(mapping.topic("gear").is_none());
    assert_eq!(mapping.topic("imu"), Mapping::of(Vehicle::Dataspeed, Network::default()).topic("imu"));
}

#[test]
fn mapping_errors_name_the_key_and_the_nearest_valid_one() {
    let roles = || Role::ALL.iter().map(|role| format!("\"{}\"", role.name())).collect::<Vec<_>>().join(", ");
    #[rustfmt::skip]
    let cases = [
        ("vehicel = 'autoware'", "vehicel: unknown key; did you mean `vehicle`?"),
        ("vehicle = 'autowear'",
         "vehicle: expected one of \"autoware\", \"dataspeed\", \"raptor\", \"carla\", \"plain\", found \"autowear\"; did you mean `autoware`?"),
        ("topics.lidr.topic = '/points'",
         "topics.lidr: unknown topic; one of another name needs `role`; did you mean `lidar`?"),
        ("topics.lidar.quos = 'sensor'", "topics.lidar.quos: unknown key; did you mean `qos`?"),
        ("topics.lidar.qos = 'sensors'",
         "topics.lidar.qos: expected one of \"sensor\", \"default\", \"vehicle\", \"latched\", found \"sensors\"; did you mean `sensor`?"),
        ("topics.lidar.qos.reliability = 'best-effort'",
         "topics.lidar.qos.reliability: expected one of \"reliable\", \"best_effort\", found \"best-effort\"; did you mean `best_effort`?"),
        ("topics.lidar.qos.depth = 0", "topics.lidar.qos.depth: expected a whole number from 1 to 10000, found 0"),
        ("topics.lidar.type = 'sensor_msgs/msg/PointCloud'",
         "topics.lidar.type: expected one of \"sensor_msgs/msg/PointCloud2\", found \"sensor_msgs/msg/PointCloud\"; did you mean `sensor_msgs/msg/PointCloud2`?"),
        ("topics.lidar.topic = 'points'",
         "topics.lidar.topic: expected a name in ROS such as \"/sensing/lidar\", found the text \"points\""),
        ("topics.left = { role = 'camera' }",
         "topics.left.topic: is missing: a topic that is not in the vehicle's table needs its name in ROS"),
        ("domain = 500", "domain: expected a whole number from 0 to 232, found 500"),
        ("localhost_only = 1", "localhost_only: expected true or false, found 1"),
        ("topics.imu.rate_max_hz = nan", "topics.imu.rate_max_hz: expected a number from 0.01 to 100000, found nan"),
        ("topics.imu.topic = '/sensing/gnss/nav_sat_fix'",
         "topics.imu.topic: `gnss` is on `/sensing/gnss/nav_sat_fix` too"),
        ("topics.odometry.topic = '/control/command/control_cmd'",
         "topics.odometry.topic: `command` is on `/control/command/control_cmd` too, with messages of type autoware_control_msgs/msg/Control"),
        ("topics.imu.role = 'gnss'", "topics.imu.role: it is `imu` in the vehicle's table"),
        ("node = '1st'", "node: expected a name of letters, digits and `_`, found the text \"1st\""),
        ("topics.lidar = 3", "topics.lidar: expected a table, found 3"),
        ("topics = [1]", "topics: expected a table, found an array of 1"),
    ];
    for (text, wanted) in cases {
        let said = parse(&format!("ros2.{text}")).unwrap_err();
        assert_eq!(said.to_string(), format!("[ros2]: {wanted}"), "{text}");
    }
    let said = parse("ros2.topics.left = { role = 3, topic = '/left' }").unwrap_err().to_string();
    assert_eq!(said, format!("[ros2]: topics.left.role: expected one of {}, found 3", roles()));
}

#[test]
fn mapping_reports_all_errors_at_once() {
    let text =
        "[ros2]\ndomain = -1\nnode = 3\n[ros2.frames]\nmap = 1\n[ros2.topics.imu]\nqos = 1\nfrme = 'x'\n";
    let keys: Vec<String> = parse(text).unwrap_err().iter().map(|problem| problem.key.clone()).collect();
    assert_eq!(keys, ["node", "domain", "frames.map", "topics.imu.qos", "topics.imu.frme"]);
}

/// The table in the page about two hosts.
#[test]
fn documented_mapping_is_valid() {
    let page = include_str!("../../../../docs/howto/two_hosts.md");
    let start = page.find("[ros2]").unwrap();
    let length = page[start..].find("```").unwrap();
    let mapping = parse(&page[start..start + length]).unwrap();
    assert_eq!((mapping.vehicle, mapping.network.domain), (Vehicle::Plain, 42));
    assert_eq!(mapping.topic("lidar").unwrap().frame, "front_lidar");
    assert_eq!(mapping.with_role(Role::Camera).count(), 2);
}
