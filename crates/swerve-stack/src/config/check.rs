//! Problems of the values, and of the resulting pipeline.

use super::Config;
use super::planner::{outside, within};
use crate::assembly::Assembly;

impl Config {
    /// Problems of single values, by key.
    pub(crate) fn problems_of_values(&self) -> Vec<(String, String)> {
        let mut faults: Vec<(String, String)> = Vec::new();
        let mut range = |key: &str, value: f64, low: f64, high: f64| {
            if !(low..=high).contains(&value) {
                faults.push((
                    key.to_owned(),
                    format!("expected {low} to {high}, found {}", swerve_text::number(value)),
                ));
            }
        };
        let sensing = &self.sensing;
        range("ego.speed_mps", self.ego.speed_mps.unwrap_or(1.0), 0.0, 70.0);
        range("sim.dt_ms", self.sim.dt_ms, 1.0, 20.0);
        range("sensing.period_ms", sensing.period_ms, 1.0, 10_000.0);
        range("sensing.range_m", sensing.range_m, 0.1, 10_000.0);
        range("sensing.range_person_m", sensing.range_person_m.unwrap_or(1.0), 0.1, 10_000.0);
        range("sensing.fov_deg", sensing.fov_deg, 1.0, 360.0);
        range("sensing.pose_period_ms", sensing.pose_period_ms, 1.0, 10_000.0);
        range("sensing.imu_period_ms", sensing.imu_period_ms, 1.0, 10_000.0);
        range("sensing.gnss_period_ms", sensing.gnss_period_ms, 1.0, 10_000.0);
        range("sensing.odometry_period_ms", sensing.odometry_period_ms, 1.0, 10_000.0);
        range("prediction.horizon_ms", self.prediction.horizon_ms, 50.0, 60_000.0);
        range("prediction.step_ms", self.prediction.step_ms, 1.0, 10_000.0);
        if let Some(horizon_ms) = self.prediction.truth_horizon_ms {
            range("prediction.truth_horizon_ms", horizon_ms, 0.0, 60_000.0);
        }
        range("prediction.truth_noise_mps", self.prediction.truth_noise_mps, 0.0, 100.0);
        range("prediction.past_steps", self.prediction.past_steps as f64, 1.0, 1000.0);
        range("control.period_ms", self.control.period_ms, 1.0, 1000.0);
        range("planning.risk_max", self.planning.risk_max, 0.0, 0.5);
        range("planning.added_latency_ms", self.planning.added_latency_ms, 0.0, 100_000.0);
        range("planning.expected_ms", self.planning.expected_ms.unwrap_or(0.0), 0.0, 10_000.0);
        let mount = sensing.mount.map(|mount| mount.problems()).unwrap_or_default();
        faults.extend(mount.into_iter().flat_map(|error| within("sensing.mount", outside(error))));
        let of_sections = [
            ("sim.vehicle", self.sim.vehicle.validate()),
            ("planning.comfort", self.planning.comfort.limits.validate()),
            ("sensing.pose", sensing.pose.validate()),
        ];
        for (section, checked) in of_sections {
            faults.extend(checked.err().into_iter().flat_map(|error| within(section, outside(error))));
        }
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
