use std::borrow::Cow;
use std::sync::Arc;

use swerve_core::Span;
use swerve_flow::{At, Context, Operator, Port, Progress, Window};
use swerve_msg::{EgoState, Plan, Prediction, PredictionList, Route};
use swerve_planning::world::predicted_start;
use swerve_planning::{Budget, Goes, Planner, Request};
use swerve_scenario::Scenario;
use swerve_vehicle::{Limits, Shape};

use crate::config::{Config, StartState};

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
            StartState::Predicted => Some(Span::from_secs(config.expected_ms() * 1e-3)),
        };
        Ok(Self {
            planner: config
                .planning
                .planner()
                .map_err(|message| anyhow::anyhow!("planning.params: {message}"))?,
            route: route.clone(),
            target_speed_mps: scenario.ego.target_speed_mps,
            shape: vehicle.shape,
            limits: vehicle.limits,
            expected,
            previous: None,
        })
    }
}

impl Operator for PlannerOperator {
    type In = (At<PredictionList>, Window<EgoState, POSES>);
    type Out = Port<Plan>;

    fn step(&mut self, cx: &mut Context<'_>, (predictions, poses): &Self::In, out: &mut Self::Out) {
        let (Some(predictions), poses) = (predictions.get(), poses.get()) else { return };
        // Measured at the frame's stamp: what came later is not what the predictions go with.
        let mut poses = poses.iter().filter(|p| p.is_plausible());
        let Some(first) = poses.next() else { return };
        let at_stamp = poses.rev().find(|p| p.header().stamp <= cx.stamp());
        let measured = at_stamp.unwrap_or(first);
        let start = match self.expected {
            None => **measured,
            Some(expected) => predicted_start(measured, self.previous.as_deref(), expected),
        };
        let stamp = predictions.stamp;
        let predictions = match predictions.predictions.iter().all(Prediction::is_plausible) {
            true => Cow::Borrowed(&predictions.predictions),
            false => {
                let plausible = predictions.predictions.iter().filter(|p| p.is_plausible());
                Cow::Owned(plausible.cloned().collect())
            }
        };
        let request = Request {
            stamp,
            start,
            route: &self.route,
            target_speed_mps: self.target_speed_mps,
            predictions: &predictions,
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
