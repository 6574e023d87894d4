//! Worker processes of a run, `[process.NAME]`.

use core::time::Duration;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_ipc::OnLoss;

use super::operator::is_plain_name;

/// One process beside the coordinator.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct ProcessConfig {
    /// Operators whose steps it takes.
    pub operators: Vec<String>,
    /// Reaction to its loss under wall clock: the ego is brought to a stop, or the process is restarted.
    pub on_loss: OnLoss,
    /// Time for which its answers, and calls on its side, are waited for without sleeping, microseconds; saves a
    /// wake-up, costs a core.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub spin_us: f64,
    /// Time limit for a step of an operator, seconds; a process that does not answer is killed. In virtual time the run
    /// then ends with an error; under wall clock `on_loss` applies. The first step of a neural network may need long.
    #[schemars(range(min = 0.1, max = 86_400.0))]
    pub reply_within_s: f64,
    /// Command that starts it, in place of this program's own `swerve worker`: a program and its arguments, such as
    /// `["ssh", "other", "swerve", "worker"]`. It has to pass on standard input and output.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub start: Vec<String>,
    /// Python class that takes the steps, `FILE.py:Class`; the file as a path from the folder of the configuration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub python: Option<String>,
    /// Python interpreter with Swerve's package: a path from that folder, or a name; found automatically when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interpreter: Option<PathBuf>,
    /// Keys of the Python class, of any name: it gets them in `begin(start)` as `start.keys`, and studies vary them.
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "crate::config::AnyTable")]
    pub keys: toml::Table,
}

impl Default for ProcessConfig {
    fn default() -> Self {
        Self {
            operators: Vec::new(),
            on_loss: OnLoss::default(),
            spin_us: 0.0,
            reply_within_s: 20.0,
            start: Vec::new(),
            python: None,
            interpreter: None,
            keys: toml::Table::new(),
        }
    }
}

/// Shared memory between the processes of a run.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SharedMemoryConfig {
    /// Name of the shared memory, for processes that join it from outside, such as a tunnel to another host; a new name
    /// for each run when absent.
    pub name: Option<String>,
}

impl ProcessConfig {
    /// File and name of its Python class, if it has one.
    ///
    /// # Errors
    /// The key `python` is malformed.
    pub fn python_class(&self) -> Option<Result<(&Path, &str), String>> {
        let python = self.python.as_deref()?;
        let parts = python.rsplit_once(':').filter(|(file, class)| !file.is_empty() && is_plain_name(class));
        let wrong = || format!("expected FILE.py:Class, found `{python}`");
        Some(parts.map(|(file, class)| (Path::new(file), class)).ok_or_else(wrong))
    }

    /// Problems of its start, by key.
    pub(crate) fn problems_of_start(&self) -> Vec<(&'static str, String)> {
        let mut told = Vec::new();
        if self.start.first().is_some_and(String::is_empty) {
            told.push(("start[0]", "expected a program, found nothing".to_owned()));
        }
        match self.python_class() {
            Some(_) if !self.start.is_empty() => {
                told.push(("start", "expected `start` or `python`, found both".to_owned()));
            }
            Some(Err(message)) => told.push(("python", message)),
            Some(Ok((file, class))) if !file.is_file() => {
                let file = file.display();
                told.push((
                    "python",
                    format!("there is no file {file}: expected one with the class `{class}`"),
                ));
            }
            None if self.interpreter.is_some() => {
                told.push(("interpreter", "runs what `python` names: expected that as well".to_owned()));
            }
            None if !self.keys.is_empty() && self.start.is_empty() => {
                let why = "are read by the class that `python` names: expected that as well";
                told.push(("keys", why.to_owned()));
            }
            _ => {}
        }
        told
    }

    /// Time for which its answers are waited for without sleeping.
    pub fn spin(&self) -> Duration {
        Duration::from_secs_f64((self.spin_us * 1e-6).max(0.0))
    }

    /// Time limit for an answer.
    pub fn reply_within(&self) -> Duration {
        Duration::from_secs_f64(self.reply_within_s.clamp(0.1, 86_400.0))
    }
}

/// A configuration's table with absolute paths.
pub(crate) fn with_whole_paths(mut table: toml::Table, folder: &Path) -> toml::Table {
    let processes = table.get_mut("process").and_then(toml::Value::as_table_mut);
    for (_, process) in processes.into_iter().flatten() {
        for key in ["python", "interpreter"] {
            let Some(toml::Value::String(path)) = process.get_mut(key) else { continue };
            // A bare name is looked up on `PATH`.
            let is_program = key == "interpreter" && !path.contains('/');
            if !is_program {
                make_whole(path, folder);
            }
        }
    }
    if let Some(toml::Value::Table(localization)) = table.get_mut("localization")
        && let Some(toml::Value::String(path)) = localization.get_mut("map")
    {
        make_whole(path, folder);
    }
    table
}

