//! Frenet optimal trajectories as in the original: every candidate is built, the start has speed and heading only, and
//! neither the road nor the car's limits are checked.

use swerve_core::Span;
use swerve_core::param::ParamError;
use swerve_geom::{Point2, Pose2, math};
use swerve_msg::{Plan, PlanPoint, PlanStatus};
use swerve_planning::fot::FrenetState;
use swerve_planning::fot::candidate::{Candidate, Judge};
use swerve_planning::fot::lattice::Lattice;
use swerve_planning::fot::line::{OnLine, RouteLine};
use swerve_planning::fot::motion::{Checks, MotionState};
use swerve_planning::fot::search::{Search, Task};
use swerve_planning::fot::{Params, places};
use swerve_planning::{Budget, CollisionMode, Counted, Obstacles, Planner, Progress, Request, Solid};
use swerve_vehicle::Shape;

use crate::boxes::{Boxes, Sight};
use crate::closed_loop::{ROUTE_POINTS, first_m, nothing_found, planned, planned_ahead_m};
use crate::{Original, Rules};

/// Largest time step of a plan whose points are not the samples, seconds.
const POINT_STEP_S: f64 = 0.1;

/// The planner, with storage that is reused between calls.
///
/// Uses only the parameters that the original has: not `slower_speeds`, `follow_gap_m`, `follow_time_s`,
/// `road_margin_m` and `tail_s`.
#[derive(Clone, Debug)]
pub struct Fot {
    params: Params,
    rules: Rules,
    search: Search,
    lattice: Lattice,
    line: RouteLine,
    boxes: Boxes,
    obstacles: Obstacles,
}

impl Fot {
    /// Creates the planner from valid parameters and rules: [`Params::fast`] and [`Params::slow`] have the paper's
    /// values.
    ///
    /// # Errors
    /// The first parameter out of its range.
    pub fn new(params: Params, rules: Rules) -> Result<Self, ParamError> {
        params.validate()?;
        rules.validate(Original::Fot)?;
        Ok(Self {
            params,
            rules,
            search: Search::default(),
            lattice: Lattice::default(),
            line: RouteLine::default(),
            boxes: Boxes::default(),
            obstacles: Obstacles::default(),
        })
    }

    /// Sets the predictions in range.
    fn set_obstacles(&mut self, request: &Request<'_>, from: Point2) {
        let Params { collision, obstacle_range_m: range_m, clearance_m, .. } = self.params;
        let Rules { range_per_place: per_place, person_half_m, .. } = self.rules;
        let sight = Sight { collision, range_m, per_place, person_half_m };
        self.boxes.set_predicted(request, from, sight, clearance_m);
        if collision == CollisionMode::SweptStatic {
            self.obstacles.set_boxes(self.boxes.rectangles(clearance_m));
        } else {
            self.obstacles.set_near(request.predictions, collision, from, range_m);
        }
    }

    /// Start state as in the original: all speed along the line, lateral velocity of the planned point, no
    /// acceleration.
    fn frenet(&self, request: &Request<'_>) -> FrenetState {
        let OnLine { s_m, d_m, turn_rad, .. } = self.line.locate(planned(request, &self.rules));
        let speed_mps = request.start.speed_mps.max(0.0);
        let swing_mps = request.start.yaw_rate_radps * planned_ahead_m(request, &self.rules);
        let (sin, cos) = math::sin_cos(turn_rad);
        FrenetState {
            s: [s_m, speed_mps, 0.0],
            d: [d_m, speed_mps * sin + swing_mps * cos, 0.0],
            d_by_s: None,
        }
    }

    /// The candidate's motion as a plan of the ego origin.
    fn plan_of(&self, task: &Task<'_>, candidate: &Candidate, request: &Request<'_>) -> Plan {
        let (back_m, sparse) = (-planned_ahead_m(request, &self.rules), self.rules.sparse_points);
        let step_s = if sparse { self.params.time_step_s } else { POINT_STEP_S };
        let curvature_max = task.checks.curvature_max_1pm;
        let point = |(t_s, place): (f64, MotionState)| PlanPoint {
            at: request.start.stamp + Span::from_secs(t_s),
            pose: Pose2::new(place.x_m, place.y_m, math::atan2(place.sin, place.cos)).ahead(back_m),
            curvature_1pm: place.curvature_1pm.clamp(-curvature_max, curvature_max),
            speed_mps: place.speed_mps,
            accel_mps2: place.accel_mps2,
        };
        let points = places(task, candidate, step_s).map(point).collect();
        Plan { stamp: request.stamp, status: PlanStatus::Found, points, work: 0 }
    }
}

