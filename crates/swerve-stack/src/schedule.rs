//! Schedule of an operator: its timer, its deadline, and the ladder that its steps choose from.
//!
//! Operators of any kind are scheduled alike, and none has code for it: the graph reads their ports on a timer, and a
//! [`Ladder`] builds the kind once for each rung. Absences: deadlines that are set for each frame, which are messages of
//! an operator (`operators/deadlines.rs`); periods of kinds that have a timer themselves.

use std::collections::BTreeSet;
use std::sync::Arc;

use swerve_core::Span;
use swerve_flow::{Every, OutputInfo, Port, PortInfo, PortMode, Reaction};
use swerve_msg::RungTaken;
use swerve_text::number;
use toml::Value;

use crate::assembly::settings::view;
use crate::config::execution::{span_ms, span_of_ms};
use crate::config::model::Model;
use crate::config::{OperatorConfig, RungConfig};
use crate::kind::{OperatorKind, Scheduled, Settings};
use crate::ladder::{RUNG, Schedule};
use crate::problems::KeyProblems;
use crate::setup::Setup;
use crate::site::{OnRung, Placed};

pub use crate::ladder::{Ladder, Rung};

/// Outputs of an operator, in the order of its ports.
pub fn outputs(kind: &dyn OperatorKind, settings: &Settings<'_>) -> Vec<OutputInfo> {
    let rung = || OutputInfo::new::<Port<RungTaken>>(RUNG, "Rung of the ladder that was used.");
    let reports = ladder(kind, settings).map(|_| rung());
    kind.outputs(settings).into_iter().chain(reports).collect()
}

/// Inputs of an operator, in the order of its ports: on a timer the newest messages.
pub fn inputs(kind: &dyn OperatorKind, settings: &Settings<'_>) -> Vec<PortInfo> {
    let mut ports = kind.inputs(settings);
    let is_timed = kind.node().scheduled.is_some() && settings.setup.execution.model == Model::Periodic;
    if is_timed || own(settings).is_some_and(|own| own.every_ms.is_some()) {
        ports
            .iter_mut()
            .filter(|port| port.mode == PortMode::At)
            .for_each(|port| port.mode = PortMode::Latest);
        ports.push(PortInfo::new::<Every>("tick", "Period of the operator."));
    }
    ports
}

/// The table `[operator.NAME]` as configured.
fn own<'a>(settings: &Settings<'a>) -> Option<&'a OperatorConfig> {
    settings.setup.operator.get(settings.name)
}

/// Ladder of an operator: that of `[operator.NAME]`, else the one that the settings of its kind put it on.
fn ladder(kind: &dyn OperatorKind, settings: &Settings<'_>) -> Option<Ladder> {
    let rungs = own(settings).map_or(&[][..], |own| &own.rungs);
    if rungs.is_empty() {
        return kind.ladder(settings);
    }
    let rung = |rung: &RungConfig| Rung {
        name: rung.name.clone(),
        run_time: span_ms(rung.ms).unwrap_or(Span::ZERO),
        keys: rung.keys.clone(),
    };
    let mut rungs: Vec<Rung> = rungs.iter().map(rung).collect();
    rungs.sort_by_key(|rung| rung.run_time);
    Some(Ladder { rungs, sets_run_time: true })
}

impl Schedule {
    /// Schedule of an operator; problems are reported by key.
    pub(crate) fn new(placed: &Placed, setup: &Setup, problems: &mut KeyProblems) -> Self {
        let settings = placed.settings(setup);
        let model = settings.setup.execution.model;
        let ladder = ladder(&*placed.kind, &settings);
        for (key, message) in wrong(placed, setup, ladder.as_ref()) {
            problems.push((format!("operator.{}.{key}", placed.name), message));
        }
        let length = length(placed, &settings, ladder.as_ref(), problems);
        Self {
            period: placed.own.every_ms.map(span_of_ms).or(length.filter(|_| model == Model::Periodic)),
            deadline: length.filter(|_| model == Model::StaticDeadlines),
            ladder,
        }
    }
}

impl OnRung {
    /// Settings of an operator on a rung of its ladder.
    ///
    /// # Errors
    /// Problems of the keys of the rung.
    pub(crate) fn new(placed: &Placed, setup: &Setup, rung: &Rung) -> Result<Self, KeyProblems> {
        let mut keys = placed.own.keys.clone();
        for (key, value) in &rung.keys {
            match (keys.get_mut(key), value) {
                (Some(Value::Table(own)), Value::Table(more)) => own.extend(more.clone()),
                _ => drop(keys.insert(key.clone(), value.clone())),
            }
        }
        let (mut setup, resolved) = match view(setup, &placed.name, &*placed.kind, &keys)? {
            Some((setup, resolved)) => (setup, Arc::new(resolved)),
            None => (placed.settings(setup).setup.clone(), placed.resolved.clone()),
        };
        let own = OperatorConfig { keys, rungs: Vec::new(), ..placed.own.clone() };
        setup.config.operator.insert(placed.name.clone(), own);
        let sets = placed.schedule.ladder.as_ref().is_some_and(|ladder| ladder.sets_run_time);
        Ok(Self { setup, resolved, run_time: sets.then_some(rung.run_time) })
    }
}

