//! Settings without an effect: those of operators that do not run.

use toml::{Table, Value};

use super::Assembly;
use crate::config::model::Model;
use crate::problems::KeyProblems;
use crate::setup::Setup;

/// Keys that decide whether an operator runs.
const SWITCHES: [&str; 2] = ["enabled", "kind"];

impl Setup {
    /// Those of the given keys that have no effect under these settings since no running operator reads them, each with
    /// the reason and the remedy. Empty with a vehicle, and where another stack drives.
    pub fn idle(&self, given: &Table) -> KeyProblems {
        if self.live.is_some() || self.is_driven_over_ros2() {
            return KeyProblems::new();
        }
        let assembly = Assembly::with_problems(self, &mut KeyProblems::new());
        let mut idle = KeyProblems::new();
        for (name, own) in named(given, "operator") {
            if let Some(key) = first_key(own, &SWITCHES).filter(|_| !assembly.has(name)) {
                idle.push((format!("operator.{name}.{key}"), self.why_absent(&assembly, name)));
            }
        }
        for table in ["camera", "radar", "lidar", "monitor"] {
            for (name, own) in named(given, table) {
                let is_view = table == "camera" && self.perception.camera.as_deref() == Some(name);
                if assembly.has(name) || is_view && self.perception.emulates() {
                    continue;
                }
                let key = first_key(own, &[]).map_or_else(String::new, |key| format!(".{key}"));
                idle.push((format!("{table}.{name}{key}"), self.why_absent(&assembly, name)));
            }
        }
        let gate = given.get("gate").and_then(Value::as_table);
        if let Some(key) = gate.and_then(|gate| first_key(gate, &SWITCHES)).filter(|_| !self.gate.enabled) {
            let message = "has no effect: there is no gate; `gate.enabled = true` adds it";
            idle.push((format!("gate.{key}"), message.into()));
        }
        self.idle_execution(given, &mut idle);
        self.idle_cost(&assembly, given, &mut idle);
        for (name, _) in named(given, "resource") {
            if !assembly.operators().iter().any(|placed| placed.own.uses.as_deref() == Some(name)) {
                let message = format!("has no effect: no running operator has `uses = \"{name}\"`");
                idle.push((format!("resource.{name}"), message));
            }
        }
        idle
    }

    /// Reason why an operator does not run, and the remedy.
    fn why_absent(&self, assembly: &Assembly, name: &str) -> String {
        let node = assembly.node(name);
        let is_disabled = self.operator.get(name).is_some_and(|own| own.enabled == Some(false));
        let why = match node {
            _ if is_disabled => format!("; `operator.{name}.enabled` is false"),
            Some(node) if node.only_with.is_some() => {
                node.only_with.map_or_else(String::new, |setting| format!("; it runs with `{setting}`"))
            }
            Some(node) if node.on_demand => {
                format!(
                    "; it runs where an operator reads it or `log.sensors` names it, such as `log.sensors = [\"{name}\"]`"
                )
            }
            _ => " in this pipeline".to_owned(),
        };
        format!("has no effect: operator `{name}` does not run{why}")
    }

    fn idle_execution(&self, given: &Table, idle: &mut KeyProblems) {
        let Some(execution) = given.get("execution").and_then(Value::as_table) else { return };
        let (model, dynamic) = (self.execution.model, "dynamic_deadlines");
        if execution.contains_key("reaction") && matches!(model, Model::Periodic | Model::DataDriven) {
            let message = format!(
                "has no effect without deadlines; `execution.model` = \"static_deadlines\" or \"{dynamic}\" sets them"
            );
            idle.push(("execution.reaction".into(), message));
        }
        if execution.contains_key("params") && model != Model::DynamicDeadlines {
            let message = format!(
                "has no effect without the deadline policy, which runs with `execution.model` = \"{dynamic}\""
            );
            idle.push(("execution.params".into(), message));
        }
    }

