//! Problems of values that other tables decide.

use swerve_ros2::Kind;
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
        // Problems of the table itself are reported by its own check.
        let mapping = self.ros2_mapping().ok();
        told.extend(mapping.iter().flat_map(|mapping| commands_of(mapping, live.enable)));
        let mut tell = |key: &str, message: String| told.push((key.to_owned(), message));
        if live.route.is_empty() {
            tell("live.route", "is missing: expected the scenario file whose road is to be followed".into());
        }
        let Some(mapping) = mapping else { return };
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

/// Problems of the topic for commands, and of the topics that driving with it needs.
fn commands_of(mapping: &Mapping, enable: EnableBy) -> Vec<(String, String)> {
    let (vehicle, name) = (mapping.vehicle, mapping.vehicle.name());
    let Some(command) = mapping.with_role(Role::Command).next() else {
        let message = "a vehicle of the table `plain` receives no commands: it can be watched, not driven; a topic \
                       `[ros2.topics.command]` changes that";
        let is_asked = vehicle == Vehicle::Plain && enable == EnableBy::AtStart;
        return is_asked.then(|| ("live.enable".into(), message.into())).into_iter().collect();
    };
    let takes: &[Kind] = match vehicle {
        Vehicle::Autoware | Vehicle::Plain => &[Kind::Control, Kind::AckermannDriveStamped],
        Vehicle::Carla => &[Kind::CarlaEgoVehicleControl],
        Vehicle::Dataspeed | Vehicle::Raptor => &[],
    };
    let mut problems = Vec::new();
    if !takes.contains(&command.kind) {
        let takes: Vec<String> = takes.iter().map(|kind| format!("\"{kind}\"")).collect();
        let message = match takes.is_empty() {
            true => format!("the vehicle `{name}` is driven by other topics"),
            false => format!(
                "expected {} for the vehicle `{name}`, found \"{}\"",
                takes.join(" or "),
                command.kind
            ),
        };
        problems.push((format!("ros2.topics.{}.type", command.name), message));
    }
    let by_topic = (enable == EnableBy::Topic).then_some(Role::Enable);
    let needs = [Some(Role::Odometry), Some(Role::Steering), by_topic];
    for role in needs.into_iter().flatten().filter(|_| vehicle == Vehicle::Plain) {
        if mapping.with_role(role).next().is_none() {
            let message = format!(
                "a vehicle of the table `plain` that is to be driven needs the topic `{}`",
                role.name()
            );
            problems.push(("ros2.topics".into(), message));
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use swerve_text::Document;

    use crate::setup::Setup;

    /// Problems of a configuration with this table `[ros2]`.
    fn problems(live: &str, ros2: &str) -> Vec<String> {
        let text = format!("live = {{ route = \"r.toml\"{live} }}\n[ros2]\n{ros2}");
        let document = Document::parse("c.toml", text).unwrap();
        let found = Setup::from_document(&document, &[]).err().unwrap_or_default();
        found.iter().map(|problem| format!("{}: {}", problem.key, problem.message)).collect()
    }

    #[test]
    fn command_topic_has_a_type_of_its_vehicle() {
        let ackermann = "[ros2.topics.command]\ntopic = \"/drive\"\ntype = \"ackermann_msgs/msg/AckermannDriveStamped\"\n";
        let with =
            |vehicle: &str, more: &str| problems("", &format!("vehicle = \"{vehicle}\"\n{ackermann}{more}"));
        assert_eq!(with("autoware", ""), Vec::<String>::new());
        assert_eq!(
            with("carla", ""),
            [
                "ros2.topics.command.type: expected \"carla_msgs/msg/CarlaEgoVehicleControl\" for the vehicle `carla`, \
                 found \"ackermann_msgs/msg/AckermannDriveStamped\""
            ]
        );
        assert_eq!(
            with("dataspeed", ""),
            ["ros2.topics.command.type: the vehicle `dataspeed` is driven by other topics"]
        );
        let lacks = |role: &str| {
            format!(
                "ros2.topics: a vehicle of the table `plain` that is to be driven needs the topic `{role}`"
            )
        };
        assert_eq!(with("plain", ""), [lacks("steering"), lacks("enable")]);
        let rest =
            "[ros2.topics.steering]\ntopic = \"/steering\"\n[ros2.topics.enable]\ntopic = \"/enable\"\n";
        assert_eq!(with("plain", rest), Vec::<String>::new());
    }

    /// The gate compares reports with commands where there are commands.
    #[test]
    fn plain_vehicle_with_a_command_topic_has_to_follow_its_commands() {
        let checked_s = |ros2: &str| {
            let text = format!("live = {{ route = \"r.toml\" }}\n[ros2]\n{ros2}");
            let setup = Setup::from_document(&Document::parse("c.toml", text).unwrap(), &[]);
            setup.unwrap_or_else(|found| panic!("{found}")).gate_params().unwrap().ignored_after_s
        };
        assert_eq!((checked_s("vehicle = \"autoware\"\n"), checked_s("vehicle = \"plain\"\n")), (1.0, 0.0));
        let driven = "vehicle = \"plain\"\n[ros2.topics.command]\ntopic = \"/drive\"\n\
                      type = \"ackermann_msgs/msg/AckermannDriveStamped\"\n[ros2.topics.steering]\n\
                      topic = \"/steering\"\n[ros2.topics.enable]\ntopic = \"/enable\"\n";
        assert_eq!(checked_s(driven), 1.0);
    }
}
