//! Limit of the vehicle itself: the largest reaction time after first sight at which some manoeuvre still avoids a
//! collision.
//!
//! The ego drives on as if the road were free. A clock starts when its sensor first sees the actor that it would hit.
//! At the reaction time it starts one manoeuvre of a family (a lateral shift of some width in some time, with some
//! braking), tracked by a controller with feed-forward on the same vehicle and simulator as in all other drives. The
//! family is finite, so the result is a lower bound of the vehicle's ability.

use std::sync::atomic::{AtomicBool, Ordering};

use swerve_control::{Controller as _, Following, Input, Law, LawController, Params};
use swerve_core::{Span, Time};
use swerve_drive::Stopped;
use swerve_geom::FrenetPoint;
use swerve_msg::truth::EndReason;
use swerve_msg::{ActorId, EgoState, Plan, PlanPoint, PlanStatus, Route};
use swerve_planning::path::points::with_curvature;
use swerve_scenario::{Scenario, Trigger};
use swerve_sim::sense::{SensorMount, SensorParams, visible_obstacles};
use swerve_sim::{SimParams, Simulator};
use swerve_stack::Setup;
use swerve_stack::config::Config;
use swerve_stack::pipeline::{controller, drawn};

use super::grid::{Budget, Cell};
use super::result::CellResult;

/// Run-up before first sight, seconds; it is never before the start of the run.
const RUN_UP_S: f64 = 2.0;
/// Spacing of lateral targets, m.
const SHIFT_STEP_M: f64 = 0.25;
/// Maximum lateral shift, m.
const SHIFT_MAX_M: f64 = 2.5;
/// Durations of the lateral shift, seconds.
const SHIFT_S: [f64; 5] = [0.5, 0.7, 0.9, 1.2, 1.6];
/// Decelerations, m/s².
const BRAKE_MPS2: [f64; 3] = [0.0, 4.0, 9.0];

/// Manoeuvre of the family.
#[derive(Clone, Copy, Debug)]
struct Manoeuvre {
    shift_m: f64,
    shift_s: f64,
    brake_mps2: f64,
}

/// Scans reaction times in steps, then bisects the edge between the last one that succeeds and the first that does not.
/// Ends with [`Stopped`] once `stop` is set.
pub(super) fn largest_reaction(
    cell: &Cell,
    (config, scenario): (&Setup, &Scenario),
    budget: &Budget,
    stop: &AtomicBool,
) -> anyhow::Result<CellResult> {
    let mut result = CellResult::blank(cell, "collision");
    let scenario = drawn(config, scenario);
    let Some(case) = Case::find(config, scenario)? else {
        // Driving on hits nothing, so no reaction is needed.
        result.verdict = "avoided".into();
        result.budget_ms = Some(budget.max_ms);
        return Ok(result);
    };
    let mut family = case.family();
    let edge = super::budget::edge(budget, |reaction_ms| {
        let reaction = Span::from_secs(reaction_ms * 1e-3);
        for i in 0..family.len() {
            if stop.load(Ordering::Relaxed) {
                return Err(Stopped.into());
            }
            if case.clears(reaction, family[i])? {
                // A successful manoeuvre is tried first at the next reaction time.
                family[..=i].rotate_right(1);
                return Ok(true);
            }
        }
        Ok(false)
    })?;
    if edge.is_some() {
        result.verdict = "avoided".into();
    }
    result.budget_ms = edge;
    Ok(result)
}

/// Scenario in which driving on hits an actor that is seen before.
struct Case<'a> {
    config: &'a Config,
    scenario: Scenario,
    params: SimParams,
    sight: Time,
}

impl<'a> Case<'a> {
    /// Finds the actor that driving on hits and the time of its first sight; starts the run shortly before that.
    fn find(config: &'a Config, scenario: Scenario) -> anyhow::Result<Option<Self>> {
        let dt = Span::from_secs(config.sim.dt_ms * 1e-3);
        let params = SimParams { dt, vehicle: config.sim.vehicle.clone() };
        let mut case = Self { config, scenario, params, sight: Time::MAX };
        let Some(first) = case.first_sight()? else { return Ok(None) };
        let timed = |t: &Trigger| matches!(t, Trigger::Time { .. });
        let late_s = first.as_secs() - RUN_UP_S;
        if late_s > 0.0 && !case.scenario.actors.iter().any(|a| a.trigger.as_ref().is_some_and(timed)) {
            // Nothing happens before: the run-up is shortened once, rather than driven for every manoeuvre.
            case.scenario.ego.s_m += case.scenario.ego.start_speed() * late_s;
        }
        let Some(sight) = case.first_sight()? else { return Ok(None) };
        case.sight = sight;
        Ok(Some(case))
    }

    fn first_sight(&self) -> anyhow::Result<Option<Time>> {
        let mount = SensorMount::roof(&self.params.vehicle.shape);
        let sensor = SensorParams { range_m: self.config.sensing.range_m, ..SensorParams::default() };
        let mut seen: Vec<(ActorId, Time)> = Vec::new();
        let mut drive = Drive::new(self)?;
        loop {
            let world = drive.simulator.state();
            if let Some((hit, _)) = world.collisions_of_ego().next() {
                return Ok(seen.iter().find(|(id, _)| *id == hit).map(|(_, at)| *at));
            }
            if world.ended.is_some() {
                return Ok(None);
            }
            for obstacle in visible_obstacles(world, &mount, &sensor).obstacles {
                if !seen.iter().any(|(id, _)| *id == obstacle.id) {
                    seen.push((obstacle.id, world.stamp));
                }
            }
            drive.step(None);
        }
    }

