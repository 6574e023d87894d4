//! Mapping of streams to ROS 2 topics, `[ros2]`: kept as written, checked by the bridge's mapping.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Driver of the simulated car.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EgoDriver {
    /// Our own stack.
    #[default]
    Stack,
    /// Another stack, by the command topics of `[ros2]`, through the safety gate. The car stands still until it is
    /// engaged.
    Ros2,
}

#[cfg(test)]
mod tests {
    use swerve_ros2::mapping::Vehicle;
    use swerve_text::Document;

    use crate::Setup;

    fn read(text: &str) -> Result<Setup, Vec<String>> {
        let document = Document::parse("c.toml", text).unwrap();
        Setup::from_document(&document, &[])
            .map_err(|problems| problems.iter().map(ToString::to_string).collect())
    }

    #[test]
    fn ros2_problems_are_reported_with_line_and_key() {
        let text = "[ros2]\nvehicle = \"autowear\"\nspeed = 3\n[ros2.topics.lidr]\ntopic = \"/points\"\n\
                    [ros2.topics.camera_left]\nrole = \"camera\"\n[ros2.topics.imu]\nqos = \"sensr\"\n";
        let said = read(text).unwrap_err();
        for (line, says) in [
            ("c.toml:2: ros2.vehicle: expected one of \"autoware\", ", "; did you mean `autoware`?"),
            ("c.toml:3: ros2.speed: unknown key; expected one of \"domain\", ", "\"vehicle\""),
            ("c.toml:4: ros2.topics.lidr: unknown topic", "; did you mean `lidar`?"),
            ("c.toml:6: ros2.topics.camera_left.topic: is missing: a topic that is not in", "in ROS"),
            ("c.toml:9: ros2.topics.imu.qos: expected one of ", "found \"sensr\"; did you mean `sensor`?"),
        ] {
            assert!(said.iter().any(|s| s.starts_with(line) && s.ends_with(says)), "{line}: {said:#?}");
        }
        assert_eq!(said.len(), 5, "{said:#?}");
        // A value that is not a table is reported with its type.
        assert_eq!(read("ros2 = 3\n").unwrap_err(), ["c.toml:1: ros2: expected a table, found 3"]);
        assert_eq!(
            read("[ros2]\ntopics = 3\n").unwrap_err(),
            ["c.toml:2: ros2.topics: expected a table, found 3"]
        );
    }

    #[test]
    fn ros2_driver_needs_the_wall_clock_and_the_gate() {
        let told = read("[ego]\ndriver = \"ros2\"\n[ros2]\nvehicle = \"plain\"\n").unwrap_err();
        let keys: Vec<&str> = told.iter().map(|t| t.split(": ").nth(1).unwrap()).collect();
        assert_eq!(keys, ["ros2.vehicle", "clock.source", "gate.enabled"], "{told:?}");
        let right = "[ego]\ndriver = \"ros2\"\n[clock]\nsource = \"wall\"\n[gate]\nenabled = true\n";
        assert_eq!(read(right).unwrap().pipeline_name(), "ros2");
    }

    #[test]
    fn ros2_table_is_kept_as_written() {
        let config =
            read("[ros2]\nvehicle = \"plain\"\ndomain = 7\n[ros2.topics.lidar]\ntopic = \"/os1\"\n").unwrap();
        let document = Document::parse("resolved", config.to_text()).unwrap();
        assert_eq!(Setup::from_document(&document, &[]).unwrap().config, config.config);
        let mapping = config.ros2_mapping().unwrap();
        assert_eq!((mapping.vehicle, mapping.network.domain), (Vehicle::Plain, 7));
        assert_eq!(mapping.topic("lidar").unwrap().topic, "/os1");
    }
}