fn make_whole(path: &mut String, folder: &Path) {
    if let Ok(whole) = std::path::absolute(folder.join(&*path)) {
        *path = whole.to_string_lossy().into_owned();
    }
}

#[cfg(test)]
mod tests {
    use crate::Setup;

    use swerve_text::Document;

    fn problems(text: &str) -> Vec<String> {
        let document = Document::parse("c.toml", text).unwrap();
        let problems = Setup::from_document(&document, &[]).err().unwrap_or_default();
        problems.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn unmovable_operators_are_refused_with_the_reason() {
        let refused =
            |operator: &str| problems(&format!("[process.a]\noperators = [\"{operator}\"]\n")).join("\n");
        let expected = "c.toml:2: process.a.operators[0]: `world` stays in the coordinator, it is the world; \
                        expected one of router, tracker, predictor, behaviour, planner";
        assert_eq!(refused("world"), expected);
        assert!(refused("controller").contains("it is the actuation"));
        for sensor in ["obstacles", "pose", "imu", "gnss", "odometry", "collisions", "red_lights"] {
            assert!(refused(sensor).contains("sensors are where the world is"), "{sensor}");
        }
        let truth = "[prediction]\npredictor = \"truth\"\n[process.a]\noperators = [\"predictor\"]\n";
        assert!(problems(truth)[0].contains("`predictor` stays in the coordinator, it reads"), "{truth}");
        assert!(refused("planer").ends_with("; did you mean `planner`?"), "{}", refused("planer"));
        let camera = "[log]\nsensors = [\"front\"]\n[camera.front]\n[process.a]\noperators = [\"front\"]\n";
        assert!(problems(camera)[0].contains("sensors are where the world is"));
        assert!(problems("[process.a]\noperators = [\"planner\", \"tracker\"]\n").is_empty());
    }

    #[test]
    fn operator_may_be_in_one_process_only() {
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
        let never = problems("[process.a]\noperators = [\"planner\"]\nreply_within_s = 0\n");
        assert!(never[0].contains("reply_within_s: expected 0.1 to 86400, found 0"), "{never:?}");
        assert!(problems("[shared_memory]\nname = \"1/2\"\n")[0].contains("a letter first"));
        let nothing = problems("[process.a]\noperators = [\"planner\"]\nstart = [\"\"]\n");
        assert!(nothing[0].contains("process.a.start[0]: expected a program"), "{nothing:?}");
        let wrong = problems("[process.a]\noperators = [\"planner\"]\non_loss = \"panic\"\n");
        assert!(wrong[0].contains("\"stop\"") && wrong[0].contains("\"restart\""), "{wrong:?}");
    }

    #[test]
    fn python_class_is_a_file_and_a_name() {
        let told =
            |keys: &str| problems(&format!("[process.a]\noperators = [\"tracker\"]\n{keys}\n")).join("\n");
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
        assert_eq!(told(&format!("python = \"{file}:Tracker\"\ninterpreter = \"python3\"")), "");
        let cases = [
            ("python = \"tracker.py\"", "c.toml:3: process.a.python: expected FILE.py:Class, found"),
            ("python = \":Tracker\"", "c.toml:3: process.a.python: "),
            ("python = \"tracker.py:\"", "c.toml:3: process.a.python: expected FILE.py:Class"),
            ("python = \"no_such.py:Tracker\"", "no_such.py: expected one with the class `Tracker`"),
            ("interpreter = \"python3\"", "c.toml:3: process.a.interpreter: runs what `python` names"),
            (
                "python = \"t.py:T\"\nstart = [\"ssh\"]",
                "c.toml:4: process.a.start: expected `start` or `python`, found both",
            ),
        ];
        for (keys, expected) in cases {
            assert!(told(keys).contains(expected), "{keys}: {}", told(keys));
        }
    }

    #[test]
    fn python_file_is_relative_to_the_configuration() {
        let config = "[process.a]\noperators = [\"tracker\"]\npython = \"t.py:T\"\n";
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src");
        let told = |file: &str, sets: &[(String, toml::Value)]| {
            let document = Document::parse(file, config).unwrap();
            Setup::from_document(&document, sets).unwrap_err()[0].to_string()
        };
        assert!(told(&format!("{folder}/c.toml"), &[]).contains(&format!("there is no file {folder}/t.py")));
        let here = std::env::current_dir().unwrap();
        assert!(told("c.toml", &[]).contains(&format!("there is no file {}/t.py", here.display())));
        let document = Document::parse("elsewhere/c.toml", config.replace("t.py", "/t.py")).unwrap();
        let set = [("process.a.python".to_owned(), "src/lib.rs:T".into())];
        let whole = Setup::formed(&crate::Registry::standard(), &document, &set).unwrap();
        let expected = format!("{}/src/lib.rs:T", here.display());
        assert_eq!(
            whole.process["a"].python.as_deref(),
            Some(&*expected),
            "what is set is from the working folder"
        );
    }
}
