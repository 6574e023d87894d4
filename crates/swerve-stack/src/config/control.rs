//! The controller, `[control]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_control::Following;
use swerve_core::Ranges;

use crate::named::Name;

/// Name of a controller: a built-in one, or one that [`Registry::with_controller`](crate::Registry::with_controller) adds.
pub type ControllerName = Name<BuiltInController>;

/// Built-in controllers.
#[derive(Clone, PartialEq, Debug, JsonSchema)]
#[schemars(rename = "ControllerName", rename_all = "snake_case")]
pub enum BuiltInController {
    /// The paper's speed PID and steering towards a waypoint.
    Pid,
    /// Speed PID and pure pursuit.
    PurePursuit,
    /// Speed PID and the Stanley law.
    Stanley,
    /// Linear time-varying model predictive control.
    Mpc,
}

/// The controller.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct ControlConfig {
    /// Controller: `stanley` when absent, `pid` of the paper under the planning preset `paper`.
    pub controller: Option<ControllerName>,
    /// Parameters of a custom controller that differ from its defaults.
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "crate::config::AnyTable")]
    pub params: toml::Table,
    /// Way to follow a plan; the planning preset's when absent.
    pub following: Option<Following>,
    /// Period of the controller, ms.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub period_ms: f64,
}

impl Default for ControlConfig {
    fn default() -> Self {
        Self { controller: None, params: toml::Table::new(), following: None, period_ms: 10.0 }
    }
}
