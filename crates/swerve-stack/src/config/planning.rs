//! Motion planner: its name, discretisation, behaviour and cost.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use swerve_core::Ranges;
use swerve_planning::fot::Fot;
use swerve_planning::hybrid_astar::HybridAstar;
use swerve_planning::rrt_star::RrtStar;
use swerve_planning::{CollisionMode, comfort, occlusion};
use swerve_pylot::{Era, Original, Preset, Rules};
use swerve_text::{KeyProblem, overridden};

use super::execution::Runtime;
use crate::named::Name;
use crate::planners::{Fineness, NamedPlanner as _};
use crate::problems::{outside, within};

/// Name of a motion planner: a built-in one, or one that [`Registry::with_planner`](crate::Registry::with_planner) adds.
pub type PlannerName = Name<BuiltInPlanner>;

/// Built-in motion planners.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug, JsonSchema)]
#[schemars(rename = "PlannerName", rename_all = "snake_case")]
pub enum BuiltInPlanner {
    /// Frenet optimal trajectories.
    Fot,
    /// RRT*.
    RrtStar,
    /// Hybrid A*.
    HybridAstar,
    /// Route following that slows and stops for obstacles ahead.
    Waypoint,
    /// Route following with emergency braking.
    Aeb,
}

impl PlannerName {
    /// Frenet optimal trajectories.
    pub const FOT: Self = Self::new(Fot::NAME);

    /// Planner of the paper with this name.
    pub(crate) fn original(&self) -> Original {
        match self.as_str() {
            Fot::NAME => Original::Fot,
            RrtStar::NAME => Original::RrtStar,
            HybridAstar::NAME => Original::HybridAstar,
            _ => Original::Other,
        }
    }

    /// True if the paper has a planner of this name.
    pub(crate) fn is_paper(&self) -> bool {
        self.original() != Original::Other
    }
}

/// Start state of a plan.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StartState {
    /// The pose measured at the stamp.
    Measured,
    /// The pose predicted over the expected run time.
    Predicted,
}

/// Run time by planner and discretisation.
pub(crate) type Cost = BTreeMap<PlannerName, BTreeMap<Fineness, Runtime>>;

/// Built-in cost, parsed once since every default configuration has it.
static BUILT_IN_COST: LazyLock<Cost> = LazyLock::new(|| swerve_text::built_in(include_str!("cost.toml")));

/// Built-in cost with the given entries in place of its own.
fn over_built_in<'de, D: Deserializer<'de>>(given: D) -> Result<Cost, D::Error> {
    let given = Cost::deserialize(given)?;
    let mut cost = BUILT_IN_COST.clone();
    for (planner, by_fineness) in given {
        cost.entry(planner).or_default().extend(by_fineness);
    }
    Ok(cost)
}

