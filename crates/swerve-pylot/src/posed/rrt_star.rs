//! Posed problems for RRT*.

mod bend;
mod boxes;
mod round;

use swerve_core::{ParamError, Ranges};
use swerve_core::{Rng, Time};
use swerve_geom::{Point2, Pose2};
use swerve_planning::path::Ends;
use swerve_planning::path::ground::{Outline, around};
use swerve_planning::path::piece::{Piece, length_m};
use swerve_planning::path::points::with_curvature;
use swerve_planning::rrt_star::tree::{Aim, Growth, Tree, Until, gamma_m2};
use swerve_planning::{Budget, Counted, Obstacles};

use super::pieces::solution;
use super::{
    AxisBox, CLEARANCE_CAP_M, Outcome, RrtStarConfig, RrtStarProblem, Solution, obb, path_length_m,
    require_near,
};
use crate::Preset;
use crate::rrt_star::turn_along;
use crate::tree;
use bend::{Bender, pieces_free};
use boxes::Boxes;
use round::Rounder;

/// Iterations of the best preset in about one millisecond, including the rounding of corners: the median over the
/// problems of the pylot_fast configuration on one core of a 2-core AMD EPYC (family 25 model 1), release build. `cargo
/// test --release -p swerve-pylot posed::rrt_star -- --nocapture` prints the time on the current machine.
pub const ITERATIONS_PER_MS: u64 = 500;

/// Distance of corners, around which paths bend, from the grown boxes, metres.
const CORNER_OUT_M: f64 = 1e-3;

/// Additional growth of the boxes when checking curved paths, metres: arcs are within 0.31 mm of their chords.
const CHORD_OUT_M: f64 = 0.5e-3;

/// Radii at which corners are rounded, widest first: if they cost nothing, wide turns are easier to steer. The last is
/// slightly more than the tightest turn of the Lincoln (4.08 m).
const RADII_M: [f64; 7] = [40.0, 25.0, 16.0, 10.0, 7.0, 5.5, 4.2];

/// Radii of paths with free headings, tried if no rounding is possible.
const BEND_RADII_M: [f64; 2] = [6.0, 4.15];

/// A rounded path not longer than this multiple of the straight one is accepted without trying tighter radii.
const GOOD_ENOUGH: f64 = 1.002;

/// Number of paths that are tried until one can be steered.
const PATHS_MAX: usize = 4;

/// Sampling distance for curvature and clearance on a path of straight lines, metres.
const LOOK_M: f64 = 0.1;

/// Solves posed problems, with storage that is reused between calls; calls are independent of each other.
#[derive(Clone, Debug)]
pub struct Solver {
    /// Seed of the random numbers.
    pub seed: u64,
    /// Largest number of iterations of the best preset; the configured one applies to the paper preset.
    pub iterations_max: u64,
    tree: Tree,
    paper: tree::Tree,
    paper_boxes: crate::boxes::Boxes,
    paper_work: u64,
    points: Vec<Point2>,
    boxes: Boxes,
    guides: Vec<Pose2>,
    corners: Vec<Pose2>,
    rounder: Rounder,
    bender: Bender,
    pieces: Vec<Piece>,
    best: Vec<Piece>,
    raw: Obstacles,
    start: Pose2,
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            seed: 0,
            iterations_max: ITERATIONS_PER_MS,
            tree: Tree::default(),
            paper: tree::Tree::default(),
            paper_boxes: crate::boxes::Boxes::default(),
            paper_work: 0,
            points: Vec::new(),
            boxes: Boxes::default(),
            guides: Vec::new(),
            corners: Vec::new(),
            rounder: Rounder::default(),
            bender: Bender::default(),
            pieces: Vec::new(),
            best: Vec::new(),
            raw: Obstacles::default(),
            start: Pose2::default(),
        }
    }
}

/// Solves one problem with seed 0; work is counted in iterations, at most [`ITERATIONS_PER_MS`] for `best` (see
/// [`Solver::iterations_max`]). The caller times the call.
///
/// `paper` returns at the first arrival near the goal, with a path of straight lines; `best` ends in the goal itself,
/// with a path that a car can steer.
pub fn solve(
    problem: &RrtStarProblem,
    config: &RrtStarConfig,
    preset: Preset,
    budget: &mut dyn Budget,
) -> Solution {
    let mut solver = Solver::default();
    match solver.search(problem, config, preset, budget) {
        Outcome::Found => solver.solution(problem, preset),
        other => Solution::without(&problem.id, (other, check(problem, config)), solver.work()),
    }
}

