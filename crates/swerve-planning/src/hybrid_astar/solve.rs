//! Posed problems.

use swerve_geom::{Pose2, math};

use super::dubins::{Piece, advance};
use super::ground::{Area, Clock, Ground, Outline};
use super::search::{Lattice, Search, length_m};
use super::shorten::Shortener;
use crate::collision::Obstacles;
use crate::posed::{CLEARANCE_CAP_M, HybridAstarConfig, HybridAstarProblem, Preset, Solution, obb};
use crate::request::{Budget, Unlimited};
use swerve_core::Time;

/// Distance of the points of a returned path, metres.
const POINT_M: f64 = 0.25;

/// Memory of the solver of posed problems, kept between calls.
#[derive(Clone, Debug, Default)]
pub struct Solver {
    search: Search,
    shortener: Shortener,
    obstacles: Obstacles,
    pieces: Vec<Piece>,
}

/// Solves one posed problem.
pub fn solve_posed(
    problem: &HybridAstarProblem,
    config: &HybridAstarConfig,
    preset: Preset,
    budget: &mut dyn Budget,
) -> Solution {
    Solver::default().solve(problem, config, preset, budget)
}

impl Solver {
    /// As [`solve_posed`], with the memory of earlier calls.
    pub fn solve(
        &mut self,
        problem: &HybridAstarProblem,
        config: &HybridAstarConfig,
        preset: Preset,
        budget: &mut dyn Budget,
    ) -> Solution {
        let _ = preset;
        let pose = |p: [f64; 3]| Pose2::new(p[0], p[1], p[2]);
        let (start, goal) = (pose(problem.start), pose(problem.goal));
        self.obstacles.set_boxes(problem.obstacles.iter().map(|b| obb(b).grown(config.obstacle_clearance)));
        let w = config.lane_width;
        let bounds = [
            start.x_m.min(goal.x_m) - w,
            start.y_m.min(goal.y_m) - w,
            start.x_m.max(goal.x_m) + w,
            start.y_m.max(goal.y_m) + w,
        ];
        let ground = Ground {
            obstacles: &self.obstacles,
            clearance_m: 0.0,
            outline: Outline {
                half_length_m: 0.5 * config.car_length,
                half_width_m: 0.5 * config.car_width,
                center_ahead_m: 0.25 * config.car_length,
            },
            area: Area::Box(bounds),
            clock: Clock::STANDING,
        };
        let motions = super::motions::fan(config.radius, 0.25 * config.radius);
        let lattice = Lattice {
            motions: &motions,
            arrival: super::search::Arrival::Exact,
            radius_m: config.radius,
            cell_rad: 0.25,
            cell_m: 0.15 * config.radius,
            expansions_max: 6000,
            detours: true,
            good_enough: 1.0,
        };
        let found = self.search.run(&ground, &lattice, (start, goal, bounds), budget, &mut self.pieces);
        if !found {
            return Solution::not_found(&problem.id, "no path", self.search.work);
        }
        let raw_m = length_m(&self.pieces);
        self.shortener.shorten(&ground, config.radius, start, &mut self.pieces, 1.5);
        let exact = ground.free_exactly(start, &self.pieces);
        Solution {
            id: problem.id.clone(),
            found: exact,
            reason: format!("{raw_m}"),
            work: self.search.work,
            length_m: length_m(&self.pieces),
            ..Solution::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::posed::ProblemFile;

    #[test]
    fn look() {
        let text = std::fs::read_to_string("/work/shared/data/planner_problems.json").unwrap();
        let file: ProblemFile = serde_json::from_str(&text).unwrap();
        let config = &file.configs.hybrid_astar["pylot_s3_r075"];
        let mut solver = Solver::default();
        let mut times = vec![];
        for p in &file.problems.hybrid_astar {
            let mut s = Solution::default();
            let mut best = f64::INFINITY;
            for _ in 0..5 {
                let t = std::time::Instant::now();
                s = solver.solve(p, config, Preset::Best, &mut Unlimited::default());
                best = best.min(t.elapsed().as_secs_f64() * 1e3);
            }
            let line = math::hypot(p.goal[0] - p.start[0], p.goal[1] - p.start[1]);
            times.push(best);
            let known = p.best_known_length_ratio_exact_heading;
            println!(
                "{} {} {:?} ours {:.4} raw {:.4} work {} {best:.3} ms {}",
                p.id,
                s.found,
                known,
                s.length_m / line,
                s.reason.parse::<f64>().unwrap_or(0.0) / line,
                s.work,
                match known {
                    Some(k) if !s.found => "MISSED",
                    Some(k) if s.length_m / line > 1.03 * k => "LONG",
                    _ => "",
                }
            );
        }
        times.sort_by(f64::total_cmp);
        println!("median {} max {}", times[times.len() / 2], times[times.len() - 1]);
    }
}
