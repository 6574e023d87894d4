//! Problems of the values, and of the resulting pipeline.

use swerve_core::Ranges as _;

use super::planner::{outside, problem, within};
use crate::assembly::Assembly;
use crate::setup::Setup;

impl Setup {
    /// Problems of single values, by key.
    pub(crate) fn problems_of_values(&self) -> Vec<(String, String)> {
        let mut faults: Vec<_> = self.out_of_range().into_iter().map(problem).collect();
        let vehicle = self.sim.vehicle.validate();
        faults.extend(vehicle.err().into_iter().flat_map(|error| within("sim.vehicle", outside(error))));
        self.check_gate(&mut faults);
        self.check_operators(&mut faults);
        self.check_sensors(&mut faults);
        self.check_localization(&mut faults);
        self.check_perception(&mut faults);
        self.check_predictor_weights(&mut faults);
        self.check_execution(&mut faults);
        self.check_log(&mut faults);
        self.check_monitors(&mut faults);
        self.check_clock(&mut faults);
        self.check_ros2(&mut faults);
        self.check_source(&mut faults);
        self.check_live(&mut faults);
        faults
    }

    /// Problems of the pipeline as a whole: operators, inputs, faults, processes.
    pub(super) fn check_pipeline(&self, problems: &mut Vec<(String, String)>) {
        let assembly = Assembly::with_problems(self, problems);
        self.check_faults(&assembly, problems);
        self.check_processes(&assembly, problems);
    }
}
