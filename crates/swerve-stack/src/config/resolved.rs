//! Settings that operators are built from: typed and checked, from the configuration as it applies to one of them.

use swerve_control::safety_gate::GateParams;
use swerve_perception::detector;
use swerve_planning::deadline;
use swerve_pylot::Rules;

use super::perception::Emulated;
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
    /// Errors of the detector in front of the tracker: without an emulated one, those of the emulation's defaults.
    pub behind: detector::Params,
    /// Number of boxes after which the tracker behind a detector reports a track of a person.
    pub tracker_hits_min: usize,
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
        let rules = config.planning.rules().unwrap_or_else(|_| config.planning.rules_of_era());
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