impl Solver {
    /// Searches; does not allocate once its storage has grown to the size of the problems.
    pub fn search(
        &mut self,
        problem: &RrtStarProblem,
        config: &RrtStarConfig,
        preset: Preset,
        budget: &mut dyn Budget,
    ) -> Outcome {
        (self.tree.work, self.paper_work) = (0, 0);
        self.best.clear();
        self.corners.clear();
        if check(problem, config).is_err() {
            return Outcome::Invalid;
        }
        let at = |p: [f64; 2]| Pose2::new(p[0], p[1], 0.0);
        let (start, goal) = (at(problem.start), at(problem.goal));
        let bounds = around(&[start, goal], config.lane_width);
        self.start = start;
        self.raw.set_boxes(problem.obstacles.iter().map(obb));
        self.boxes.set(&problem.obstacles, config.obstacle_clearance, bounds);
        if !self.boxes.point_free(start.point()) {
            return Outcome::StartBlocked;
        }
        match preset {
            Preset::Paper => self.first_arrival(problem, config, bounds, budget),
            Preset::Best if !self.boxes.point_free(goal.point()) => Outcome::GoalBlocked,
            Preset::Best => self.shortest(problem, config, &Ends { start, goal, bounds }, budget),
        }
    }

    fn first_arrival(
        &mut self,
        problem: &RrtStarProblem,
        config: &RrtStarConfig,
        bounds: AxisBox,
        budget: &mut dyn Budget,
    ) -> Outcome {
        let growth = tree::Growth {
            step_m: config.step_size,
            iterations_max: config.max_iterations.min(100_000),
            goal_share: 0.01,
            arrival_m: config.end_dist_threshold,
            rewiring: false,
            speed_mps: f64::INFINITY,
        };
        self.paper_boxes.set_standing(&problem.obstacles, config.obstacle_clearance);
        let at = |p: [f64; 2]| Point2::new(p[0], p[1]);
        let aim = tree::Aim { start: at(problem.start), goal: at(problem.goal), bounds };
        let mut rng = Rng::keyed(self.seed, "rrt_star", &[]);
        let mut counted = Counted::new(budget);
        let Self { paper, paper_boxes, points, .. } = self;
        let found = paper.grow(paper_boxes, (&growth, &aim), &mut rng, &mut counted, points);
        self.paper_work = counted.spent;
        if found {
            self.corners.extend(self.points.iter().map(|p| Pose2::new(p.x_m, p.y_m, 0.0)));
        }
        if found { Outcome::Found } else { Outcome::NoPath }
    }

    fn shortest(
        &mut self,
        problem: &RrtStarProblem,
        config: &RrtStarConfig,
        ends: &Ends,
        budget: &mut dyn Budget,
    ) -> Outcome {
        let growth = Growth {
            step_m: 10.0,
            iterations_max: self.iterations_max,
            goal_share: 0.05,
            guide_share: 0.3,
            gamma_m2: gamma_m2(ends.bounds),
            radius_max_m: 6.0,
            until: Until::Spent,
        };
        let clearance_m = config.obstacle_clearance;
        self.boxes.set(&problem.obstacles, clearance_m + CORNER_OUT_M, ends.bounds);
        self.boxes.corners(&mut self.guides);
        let mut rng = Rng::keyed(self.seed, "rrt_star", &[]);
        let aim = Aim { start: ends.start, goal: ends.goal, bounds: ends.bounds, guides: &self.guides };
        self.tree.grow(&self.boxes, &growth, &aim, &mut rng, budget);
        self.boxes.set(&problem.obstacles, clearance_m + CHORD_OUT_M, ends.bounds);
        for _ in 0..PATHS_MAX {
            let Some(_) = self.tree.take_best(&mut self.corners) else { return Outcome::NoPath };
            self.corners.push(ends.goal);
            simplify(&self.boxes, &mut self.corners);
            if self.steer() {
                return Outcome::Found;
            }
        }
        Outcome::NoPath
    }

