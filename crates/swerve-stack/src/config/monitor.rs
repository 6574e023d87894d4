//! Monitors of single cameras and lidars, `[monitor.NAME]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Config;
use super::camera::Output;
use super::operator::is_plain_name;
use crate::assembly::{one_of, pipeline_names};
use crate::kind::KeyProblems;
use crate::section::{Section, of_config};
use crate::setup::Setup;

/// Monitor of a camera or lidar: checks every byte of its output for frozen, blank or broken data.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MonitorConfig {
    /// Camera or lidar to monitor; the monitor makes it run.
    pub sensor: String,
    /// Output of the camera to monitor.
    pub output: Output,
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

impl Default for MonitorConfig {
    fn default() -> Self {
        Self { sensor: String::new(), output: Output::Rgb }
    }
}

impl Config {
    /// Names of all monitors.
    pub fn monitors(&self) -> impl Iterator<Item = &str> {
        self.monitor.keys().map(String::as_str)
    }

    pub(super) fn check_monitors(&self, told: &mut Vec<(String, String)>) {
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
}
