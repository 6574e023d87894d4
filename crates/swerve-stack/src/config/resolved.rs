//! Settings that operators are built from: typed and checked, from the configuration as it applies to one of them.

use swerve_control::safety_gate::GateParams;
use swerve_perception::detector;
use swerve_planning::deadline;
use swerve_pylot::Rules;
use swerve_text::KeyProblem;

use super::perception::Emulated;
use super::planner::within;
use crate::assembly::scheduled_operator;
use crate::kind::{KeyProblems, Scheduled};
use crate::schedule::Rung;
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
    /// Errors of the detector in front of the tracker: without an emulated one, those of the emulation's defaults.
    pub behind: detector::Params,
    /// Number of boxes after which the tracker behind a detector reports a track of a person.
    pub tracker_hits_min: usize,
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
        if let Err(message) = config.detector_rungs() {
            tell("perception", vec![("ladder".to_owned(), message)]);
        }
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
        let built = |params: &toml::Table| planning.planner_with(&config.registry, params);
        let on_rung = |rung: &Rung| {
            let mut params = planning.params.clone();
            params.extend(rung.keys["params"].as_table().cloned().unwrap_or_default());
            built(&params).err()
        };
        let on_ladder = planner_rungs.iter().find_map(on_rung);
        if let Some(found) = built(&planning.params).err().or(on_ladder) {
            tell("planning.params", found);
        }
        if let Err(found) = config.built_controller() {
            tell("control", found);
        }
        if let Err(found) = config.prediction.built(&config.registry, None) {
            tell("prediction", found);
        }
        Self { gate, deadlines, detector, behind, tracker_hits_min, rules }
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
