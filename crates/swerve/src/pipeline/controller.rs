use swerve_control::{Controller, Following, Input, Law, Params};
use swerve_flow::{Context, Every, Latest, Operator, Port};
use swerve_msg::{Command, EgoState, Plan, Route};
use swerve_planning::posed::Preset;
use swerve_vehicle::pedals_for_accel;

use crate::config::{Config, ControllerName};

/// Follows the newest plan; the route before there is one.
pub(super) struct ControllerOperator {
    controller: Controller,
    route: Route,
}

impl ControllerOperator {
    pub(super) fn new(config: &Config, route: &Route) -> Self {
        let vehicle = config.sim.vehicle.clone();
        let preset = match config.planning.preset {
            Preset::Paper => Following::Projection,
            Preset::Best => Following::Time,
        };
        let law = match config.control.controller {
            ControllerName::Pid => Law::Pid,
            ControllerName::PurePursuit => Law::PurePursuit,
            ControllerName::Stanley => Law::Stanley,
        };
        let params =
            Params { law, following: config.control.following.unwrap_or(preset), ..Params::default() };
        let (shape, limits) = (vehicle.shape, vehicle.limits);
        let pedals = move |accel_mps2: f64, speed_mps: f64| {
            let pedals = pedals_for_accel(&vehicle, speed_mps, accel_mps2);
            swerve_control::Pedals { throttle: pedals.throttle, brake: pedals.brake }
        };
        Self { controller: Controller::new(params, shape, limits, Box::new(pedals)), route: route.clone() }
    }
}

impl Operator for ControllerOperator {
    type In = (Every, Latest<EgoState>, Latest<Plan>);
    type Out = Port<Command>;

    fn step(&mut self, cx: &mut Context<'_>, (_, ego, plan): &Self::In, out: &mut Self::Out) {
        let Some(ego) = ego.get() else { return };
        let input = Input { now: cx.now(), ego, plan: plan.get().map(|p| &**p), route: &self.route };
        out.loan().send(self.controller.step(&input).command);
    }
}
