//! The configuration of a single operator: the tables of its kind as changed by `[operator.NAME]`.

use std::collections::BTreeSet;

use swerve_control::safety_gate::GateParams;
use swerve_text::{Guessed, KeyProblem, unknown_key};
use toml::Table;

use crate::base::entries;
use crate::config::old_names::with_present_name;
use crate::config::resolved::Resolved;
use crate::kind::OperatorKind;
use crate::named::NoKeys;
use crate::problems::{KeyProblems, within};
use crate::section::{AnySection, Section};
use crate::setup::Setup;

impl Resolved {
    /// Resolves all settings. Defaults replace invalid ones.
    pub fn new(config: &Setup) -> Self {
        let gate = config.gate_params().unwrap_or_else(|_| GateParams::new(&config.sim.vehicle));
        let deadlines = config.execution.deadline_params().unwrap_or_default();
        let perception = &config.perception;
        let detector = perception.emulated().unwrap_or_default();
        let behind = config.noise_behind_detector();
        let tracker = config.tracker_behind(&behind);
        let tracker_hits_min = tracker.map_or(1, |tracker| tracker.hits_min());
        let rules = config.planning.rules().unwrap_or_else(|_| config.planning.rules_of_era());
        Self { gate, deadlines, detector, behind, tracker_hits_min, rules }
    }
}

/// Keys of `[operator.NAME]` common to all operators, with their descriptions.
pub const COMMON_KEYS: [(&str, &str); 10] = [
    ("kind", "what it is; that of the pipeline's operator of this name when absent"),
    ("enabled", "false takes it out of the pipeline"),
    ("reads", "the streams that it reads, by port; found by their type when absent"),
    (
        "runtime",
        "what a step takes: { fixed_ms = 5 }, cycle_ms, normal_ms, log_normal_ms, percentiles_ms, work, measured",
    ),
    (
        "policy",
        "what becomes of frames that find it busy: \"skip_to_latest\", \"queue(N)\", \"pipelined(N)\"",
    ),
    ("deadline", "{ ms = 50, anchor = \"arrival\", reaction = \"skip\" }; none when absent"),
    (
        "every_ms",
        "period of a timer that it runs on, with the newest input; on arrival of its input when absent",
    ),
    (
        "rungs",
        "its ladder: [{ name = \"fast\", ms = 5, KEY = VALUE }, ...]; a step takes the finest that meets the deadline",
    ),
    ("uses", "the [resource.NAME] that its steps hold a slot of"),
    ("delay_ms", "from the publication of its messages to their readers"),
];

/// The setup and resolved settings for an operator of this kind with these own keys; `None` where the keys change no
/// table of the configuration.
pub(crate) fn view(
    setup: &Setup,
    name: &str,
    kind: &dyn OperatorKind,
    keys: &Table,
) -> Result<Option<(Setup, Resolved)>, KeyProblems> {
    if keys.is_empty() {
        return Ok(None);
    }
    let mut sections: Vec<_> = kind.node().sections().collect();
    if sections.is_empty() {
        sections.push(const { &Section::<NoKeys>::own(|_, _| KeyProblems::new()) });
    }
    let mut changed = setup.clone();
    let mut wrong = KeyProblems::new();
    let overridden = split(keys, &sections).into_iter().map(|(section, keys)| {
        let read = section.override_by(&keys, &mut changed, name);
        (section, read.err().unwrap_or_default())
    });
    for (section, (mut found, guessed)) in overridden.collect::<Vec<_>>() {
        // Problems of the table itself are reported by its own keys.
        let before = section.table().map_or_else(KeyProblems::new, |_| section.problems(setup, name));
        let mut after = section.problems(&changed, name);
        after.retain(|problem| !before.contains(problem) && !guessed.holds(&problem.0));
        found.extend(after);
        wrong.extend(found.into_iter().map(|problem| explained(problem, section, &sections)));
    }
    if !wrong.is_empty() {
        return Err(within(&format!("operator.{name}"), wrong));
    }
    let changes = sections.iter().any(|section| section.table().is_some());
    Ok(changes.then(|| {
        let resolved = Resolved::new(&changed);
        (changed, resolved)
    }))
}

