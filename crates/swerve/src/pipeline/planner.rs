use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::Span;
use swerve_flow::{At, Context, Operator, Port, Progress, Window};
use swerve_msg::{EgoState, Plan, PredictionList, Route};
use swerve_planning::aeb::{self, Aeb};
use swerve_planning::fot::{self, Fot};
use swerve_planning::hybrid_astar::{self, HybridAstar};
use swerve_planning::rrt_star::{self, RrtStar};
use swerve_planning::waypoint::{self, Waypoint};
use swerve_planning::world::predicted_start;
use swerve_planning::{Budget, Goes, Planner, Request};
use swerve_scenario::Scenario;
use swerve_vehicle::{Limits, Shape};

use crate::config::text::with_nearest_name;
use crate::config::{Config, Fineness, PlannerName, StartState};

/// Past poses kept to find the one measured at a frame's stamp: as old as frames get, at 100 Hz.
const POSES: usize = 64;

/// Asks a motion planner for a plan, frame by frame.
pub(super) struct PlannerOperator {
    planner: Box<dyn Planner>,
    route: Route,
    target_speed_mps: f64,
    shape: Shape,
    limits: Limits,
    /// Moved on by this where the start is predicted.
    expected: Option<Span>,
    previous: Option<Arc<Plan>>,
}

impl PlannerOperator {
    pub(super) fn new(config: &Config, scenario: &Scenario, route: &Route) -> anyhow::Result<Self> {
        let vehicle = &config.sim.vehicle;
        let expected = match config.planning.start_state() {
            StartState::Measured => None,
            StartState::Predicted => Some(Span::from_secs(config.planning.expected_ms() * 1e-3)),
        };
        Ok(Self {
            planner: planner(config).map_err(|message| anyhow::anyhow!("planning.params: {message}"))?,
            route: route.clone(),
            target_speed_mps: scenario.ego.target_speed_mps,
            shape: vehicle.shape,
            limits: vehicle.limits,
            expected,
            previous: None,
        })
    }
}

/// The planner that a configuration names, with its parameters.
pub fn planner(config: &Config) -> Result<Box<dyn Planner>, String> {
    let planning = &config.planning;
    let (preset, fineness) = (planning.preset, planning.config);
    Ok(match planning.planner {
        PlannerName::Fot => {
            let defaults = match fineness {
                Fineness::Fast => fot::Params::fast(preset),
                Fineness::Slow => fot::Params::slow(preset),
            };
            let defaults = fot::Params { collision: planning.collision, ..defaults };
            Box::new(Fot::new(overridden(&defaults, &planning.params)?).map_err(|e| e.to_string())?)
        }
        PlannerName::HybridAstar => {
            let defaults = match fineness {
                Fineness::Fast => hybrid_astar::Params::fast(preset),
                Fineness::Slow => hybrid_astar::Params::slow(preset),
            };
            let defaults = hybrid_astar::Params { collision: planning.collision, ..defaults };
            Box::new(HybridAstar::new(overridden(&defaults, &planning.params)?).map_err(|e| e.to_string())?)
        }
        PlannerName::RrtStar => {
            let defaults = match fineness {
                Fineness::Fast => rrt_star::Params::fast(preset),
                Fineness::Slow => rrt_star::Params::slow(preset),
            };
            let defaults = rrt_star::Params { collision: planning.collision, ..defaults };
            Box::new(RrtStar::new(overridden(&defaults, &planning.params)?).map_err(|e| e.to_string())?)
        }
        PlannerName::Waypoint => {
            let params = overridden(&waypoint::Params::default(), &planning.params)?;
            Box::new(Waypoint::new(params).map_err(|e| e.to_string())?)
        }
        PlannerName::Aeb => {
            let defaults = aeb::Params { collision: planning.collision, ..aeb::Params::default() };
            Box::new(Aeb::new(overridden(&defaults, &planning.params)?).map_err(|e| e.to_string())?)
        }
    })
}

/// A planner's parameters with what the configuration says otherwise.
fn overridden<T: Serialize + DeserializeOwned>(defaults: &T, changes: &toml::Table) -> Result<T, String> {
    let mut table = toml::Table::try_from(defaults).map_err(|error| error.to_string())?;
    table.extend(changes.clone());
    table.try_into().map_err(|error| with_nearest_name(error.message()))
}

impl Operator for PlannerOperator {
    type In = (At<PredictionList>, Window<EgoState, POSES>);
    type Out = Port<Plan>;

    fn step(&mut self, cx: &mut Context<'_>, (predictions, poses): &Self::In, out: &mut Self::Out) {
        let (Some(predictions), poses) = (predictions.get(), poses.get()) else { return };
        // Measured at the frame's stamp: what came later is not what the predictions go with.
        let at_stamp = poses.iter().rev().find(|p| p.header().stamp <= cx.stamp());
        let Some(measured) = at_stamp.or(poses.first()) else { return };
        let start = match self.expected {
            None => **measured,
            Some(expected) => predicted_start(measured, self.previous.as_deref(), expected),
        };
        let request = Request {
            stamp: predictions.stamp,
            start,
            route: &self.route,
            target_speed_mps: self.target_speed_mps,
            predictions: &predictions.predictions,
            shape: &self.shape,
            limits: &self.limits,
            previous: self.previous.as_deref(),
            seed: cx.rng().bits(),
        };
        let plan = Arc::new(self.planner.plan(&request, &mut Metered(cx)));
        self.previous = Some(plan.clone());
        out.forward(plan);
    }
}

/// The engine's meter, as a planner knows it.
struct Metered<'a, 'b>(&'a mut Context<'b>);

impl Budget for Metered<'_, '_> {
    fn spend(&mut self, units: u64) -> Goes {
        match self.0.spend(units) {
            Progress::Continue => Goes::On,
            Progress::Stop => Goes::Stop,
        }
    }
}