    fn family(&self) -> Vec<Manoeuvre> {
        let route = self.scenario.road.route();
        let half = 0.5 * self.params.vehicle.shape.width_m;
        let reach = |border_m: f64| (border_m - half).min(SHIFT_MAX_M);
        let (left, right) = (reach(route.borders().left().max_m()), reach(route.borders().right().max_m()));
        let steps = |reach: f64| (reach / SHIFT_STEP_M).floor().max(0.0) as i32;
        let mut family = Vec::new();
        for brake_mps2 in BRAKE_MPS2 {
            for k in -steps(right)..=steps(left) {
                for shift_s in SHIFT_S {
                    family.push(Manoeuvre { shift_m: f64::from(k) * SHIFT_STEP_M, shift_s, brake_mps2 });
                }
            }
        }
        // Strongest braking first: it gives the shortest run if it suffices.
        family.reverse();
        family
    }

    /// True if the manoeuvre, started `reaction` after first sight, avoids any contact of the ego and stays on the road.
    fn clears(&self, reaction: Span, manoeuvre: Manoeuvre) -> anyhow::Result<bool> {
        let start = self.sight + reaction;
        let mut drive = Drive::new(self)?;
        let mut plan = None;
        loop {
            let world = drive.simulator.state();
            if world.collisions_of_ego().next().is_some() || !world.infractions.is_empty() {
                return Ok(false);
            }
            if world.ended.is_some() {
                return Ok(world.ended != Some(EndReason::Timeout));
            }
            let ego = world.ego.state;
            if plan.is_some() && ego.speed_mps < 0.1 {
                return Ok(true);
            }
            if plan.is_none() && world.stamp >= start {
                plan = Some(manoeuvre.plan(&ego, &drive.route));
            }
            if plan.as_ref().is_some_and(|p: &Plan| world.stamp > p.end()) {
                return Ok(true);
            }
            drive.step(plan.as_ref());
        }
    }
}

/// Simulator and controller, stepped together.
struct Drive {
    simulator: Simulator,
    controller: LawController,
    route: Route,
    dt: Span,
    period: Span,
    next: Time,
    command: swerve_msg::Command,
}

impl Drive {
    fn new(case: &Case<'_>) -> anyhow::Result<Self> {
        let params = Params { law: Law::Stanley, following: Following::Time, ..Params::default() };
        Ok(Self {
            simulator: Simulator::exact(case.scenario.clone(), &case.params)?,
            controller: controller(&case.params.vehicle, params),
            route: case.scenario.road.route(),
            dt: case.params.dt,
            period: Span::from_secs(case.config.control.period_ms * 1e-3),
            next: Time::ZERO,
            command: swerve_msg::Command::default(),
        })
    }

    fn step(&mut self, plan: Option<&Plan>) {
        let world = self.simulator.state();
        if world.stamp >= self.next {
            self.next = world.stamp + self.period.max(self.dt);
            let input = Input { now: world.stamp, ego: &world.ego.state, plan, route: &self.route };
            self.command = self.controller.step(&input).command;
        }
        self.simulator.step(self.command);
    }
}

/// Duration of a manoeuvre, seconds: beyond any conflict visible at first sight.
const HORIZON_S: f64 = 3.0;
const POINT_S: f64 = 0.02;

impl Manoeuvre {
    /// Plan of the manoeuvre from the ego's pose: a quintic lateral shift over time, at constant deceleration.
    fn plan(self, ego: &EgoState, route: &Route) -> Plan {
        let from = route.project(ego.pose.point());
        let speed_at = |t: f64| (ego.speed_mps - self.brake_mps2 * t).max(0.0);
        let until_s =
            if self.brake_mps2 > 0.0 { (ego.speed_mps / self.brake_mps2).min(HORIZON_S) } else { HORIZON_S };
        let n = (until_s / POINT_S).ceil() as usize;
        let times: Vec<f64> = (0..=n).map(|k| until_s * k as f64 / n as f64).collect();
        let frenet = |t: f64| {
            let u = (t / self.shift_s).min(1.0);
            let share = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
            let s_m = from.s_m + ego.speed_mps * t - 0.5 * self.brake_mps2 * t * t;
            FrenetPoint { s_m, d_m: from.d_m + (self.shift_m - from.d_m) * share }
        };
        let poses: Vec<_> = times
            .iter()
            .map(|&t| {
                let (here, ahead) = (route.unproject(frenet(t)), route.unproject(frenet(t + 1e-4)));
                let heading = if speed_at(t) > 0.1 {
                    (ahead - here).heading()
                } else {
                    route.line().at(frenet(t).s_m).pose.heading_rad
                };
                swerve_geom::Pose2::new(here.x_m, here.y_m, heading)
            })
            .collect();
        let path = with_curvature(&poses);
        let points = path.iter().zip(&times).map(|(p, &t)| PlanPoint {
            at: ego.stamp + Span::from_secs(t),
            pose: p.pose,
            curvature_1pm: p.curvature_1pm,
            speed_mps: speed_at(t),
            accel_mps2: -self.brake_mps2,
        });
        Plan { stamp: ego.stamp, status: PlanStatus::Found, points: points.collect(), work: 0 }
    }
}