/// Keys of an operator by the first section that has each; unknown ones with those of the first section.
fn split<'s>(keys: &Table, sections: &[&'s dyn AnySection]) -> Vec<(&'s dyn AnySection, Table)> {
    let mut parts: Vec<_> = sections.iter().map(|section| (*section, Table::new())).collect();
    for (key, value) in keys {
        let has = |section: &&dyn AnySection| section.keys().is_none_or(|keys| keys.contains(&key.as_str()));
        let place = sections.iter().position(has).unwrap_or(0);
        parts[place].1.insert(key.clone(), value.clone());
    }
    parts
}

/// Problem of an own key of an operator: for an unknown key, with its present name or the nearest of all keys that the
/// operator may have.
fn explained(
    (key, message): KeyProblem,
    section: &dyn AnySection,
    sections: &[&dyn AnySection],
) -> KeyProblem {
    let known: Option<Vec<_>> = sections.iter().map(|section| section.keys()).collect();
    let known = known.filter(|_| !key.contains(['.', '['])).map(|known| known.concat());
    let message = match known {
        Some(mut known) if !known.contains(&key.as_str()) => {
            known.extend(COMMON_KEYS.map(|(key, _)| key));
            let mut seen = BTreeSet::new();
            known.retain(|key| seen.insert(*key));
            unknown_key(&key, &known)
        }
        _ => message,
    };
    let in_table = section.table().map(|table| (format!("{table}.{key}"), message.clone()));
    (key, in_table.map_or(message, |problem| with_present_name(problem).1))
}

/// Gives the keys of operators whose kind has a table for each of them to that table: `[operator.front]
/// kind = "camera"` makes `[camera.front]`. Returns the problems; `guessed` gets the keys of repaired values.
pub(crate) fn give_sections(setup: &mut Setup, guessed: &mut Guessed) -> KeyProblems {
    let mut wrong = KeyProblems::new();
    for (name, own) in entries(setup) {
        let kind = own.kind.as_deref().and_then(|kind| setup.registry.kind(kind));
        let Some(section) = kind.and_then(|kind| kind.node().sections().find(|one| one.is_of_each())) else {
            continue;
        };
        let Some(own) = setup.config.operator.get_mut(&name) else { continue };
        own.kind = None;
        let keys = core::mem::take(&mut own.keys);
        if let Err((found, repaired)) = section.override_by(&keys, &mut setup.config, &name) {
            let found = found.into_iter().map(|problem| explained(problem, section, &[section]));
            wrong.extend(within(&format!("operator.{name}"), found.collect()));
            let table = section.table().unwrap_or_default();
            guessed.extend(&format!("{table}.{name}"), repaired);
        }
    }
    wrong
}

#[cfg(test)]
mod tests {
    use swerve_text::{Document, parse_assignment};

    use super::*;
    use crate::assembly::Assembly;
    use crate::config::OperatorConfig;
    use crate::sections::SECTIONS;

    fn read(text: &str, sets: &[&str]) -> Result<Setup, String> {
        let sets: Vec<_> = sets.iter().map(|set| parse_assignment(set).unwrap()).collect();
        Setup::from_document(&Document::parse("c.toml", text).unwrap(), &sets)
            .map_err(|found| found.to_string())
    }

