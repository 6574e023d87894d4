//! The motion planner: which one, how finely it searches, and what it costs.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_planning::{CollisionMode, Planner, comfort};
use swerve_pylot::{Era, Original, Preset, Rules};
use swerve_text::KeyProblem;

use super::execution::Runtime;
use super::planner;

/// Motion planners by name.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PlannerName {
    /// Frenet optimal trajectories.
    Fot,
    /// RRT*.
    RrtStar,
    /// Hybrid A*.
    HybridAstar,
    /// Route following that slows and stops for what is ahead.
    Waypoint,
    /// Route following with emergency braking.
    Aeb,
}

impl PlannerName {
    /// Who it is to the paper's rules.
    pub(super) fn original(self) -> Original {
        match self {
            Self::Fot => Original::Fot,
            Self::RrtStar => Original::RrtStar,
            Self::HybridAstar => Original::HybridAstar,
            Self::Waypoint | Self::Aeb => Original::Other,
        }
    }

    /// All of them.
    pub const ALL: [Self; 5] = [Self::Fot, Self::RrtStar, Self::HybridAstar, Self::Waypoint, Self::Aeb];

    /// Whether the paper has a planner of this name.
    pub(super) fn is_paper(self) -> bool {
        self.original() != Original::Other
    }

    /// The name in files and tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Fot => "fot",
            Self::RrtStar => "rrt_star",
            Self::HybridAstar => "hybrid_astar",
            Self::Waypoint => "waypoint",
            Self::Aeb => "aeb",
        }
    }
}

/// A planner's discretisation.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Fineness {
    /// Coarse.
    Fast,
    /// Fine.
    Slow,
}

impl Fineness {
    /// The name in files and tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Slow => "slow",
        }
    }
}

/// Where a plan starts.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StartState {
    /// The pose measured at the stamp.
    Measured,
    /// Moved on by the expected run time.
    Predicted,
}

/// Run time by planner and discretisation.
pub(crate) type Cost = BTreeMap<PlannerName, BTreeMap<Fineness, Runtime>>;

/// Read once: every default configuration has it.
static BUILT_IN_COST: LazyLock<Cost> = LazyLock::new(|| swerve_text::built_in(include_str!("cost.toml")));

/// The motion planner.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlanningConfig {
    /// Which one.
    pub planner: PlannerName,
    /// Its discretisation.
    pub config: Fineness,
    /// The paper's behaviour, or ours; sets the defaults of the keys below.
    pub preset: Preset,
    /// Whose rules the paper's preset keeps: `pylot_2020_05` (when absent) or `pylot_2020_11`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub era: Option<Era>,
    /// Single rules that differ from the era's (`swerve_pylot::Rules` has them with their sources).
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "Rules")]
    pub rules: toml::Table,
    /// What predictions mean for collision checks: `time_indexed`, `may_stop` (pedestrians, anywhere on their way: slow
    /// or stop while that suffices, else go by where they are predicted to be), `risk` (as `may_stop`, but the least
    /// likely modes of a predictor are not kept clear of, up to `risk_max`), or the original's `swept_static`; when
    /// absent `risk`, under the preset `paper` the original's.
    pub collision: Option<CollisionMode>,
    /// With `collision = "risk"`: probability that a plan may touch anybody, as far as predictions are right.
    pub risk_max: f64,
    /// Deviations of the place that localization tells, metres: from the first on the ego drives slower than its target,
    /// from the second on at 0.3 of it. When absent 0.4 and 1.0, which is what a car has beside it on its lane over two
    /// deviations and over one; under the preset `paper` it never does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slow_by_sigma_m: Option<[f64; 2]>,
    /// Standard deviations of the lateral position that plans keep from the edges of the road. The car is no faster than it
    /// can stop in its lane by dead reckoning with so many to spare at the nearer edge; where they do not fit there it
    /// stops, and goes on when 1.1 times as many fit. 0 keeps none and never stops. When absent 2.33, which 1 % of a normal
    /// distribution exceeds; under the preset `paper` 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lane_sigmas: Option<f64>,
    /// Where a plan starts; the preset's when absent.
    pub start: Option<StartState>,
    /// Expected time from a sensor frame to its plan, ms, for the predicted start; the planner's typical cost when absent.
    pub expected_ms: Option<f64>,
    /// Parameters of the chosen planner that differ from its preset's and discretisation's.
    #[schemars(with = "crate::config::AnyTable")]
    pub params: toml::Table,
    /// A ladder of discretisations (`fot@d3`): the planner takes the finest that fits the time left until its deadline,
    /// and as long as that takes.
    pub ladder: Option<String>,
    /// The ladder's highest rung that is taken, by its run time, ms; the finest of all when absent.
    pub rung_ms: Option<f64>,
    /// Run time by planner and discretisation; `[operator.planner] runtime` goes before it. A file that names one
    /// entry replaces the whole table. Default: `cost.toml`, measured by `swerve calibrate` for the `best` presets.
    pub cost: Cost,
    /// Latency added to every plan, ms.
    pub added_latency_ms: f64,
    /// The comfortable layer above the planner: its plan is driven while one is free.
    pub comfort: ComfortConfig,
}

