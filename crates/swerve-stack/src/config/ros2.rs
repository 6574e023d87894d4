//! Which stream is which ROS 2 topic, `[ros2]`: as written, checked by the bridge's own mapping.

use anyhow::Context as _;
use serde::{Deserialize, Serialize};
use swerve_ros2::env::Network;
use swerve_ros2::mapping::{Mapping, MappingError, Vehicle};
use toml::Table;

use super::Config;
use super::clock::Clock;

/// Who drives the simulated car.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EgoDriver {
    /// Our own stack.
    #[default]
    Stack,
    /// Another one, by the command topics of `[ros2]`, through the safety gate. The car stands until it is engaged.
    Ros2,
}

impl Config {
    /// Whether another stack drives, over ROS 2.
    pub fn is_driven_over_ros2(&self) -> bool {
        self.ego.driver == EgoDriver::Ros2
    }

    fn check_driver(&self, told: &mut Vec<(String, String)>) {
        if !self.is_driven_over_ros2() {
            return;
        }
        let mut tell = |key: &str, message: &str| told.push((key.to_owned(), message.to_owned()));
        if self.clock.source != Clock::Wall {
            tell(
                "clock.source",
                "ego.driver is \"ros2\": expected \"wall\", another stack lives by the real clock",
            );
        }
        if !self.gate.enabled {
            tell(
                "gate.enabled",
                "ego.driver is \"ros2\": expected true, what comes from outside goes through the gate",
            );
        }
        if !self.process.is_empty() {
            tell("process", "ego.driver is \"ros2\": nothing runs that could be moved to a process");
        }
        // What is wrong with the table itself is told by its own check.
        if self.ros2_mapping().is_ok_and(|mapping| mapping.vehicle == Vehicle::Plain) {
            tell(
                "ros2.vehicle",
                "ego.driver is \"ros2\": expected a vehicle with commands, \"plain\" has none",
            );
        }
    }

    /// The topics of `[ros2]`, on the network that the environment names where the table does not.
    ///
    /// # Errors
    /// A variable of the environment that says nothing that ROS knows.
    pub fn ros2_mapping(&self) -> anyhow::Result<Mapping> {
        let network = Network::from_variables(|name| std::env::var(name).ok())?;
        Mapping::from_table(&self.ros2, network).context("in `[ros2]`")
    }

    /// What is wrong with the table: each fault is taken out of a copy of it, then the next one shows.
    pub(super) fn check_ros2(&self, told: &mut Vec<(String, String)>) {
        self.check_driver(told);
        let mut table = self.ros2.clone();
        while let Err(MappingError { key, problem, nearest }) =
            Mapping::from_table(&table, Network::default())
        {
            let hint = nearest.map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"));
            told.push((format!("ros2.{key}"), format!("{problem}{hint}")));
            if !take_out(&mut table, &key) {
                break;
            }
        }
    }
}

/// Removes the value at a dotted key, or the nearest table around it that is there.
fn take_out(table: &mut Table, key: &str) -> bool {
    let Some((first, rest)) = key.split_once('.') else { return table.remove(key).is_some() };
    let inner = table.get_mut(first).and_then(toml::Value::as_table_mut);
    inner.is_some_and(|inner| take_out(inner, rest)) || table.remove(first).is_some()
}

#[cfg(test)]
mod tests {
    use swerve_ros2::mapping::Vehicle;

    use crate::config::Config;
    use crate::config::text::Document;

    fn read(text: &str) -> Result<Config, Vec<String>> {
        let document = Document::parse("c.toml", text.to_owned()).unwrap();
        let told = |problems: Vec<_>| problems.iter().map(ToString::to_string).collect();
        Config::from_document(&document, &[]).map_err(told)
    }

    #[test]
    fn all_faults_are_told_with_line_and_key() {
        let text = "[ros2]\nvehicle = \"autowear\"\nspeed = 3\n[ros2.topics.lidr]\ntopic = \"/points\"\n\
                    [ros2.topics.camera_left]\nrole = \"camera\"\n[ros2.topics.imu]\nqos = \"sensr\"\n";
        let told = read(text).unwrap_err();
        let lines: Vec<&str> = told.iter().map(|t| t.split_once(": ").unwrap().0).collect();
        assert_eq!(lines, ["c.toml:2", "c.toml:3", "c.toml:6", "c.toml:9", "c.toml:4"], "{told:#?}");
        assert!(
            told[0].ends_with("ros2.vehicle: there is no `autowear` (did you mean `autoware`?)"),
            "{told:?}"
        );
        assert!(told[2].contains("ros2.topics.camera_left.topic: a topic that is not in"), "{told:?}");
        assert!(told[3].ends_with("(did you mean `sensor`?)"), "{told:?}");
        assert!(told[4].ends_with("(did you mean `lidar`?)"), "{told:?}");
        // A table of another form than a table is told by its kind.
        assert!(read("ros2 = 3\n").unwrap_err()[0].starts_with("c.toml:1: ros2: expected a table"));
        assert!(read("[ros2]\ntopics = 3\n").unwrap_err()[0].starts_with("c.toml:2: ros2.topics: a table"));
    }

    #[test]
    fn another_driver_needs_the_real_clock_and_the_gate() {
        let told = read("[ego]\ndriver = \"ros2\"\n[ros2]\nvehicle = \"plain\"\n").unwrap_err();
        let keys: Vec<&str> = told.iter().map(|t| t.split(": ").nth(1).unwrap()).collect();
        assert_eq!(keys, ["clock.source", "gate.enabled", "ros2.vehicle"], "{told:?}");
        let right = "[ego]\ndriver = \"ros2\"\n[clock]\nsource = \"wall\"\n[gate]\nenabled = true\n";
        assert_eq!(read(right).unwrap().pipeline_name(), "ros2");
    }

    #[test]
    fn the_table_is_kept_as_it_is() {
        let config =
            read("[ros2]\nvehicle = \"plain\"\ndomain = 7\n[ros2.topics.lidar]\ntopic = \"/os1\"\n").unwrap();
        let document = Document::parse("resolved", config.to_text()).unwrap();
        assert_eq!(Config::from_document(&document, &[]).unwrap(), config);
        let mapping = config.ros2_mapping().unwrap();
        assert_eq!((mapping.vehicle, mapping.network.domain), (Vehicle::Plain, 7));
        assert_eq!(mapping.topic("lidar").unwrap().topic, "/os1");
    }
}
