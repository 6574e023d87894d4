use swerve_control::{Controller, Following, Input, Law, Params, Pedals};
use swerve_core::{Span, Time};
use swerve_flow::{Context, Every, Latest, Operator, Port};
use swerve_msg::{Command, EgoState, Plan, Route, Supervision};
use swerve_planning::posed::Preset;
use swerve_vehicle::{VehicleParams, pedals_for_accel};

use crate::config::{Config, ControllerName};

/// Follows the newest plan; the route before there is one. Stops where a process is lost.
pub(super) struct ControllerOperator {
    controller: Controller,
    route: Route,
    /// Where the ego comes to a stop, while it has to.
    stop_along: Option<Plan>,
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
        Self { controller: controller(&config.sim.vehicle, params), route: route.clone(), stop_along: None }
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
    type In = (Every, Latest<EgoState>, Latest<Plan>, Vec<Latest<Supervision>>);
    type Out = Port<Command>;

    fn step(&mut self, cx: &mut Context<'_>, (_, ego, plan, processes): &Self::In, out: &mut Self::Out) {
        // What no car can do is no measurement and no plan: better none.
        let Some(ego) = ego.get().filter(|ego| ego.is_plausible()) else { return };
        let plan = plan.get().map(|plan| &**plan).filter(|plan| plan.is_plausible());
        let gone = |processes: &Latest<Supervision>| processes.get().is_some_and(|all| !all.gone.is_empty());
        if processes.iter().any(gone) {
            // Plans that still come are not looked at: what they are made from may be out of date.
            self.stop_along.get_or_insert_with(|| over(plan, cx.now()));
        } else {
            self.stop_along = None;
        }
        let plan = self.stop_along.as_ref().or(plan);
        let input = Input { now: cx.now(), ego, plan, route: &self.route };
        out.loan().send(self.controller.step(&input).command);
    }
}

/// The same path as a plan whose time is over: what the controller makes a comfortable stop along.
fn over(plan: Option<&Plan>, now: Time) -> Plan {
    let mut plan = plan.cloned().unwrap_or_default();
    let since = plan.end() - now + Span::from_ns(1);
    plan.points.iter_mut().for_each(|point| point.at = point.at - since);
    plan
}
