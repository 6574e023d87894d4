use swerve_control::{Controller, Following, Input, Law, Params, Pedals};
use swerve_flow::{Context, Every, Latest, Operator, Port};
use swerve_msg::{Command, EgoState, Plan, Route};
use swerve_planning::posed::Preset;
use swerve_vehicle::{VehicleParams, pedals_for_accel};

use crate::config::{Config, ControllerName};

/// Follows the newest plan; the route before there is one.
pub(super) struct ControllerOperator {
    controller: Controller,
    route: Route,
}

impl ControllerOperator {
    pub(super) fn new(config: &Config, route: &Route) -> Self {
        let preset = match config.planning.preset {
            Preset::Paper => Following::Projection,
            Preset::Best => Following::Time,
        };
        let law = match config.control.controller {
            ControllerName::Pid => Law::Pid,
            ControllerName::PurePursuit => Law::PurePursuit,
            ControllerName::Stanley => Law::Stanley,
            ControllerName::Mpc => Law::Mpc,
        };
        let params =
            Params { law, following: config.control.following.unwrap_or(preset), ..Params::default() };
        Self { controller: controller(&config.sim.vehicle, params), route: route.clone() }
    }
}

/// A controller that knows the pedals of `vehicle`.
pub fn controller(vehicle: &VehicleParams, params: Params) -> Controller {
    let of = vehicle.clone();
    let pedals = move |accel_mps2: f64, speed_mps: f64| {
        let pedals = pedals_for_accel(&of, speed_mps, accel_mps2);
        Pedals { throttle: pedals.throttle, brake: pedals.brake }
    };
    Controller::new(params, vehicle.shape, vehicle.limits, Box::new(pedals))
}

impl Operator for ControllerOperator {
    type In = (Every, Latest<EgoState>, Latest<Plan>);
    type Out = Port<Command>;

    fn step(&mut self, cx: &mut Context<'_>, (_, ego, plan): &Self::In, out: &mut Self::Out) {
        // What no car can do is no measurement and no plan: better none.
        let Some(ego) = ego.get().filter(|ego| ego.is_plausible()) else { return };
        let plan = plan.get().map(|p| &**p).filter(|plan| plan.is_plausible());
        let input = Input { now: cx.now(), ego, plan, route: &self.route };
        out.loan().send(self.controller.step(&input).command);
    }
}
