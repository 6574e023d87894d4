//! Problems of values that other tables decide.

use swerve_ros2::env::Network;
use swerve_ros2::mapping::{Mapping, Role, Vehicle};

use super::Config;
use super::clock::Clock;
use super::execution::{self, Runtime};
use super::live::{EnableBy, LiveClock};
use super::operator::is_plain_name;
use crate::problems::within;

impl Config {
    pub(crate) fn check_operators(&self, faults: &mut Vec<(String, String)>) {
        for (name, operator) in &self.operator {
            let key = |last: &str| format!("operator.{name}.{last}");
            if !is_plain_name(name) {
                let message = "expected a name of letters, digits and underscores";
                faults.push((format!("operator.{name}"), message.into()));
            }
            if let Some(Err(problem)) = operator.runtime.as_ref().map(Runtime::model_by_key) {
                faults.extend(within(&key("runtime"), vec![problem]));
            }
            if let Some(Err(message)) = operator.policy.as_deref().map(execution::parse_policy) {
                faults.push((key("policy"), message));
            }
            for (k, rung) in operator.rungs.iter().enumerate() {
                let problem = execution::span_ms(rung.ms).err();
                faults.extend(problem.map(|message| (key(&format!("rungs.{k}.ms")), message)));
            }
            if let Some(resource) = operator.uses.as_ref().filter(|r| !self.resource.contains_key(*r)) {
                let names: Vec<&str> = self.resource.keys().map(String::as_str).collect();
                let message = match names.is_empty() {
                    true => {
                        format!("unknown resource `{resource}`: [resource.{resource}] slots = 1 makes it")
                    }
                    false => format!("unknown resource `{resource}`, expected one of {}", names.join(", ")),
                };
                faults.push((key("uses"), message));
            }
        }
    }

    pub(crate) fn check_clock(&self, told: &mut Vec<(String, String)>) {
        let pin = &self.clock.pin;
        for (k, cpu) in pin.iter().enumerate() {
            if pin[..k].contains(cpu) {
                told.push((format!("clock.pin[{k}]"), format!("processor {cpu} is there twice")));
            }
        }
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
        // Problems of the table itself are reported by its own check.
        if self.ros2_mapping().is_ok_and(|mapping| mapping.vehicle == Vehicle::Plain) {
            tell(
                "ros2.vehicle",
                "ego.driver is \"ros2\": expected a vehicle with commands, \"plain\" has none",
            );
        }
    }

    pub(crate) fn check_ros2(&self, problems: &mut Vec<(String, String)>) {
        self.check_driver(problems);
        let found = Mapping::from_table(&self.ros2, Network::default()).err().unwrap_or_default();
        problems.extend(found.into_iter().map(|found| (format!("ros2.{}", found.key), found.message)));
    }

    pub(crate) fn check_source(&self, told: &mut Vec<(String, String)>) {
        let Some(source) = &self.source else { return };
        if source.rosbag.is_empty() {
            told.push(("source.rosbag".into(), "expected the file or the folder of a rosbag2 log".into()));
        }
        if self.live.is_none() {
            let message = "a recorded drive replaces a vehicle of `swerve live`: expected `[live]` as well";
            told.push(("source".into(), message.into()));
        }
    }

    pub(crate) fn check_live(&self, told: &mut Vec<(String, String)>) {
        let Some(live) = &self.live else { return };
        let mut tell = |key: &str, message: String| told.push((key.to_owned(), message));
        if live.route.is_empty() {
            tell("live.route", "is missing: expected the scenario file whose road is to be followed".into());
        }
        // Problems of the table itself are reported by its own check.
        let Ok(mapping) = self.ros2_mapping() else { return };
        if mapping.vehicle == Vehicle::Plain && live.enable == EnableBy::AtStart {
            let message =
                "a vehicle of the table `plain` receives no commands: it can be watched, not driven";
            tell("live.enable", message.into());
        }
        if live.clock == LiveClock::Topic && mapping.topic("clock").is_none() {
            let message =
                "simulated time is read from the topic `clock` of `[ros2.topics]`, which is not enabled";
            tell("live.clock", message.into());
        }
        if mapping.vehicle != Vehicle::Plain && mapping.with_role(Role::Odometry).next().is_none() {
            tell("ros2.topics", "a vehicle that is to be driven needs the topic `odometry`".into());
        }
        for (table, name, role) in self
            .camera
            .keys()
            .map(|name| ("camera", name, Role::Camera))
            .chain(self.lidar.keys().map(|name| ("lidar", name, Role::Lidar)))
        {
            if mapping.topic(name).is_none_or(|topic| topic.role != role) {
                let message = format!("no topic of `[ros2.topics]` with the role `{table}` has this name");
                tell(&format!("{table}.{name}"), message);
            }
        }
    }
}