/// The comfortable layer above a planner, and its limits.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ComfortConfig {
    /// Whether there is one; when absent with the preset `best`, except above `aeb`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub enabled: Option<bool>,
    /// Its limits.
    #[serde(flatten)]
    pub limits: comfort::Params,
}

impl Default for PlanningConfig {
    fn default() -> Self {
        Self {
            planner: PlannerName::Fot,
            config: Fineness::Fast,
            preset: Preset::Best,
            era: None,
            rules: toml::Table::new(),
            collision: None,
            risk_max: 0.05,
            slow_by_sigma_m: None,
            lane_sigmas: None,
            start: None,
            expected_ms: None,
            params: toml::Table::new(),
            ladder: None,
            rung_ms: None,
            cost: BUILT_IN_COST.clone(),
            added_latency_ms: 0.0,
            comfort: ComfortConfig::default(),
        }
    }
}

impl PlanningConfig {
    /// The planner that this names, with its parameters.
    ///
    /// # Errors
    /// Problems of the parameters, each by its key in `planning.params`.
    pub fn planner(&self) -> Result<Box<dyn Planner>, Vec<KeyProblem>> {
        self.planner_with(&self.params)
    }

    /// The same with other parameters.
    ///
    /// # Errors
    /// Problems of the parameters, each by its key.
    pub fn planner_with(&self, params: &toml::Table) -> Result<Box<dyn Planner>, Vec<KeyProblem>> {
        planner::planner(self, params)
    }

    /// The rules of the paper's preset for the chosen planner; what is wrong with them, each by its key.
    pub fn rules(&self) -> Result<Rules, Vec<(String, String)>> {
        planner::rules(self)
    }

    /// The rules of the era alone.
    pub(super) fn rules_of_era(&self) -> Rules {
        Rules::of(self.era.unwrap_or_default(), self.planner.original())
    }

    /// Run time of the chosen planner and discretisation.
    pub fn cost_of_chosen(&self) -> Option<&Runtime> {
        self.cost.get(&self.planner)?.get(&self.config)
    }

    /// Whether a comfortable layer is above the planner.
    pub fn has_comfort(&self) -> bool {
        self.comfort.enabled.unwrap_or(self.preset == Preset::Best && self.planner != PlannerName::Aeb)
    }

    /// What predictions mean for collision checks.
    pub fn collision(&self) -> CollisionMode {
        self.collision.unwrap_or(match self.preset {
            Preset::Paper => CollisionMode::SweptStatic,
            Preset::Best => CollisionMode::Risk,
        })
    }

    /// The deviations of localization by which the ego slows, metres.
    pub fn slow_by_sigma_m(&self) -> [f64; 2] {
        self.slow_by_sigma_m.unwrap_or(match self.preset {
            Preset::Paper => [f64::MAX; 2],
            Preset::Best => [0.4, 1.0],
        })
    }

    /// Deviations of the lateral position that are kept from the edges of the road.
    pub fn lane_sigmas(&self) -> f64 {
        self.lane_sigmas.unwrap_or(match self.preset {
            Preset::Paper => 0.0,
            Preset::Best => 2.33,
        })
    }

    /// Where a plan starts.
    pub fn start_state(&self) -> StartState {
        self.start.unwrap_or(match self.preset {
            Preset::Paper => StartState::Measured,
            Preset::Best => StartState::Predicted,
        })
    }

    /// Expected time from a sensor frame to its plan's first effect, ms.
    pub fn expected_ms(&self) -> f64 {
        self.expected_ms
            .unwrap_or_else(|| self.cost_of_chosen().map_or(0.0, Runtime::typical_ms) + self.added_latency_ms)
    }
}