    #[test]
    fn own_keys_override_the_table_of_the_kind() {
        let text = "[camera.front]\nwidth_px = 64\nheight_px = 48\n[operator.front]\nwidth_px = 32\n";
        let front =
            read(text, &["operator.front.period_ms=20"]).unwrap().config.camera.remove("front").unwrap();
        assert_eq!((front.width_px, front.height_px, front.period_ms), (32, 48, 20.0));
        let text = "[gate]\nenabled = true\nparams = { stop_decel_mps2 = 2.5 }\n[operator.gate]\nperiod_ms = 20\n\
                    params = { repeat_max_s = 0.5 }\n[operator.tracker]\npast_steps = 70\ntracker = { hits_min = 4 }\n";
        let setup = read(text, &[]).unwrap();
        let assembly = Assembly::new(&setup).unwrap();
        let resolved = |name: &str| &assembly.operator(name).unwrap().resolved;
        let config = |name: &str| assembly.operator(name).unwrap().settings(&setup).setup.config.clone();
        let gate = &resolved("gate").gate;
        assert_eq!((gate.stop_decel_mps2, gate.repeat_max_s), (2.5, 0.5));
        assert_eq!((config("gate").gate.period_ms, config("switch").gate.period_ms), (20.0, 10.0));
        // One key is of `[prediction]`, the other of `[perception]`.
        assert_eq!(config("tracker").prediction.past_steps, 70);
        let hits_min = ["tracker", "planner"].map(|name| resolved(name).tracker_hits_min);
        assert_eq!(hits_min, [4, 2]);
        assert_eq!(config("predictor"), setup.config);
    }

    #[test]
    fn invalid_own_keys_are_all_reported() {
        for (text, expected) in [
            (
                "[operator.planner]\nrisk_max = 0.9\nplaner = 3\nconfig = \"fast\"\n",
                "c.toml:2: operator.planner.risk_max: expected 0 to 0.5, found 0.9\n\
                 c.toml:3: operator.planner.planer: unknown key; did you mean `planner`?\n\
                 c.toml:4: operator.planner.config: this key was renamed to `discretisation`",
            ),
            (
                "[operator.tracker]\npast_stps = 3\npast_steps = 0\n",
                "c.toml:2: operator.tracker.past_stps: unknown key; did you mean `past_steps`?\n\
                 c.toml:3: operator.tracker.past_steps: expected 1 to 1000, found 0",
            ),
            (
                "[operator.supervisor]\nruntme = 1\n",
                "c.toml:2: operator.supervisor.runtme: unknown key; did you mean `runtime`?",
            ),
            (
                "[camera.front]\nwidth_px = 64\n[operator.front]\nwidth_px = 0\n",
                "c.toml:4: operator.front.width_px: expected 1 to 8192, found 0",
            ),
            (
                "[operator.front]\nkind = \"camera\"\nwidht_px = 64\nheight_px = 0\n",
                "c.toml:3: operator.front.widht_px: unknown key; did you mean `width_px`?\n\
                 c.toml:4: operator.front.height_px: expected 1 to 8192, found 0",
            ),
        ] {
            assert_eq!(read(text, &[]).unwrap_err(), expected, "{text}");
        }
        let said = read("[camera.front]\n", &["operator.front.width_px=0"]).unwrap_err();
        assert_eq!(said, "--set: operator.front.width_px: expected 1 to 8192, found 0");
    }

    #[test]
    fn sections_know_all_their_keys() {
        for section in SECTIONS {
            let keys = section.keys().unwrap();
            assert!(section.defaults().keys().all(|key| keys.contains(&key.as_str())), "{section:?}");
        }
    }

    #[test]
    fn common_keys_are_the_ones_that_every_operator_reads() {
        let every = "kind = \"x\"\nenabled = true\nreads = { a = \"b\" }\nruntime = { zero = true }\npolicy = \"p\"\n\
                     deadline = { ms = 1 }\nevery_ms = 1\nrungs = [{ name = \"a\", ms = 1 }]\nuses = \"r\"\ndelay_ms = 1\n";
        let own: OperatorConfig = swerve_text::built_in(every);
        assert!(own.keys.is_empty(), "{:?}", own.keys);
        let mut keys: Vec<String> = Table::try_from(&own).unwrap().keys().cloned().collect();
        keys.sort_by_key(|key| COMMON_KEYS.iter().position(|(common, _)| common == key));
        assert_eq!(keys, COMMON_KEYS.map(|(key, _)| key));
    }
}
