//! Settings that operators are built from: typed and checked, from the configuration as it applies to one of them.

use swerve_control::safety_gate::GateParams;
use swerve_core::Span;
use swerve_perception::detector;
use swerve_planning::deadline;
use swerve_pylot::Rules;
use swerve_text::{KeyProblem, number};
use toml::Value;

use super::execution::{Runtime, span_ms};
use super::model::{Model, Rung};
use super::perception::Emulated;
use super::planner::within;
use super::{Config, OperatorConfig};
use crate::assembly::scheduled_operator;
use crate::kind::{KeyProblems, Scheduled};
use crate::setup::Setup;
use crate::trackers::TrackerSetup;

/// Resolved settings of a configuration. Operators are built from it and read no text.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// Limits and times of the safety gate.
    pub gate: GateParams,
    /// The deadline policy.
    pub deadlines: deadline::Params,
    /// The emulated detector, if there is one.
    pub detector: Option<Emulated>,
    /// Ladder of that detector, the fastest rung first; empty without a ladder.
    pub detector_rungs: Vec<Rung<detector::Params>>,
    /// Errors of the detector in front of the tracker: without an emulated one, those of the emulation's defaults.
    pub behind: detector::Params,
    /// Number of boxes after which the tracker behind a detector reports a track of a person.
    pub tracker_hits_min: usize,
    /// Ladder of the planner, the fastest rung first, each with the parameters that define it; empty without a ladder.
    pub planner_rungs: Vec<Rung<toml::Table>>,
    /// The rules of the paper's preset for the chosen planner.
    pub rules: Rules,
}

impl Resolved {
    /// Resolves all settings. Problems are reported by key, and defaults take the place of wrong settings.
    pub fn new(config: &Setup, told: &mut KeyProblems) -> Self {
        let mut tell = |section: &str, problems: Vec<KeyProblem>| told.extend(within(section, problems));
        let vehicle = &config.sim.vehicle;
        let gate = config.gate_params().unwrap_or_else(|found| {
            tell("gate.params", found);
            GateParams::new(vehicle)
        });
        let deadlines = config.deadline_params().unwrap_or_else(|found| {
            tell("execution.params", found);
            deadline::Params::default()
        });
        let perception = &config.perception;
        let detector = perception.emulated().unwrap_or_else(|found| {
            tell("perception", found);
            None
        });
        // Without an emulated detector its noise is that of the emulation's defaults.
        let behind = detector.as_ref().map_or_else(Default::default, |emulated| emulated.params);
        let of = TrackerSetup { behind: &behind, sightings_max: config.prediction.sightings() };
        let tracker = perception.built_tracker(&config.registry, of);
        let tracker_hits_min = tracker.map(|tracker| tracker.hits_min()).unwrap_or_else(|found| {
            tell("perception", found);
            1
        });
        // Rungs have the detector's own parameters, and so the same problems.
        let detector_rungs = config.detector_rungs().unwrap_or_else(|mut found| {
            found.retain(|(key, _)| !key.starts_with("params"));
            tell("perception", found);
            Vec::new()
        });
        let planner_rungs = config.planner_rungs().unwrap_or_else(|(key, message)| {
            tell("planning", vec![(key.to_owned(), message)]);
            Vec::new()
        });
        let planning = &config.planning;
        let rules = planning.rules().unwrap_or_else(|found| {
            tell("", found);
            planning.rules_of_era()
        });
        tell("planning", planning.problems_of_names(&config.registry));
        let built = |params| planning.planner_with(&config.registry, params);
        let on_ladder = planner_rungs.iter().find_map(|rung| built(&rung.what).err());
        if let Some(found) = built(&planning.params).err().or(on_ladder) {
            tell("planning.params", found);
        }
        if let Err(found) = config.built_controller() {
            tell("control", found);
        }
        if let Err(found) = config.prediction.built(&config.registry, None) {
            tell("prediction", found);
        }
        Self { gate, deadlines, detector, detector_rungs, behind, tracker_hits_min, planner_rungs, rules }
    }
}

impl Scheduled {
    /// Key of `[execution]` for the length.
    pub(crate) const fn key(self) -> &'static str {
        match self {
            Self::Detector => "detector_ms",
            Self::Planner => "planner_ms",
        }
    }

    /// Period or fixed deadline of an operator, under the models that have one: the configured one, else its fixed run
    /// time or that of its highest rung; `takes_ms` is the run time given by its kind.
    ///
    /// # Errors
    /// No key gives a length, or it is out of range.
    pub(crate) fn length(
        self,
        config: &Config,
        own: &OperatorConfig,
        resolved: &Resolved,
        takes_ms: Option<[f64; 2]>,
    ) -> Result<Option<Span>, String> {
        let execution = &config.execution;
        if !execution.model.has_lengths() {
            return Ok(None);
        }
        let (given, top) = match self {
            Self::Detector => (execution.detector_ms, takes_ms.map(|[_, most_ms]| most_ms)),
            Self::Planner => {
                (execution.planner_ms, resolved.planner_rungs.last().map(|rung| rung.run_time.as_ms()))
            }
        };
        let fixed = own.runtime.as_ref().and_then(|runtime| runtime.fixed_ms);
        let ms = given.or(fixed).or(top).ok_or("expected milliseconds, as no fixed run time gives them")?;
        if !(1.0..=10_000.0).contains(&ms) {
            return Err(format!("expected 1 to 10000, found {}", number(ms)));
        }
        span_ms(ms).map(Some)
    }

    /// Problems of `[operator.NAME]` of an operator that a model schedules, by key.
    pub(crate) fn problems(self, config: &Config, own: &OperatorConfig) -> Vec<(&'static str, &'static str)> {
        let mut wrong = Vec::new();
        let deadlines = matches!(config.execution.model, Model::StaticDeadlines | Model::DynamicDeadlines);
        if own.deadline.is_some() && deadlines {
            wrong.push(("deadline", "`execution.model` sets the deadline of this operator"));
        }
        let ladder = match self {
            Self::Detector => {
                config.perception.ladder || own.keys.get("ladder").and_then(Value::as_bool) == Some(true)
            }
            Self::Planner => config.planning.ladder.is_some(),
        };
        if ladder && own.runtime.as_ref().is_some_and(|runtime: &Runtime| runtime.model().is_ok()) {
            wrong.push(("runtime", "the rungs of its ladder say what this operator takes"));
        }
        wrong
    }
}

impl Setup {
    /// Checks `[execution]`.
    pub(super) fn check_execution(&self, told: &mut KeyProblems) {
        let execution = &self.execution;
        let used = execution.model.has_lengths();
        let detects = scheduled_operator(self, Scheduled::Detector).is_some();
        let lengths = [
            (Scheduled::Detector, execution.detector_ms, detects),
            (Scheduled::Planner, execution.planner_ms, true),
        ];
        for (scheduled, ms, runs) in lengths {
            if ms.is_none() || used && runs {
                continue;
            }
            let message = if runs || !used {
                "only `periodic` and `static_deadlines` have use for it"
            } else {
                "there is no detector"
            };
            told.push((format!("execution.{}", scheduled.key()), message.into()));
        }
    }
}
