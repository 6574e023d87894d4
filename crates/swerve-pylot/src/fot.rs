//! Frenet optimal trajectories as in the original: every candidate is built, the start has speed and heading only, and
//! neither the road nor the car's limits are looked at.

use swerve_core::param::ParamError;
use swerve_geom::Point2;
use swerve_msg::{Plan, PlanStatus};
use swerve_planning::brake::{brake_along, brake_length_m};
use swerve_planning::fot::lattice::Lattice;
use swerve_planning::fot::line::{OnLine, RouteLine};
use swerve_planning::fot::motion::{Checks, FrenetState};
use swerve_planning::fot::search::{Candidate, Outcome, Search, Task};
use swerve_planning::fot::{Params, to_plan};
use swerve_planning::path::route::route_path;
use swerve_planning::{Budget, Counted, Obstacles, Planner, Progress, Request};

/// The planner, with the storage it keeps from call to call; no call depends on an earlier one.
///
/// Of its parameters those count that the original has: not `slower_speeds`, `follow_gap_m`, `follow_time_s`,
/// `road_margin_m` and `tail_s`.
#[derive(Clone, Debug)]
pub struct Fot {
    params: Params,
    search: Search,
    lattice: Lattice,
    line: RouteLine,
    obstacles: Obstacles,
}

impl Fot {
    /// With valid parameters: [`Params::fast`] and [`Params::slow`] have the paper's numbers.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn new(params: Params) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self {
            params,
            search: Search::default(),
            lattice: Lattice::default(),
            line: RouteLine::default(),
            obstacles: Obstacles::default(),
        })
    }

    /// The start as the original has it: all speed along the line, the heading's part across it, no acceleration.
    fn frenet(&self, request: &Request<'_>) -> FrenetState {
        let OnLine { s_m, d_m, turn_rad, .. } = self.line.locate(request.start.pose);
        let speed_mps = request.start.speed_mps.max(0.0);
        let (sin, _) = swerve_geom::math::sin_cos(turn_rad);
        FrenetState { s: [s_m, speed_mps, 0.0], d: [d_m, speed_mps * sin, 0.0] }
    }
}

impl Planner for Fot {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let mut counted = Counted::new(budget);
        let params = &self.params;
        self.line.follow(request.route.line());
        let center: Point2 = request.start.pose.point();
        self.obstacles.set_near(request.predictions, params.collision, center, params.obstacle_range_m);
        let start = self.frenet(request);
        let target_mps = request.target_speed_mps;
        self.lattice.set(params, target_mps);
        let checks = checks(params, request, &self.obstacles);
        let line = self.line.line();
        let task = Task { params, line, cut_m: f64::INFINITY, start, target_mps, checks };
        let plan = match build_all(&mut self.search, &task, &mut self.lattice, &mut counted) {
            Some(candidate) => to_plan(&task, &candidate, request),
            None => stop_on_route(request),
        };
        Plan { work: counted.spent, ..plan }
    }
}

fn checks<'a>(params: &Params, request: &Request<'a>, obstacles: &'a Obstacles) -> Checks<'a> {
    let direction = request.start.pose.direction();
    Checks {
        obstacles,
        shape: request.shape,
        at: request.start.stamp,
        clearance_m: params.clearance_m,
        exact: false,
        curvature_max_1pm: params.max_curvature_1pm,
        offset_m: (f64::NEG_INFINITY, f64::INFINITY),
        smooth: false,
        drivable: None,
        heading: (direction.x, direction.y),
        tail_s: 0.0,
    }
}

/// The cheapest of all candidates, each of which counts, as the original builds them all; when the budget ends, the best
/// of the offsets looked at by then (coarse first).
pub(crate) fn build_all(
    search: &mut Search,
    task: &Task<'_>,
    lattice: &mut Lattice,
    budget: &mut dyn Budget,
) -> Option<Candidate> {
    let (offsets, block) = (lattice.d_m.len(), (lattice.t_s.len() * lattice.v_mps.len()) as u64);
    for done in 0..offsets {
        if budget.spend(block) == Progress::Stop {
            if done == 0 {
                return None;
            }
            lattice.keep_offsets(done);
            break;
        }
    }
    match search.run(task, lattice, None, &mut 0) {
        Outcome::Found(candidate) => Some(candidate),
        Outcome::Nothing | Outcome::Stopped => None,
    }
}

/// Speed zero along the route.
fn stop_on_route(request: &Request<'_>) -> Plan {
    let path = route_path(request.route.line(), request.start.pose, brake_length_m(request));
    let mut plan = brake_along(request, &path, PlanStatus::Stop);
    plan.points.iter_mut().for_each(|p| p.speed_mps = 0.0);
    plan
}

#[cfg(test)]
mod tests {
    use swerve_planning::testing::{Capped, World, conformance};
    use swerve_planning::{CollisionMode, Unlimited};

    use super::*;

    fn plan(world: &World, params: Params) -> Plan {
        Fot::new(params).unwrap().plan(&world.request(), &mut Unlimited::default())
    }

    #[test]
    fn holds_what_every_planner_must() {
        conformance(&|| Fot::new(Params::fast()).unwrap(), false);
    }

    #[test]
    fn every_candidate_counts() {
        let world = World::straight(16.0).with_person((25.0, 0.5), (0.0, 0.0));
        assert_eq!(plan(&world, Params::fast()).work, 825);
        assert_eq!(plan(&world, Params::slow()).work, 11_005);
        let mut planner = Fot::new(Params::fast()).unwrap();
        assert_eq!(planner.plan(&world.request(), &mut Capped::new(400)).status, PlanStatus::Found);
    }

    #[test]
    fn a_person_is_passed_behind_in_time() {
        let world = World::straight(14.0).with_person((26.0, 3.0), (0.0, -3.0));
        let timed = plan(&world, Params { clearance_m: 0.5, ..Params::fast() });
        assert_eq!(timed.status, PlanStatus::Found);
        assert!(world.clearance_m(&timed, CollisionMode::TimeIndexed) >= 0.49);
        let swept = Params { collision: CollisionMode::SweptStatic, left_m: 1.0, ..Params::fast() };
        let stopped = plan(&world, swept);
        let front_m = |p: &swerve_msg::PlanPoint| world.shape.footprint(p.pose).corners()[0].x_m;
        assert!(stopped.status.is_fallback() || stopped.points.iter().all(|p| front_m(p) < 25.75));
    }

    #[test]
    fn without_a_path_the_speed_is_zero_at_once() {
        let stop = stop_on_route(&World::straight(10.0).request());
        assert_eq!(stop.status, PlanStatus::Stop);
        assert!(stop.points.iter().all(|p| p.speed_mps == 0.0));
    }
}
