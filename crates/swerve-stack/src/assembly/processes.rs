//! Processes of a run that operators of its pipeline are moved to.

use super::Assembly;
use crate::config::process::ProcessConfig;
use crate::config::{Config, is_plain_name};
use crate::problems::one_of;

impl Config {
    pub(crate) fn check_processes(&self, assembly: &Assembly, told: &mut Vec<(String, String)>) {
        if let Some(name) = &self.shared_memory.name {
            let plain = is_plain_name(name);
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
            let of_start = process.problems_of_start();
            told.extend(
                of_start.into_iter().map(|(key, message)| (format!("process.{name}.{key}"), message)),
            );
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
                } else if is_elsewhere(assembly, operator)
                    && process.python.is_none()
                    && process.start.is_empty()
                {
                    let message =
                        format!("`{operator}` is written in Python: expected `python = \"FILE.py:Class\"`");
                    told.push((key, message));
                }
            }
        }
        self.check_elsewhere(assembly, told);
    }

    /// Checks that operators that need another process are in one.
    fn check_elsewhere(&self, assembly: &Assembly, told: &mut Vec<(String, String)>) {
        let placed = assembly.operators().iter().filter(|placed| placed.kind.node().elsewhere);
        for name in placed.map(|placed| &placed.name).filter(|name| self.process_of(name).is_none()) {
            let message = format!(
                "its steps are taken by a process: expected a table `[process.NAME]` with `operators = [\"{name}\"]` and `python = \"FILE.py:Class\"`"
            );
            told.push((format!("operator.{name}.kind"), message));
        }
    }

    /// Processes that take steps in Python, or of operators that this program cannot run.
    pub fn processes_elsewhere<'a>(
        &'a self,
        assembly: &'a Assembly,
    ) -> impl Iterator<Item = (&'a String, &'a ProcessConfig)> {
        let is_needed = |process: &ProcessConfig| {
            process.python.is_some() || process.operators.iter().any(|name| is_elsewhere(assembly, name))
        };
        self.process.iter().filter(move |(_, process)| is_needed(process))
    }
}

/// Returns true if only another process can take the steps of an operator.
fn is_elsewhere(assembly: &Assembly, operator: &str) -> bool {
    assembly.operator(operator).is_some_and(|placed| placed.kind.node().elsewhere)
}

/// Reason that an operator cannot be moved; `None` if it can.
fn cannot_move(assembly: &Assembly, operator: &str) -> Option<String> {
    let movable = assembly.operators().iter().map(|placed| placed.name.as_str());
    let movable: Vec<&str> =
        movable.filter(|name| assembly.node(name).is_some_and(|node| node.stays.is_none())).collect();
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