    /// Run times of planners, none of them that of the chosen planner.
    fn idle_cost(&self, assembly: &Assembly, given: &Table, idle: &mut KeyProblems) {
        let cost = given.get("planning").and_then(|planning| planning.get("cost"));
        let Some(cost) = cost.and_then(Value::as_table) else { return };
        let (planner, fineness) = (self.planning.planner.as_str(), self.planning.discretisation.as_str());
        let Some((other, by_fineness)) = cost.iter().next() else { return };
        let is_overridden = self.operator.get("planner").is_some_and(|own| own.runtime.is_some());
        let message = if cost.get(planner).is_none_or(|by| by.get(fineness).is_none()) {
            format!(
                "has no effect: the planner of this run is `{planner}`, discretisation `{fineness}`; `planning.planner` and \
                 `planning.discretisation` choose it"
            )
        } else if is_overridden {
            "has no effect: `operator.planner.runtime` overrides it".to_owned()
        } else if self.planning.ladder.is_some() {
            "has no effect: the rungs of `planning.ladder` have their own run times".to_owned()
        } else if assembly.operator("planner").is_some_and(|placed| placed.kind.node().kind != "planner") {
            "has no effect: `operator.planner` is of another kind; `operator.planner.runtime` sets its run time"
                .to_owned()
        } else {
            return;
        };
        let fineness = by_fineness.as_table().and_then(|by| by.keys().next());
        let fineness = fineness.map_or_else(String::new, |fineness| format!(".{fineness}"));
        idle.push((format!("planning.cost.{other}{fineness}"), message));
    }
}

/// Tables within a table, by name.
fn named<'t>(given: &'t Table, table: &str) -> impl Iterator<Item = (&'t str, &'t Table)> {
    let tables = given.get(table).and_then(Value::as_table).into_iter().flatten();
    tables.filter_map(|(name, own)| Some((name.as_str(), own.as_table()?)))
}

/// First key that is not in `except`.
fn first_key<'t>(table: &'t Table, except: &[&str]) -> Option<&'t str> {
    table.keys().map(String::as_str).find(|key| !except.contains(key))
}

#[cfg(test)]
mod tests {
    use swerve_text::{Document, parse_assignment, set};

    use super::*;

    /// The idle ones of the `given` assignments, under these and `other` assignments.
    fn idle(given: &str, other: &[&str]) -> Vec<String> {
        let (key, value) = parse_assignment(given).unwrap();
        let mut table = Table::new();
        set(&mut table, &key, value.clone()).unwrap();
        let mut sets: Vec<_> = other.iter().map(|set| parse_assignment(set).unwrap()).collect();
        sets.push((key, value));
        let document = Document::parse("c.toml", "").unwrap();
        let setup = Setup::from_document(&document, &sets).unwrap_or_else(|found| panic!("{found}"));
        setup.idle(&table).into_iter().map(|(key, message)| format!("{key}: {message}")).collect()
    }

    #[test]
    fn settings_of_operators_that_do_not_run_are_idle() {
        for (given, switch, expected) in [
            (
                "operator.detector.runtime.fixed_ms=100",
                &["perception.detector=efficientdet-d3@v100"][..],
                "operator.detector.runtime: has no effect: operator `detector` does not run; it runs with \
                 `perception.detector = \"NAME\"`",
            ),
            (
                "operator.gate.runtime.fixed_ms=5",
                &["gate.enabled=true"],
                "operator.gate.runtime: has no effect: operator `gate` does not run; it runs with `gate.enabled = true`",
            ),
            (
                "camera.front.width_px=64",
                &["log.sensors=[\"front\"]"],
                "camera.front.width_px: has no effect: operator `front` does not run; it runs where an operator reads it",
            ),
            (
                "camera.front.width_px=640",
                &["perception.camera=front", "perception.detector=custom"],
                "camera.front.width_px: has no effect",
            ),
            ("gate.period_ms=20", &["gate.enabled=true"], "gate.period_ms: has no effect: there is no gate"),
            (
                "execution.reaction=reuse_last",
                &["execution.model=static_deadlines", "execution.planner_ms=100"],
                "execution.reaction: has no effect without deadlines; `execution.model` = \"static_deadlines\" or",
            ),
            (
                "planning.cost.waypoint.fast.fixed_ms=5",
                &["planning.planner=waypoint"],
                "planning.cost.waypoint.fast: has no effect: the planner of this run is `fot`, discretisation `fast`;",
            ),
            (
                "resource.gpu.slots=1",
                &["operator.planner.uses=gpu"],
                "resource.gpu: has no effect: no running operator has `uses = \"gpu\"`",
            ),
        ] {
            let found = idle(given, &[]);
            assert!(found.len() == 1 && found[0].starts_with(expected), "{given}: {found:?}");
            assert_eq!(idle(given, switch), Vec::<String>::new(), "{given} {switch:?}");
        }
    }

    #[test]
    fn switches_are_not_idle() {
        for given in
            ["operator.detector.enabled=false", "gate.enabled=false", "seed=2", "planning.planner=aeb"]
        {
            assert_eq!(idle(given, &[]), Vec::<String>::new(), "{given}");
        }
    }
}
