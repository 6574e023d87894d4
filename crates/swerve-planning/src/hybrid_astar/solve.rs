//! Posed problems.

use swerve_core::Time;
use swerve_geom::Pose2;
use swerve_vehicle::{Kinematic, VehicleParams};

use super::drive::worst_offset_m;
use super::dubins::{Piece, advance, walk};
use super::ground::{Area, Clock, Ground, Outline};
use super::motions::{fan, scan};
use super::on_road::around;
use super::search::{Arrival, Lattice, Search, length_m};
use super::shorten::Shortener;
use crate::collision::{Obstacles, Solid};
use crate::posed::{CLEARANCE_CAP_M, HybridAstarConfig, HybridAstarProblem, Preset, Solution, obb};
use crate::request::Budget;

/// Distance of the points of a solution's path, metres.
const POINT_M: f64 = 0.25;

/// Distance of the looks that measure a solution's clearance, metres.
const CLEARANCE_STEP_M: f64 = 0.1;

/// Lateral acceleration of a solution's speed at most: 0.8 g, m/s².
const LATERAL_MPS2: f64 = 0.8 * 9.81;

/// How far the driven car may be off a solution's path, metres.
const OFF_MAX_M: f64 = 0.25;

/// Fastest speed at which a solution is timed, m/s.
const SPEED_MAX_MPS: f64 = 20.0;

/// No solution is timed much slower than this, m/s.
const SPEED_MIN_MPS: f64 = 0.5;

/// What the speed is multiplied by as long as the car leaves the path.
const SLOWER: f64 = 0.9;

/// Expansions of the best preset, at most: it ends much earlier where the ground is bounded as in the problems.
const EXPANSIONS_MAX: usize = 6000;

/// What came of a search.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Outcome {
    /// There is a path.
    Found,
    /// A number of the problem or of its settings is not finite or out of range.
    Invalid,
    /// The start touches an obstacle or lies outside the bounds.
    StartBlocked,
    /// The goal does.
    GoalBlocked,
    /// The search ended without a path.
    NoPath,
}

impl Outcome {
    /// In words; empty for [`Outcome::Found`].
    pub fn reason(self) -> &'static str {
        match self {
            Self::Found => "",
            Self::Invalid => "a number is not finite or out of range",
            Self::StartBlocked => "the start is not free",
            Self::GoalBlocked => "the goal is not free",
            Self::NoPath => "no path within the budget",
        }
    }
}

/// Solves posed problems, with memory kept between calls; no call depends on an earlier one.
#[derive(Clone, Debug, Default)]
pub struct Solver {
    search: Search,
    shortener: Shortener,
    grown: Obstacles,
    raw: Obstacles,
    motions: Vec<Piece>,
    pieces: Vec<Piece>,
    spare: Vec<Piece>,
}

/// Solves one problem; work is counted in neighbours generated. The call's time is for the caller to measure.
///
/// `paper` ends within the settings' distance of the goal, `best` in the goal pose itself.
pub fn solve_posed(
    problem: &HybridAstarProblem,
    config: &HybridAstarConfig,
    preset: Preset,
    budget: &mut dyn Budget,
) -> Solution {
    let mut solver = Solver::default();
    match solver.search(problem, config, preset, budget) {
        Outcome::Found => solver.solution(problem, config),
        other => Solution::not_found(&problem.id, other.reason(), solver.work()),
    }
}

impl Solver {
    /// Searches; does not allocate once it has grown to the size of the problems it is given.
    pub fn search(
        &mut self,
        problem: &HybridAstarProblem,
        config: &HybridAstarConfig,
        preset: Preset,
        budget: &mut dyn Budget,
    ) -> Outcome {
        self.search.work = 0;
        self.pieces.clear();
        if !is_valid(problem, config) {
            return Outcome::Invalid;
        }
        let (start, goal) = (pose(problem.start), pose(problem.goal));
        let clearance_m = config.obstacle_clearance;
        // The boxes grow as boxes, corners and all, as the original's do.
        self.grown.set_boxes(problem.obstacles.iter().map(|b| obb(b).grown(clearance_m)));
        self.raw.set_boxes(problem.obstacles.iter().map(obb));
        let bounds = around(&[start, goal], config.lane_width);
        let ground = Ground {
            obstacles: &self.grown,
            clearance_m: 0.0,
            outline: outline(config),
            area: Area::Box(bounds),
            clock: Clock::STANDING,
        };
        if !ground.pose_free(start, 0.0) {
            return Outcome::StartBlocked;
        }
        if preset == Preset::Best && !ground.pose_free(goal, 0.0) {
            return Outcome::GoalBlocked;
        }
        let lattice = lattice(config, preset, &mut self.motions);
        let ends = (start, goal, bounds);
        if !self.search.run(&ground, &lattice, ends, budget, &mut self.pieces) {
            return Outcome::NoPath;
        }
        if preset == Preset::Best {
            self.spare.clear();
            self.spare.extend_from_slice(&self.pieces);
            self.shortener.shorten(&ground, config.radius, start, &mut self.pieces, 0.25 * config.radius);
            if !ground.free_exactly(start, &self.pieces) {
                core::mem::swap(&mut self.pieces, &mut self.spare);
            }
        }
        if ground.free_exactly(start, &self.pieces) { Outcome::Found } else { Outcome::NoPath }
    }

    /// Neighbours generated by the newest search.
    pub fn work(&self) -> u64 {
        self.search.work
    }

    /// Length of the path of the newest search, metres; zero without.
    pub fn length_m(&self) -> f64 {
        length_m(&self.pieces)
    }

