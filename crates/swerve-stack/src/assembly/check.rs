//! Problems of the values of a setup, and of the resulting pipeline.

use swerve_core::Ranges as _;
use swerve_text::did_you_mean;

use super::Assembly;
use crate::base::{pipeline_names, sensor_operators};
use crate::config::injection::{Carries, Corruption, FaultKind};
use crate::config::{Images, is_plain_name};
use crate::problems::{KeyProblems, problem, problems_of_ranges, within};
use crate::sections::SECTIONS;
use crate::setup::Setup;

impl Setup {
    /// Problems of single values, by key.
    pub(crate) fn problems_of_values(&self) -> KeyProblems {
        let mut faults = problems_of_ranges(&self.config);
        let mut vehicle = problems_of_ranges(&self.sim.vehicle);
        if vehicle.is_empty() {
            vehicle.extend(self.sim.vehicle.validate().err().map(problem));
        }
        faults.extend(within("sim.vehicle", vehicle));
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
    pub(crate) fn check_pipeline(&self, problems: &mut KeyProblems) {
        let assembly = Assembly::with_problems(self, problems);
        self.check_faults(&assembly, problems);
        self.check_processes(&assembly, problems);
    }

    /// Returns true if a sensor runs: an operator reads it, or `log.sensors` names it.
    pub fn runs(&self, sensor: &str) -> bool {
        Assembly::with_problems(self, &mut Vec::new()).has(sensor)
    }

    fn check_sensors(&self, told: &mut KeyProblems) {
        for (kind, name) in self.named_sensors() {
            let plain = is_plain_name(name);
            if !plain || pipeline_names().any(|operator| operator == name) {
                let message = "expected a name of letters, digits and underscores that no operator has";
                told.push((format!("{kind}.{name}"), message.into()));
            }
            let other = self.named_sensors().find(|(_, first)| *first == name);
            if let Some((other, _)) = other.filter(|(other, _)| *other != kind) {
                let message = format!("expected a unique name, found that of `[{other}.{name}]`");
                told.push((format!("{kind}.{name}"), message));
            }
        }
    }

    fn check_localization(&self, faults: &mut Vec<(String, String)>) {
        if let Some(message) = self.registry.localizers.problem(self.localization.localizer.as_str()) {
            faults.push(("localization.localizer".into(), message));
        }
        let reads_map = self.localization.reads_map(&self.registry);
        if self.localization.estimates() && self.is_driven_over_ros2() {
            let message = "expected \"truth\": a stack that drives over ROS 2 localizes itself";
            faults.push(("localization.localizer".into(), message.into()));
        }
        if reads_map && self.localization.map.is_none() && self.live.is_some() {
            let message = "is missing: expected a map of the road, as `swerve map build` writes it";
            faults.push(("localization.map".into(), message.into()));
        }
        if self.localization.map.is_some() && !reads_map {
            let message =
                "is for `localization.localizer = \"ndt\"` or `\"eskf_ndt\"`, which match turns with it";
            faults.push(("localization.map".into(), message.into()));
        }
        self.check_stored_pose(faults);
    }

    fn check_stored_pose(&self, faults: &mut Vec<(String, String)>) {
        let Some([place_m, heading_deg]) = self.localization.stored_pose else { return };
        let mut fault = |message: String| faults.push(("localization.stored_pose".into(), message));
        if !self.localization.named(&self.registry).is_some_and(|named| named.starts_stored) {
            fault("is for `localization.localizer = \"eskf\"` or `\"eskf_ndt\"`, which start from it".into());
        } else if self.live.is_some() {
            fault("expected none: a vehicle starts from its first fix".into());
        } else if !((0.001..=10.0).contains(&place_m) && (0.01..=30.0).contains(&heading_deg)) {
            fault(format!(
                "expected 0.001 to 10 m and 0.01 to 30 degrees, found {place_m} and {heading_deg}"
            ));
        }
    }

    fn check_log(&self, told: &mut KeyProblems) {
        let sensors = sensor_operators(self);
        let known = || sensors.iter().map(String::as_str);
        for (k, sensor) in self.log.sensors.iter().enumerate() {
            if known().any(|name| name == sensor) {
                continue;
            }
            let near = did_you_mean(sensor, known());
            let names: Vec<&str> = known().collect();
            let message = format!("unknown sensor `{sensor}`, expected one of {}{near}", names.join(", "));
            told.push((format!("log.sensors[{k}]"), message));
        }
        let log = &self.log;
        if log.images == Images::Jpeg && !log.foxglove {
            let message = "expected true where log.images is \"jpeg\": JPEG images are there to be looked at";
            told.push(("log.foxglove".into(), message.into()));
        }
    }

    fn check_monitors(&self, told: &mut Vec<(String, String)>) {
        for name in self.monitor.keys() {
            let plain = is_plain_name(name);
            if !plain
                || pipeline_names().any(|operator| operator == name)
                || self.sensors().any(|sensor| sensor == name)
            {
                let message = "expected a name of letters, digits and underscores that no operator has";
                told.push((format!("monitor.{name}"), message.into()));
            }
        }
    }

    fn check_faults(&self, assembly: &Assembly, told: &mut Vec<(String, String)>) {
        let streams = self.corruptible_streams(assembly);
        for (name, fault) in &self.fault {
            let key = |last: &str| format!("fault.{name}.{last}");
            if name.is_empty() || assembly.names().any(|operator| operator == name) {
                told.push((format!("fault.{name}"), "expected a name that no operator has".into()));
            }
            let stream = streams.iter().find(|(stream, _)| *stream == fault.stream);
            if stream.is_none() {
                let names: Vec<&str> = streams.iter().map(|(name, _)| name.as_str()).collect();
                let near = did_you_mean(&fault.stream, names.iter().copied());
                let wrong = match fault.stream.as_str() {
                    "" => "is missing:".to_owned(),
                    other => format!("unknown stream `{other}`,"),
                };
                let message = format!(
                    "{wrong} expected one of {}{near}; sensors that only the log reads run where `log.sensors` names them",
                    names.join(", ")
                );
                told.push((key("stream"), message));
            }
            if fault.check_ranges().is_err() {
                continue;
            }
            let fits = |kind: FaultKind, carries: Carries| match kind {
                FaultKind::Corrupt(Corruption::FlipBits(_)) => carries != Carries::Numbers,
                FaultKind::Corrupt(Corruption::Nan) => carries != Carries::Levels,
                _ => true,
            };
            match (fault.kind(), stream) {
                (Err(("", message)), _) => told.push((format!("fault.{name}"), message)),
                (Err((last, message)), _) => told.push((key(last), message)),
                (Ok(kind), Some((_, carries))) if !fits(kind, *carries) => told.push((
                    key(kind.name()),
                    format!("`{}` carries {carries}: this fault does not apply to it", fault.stream),
                )),
                _ => {}
            }
            if let Err((last, message)) = fault.stamps() {
                told.push((key(last), message));
            }
        }
    }

    /// All streams that faults can affect, with their contents; the first stream of an operator has the operator's
    /// name.
    fn corruptible_streams(&self, assembly: &Assembly) -> Vec<(String, Carries)> {
        let mut streams = Vec::new();
        for (placed, output) in assembly.streams().filter(|(_, output)| !output.silent) {
            let Some(corruptible) = self.registry.corruptible(output.port.payload) else { continue };
            let is_first = placed.outputs.first().is_some_and(|first| first.stream == output.stream);
            let by_operator = is_first && placed.kind.node().table_of_each().is_none();
            let name = if by_operator { &placed.name } else { &output.stream };
            streams.push((name.clone(), (corruptible.carries)(&output.port.name)));
        }
        streams
    }
}