/// The motion planner.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct PlanningConfig {
    /// Motion planner.
    pub planner: PlannerName,
    /// Discretisation of the planner.
    pub discretisation: Fineness,
    /// Behaviour of the paper (`paper`) or ours (`best`); sets the defaults of the keys below.
    pub preset: Preset,
    /// Version of Pylot whose rules the preset `paper` follows: `pylot_2020_05` (when absent) or `pylot_2020_11`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub era: Option<Era>,
    /// Rules that differ from the era's (`swerve_pylot::Rules` lists them with their sources).
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "Rules")]
    pub rules: toml::Table,
    /// Interpretation of predictions in collision checks: `time_indexed`, `may_stop` (pedestrians may be anywhere on
    /// their predicted way: slows or stops while that suffices, else passes them at their predicted positions), `risk`
    /// (as `may_stop`, but ignores the least likely modes of a predictor, up to `risk_max`), or the original's
    /// `swept_static`; when absent `risk`, under the preset `paper` the original's.
    pub collision: Option<CollisionMode>,
    /// With `collision = "risk"`: largest probability that a plan touches any road user, according to the predictions.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub risk_max: f64,
    /// Standard deviations of the localized position at which the ego slows, metres: below its target speed from the
    /// first, at 0.3 of it from the second. When absent 0.4 and 1.0, at which two deviations and one fit beside the car
    /// in its lane; under the preset `paper` it never slows.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(inner(range(min = 0.0, max = 1e6)))]
    pub slow_by_sigma_m: Option<[f64; 2]>,
    /// Margin that plans keep from the edges of the road, in standard deviations of the lateral position. Limits the
    /// speed so that a stop by dead reckoning ends in the lane with this margin to the nearer edge; where the margin
    /// does not fit, the car stops, and goes on when 1.1 times the margin fits. 1.5 times as much while localization is
    /// `noisy`. 0 keeps none and never stops. When absent 2.33, which 1 % of a normal distribution exceeds; under the
    /// preset `paper` 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub lane_sigmas: Option<f64>,
    /// Start state of a plan; the preset's when absent.
    pub start: Option<StartState>,
    /// Expected time from a sensor frame to its plan, ms, for the predicted start; the planner's typical cost when
    /// absent.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub expected_ms: Option<f64>,
    /// Parameters of the planner that differ from the defaults of preset and discretisation.
    #[schemars(with = "crate::config::AnyTable")]
    pub params: toml::Table,
    /// Ladder of discretisations (`fot@d3`): the planner takes the finest that fits the time left until its deadline,
    /// with its run time.
    pub ladder: Option<String>,
    /// Run time of the highest rung that may be taken, ms; the finest of all when absent.
    pub rung_ms: Option<f64>,
    /// Run time by planner and discretisation; `[operator.planner] runtime` overrides it. An entry replaces the built-in
    /// one of its planner and discretisation and keeps the others. Default: `cost.toml`, measured by `swerve calibrate`
    /// for the `best` presets.
    #[serde(deserialize_with = "over_built_in")]
    pub cost: Cost,
    /// Latency added to every plan, ms.
    #[schemars(range(min = 0.0, max = 100_000.0))]
    pub added_latency_ms: f64,
    /// Comfortable layer above the planner: its plan is driven while one is collision-free.
    #[ranges(nested)]
    pub comfort: ComfortConfig,
    /// Hidden places: people who may step out from behind standing vehicles, and oncoming cars beyond sight.
    #[ranges(nested)]
    pub occlusion: OcclusionConfig,
}

/// Rule of the comfortable layer for places that the ego cannot see.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct OcclusionConfig {
    /// The comfortable layer slows beside standing vehicles so that it can answer a person who steps out from behind
    /// them, and overtakes moving vehicles only as far as it sees along the other lane.
    pub enabled: bool,
    /// Speed of a person who steps out, m/s.
    #[schemars(range(min = 0.1, max = 10.0))]
    pub phantom_speed_mps: f64,
    /// Time from the first sight of the person until the car brakes, seconds; when absent the expected time from a
    /// sensor frame to its plan, and 0.25 s for the next frame and the brake.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0, max = 10.0))]
    pub reaction_s: Option<f64>,
    /// Deceleration for the person, m/s².
    #[schemars(range(min = 0.5, max = 20.0))]
    pub brake_mps2: f64,
    /// Lowest speed to which the car slows for hidden places, m/s; the default is the speed beside people in the lane.
    #[schemars(range(min = 0.5, max = 100.0))]
    pub least_speed_mps: f64,
    /// Range of sight along the other lane, metres; the default is the range of perfect perception.
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub sight_m: f64,
}

impl Default for OcclusionConfig {
    fn default() -> Self {
        Self {
            enabled: false,
            phantom_speed_mps: 2.0,
            reaction_s: None,
            brake_mps2: 7.0,
            least_speed_mps: 5.5,
            sight_m: 100.0,
        }
    }
}

/// Time from sight of a person to braking besides the expected time from a sensor frame to its plan, seconds: the next
/// frame, and the build-up of the deceleration.
const REACTS_S: f64 = 0.25;

