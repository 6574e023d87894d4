//! An agent outside in the place of a part of the stack: what it decides goes into the graph by an operator under the
//! name of the one whose place it takes, with what the configuration says of that one's run time, delay and faults.

use std::sync::{Arc, Mutex, PoisonError};

use swerve_core::Span;
use swerve_flow::{Context, Every, Graph, Latest, Operator, Port, Stream, every};
use swerve_geom::{FrenetPoint, Pose2, math};
use swerve_msg::{Command, EgoState, Plan, PlanPoint, PlanStatus, Route};
use swerve_vehicle::Limits;

use super::faulty::faulty;
use super::ms;
use crate::config::Config;

/// What an agent decides, and in whose place.
#[derive(Clone)]
pub enum Agent {
    /// Pedals and steering, for the controller, once a control period.
    Command(Seat<Command>),
    /// A plan, for the planner, once a frame of the obstacle sensor.
    Plan(Seat<Plan>),
    /// How fast to go and how far beside the route, from which a plan is made; for the planner.
    Target(Seat<Target>),
}

/// How fast to go, and where beside the route.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Target {
    /// Wanted speed, m/s.
    pub speed_mps: f64,
    /// Wanted distance to the left of the route's centre line, metres.
    pub offset_m: f64,
}

/// Where the agent's newest decision lies for its operator, which repeats it until there is another.
pub struct Seat<T>(Arc<Mutex<Option<T>>>);

impl<T> Clone for Seat<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> Default for Seat<T> {
    fn default() -> Self {
        Self(Arc::default())
    }
}

impl<T: Clone> Seat<T> {
    /// Decides.
    pub fn set(&self, decision: T) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(decision);
    }

    fn get(&self) -> Option<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Agent {
    /// The operator whose place it takes.
    pub fn operator(&self) -> &'static str {
        match self {
            Self::Command(_) => "controller",
            Self::Plan(_) | Self::Target(_) => "planner",
        }
    }

    /// From one decision to the next.
    pub fn period(&self, config: &Config) -> Span {
        ms(match self {
            Self::Command(_) => config.control.period_ms,
            Self::Plan(_) | Self::Target(_) => config.sensing.period_ms,
        })
    }
}

/// Publishes what the agent decided last.
struct Decided<T>(Seat<T>);

impl<T: swerve_flow::Payload + Clone> Operator for Decided<T> {
    type In = Every;
    type Out = Port<T>;

    fn step(&mut self, _: &mut Context<'_>, _: &Every, out: &mut Port<T>) {
        if let Some(decision) = self.0.get() {
            out.send(decision);
        }
    }
}

/// What an agent at the wheel gives: the command stream, in the controller's place.
pub(super) fn commands(
    graph: &mut Graph,
    config: &Config,
    seat: &Seat<Command>,
    agent: &Agent,
) -> anyhow::Result<Stream<Command>> {
    anyhow::ensure!(
        !config.gate.enabled,
        "gate.enabled: the gate takes motion, an agent in the place of the controller gives pedals; \
         expected false, or an agent in the place of the planner"
    );
    let ticks = every(agent.period(config));
    let commands = graph.add("controller", Decided(seat.clone()), ticks).out();
    faulty(graph, config, "controller", commands)
}

/// What an agent that plans gives: the stream of plans, in the planner's place.
pub(super) fn plans(
    graph: &mut Graph,
    config: &Config,
    agent: &Agent,
    route: &Route,
    pose: Stream<EgoState>,
) -> anyhow::Result<Option<Stream<Plan>>> {
    let ticks = every(agent.period(config));
    let plan = match agent {
        Agent::Command(_) => return Ok(None),
        Agent::Plan(seat) => graph.add("planner", Decided(seat.clone()), ticks).out(),
        Agent::Target(seat) => {
            let limits = config.sim.vehicle.limits;
            let follower = TargetPlanner { seat: seat.clone(), route: route.clone(), limits };
            graph.add("planner", follower, (ticks, pose)).out()
        }
    };
    faulty(graph, config, "planner", plan).map(Some)
}

/// Makes a plan of a target: along the route, over to the offset, up or down to the speed.
struct TargetPlanner {
    seat: Seat<Target>,
    route: Route,
    limits: Limits,
}

impl TargetPlanner {
    /// How far a plan reaches, and from point to point.
    const HORIZON: Span = Span::from_ms(3000);
    const STEP: Span = Span::from_ms(100);
    /// A change of offset lasts so long, s.
    const SWERVE_S: f64 = 1.5;
    /// Share of what the car can do that a change of speed asks for.
    const EASE: f64 = 0.6;

