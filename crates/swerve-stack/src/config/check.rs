//! Problems of the values, and of the resulting pipeline.

use super::SECTIONS;
use super::planner::{outside, problems_of_ranges, within};
use crate::assembly::Assembly;
use crate::kind::KeyProblems;
use crate::setup::Setup;

impl Setup {
    /// Problems of single values, by key.
    pub(super) fn problems_of_values(&self) -> KeyProblems {
        let mut faults = problems_of_ranges(&self.config);
        let vehicle = self.sim.vehicle.validate();
        faults.extend(vehicle.err().into_iter().flat_map(|error| within("sim.vehicle", outside(error))));
        self.check_operators(&mut faults);
        faults.extend(self.problems_of_sections());
        self.check_sensors(&mut faults);
        self.check_localization(&mut faults);
        self.check_log(&mut faults);
        self.check_monitors(&mut faults);
        self.check_clock(&mut faults);
        self.check_ros2(&mut faults);
        self.check_source(&mut faults);
        self.check_live(&mut faults);
        faults
    }

    /// Problems of the tables of kinds of operators, by key.
    pub(crate) fn problems_of_sections(&self) -> KeyProblems {
        SECTIONS.iter().flat_map(|section| section.problems_of_table(self)).collect()
    }

    /// Problems of the pipeline as a whole: operators, inputs, faults, processes.
    pub(super) fn check_pipeline(&self, problems: &mut KeyProblems) {
        let assembly = Assembly::with_problems(self, problems);
        self.check_faults(&assembly, problems);
        self.check_processes(&assembly, problems);
    }
}