    /// Converts the path over the corners to one that a car can steer; writes it to `best`.
    fn steer(&mut self) -> bool {
        let straight_m: f64 = self.corners.windows(2).map(|p| p[0].point().distance(p[1].point())).sum();
        let mut best_m = f64::INFINITY;
        let mut take = |start: Pose2, pieces: &[Piece], best: &mut Vec<Piece>| {
            let whole_m = length_m(pieces);
            if whole_m < best_m {
                best_m = whole_m;
                self.start = start;
                best.clear();
                best.extend_from_slice(pieces);
            }
            best_m
        };
        let from = self.corners[0];
        let turned = |heading_rad: f64| Pose2::new(from.x_m, from.y_m, heading_rad);
        for radius_m in RADII_M {
            let Some(heading_rad) = self.rounder.round(&self.corners, |_| radius_m, &mut self.pieces) else {
                continue;
            };
            if pieces_free(&self.boxes, turned(heading_rad), &self.pieces)
                && take(turned(heading_rad), &self.pieces, &mut self.best) < straight_m * GOOD_ENOUGH
            {
                return true;
            }
        }
        for radius_m in BEND_RADII_M {
            if !self.best.is_empty() {
                break;
            }
            if let Some(heading_rad) =
                self.bender.bend(&self.boxes, &self.corners, radius_m, &mut self.pieces)
            {
                take(turned(heading_rad), &self.pieces, &mut self.best);
            }
        }
        !self.best.is_empty()
    }

    /// Iterations of the latest search.
    pub fn work(&self) -> u64 {
        self.tree.work + self.paper_work
    }

    /// Length of the path of the latest search, metres; zero without a path.
    pub fn length_m(&self) -> f64 {
        if self.best.is_empty() {
            return self.corners.windows(2).map(|p| p[0].point().distance(p[1].point())).sum();
        }
        length_m(&self.best)
    }

    fn solution(&self, problem: &RrtStarProblem, preset: Preset) -> Solution {
        let distance_m = |point: Point2, direction: [f64; 2]| {
            let solid = Outline::POINT.at(point, direction);
            self.raw.distance_below(&solid, Time::ZERO, CLEARANCE_CAP_M)
        };
        let solution = match preset {
            Preset::Best => solution(&problem.id, self.start, &self.best, distance_m),
            Preset::Paper => straight_lines(&problem.id, &self.corners, distance_m),
        };
        Solution { work: self.work(), ..solution }
    }
}

/// The original's path: the nodes of the tree, at one metre per second.
fn straight_lines(id: &str, nodes: &[Pose2], distance_m: impl Fn(Point2, [f64; 2]) -> f64) -> Solution {
    let mut poses = nodes.to_vec();
    turn_along(&mut poses);
    let curvature_max = with_curvature(&poses).iter().map(|p| p.curvature_1pm.abs()).fold(0.0, f64::max);
    let (mut path, mut t_s) = (Vec::with_capacity(poses.len()), 0.0);
    let mut clearance_m = CLEARANCE_CAP_M;
    for (i, pose) in poses.iter().enumerate() {
        let before = poses[i.saturating_sub(1)].point();
        let way = pose.point() - before;
        let looks = (way.norm() / LOOK_M).ceil().max(1.0);
        for k in 1..=looks as usize {
            clearance_m = clearance_m.min(distance_m(before + way * (k as f64 / looks), [1.0, 0.0]));
        }
        t_s += way.norm();
        path.push([pose.x_m, pose.y_m, pose.heading_rad, t_s]);
    }
    let length_m = path_length_m(&path);
    Solution {
        id: id.to_owned(),
        found: true,
        length_m,
        cost: length_m,
        clearance_m,
        curvature_max,
        path,
        ..Solution::default()
    }
}

/// Removes unnecessary corners.
fn simplify(boxes: &Boxes, corners: &mut Vec<Pose2>) {
    let (mut kept, mut from) = (1, 0);
    while from + 1 < corners.len() {
        let here = corners[kept - 1].point();
        let next = (from + 1..corners.len()).rev().find(|&to| boxes.segment_free(here, corners[to].point()));
        let to = next.unwrap_or(from + 1);
        corners[kept] = corners[to];
        kept += 1;
        from = to;
    }
    corners.truncate(kept);
}

/// Rejects out-of-range numbers of the problem and its settings, by their keys in the file.
fn check(problem: &RrtStarProblem, config: &RrtStarConfig) -> Result<(), ParamError> {
    config.check_ranges()?;
    require_near("start", &problem.start)?;
    require_near("goal", &problem.goal)?;
    problem.obstacles.iter().try_for_each(|b| require_near("obstacles", b))
}

#[cfg(test)]
mod tests;
