//! Tables of the configuration that are settings of kinds of operators, and the problems of their values.

use swerve_text::{KeyProblem, did_you_mean, list};

use crate::base::scheduled_operator;
use crate::config::camera::CameraConfig;
use crate::config::gate::GateConfig;
use crate::config::model::ExecutionConfig;
use crate::config::monitor::MonitorConfig;
use crate::config::perception::PerceptionConfig;
use crate::config::sensors::{LidarConfig, RadarConfig};
use crate::config::{ControlConfig, PlanningConfig, PredictionConfig, SensingConfig};
use crate::controllers::AnyController;
use crate::kind::Scheduled;
use crate::ladder::Rung;
use crate::problems::{KeyProblems, one_of, problems_of_ranges, within};
use crate::section::{AnySection, Section, of_config};
use crate::setup::Setup;

/// Tables of the configuration that belong to kinds of operators.
pub(crate) const SECTIONS: [&dyn AnySection; 11] = [
    &SensingConfig::SECTION,
    &CameraConfig::SECTION,
    &RadarConfig::SECTION,
    &LidarConfig::SECTION,
    &MonitorConfig::SECTION,
    &PerceptionConfig::SECTION,
    &PredictionConfig::SECTION,
    &PlanningConfig::SECTION,
    &ControlConfig::SECTION,
    &GateConfig::SECTION,
    &ExecutionConfig::SECTION,
];

impl SensingConfig {
    /// `[sensing]`.
    pub const SECTION: Section<Self> = of_config!(sensing, Self::problems);

    fn problems(&self, _: &Setup) -> KeyProblems {
        problems_of_ranges(self)
    }
}

impl CameraConfig {
    /// `[camera.NAME]`.
    pub const SECTION: Section<Self> = of_config!(camera.NAME, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        self.faults(&setup.sim.vehicle.shape)
    }
}

impl RadarConfig {
    /// `[radar.NAME]`.
    pub const SECTION: Section<Self> = of_config!(radar.NAME, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        self.faults(&setup.sim.vehicle.shape)
    }
}

impl LidarConfig {
    /// `[lidar.NAME]`.
    pub const SECTION: Section<Self> = of_config!(lidar.NAME, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        self.faults(&setup.sim.vehicle.shape, setup.sim.dt_ms)
    }
}

impl MonitorConfig {
    /// `[monitor.NAME]`.
    pub const SECTION: Section<Self> = of_config!(monitor.NAME, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let mut found = KeyProblems::new();
        let known = || setup.camera.keys().chain(setup.lidar.keys()).map(String::as_str);
        let Self { sensor, output } = self;
        if !known().any(|known| known == sensor) {
            let names: Vec<&str> = known().collect();
            let message = match (sensor.as_str(), &names[..]) {
                ("", []) => {
                    "is missing: expected a camera or a lidar; [camera.NAME] or [lidar.NAME] makes one".into()
                }
                ("", names) => {
                    format!("is missing: expected a camera or a lidar, one of {}", names.join(", "))
                }
                _ => format!("unknown camera or lidar `{sensor}`{}", one_of(sensor, &names)),
            };
            found.push(("sensor".to_owned(), message));
        }
        if setup.camera.get(sensor).is_some_and(|camera| !camera.outputs.contains(output)) {
            let message = format!("`{sensor}` has no output `{}`", output.name());
            found.push(("output".to_owned(), message));
        }
        found
    }
}

impl PerceptionConfig {
    /// `[perception]`.
    pub const SECTION: Section<Self> = of_config!(perception, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let mut found = KeyProblems::new();
        if let Some(name) = self.camera.as_ref().filter(|name| !setup.camera.contains_key(*name)) {
            let names: Vec<&str> = setup.camera.keys().map(String::as_str).collect();
            let near = did_you_mean(name, names.iter().copied());
            let message = format!("unknown camera `{name}`, expected one of [{}]{near}", names.join(", "));
            found.push(("camera".to_owned(), message));
        }
        found.extend(self.emulated().err().unwrap_or_default());
        let tracker = setup.tracker_behind(&setup.noise_behind_detector());
        found.extend(tracker.err().unwrap_or_default());
        found.extend(setup.perception.rungs().err().map(|message| ("ladder".to_owned(), message)));
        found
    }
}

