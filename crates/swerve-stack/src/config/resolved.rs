//! Settings that operators are built from: typed and checked, from the configuration as it applies to one of them.

use swerve_control::safety_gate::GateParams;
use swerve_perception::detector;
use swerve_planning::deadline;
use swerve_pylot::Rules;

use super::perception::Emulated;

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