/// The comfortable layer above a planner, and its limits.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct ComfortConfig {
    /// Enables the comfortable layer; when absent with the preset `best`, except above `aeb`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub enabled: Option<bool>,
    /// Limits of comfort.
    #[serde(flatten)]
    #[ranges(flatten)]
    pub limits: comfort::Params,
}

impl Default for PlanningConfig {
    fn default() -> Self {
        Self {
            planner: PlannerName::FOT,
            discretisation: Fineness::Fast,
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
            occlusion: OcclusionConfig::default(),
        }
    }
}

impl PlanningConfig {
    /// Rules of the paper's preset for the chosen planner, or their problems, each by its key in `planning`.
    pub fn rules(&self) -> Result<Rules, Vec<KeyProblem>> {
        let rules: Rules =
            overridden(&self.rules_of_era(), &self.rules).map_err(|found| within("rules", found))?;
        if self.preset != Preset::Paper {
            let only = "only the preset `paper` has one";
            let era = self.era.map(|_| ("era".to_owned(), only.to_owned()));
            let rule = self.rules.keys().next().map(|rule| (format!("rules.{rule}"), only.to_owned()));
            let wrong: Vec<_> = era.into_iter().chain(rule).collect();
            return if wrong.is_empty() { Ok(rules) } else { Err(wrong) };
        }
        let ours = matches!(self.collision(), CollisionMode::MayStop | CollisionMode::Risk);
        if ours && self.planner.is_paper() {
            let message = "the paper's planners know `swept_static` and `time_indexed`".to_owned();
            return Err(vec![("collision".into(), message)]);
        }
        rules.validate(self.planner.original()).map_err(|error| within("rules", outside(error)))?;
        Ok(rules)
    }

    /// Rules of the era, without the configuration's changes.
    pub(crate) fn rules_of_era(&self) -> Rules {
        Rules::of(self.era.unwrap_or_default(), self.planner.original())
    }

    /// Run time of the chosen planner and discretisation.
    pub fn cost_of_chosen(&self) -> Option<&Runtime> {
        self.cost.get(&self.planner)?.get(&self.discretisation)
    }

    /// Interpretation of predictions in collision checks.
    pub fn collision(&self) -> CollisionMode {
        self.collision.unwrap_or(match self.preset {
            Preset::Paper => CollisionMode::SweptStatic,
            Preset::Best => CollisionMode::Risk,
        })
    }

    /// Standard deviations of the localized position at which the ego slows, metres.
    pub fn slow_by_sigma_m(&self) -> [f64; 2] {
        self.slow_by_sigma_m.unwrap_or(match self.preset {
            Preset::Paper => [f64::MAX; 2],
            Preset::Best => [0.4, 1.0],
        })
    }

    /// Margin to the edges of the road, in standard deviations of the lateral position.
    pub fn lane_sigmas(&self) -> f64 {
        self.lane_sigmas.unwrap_or(match self.preset {
            Preset::Paper => 0.0,
            Preset::Best => 2.33,
        })
    }

    /// Start state of a plan.
    pub fn start_state(&self) -> StartState {
        self.start.unwrap_or(match self.preset {
            Preset::Paper => StartState::Measured,
            Preset::Best => StartState::Predicted,
        })
    }

    /// Rule for hidden places, if it is enabled.
    pub fn occlusion(&self) -> Option<occlusion::Params> {
        let OcclusionConfig { enabled, phantom_speed_mps, reaction_s, brake_mps2, least_speed_mps, sight_m } =
            self.occlusion;
        let reaction_s = reaction_s.unwrap_or_else(|| 1e-3 * self.expected_ms() + REACTS_S);
        enabled.then_some(occlusion::Params {
            phantom_speed_mps,
            reaction_s,
            brake_mps2,
            least_speed_mps,
            sight_m,
        })
    }

    /// Expected time from a sensor frame to its plan's first effect, ms.
    pub fn expected_ms(&self) -> f64 {
        self.expected_ms
            .unwrap_or_else(|| self.cost_of_chosen().map_or(0.0, Runtime::typical_ms) + self.added_latency_ms)
    }
}