impl Planner for Fot {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let mut counted = Counted::new(budget);
        self.line.follow(request.route.line());
        let from = planned(request, &self.rules);
        self.set_obstacles(request, from.point());
        let start = self.frenet(request);
        let target_mps = request.target_speed_mps;
        self.lattice.set(&self.params, target_mps);
        // The outline is centred on the planned point.
        let middle = Shape { rear_overhang_m: 0.5 * request.shape.length_m, ..*request.shape };
        let shape = if self.rules.middle_of_car { &middle } else { request.shape };
        let checks = checks(&self.params, &Request { shape, ..*request }, &self.obstacles);
        let route_end_m = first_m(start.s[0], &self.rules) + (ROUTE_POINTS - 1) as f64;
        let cut_m = if self.rules.cut_at_route_end { route_end_m } else { f64::INFINITY };
        let task = Task { params: &self.params, line: self.line.line(), cut_m, start, target_mps, checks };
        let Self { search, lattice, boxes, rules, .. } = self;
        let found = build_all(lattice, &mut counted).then(|| match rules.borders_only {
            true => search.run_where(&task, lattice, &mut Borders { task: &task, boxes, hint: 0 }),
            false => search.run(&task, lattice, None, &mut 0).found(),
        });
        let plan = match found.flatten() {
            Some(candidate) => self.plan_of(&task, &candidate, request),
            None => nothing_found(request, &self.rules),
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
        speed_max_mps: f64::INFINITY,
        accel_max_mps2: f64::INFINITY,
        offset_m: (f64::NEG_INFINITY, f64::INFINITY),
        smooth: false,
        drivable: None,
        heading: (direction.x, direction.y),
        tail_s: 0.0,
    }
}

/// The original's conditions on a candidate, with the sample at which one last collided: similar candidates tend to do
/// so too.
struct Borders<'a> {
    task: &'a Task<'a>,
    boxes: &'a Boxes,
    hint: usize,
}

impl Judge for Borders<'_> {
    fn fails_too(&mut self, candidate: &Candidate) -> bool {
        Samples::new(self.task, candidate).touches_at(self.boxes, self.hint)
    }

    fn holds(&mut self, candidate: &Candidate) -> bool {
        !self.fails_too(candidate) && Samples::new(self.task, candidate).free(self.boxes, &mut self.hint)
    }
}

/// Samples of a candidate, as the original checks them.
struct Samples<'a> {
    task: &'a Task<'a>,
    candidate: &'a Candidate,
    last: usize,
}

impl<'a> Samples<'a> {
    fn new(task: &'a Task<'a>, candidate: &'a Candidate) -> Self {
        let last = (candidate.last_s / task.params.time_step_s + 1e-9).floor() as usize;
        Self { task, candidate, last }
    }

    fn at_s(&self, k: usize) -> f64 {
        self.task.params.time_step_s * k as f64
    }

    fn place(&self, k: usize) -> MotionState {
        self.candidate.motion.pose_at(self.task.line, self.at_s(k), self.task.checks.heading)
    }

    /// The car at sample `k`, heading along the straight line to the next sample; the last one along the line that
    /// leads to it.
    fn car(&self, k: usize) -> (Solid, f64) {
        let here = self.place(k);
        let (from, to) =
            if k < self.last { (here, self.place(k + 1)) } else { (self.place(k.max(1) - 1), here) };
        self.car_along(&here, &from, &to)
    }

    /// The car at `here`, heading along the straight line from one place to another, and its length.
    fn car_along(&self, here: &MotionState, from: &MotionState, to: &MotionState) -> (Solid, f64) {
        let ahead_m = self.task.checks.shape.center_ahead_m();
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let way_m = math::hypot(dx, dy);
        let (cos, sin) = if way_m > 0.0 { (dx / way_m, dy / way_m) } else { (here.cos, here.sin) };
        let car = Solid {
            x_m: here.x_m + cos * ahead_m,
            y_m: here.y_m + sin * ahead_m,
            cos,
            sin,
            half_length_m: 0.5 * self.task.checks.shape.length_m,
            half_width_m: 0.5 * self.task.checks.shape.width_m,
        };
        (car, way_m)
    }

