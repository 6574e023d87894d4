use super::*;
use crate::message::Kind;

fn parse(text: &str) -> Result<Mapping, MappingError> {
    let table: Table = text.parse().expect("the test's table is TOML");
    let empty = Table::new();
    let ros2 = table.get("ros2").map_or(&empty, |value| value.as_table().expect("a table"));
    Mapping::from_table(ros2, Network::default())
}

#[test]
fn built_in_tables_are_whole() {
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
        assert_eq!(mapping.topic("command").is_some(), vehicle == Vehicle::Autoware);
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

#[test]
fn a_table_changes_what_it_names_and_nothing_else() {
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
fn mistakes_name_the_key_and_the_nearest() {
    let check = |text: &str, wanted: &str| assert_eq!(parse(text).unwrap_err().to_string(), wanted);
    check("ros2.vehicel = 'autoware'", "`vehicel`: there is no `vehicel`; did you mean `vehicle`?");
    check("ros2.vehicle = 'autowear'", "`vehicle`: there is no `autowear`; did you mean `autoware`?");
    check(
        "ros2.topics.lidr.topic = '/points'",
        "`topics.lidr`: there is no `lidr`; a topic of another name needs `role`; did you mean `lidar`?",
    );
    check(
        "ros2.topics.lidar.quos = 'sensor'",
        "`topics.lidar.quos`: there is no `quos`; did you mean `qos`?",
    );
    check(
        "ros2.topics.lidar.qos = 'sensors'",
        "`topics.lidar.qos`: there is no `sensors`; did you mean `sensor`?",
    );
    check(
        "ros2.topics.lidar.qos.reliability = 'best-effort'",
        "`topics.lidar.qos.reliability`: there is no `best-effort`; did you mean `best_effort`?",
    );
    check(
        "ros2.topics.lidar.type = 'sensor_msgs/msg/PointCloud'",
        "`topics.lidar.type`: `sensor_msgs/msg/PointCloud` is no type that `lidar` can have; did you mean \
         `sensor_msgs/msg/PointCloud2`?",
    );
    check(
        "ros2.topics.lidar.topic = 'points'",
        "`topics.lidar.topic`: a name in ROS such as \"/sensing/lidar\" was expected, not `\"points\"`",
    );
    check(
        "ros2.topics.left = { role = 'camera' }",
        "`topics.left.topic`: a topic that is not in the vehicle's table needs its name in ROS",
    );
    check("ros2.domain = 500", "`domain`: a whole number from 0 to 232 was expected, not `500`");
    check(
        "ros2.topics.imu.rate_max_hz = nan",
        "`topics.imu.rate_max_hz`: a rate from 0.01 to 100000 was expected, not `nan`",
    );
    check(
        "ros2.topics.imu.topic = '/sensing/gnss/nav_sat_fix'",
        "`topics.imu.topic`: `gnss` is on `/sensing/gnss/nav_sat_fix` too",
    );
    check("ros2.node = '1st'", "`node`: a name of letters, digits and `_` was expected, not `\"1st\"`");
    check("ros2.topics.lidar = 3", "`topics.lidar`: a table was expected, not `3`");
}

/// The table that the page about two hosts shows.
#[test]
fn the_documented_table_is_one() {
    let page = include_str!("../../../../docs/howto/two_hosts.md");
    let start = page.find("[ros2]").unwrap();
    let length = page[start..].find("```").unwrap();
    let mapping = parse(&page[start..start + length]).unwrap();
    assert_eq!((mapping.vehicle, mapping.network.domain), (Vehicle::Plain, 42));
    assert_eq!(mapping.topic("lidar").unwrap().frame, "front_lidar");
    assert_eq!(mapping.with_role(Role::Camera).count(), 2);
}