impl PredictionConfig {
    /// `[prediction]`.
    pub const SECTION: Section<Self> = of_config!(prediction, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let mut found = problems_of_ranges(self);
        found.extend(self.file_weights().err().map(|message| ("weights".to_owned(), message)));
        found.extend(self.built(&setup.registry, None).err().unwrap_or_default());
        found
    }
}

impl PlanningConfig {
    /// `[planning]`.
    pub const SECTION: Section<Self> = of_config!(planning, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let registry = &setup.registry;
        let mut found = problems_of_ranges(self);
        if let Some([from_m, to_m]) = self.slow_by_sigma_m
            && from_m > to_m
        {
            let message =
                format!("expected two deviations in order, 0 to 1000000, found {from_m} and {to_m}");
            found.push(("slow_by_sigma_m".into(), message));
        }
        for (planner, by_fineness) in &self.cost {
            for (fineness, cost) in by_fineness {
                let key = format!("cost.{}.{}", planner.as_str(), fineness.as_str());
                found.extend(within(&key, cost.model_by_key().err().into_iter().collect()));
            }
        }
        let rungs = setup.planning.rungs().unwrap_or_else(|(key, message)| {
            found.push((key.to_owned(), message));
            Vec::new()
        });
        if self.occlusion.enabled && !self.has_comfort(registry) {
            let message = "is a rule of the comfortable layer, which `planning.comfort.enabled` enables";
            found.push(("occlusion.enabled".into(), message.to_owned()));
        }
        found.extend(self.rules().err().unwrap_or_default());
        found.extend(self.problems_of_names(registry));
        let on_rung = |rung: &Rung| {
            let mut params = self.params.clone();
            params.extend(rung.keys["params"].as_table().cloned().unwrap_or_default());
            params
        };
        let params = core::iter::once(self.params.clone()).chain(rungs.iter().map(on_rung));
        let wrong = params.into_iter().find_map(|params| self.planner_with(registry, &params).err());
        found.extend(within("params", wrong.unwrap_or_default()));
        found
    }
}

impl ControlConfig {
    /// `[control]`.
    pub const SECTION: Section<Self> = of_config!(control, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let mut found = problems_of_ranges(self);
        found.extend(setup.built_controller().err().unwrap_or_default());
        found.extend(setup.problem_of_pedals());
        found
    }
}

impl GateConfig {
    /// `[gate]`.
    pub const SECTION: Section<Self> = of_config!(gate, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let mut found = problems_of_ranges(self);
        if let Some(release_at_ms) = self.release_at_ms.filter(|ms| *ms < self.enable_at_ms) {
            let (low, release) = (self.enable_at_ms, swerve_text::number(release_at_ms));
            let message =
                format!("expected an instant not before `enable_at_ms`, which is {low}, found {release}");
            found.push(("release_at_ms".into(), message));
        }
        found.extend(within("params", setup.gate_params().err().unwrap_or_default()));
        found
    }
}

impl ExecutionConfig {
    /// `[execution]`.
    pub const SECTION: Section<Self> = of_config!(execution, Self::problems);

    fn problems(&self, setup: &Setup) -> KeyProblems {
        let mut found = problems_of_ranges(self);
        let used = self.model.has_lengths();
        let detects = scheduled_operator(setup, Scheduled::Detector).is_some();
        let lengths =
            [(Scheduled::Detector, self.detector_ms, detects), (Scheduled::Planner, self.planner_ms, true)];
        for (scheduled, ms, runs) in lengths {
            if ms.is_none() || used && runs {
                continue;
            }
            let message = if runs || !used {
                "only `periodic` and `static_deadlines` have use for it"
            } else {
                "there is no detector"
            };
            found.push((scheduled.key().to_owned(), message.to_owned()));
        }
        found.extend(within("params", setup.execution.deadline_params().err().unwrap_or_default()));
        found
    }
}

impl Setup {
    /// Problem of a controller of pedals for a vehicle, by its key in `control`.
    fn problem_of_pedals(&self) -> Option<KeyProblem> {
        let controllers = &self.registry.controllers;
        let accelerates = |name: &str| controllers.get(name).is_none_or(AnyController::accelerates);
        if self.live.is_none() || accelerates(self.controller()) {
            return None;
        }
        let names: Vec<&str> = controllers.names().filter(|name| accelerates(name)).collect();
        let message = format!(
            "expected one of {}: \"{}\" knows pedals only, and what goes to a vehicle is an acceleration",
            list(&names),
            self.controller()
        );
        Some(("controller".to_owned(), message))
    }
}