    fn plan(&self, ego: &EgoState, target: Target) -> Plan {
        let line = &self.route.line;
        let start = line.project(ego.pose.point());
        let accel = if target.speed_mps >= ego.speed_mps {
            Self::EASE * self.limits.accel_max_mps2
        } else {
            -Self::EASE * self.limits.brake_max_mps2
        };
        let step_s = Self::STEP.as_secs();
        let (mut speed, mut s_m) = (ego.speed_mps.max(0.0), start.s_m);
        let mut points: Vec<PlanPoint> = Vec::new();
        for i in 0..=Self::HORIZON.ns() / Self::STEP.ns() {
            let t = i as f64 * step_s;
            let d_m = start.d_m + (target.offset_m - start.d_m) * blend(t / Self::SWERVE_S);
            let point = line.to_map(FrenetPoint { s_m, d_m });
            let along = line.at(s_m);
            let next = clamp_towards(speed, accel * step_s, target.speed_mps.max(0.0));
            points.push(PlanPoint {
                at: ego.stamp + Self::STEP * i,
                pose: Pose2::new(point.x_m, point.y_m, along.pose.heading_rad),
                curvature_1pm: along.curvature_1pm,
                speed_mps: speed,
                accel_mps2: (next - speed) / step_s,
            });
            s_m += 0.5 * (speed + next) * step_s;
            speed = next;
        }
        turn_along(&mut points);
        Plan { stamp: ego.stamp, status: PlanStatus::Found, points, work: 0 }
    }
}

/// From 0 to 1 and at rest at both ends.
fn blend(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (10.0 - t * (15.0 - 6.0 * t))
}

fn clamp_towards(from: f64, change: f64, to: f64) -> f64 {
    if change >= 0.0 { (from + change).min(to) } else { (from + change).max(to) }
}

/// Headings and curvatures of the path itself, where the points are far enough from each other to tell.
fn turn_along(points: &mut [PlanPoint]) {
    const TELLS_M: f64 = 0.05;
    for i in 1..points.len() {
        let between = points[i].pose.point() - points[i - 1].pose.point();
        let length = between.norm();
        if length < TELLS_M {
            points[i].pose.heading_rad = points[i - 1].pose.heading_rad;
            continue;
        }
        points[i].pose.heading_rad = math::atan2(between.y, between.x);
        let turn = swerve_geom::angle_between(points[i - 1].pose.heading_rad, points[i].pose.heading_rad);
        points[i].curvature_1pm = turn / length;
    }
}

impl Operator for TargetPlanner {
    type In = (Every, Latest<EgoState>);
    type Out = Port<Plan>;

    fn step(&mut self, _: &mut Context<'_>, (_, ego): &Self::In, out: &mut Port<Plan>) {
        let Some(ego) = ego.get().filter(|ego| ego.is_plausible()) else { return };
        if let Some(target) = self.seat.get() {
            out.send(self.plan(ego, target));
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::Time;
    use swerve_flow::{Reached, RunOptions, Session};
    use swerve_msg::truth::WorldState;

    use super::*;
    use crate::pipeline::Pipeline;
    use crate::run::read_scenario;

    fn lane() -> (Config, swerve_scenario::Scenario) {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/lane.toml");
        (Config::default(), read_scenario(file.as_ref()).unwrap())
    }

    /// Drives for so long; gives the true states and how often the agent was asked.
    fn driven(agent: &Agent, until: Time) -> (Vec<EgoState>, usize) {
        let (config, scenario) = lane();
        let pipeline = Pipeline::build_for(&config, &scenario, Some(agent)).unwrap();
        let options = RunOptions::until(until).seed(config.seed);
        let mut session = Session::new(pipeline.graph, &options, vec![]).unwrap();
        session.hold_before(agent.operator()).unwrap();
        let world = session.watch("world", 1).unwrap();
        let mut states = Vec::new();
        while session.advance() == Reached::Held {
            let (_, payload) = session.newest(world).unwrap();
            states.push((**payload).as_any().downcast_ref::<WorldState>().unwrap().ego.state);
        }
        let asked = states.len();
        session.finish().unwrap();
        (states, asked)
    }

    #[test]
    fn a_target_is_driven_at_and_beside_the_route() {
        let seat = Seat::default();
        seat.set(Target { speed_mps: 6.0, offset_m: 0.8 });
        let (states, asked) = driven(&Agent::Target(seat), Time::from_ms(6000));
        let (_, scenario) = lane();
        let last = states.last().unwrap();
        let place = scenario.road.route().line.project(last.pose.point());
        assert_eq!(asked, 121, "once a frame of the obstacle sensor");
        assert!((last.speed_mps - 6.0).abs() < 0.5, "{last:?}");
        assert!((place.d_m - 0.8).abs() < 0.2, "{place:?}");
    }

    #[test]
    fn an_agent_at_the_wheel_is_asked_once_a_period_and_its_command_is_driven() {
        let seat = Seat::default();
        seat.set(Command::FULL_BRAKE);
        let (states, asked) = driven(&Agent::Command(seat), Time::from_ms(1000));
        assert_eq!(asked, 101);
        assert!(states[100].speed_mps < states[0].speed_mps - 3.0, "{:?}", states[100]);
    }
}