    fn solution(&self, problem: &HybridAstarProblem, config: &HybridAstarConfig) -> Solution {
        let (outline, start) = (outline(config), pose(problem.start));
        let solution = solution(&problem.id, start, &self.pieces, |point, direction| {
            let solid: Solid = outline.at(point, direction);
            self.raw.distance_below(&solid, Time::ZERO, CLEARANCE_CAP_M)
        });
        Solution { work: self.work(), ..solution }
    }
}

/// The speed at which the Lincoln follows `pieces` from `start`, m/s: it keeps 0.8 g in the tightest turn, and the
/// vehicle model, driven along them, stays within [`OFF_MAX_M`].
fn drivable_mps(start: Pose2, pieces: &[Piece]) -> f64 {
    let car = Kinematic::new(&VehicleParams::default());
    let bends = pieces.iter().map(|piece| piece.curvature_1pm.abs().max(1e-9));
    let fastest_mps = bends.map(|bend_1pm| (LATERAL_MPS2 / bend_1pm).sqrt()).fold(SPEED_MAX_MPS, f64::min);
    let mut speed_mps = fastest_mps;
    while speed_mps > SPEED_MIN_MPS && worst_offset_m(&car, start, pieces, speed_mps) > OFF_MAX_M {
        speed_mps *= SLOWER;
    }
    speed_mps
}

/// The solution along `pieces`, timed at a steady speed at which the car can follow it.
pub(crate) fn solution(
    id: &str,
    start: Pose2,
    pieces: &[Piece],
    distance_m: impl Fn(swerve_geom::Point2, [f64; 2]) -> f64,
) -> Solution {
    let curvature_max = pieces.iter().map(|p| p.curvature_1pm.abs()).fold(0.0, f64::max);
    let speed_mps = drivable_mps(start, pieces);
    let mut path = vec![[start.x_m, start.y_m, start.heading_rad, 0.0]];
    let (sin, cos) = swerve_geom::math::sin_cos(start.heading_rad);
    let mut clearance_m = distance_m(start.point(), [cos, sin]).min(CLEARANCE_CAP_M);
    let (mut from, mut s_m) = (start, 0.0);
    for &piece in pieces {
        let n = (piece.length_m / POINT_M).ceil().max(1.0);
        for k in 1..=n as usize {
            let done_m = piece.length_m * k as f64 / n;
            let at = advance(from, piece.curvature_1pm, done_m);
            path.push([at.x_m, at.y_m, at.heading_rad, (s_m + done_m) / speed_mps]);
        }
        walk(from, piece, CLEARANCE_STEP_M, |point, direction, _| {
            clearance_m = clearance_m.min(distance_m(point, direction));
            true
        });
        from = advance(from, piece.curvature_1pm, piece.length_m);
        s_m += piece.length_m;
    }
    Solution {
        id: id.to_owned(),
        found: true,
        length_m: s_m,
        cost: s_m,
        clearance_m,
        curvature_max,
        path,
        ..Solution::default()
    }
}

fn pose(p: [f64; 3]) -> Pose2 {
    Pose2::new(p[0], p[1], p[2])
}

/// The car of the problems: its reference point lies a quarter of its length ahead of its tail.
fn outline(config: &HybridAstarConfig) -> Outline {
    Outline {
        half_length_m: 0.5 * config.car_length,
        half_width_m: 0.5 * config.car_width,
        center_ahead_m: 0.25 * config.car_length,
    }
}

fn lattice<'a>(config: &HybridAstarConfig, preset: Preset, motions: &'a mut Vec<Piece>) -> Lattice<'a> {
    match preset {
        Preset::Paper => {
            let reach = (config.rad_lower_range, config.rad_upper_range);
            scan(config.radius, config.step_size, reach, config.rad_step, motions);
            Lattice {
                motions,
                arrival: Arrival::Within(config.completion_threshold, config.angle_completion_threshold),
                radius_m: config.radius,
                cell_m: config.completion_threshold,
                cell_rad: config.rad_step,
                expansions_max: config.max_iterations.min(100_000) as usize,
                detours: false,
                good_enough: 1.0,
            }
        }
        Preset::Best => {
            motions.clear();
            motions.extend(fan(config.radius, 0.25 * config.radius));
            Lattice {
                motions,
                arrival: Arrival::Exact,
                radius_m: config.radius,
                cell_m: 0.15 * config.radius,
                cell_rad: 0.25,
                expansions_max: EXPANSIONS_MAX,
                detours: true,
                good_enough: 1.0,
            }
        }
    }
}

fn is_valid(problem: &HybridAstarProblem, config: &HybridAstarConfig) -> bool {
    let above_zero = [
        config.step_size,
        config.rad_step,
        config.completion_threshold,
        config.radius,
        config.car_length,
        config.car_width,
    ];
    let from_zero = [
        config.obstacle_clearance,
        config.lane_width,
        config.rad_lower_range,
        config.rad_upper_range,
        config.angle_completion_threshold,
    ];
    let places = problem.start.iter().chain(&problem.goal).chain(problem.obstacles.iter().flatten());
    above_zero.iter().all(|v| v.is_finite() && *v > 0.0)
        && from_zero.iter().all(|v| v.is_finite() && *v >= 0.0)
        && config.rad_step * 1000.0 >= config.rad_lower_range + config.rad_upper_range
        && places.into_iter().all(|v| v.is_finite() && v.abs() < 1e6)
}

#[cfg(test)]
mod tests;