/// Problems of the schedule, by key of `[operator.NAME]`.
fn wrong(placed: &Placed, setup: &Setup, ladder: Option<&Ladder>) -> Vec<(&'static str, String)> {
    let settings = &placed.settings(setup);
    let (node, own, model) = (placed.kind.node(), &placed.own, settings.setup.execution.model);
    let mut wrong = Vec::new();
    let sets_deadlines = matches!(model, Model::StaticDeadlines | Model::DynamicDeadlines);
    if own.deadline.is_some() && node.scheduled.is_some() && sets_deadlines {
        wrong.push(("deadline", "`execution.model` sets the deadline of this operator".to_owned()));
    }
    let is_timed = own.runtime.as_ref().is_some_and(|runtime| runtime.model().is_ok());
    if is_timed && ladder.is_some_and(|ladder| ladder.sets_run_time) {
        wrong.push(("runtime", "the rungs of its ladder say what this operator takes".to_owned()));
    }
    if node.elsewhere && own.deadline.is_some_and(|deadline| deadline.reaction == Reaction::OnDeadline) {
        let message = "an operator in Python has no answer to a missed deadline: expected \"skip\" or \"reuse_last\", found \"on_deadline\"";
        wrong.push(("deadline.reaction", message.to_owned()));
    }
    if own.every_ms.is_some() {
        let ports = placed.kind.inputs(settings);
        let count = |mode| ports.iter().filter(|port| port.mode == mode).count();
        wrong.extend(match (count(PortMode::Every), count(PortMode::At)) {
            _ if node.scheduled.is_some() && model == Model::Periodic => {
                Some(("every_ms", "`execution.model` sets the period of this operator".to_owned()))
            }
            (0, 1) => None,
            (0, at) => Some((
                "every_ms",
                format!(
                    "expected an operator with one port of the frame's stamp: a `{}` has {at}",
                    node.kind
                ),
            )),
            _ => Some(("every_ms", format!("expected none: a `{}` has a timer", node.kind))),
        });
    }
    if let Some(ladder) = ladder.filter(|_| !own.rungs.is_empty()) {
        wrong.extend(wrong_rungs(placed, setup, ladder).into_iter().map(|message| ("rungs", message)));
    }
    wrong
}

/// Problems of `[operator.NAME] rungs`.
fn wrong_rungs(placed: &Placed, setup: &Setup, ladder: &Ladder) -> Vec<String> {
    let (kind, node, settings) = (&placed.kind, placed.kind.node(), &placed.settings(setup));
    if !node.on_ladder {
        return vec![format!(
            "expected none: a `{}` keeps its state from step to step, and rungs do not share it",
            node.kind
        )];
    }
    if kind.ladder(settings).is_some_and(|ladder| ladder.sets_run_time) {
        return vec!["expected none: the settings of its kind put it on a ladder".to_owned()];
    }
    let mut wrong = Vec::new();
    let mut names = BTreeSet::new();
    let twice = placed.own.rungs.iter().filter(|rung| !names.insert(&rung.name));
    wrong.extend(twice.map(|rung| format!("two rungs have the name `{}`", rung.name)));
    let ports = |settings: &Settings<'_>| (kind.inputs(settings), kind.outputs(settings));
    for rung in &ladder.rungs {
        let name = &rung.name;
        match OnRung::new(placed, setup, rung) {
            Ok(OnRung { setup, .. })
                if ports(&Settings { setup: &setup, ..*settings }) != ports(settings) =>
            {
                wrong.push(format!("`{name}`: expected the ports of the operator without rungs"));
            }
            Ok(_) => {}
            Err(found) => {
                wrong.extend(found.iter().map(|(key, message)| format!("`{name}`: {key}: {message}")));
            }
        }
    }
    wrong
}

/// Period or constant deadline of an operator under the models of `[execution]` that have one: the configured one, else
/// its fixed run time or that of its highest rung. Problems are reported.
fn length(
    placed: &Placed,
    settings: &Settings<'_>,
    ladder: Option<&Ladder>,
    problems: &mut KeyProblems,
) -> Option<Span> {
    let execution = &settings.setup.execution;
    let scheduled = placed.kind.node().scheduled.filter(|_| execution.model.has_lengths())?;
    let given = match scheduled {
        Scheduled::Detector => execution.detector_ms,
        Scheduled::Planner => execution.planner_ms,
    };
    let fixed = placed.own.runtime.as_ref().and_then(|runtime| runtime.fixed_ms);
    let top = ladder.and_then(|ladder| ladder.rungs.last()).map(|rung| rung.run_time.as_ms());
    let usual = || placed.kind.takes_ms(settings).map(|[_, most_ms]| most_ms);
    let span = match given.or(fixed).or(top).or_else(usual) {
        None => Err("expected milliseconds, as no fixed run time gives them".to_owned()),
        Some(ms) if (1.0..=10_000.0).contains(&ms) => span_ms(ms),
        Some(ms) => Err(format!("expected 1 to 10000, found {}", number(ms))),
    };
    span.map_err(|message| {
        let problem = (format!("execution.{}", scheduled.key()), message);
        // Several detectors or planners would report the same problem.
        if !problems.contains(&problem) {
            problems.push(problem);
        }
    })
    .ok()
}
