//! Processes that take steps for the run, `[process.NAME]`.

use core::time::Duration;

use serde::{Deserialize, Serialize};
use swerve_ipc::OnLoss;
use swerve_text::number;

use super::Config;
use super::operator::is_plain_name;
use crate::assembly::{Assembly, one_of};

/// One process beside the coordinator.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ProcessConfig {
    /// The operators whose steps it takes.
    pub operators: Vec<String>,
    /// Under wall clock, what happens when it dies: the ego is brought to a stop, or it is started again.
    pub on_loss: OnLoss,
    /// Its answers, and its calls at its end, are waited for so long without sleeping, microseconds; saves a wake-up,
    /// costs a core.
    pub spin_us: f64,
    /// What starts it, in place of this program's own `swerve worker`: a program and its arguments, such as
    /// `["ssh", "other", "swerve", "worker"]`. It hands on standard input and output.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub start: Vec<String>,
}

/// The shared memory that the processes of a run share.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SharedMemoryConfig {
    /// Its name, for those who join it from outside, such as a tunnel to another host; one of its own when absent.
    pub name: Option<String>,
}

impl ProcessConfig {
    /// How long its answers are waited for without sleeping.
    pub fn spin(&self) -> Duration {
        Duration::from_secs_f64((self.spin_us * 1e-6).max(0.0))
    }
}

impl Config {
    /// The process that takes the steps of an operator, if it is not this one.
    pub fn process_of(&self, operator: &str) -> Option<&str> {
        let has = |process: &ProcessConfig| process.operators.iter().any(|name| name == operator);
        self.process.iter().find(|(_, process)| has(process)).map(|(name, _)| name.as_str())
    }

    pub(super) fn check_processes(&self, assembly: &Assembly, told: &mut Vec<(String, String)>) {
        if let Some(name) = &self.shared_memory.name {
            let plain = name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
            let begins = name.starts_with(|c: char| c.is_ascii_alphabetic());
            if !plain || !begins || name.len() > 32 {
                let message = "expected at most 32 letters, digits and underscores, a letter first";
                told.push(("shared_memory.name".into(), message.into()));
            }
        }
        let mut taken: Vec<(&str, &str)> = Vec::new();
        for (name, process) in &self.process {
            let plain = is_plain_name(name);
            if !plain {
                let message = "expected a name of letters, digits and underscores";
                told.push((format!("process.{name}"), message.into()));
            }
            if !(0.0..=1e6).contains(&process.spin_us) {
                let message = format!("expected 0 to 1000000, found {}", number(process.spin_us));
                told.push((format!("process.{name}.spin_us"), message));
            }
            if process.start.first().is_some_and(String::is_empty) {
                let message = "expected a program, found nothing";
                told.push((format!("process.{name}.start[0]"), message.into()));
            }
            if process.operators.is_empty() {
                let message = "expected at least one operator";
                told.push((format!("process.{name}.operators"), message.into()));
            }
            for (k, operator) in process.operators.iter().enumerate() {
                let key = format!("process.{name}.operators[{k}]");
                if let Some((_, other)) = taken.iter().find(|(taken, _)| taken == operator) {
                    told.push((key, format!("`{operator}` is in `[process.{other}]` already")));
                    continue;
                }
                taken.push((operator, name));
                if let Some(message) = cannot_move(assembly, operator) {
                    told.push((key, message));
                }
            }
        }
    }
}

/// What is wrong with moving an operator, if anything is.
fn cannot_move(assembly: &Assembly, operator: &str) -> Option<String> {
    let movable = assembly.operators().iter().filter(|placed| placed.kind.node().stays.is_none());
    let movable: Vec<&str> = movable.map(|placed| placed.name.as_str()).collect();
    let Some(node) = assembly.node(operator) else {
        return Some(format!("unknown operator `{operator}`{}", one_of(operator, &movable)));
    };
    let expected = movable.join(", ");
    match node.stays {
        Some(why) => {
            Some(format!("`{operator}` stays in the coordinator, {why}; expected one of {expected}"))
        }
        None if assembly.has(operator) => None,
        None => Some(format!("`{operator}` does not run under these settings; expected one of {expected}")),
    }
}

#[cfg(test)]
mod tests {
    use crate::config::Config;
    use swerve_text::Document;

    fn problems(text: &str) -> Vec<String> {
        let document = Document::parse("c.toml", text).unwrap();
        let problems = Config::from_document(&document, &[]).err().unwrap_or_default();
        problems.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn what_cannot_be_moved_is_refused_with_the_reason() {
        let refused =
            |operator: &str| problems(&format!("[process.a]\noperators = [\"{operator}\"]\n")).join("\n");
        let expected = "c.toml:2: process.a.operators[0]: `world` stays in the coordinator, it is the world; \
                        expected one of tracker, predictor, planner";
        assert_eq!(refused("world"), expected);
        assert!(refused("controller").contains("it is the actuation"));
        for sensor in ["obstacles", "pose", "imu", "gnss", "odometry", "collisions", "red_lights"] {
            assert!(refused(sensor).contains("sensors are where the world is"), "{sensor}");
        }
        assert!(refused("planer").ends_with("(did you mean `planner`?)"), "{}", refused("planer"));
        let camera = "[log]\nsensors = [\"front\"]\n[camera.front]\n[process.a]\noperators = [\"front\"]\n";
        assert!(problems(camera)[0].contains("sensors are where the world is"));
        assert!(problems("[process.a]\noperators = [\"planner\", \"tracker\"]\n").is_empty());
    }

    #[test]
    fn an_operator_is_in_one_process() {
        let twice =
            "[process.a]\noperators = [\"planner\"]\n[process.b]\noperators = [\"tracker\", \"planner\"]\n";
        assert_eq!(
            problems(twice),
            ["c.toml:4: process.b.operators[1]: `planner` is in `[process.a]` already"]
        );
        assert!(problems("[process.a]\n")[0].contains("at least one operator"));
        assert!(problems("[process.\"a/b\"]\noperators = [\"planner\"]\n")[0].contains("letters, digits"));
        assert!(
            problems("[process.a]\noperators = [\"planner\"]\nspin_us = nan\n")[0].contains("0 to 1000000")
        );
        assert!(problems("[shared_memory]\nname = \"1/2\"\n")[0].contains("a letter first"));
        let nothing = problems("[process.a]\noperators = [\"planner\"]\nstart = [\"\"]\n");
        assert!(nothing[0].contains("process.a.start[0]: expected a program"), "{nothing:?}");
        let wrong = problems("[process.a]\noperators = [\"planner\"]\non_loss = \"panic\"\n");
        assert!(wrong[0].contains("\"stop\"") && wrong[0].contains("\"restart\""), "{wrong:?}");
    }
}
