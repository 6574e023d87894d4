//! Settings that operators are built from: typed and checked, from the configuration as it applies to one of them.

use swerve_control::safety_gate::GateParams;
use swerve_core::Span;
use swerve_perception::detector;
use swerve_planning::deadline;
use swerve_pylot::Rules;
use swerve_text::number;
use toml::Value;

use super::execution::{Runtime, span_ms};
use super::model::{Model, Rung};
use super::perception::Emulated;
use super::{Config, OperatorConfig};
use crate::kind::Scheduled;
use crate::setup::Setup;

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
    /// Resolves all settings. Defaults replace invalid ones.
    pub fn new(config: &Setup) -> Self {
        let gate = config.gate_params().unwrap_or_else(|_| GateParams::new(&config.sim.vehicle));
        let deadlines = config.deadline_params().unwrap_or_default();
        let perception = &config.perception;
        let detector = perception.emulated().unwrap_or_default();
        let behind = config.noise_behind_detector();
        let tracker = config.tracker_behind(&behind);
        let tracker_hits_min = tracker.map_or(1, |tracker| tracker.hits_min());
        let detector_rungs = config.detector_rungs().unwrap_or_default();
        let planner_rungs = config.planner_rungs().unwrap_or_default();
        let rules = config.planning.rules().unwrap_or_else(|_| config.planning.rules_of_era());
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