    /// Returns true if the borders touch at sample `k`, if it exists.
    fn touches_at(&self, boxes: &Boxes, k: usize) -> bool {
        k <= self.last && !boxes.border_free(&self.car(k).0, self.at_s(k))
    }

    /// Returns true if the borders are free at all samples, and the lines between them turn no tighter than allowed;
    /// sets `hint` to a failing sample.
    fn free(&self, boxes: &Boxes, hint: &mut usize) -> bool {
        let mut before: Option<Solid> = None;
        let (mut last, mut here) = (self.place(0), self.place(0));
        for k in 0..=self.last {
            let next = if k < self.last { self.place(k + 1) } else { here };
            let from = if k < self.last { here } else { last };
            let (car, way_m) = self.car_along(&here, &from, &next);
            (last, here) = (here, next);
            if let Some(was) = before.filter(|_| k < self.last) {
                let turned =
                    math::atan2(was.cos * car.sin - was.sin * car.cos, was.cos * car.cos + was.sin * car.sin);
                if turned.abs() > self.task.params.max_curvature_1pm * way_m.max(1e-9) {
                    return false;
                }
            }
            if !boxes.border_free(&car, self.at_s(k)) {
                *hint = k;
                return false;
            }
            before = Some(car);
        }
        true
    }
}

/// Accounts for every candidate, as the original builds them all; when the budget ends, keeps the offsets processed
/// until then (coarse first). Returns true if there are any.
pub(crate) fn build_all(lattice: &mut Lattice, budget: &mut dyn Budget) -> bool {
    let (offsets, block) = (lattice.d_m.len(), (lattice.t_s.len() * lattice.v_mps.len()) as u64);
    for done in 0..offsets {
        if budget.spend(block) == Progress::Stop {
            lattice.keep_offsets(done.max(1));
            return done > 0;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use swerve_planning::Unlimited;
    use swerve_planning::testing::{Capped, World, conformance};

    use super::*;
    use crate::Era;

    fn planner(params: Params) -> Fot {
        Fot::new(params, Rules::of(Era::November2020, Original::Fot)).unwrap()
    }

    fn swept() -> Params {
        Params { collision: CollisionMode::SweptStatic, ..Params::fast() }
    }

    fn plan(world: &World, params: Params) -> Plan {
        planner(params).plan(&world.request(), &mut Unlimited::default())
    }

    #[test]
    fn original_fot_conforms() {
        conformance(&|| planner(swept()), false);
        conformance(&|| planner(Params::fast()), false);
        let exact = Rules { borders_only: false, ..Rules::of(Era::May2020, Original::Fot) };
        conformance(&|| Fot::new(swept(), exact).unwrap(), false);
    }

    #[test]
    fn every_candidate_is_counted_as_work() {
        let world = World::straight(16.0).with_person((25.0, 0.5), (0.0, 0.0));
        assert_eq!(plan(&world, Params::fast()).work, 825);
        assert_eq!(plan(&world, Params::slow()).work, 11_005);
        let found = planner(Params::fast()).plan(&world.request(), &mut Capped::new(400));
        assert_eq!(found.status, PlanStatus::Found);
    }

    #[test]
    fn all_predicted_places_at_once_are_a_wall() {
        let world = World::straight(16.0).with_person((24.0, 3.0), (0.0, -2.75));
        assert_eq!(plan(&world, Params { left_m: 2.0, ..Params::fast() }).status, PlanStatus::Found);
        assert_eq!(plan(&world, Params { left_m: 2.0, ..swept() }).status, PlanStatus::Stop);
    }

    #[test]
    fn plan_points_are_the_samples_and_end_with_the_route() {
        let world = World::straight(16.0);
        let points = |change: fn(&mut Rules)| {
            let mut rules = Rules { whole_metres: false, ..Rules::of(Era::May2020, Original::Fot) };
            change(&mut rules);
            let mut planner = Fot::new(swept(), rules).unwrap();
            let plan = planner.plan(&world.request(), &mut Unlimited::default());
            let last = plan.points[plan.points.len() - 1].pose.x_m;
            (plan.points.len(), last)
        };
        // 16 m/s times 0.3 s is 4.8 m: 29 m contain six of them, plus the start; with whole metres fewer remain.
        assert_eq!([points(|_| ()).0, points(|rules| rules.whole_metres = true).0], [7, 6]);
        assert!(points(|_| ()).1 < 29.0 && points(|rules| rules.cut_at_route_end = false).1 > 31.9);
        assert_eq!(points(|rules| rules.sparse_points = false).0, 19);
    }
}
