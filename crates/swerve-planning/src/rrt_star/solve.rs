//! Posed problems.

use swerve_core::Rng;
use swerve_geom::{Point2, Pose2, math};

use super::boxes::Boxes;
use super::round::Rounder;
use super::tree::{Growth, Tree, Until};
use crate::hybrid_astar::dubins::{Piece, walk, advance};
use crate::posed::{Preset, RrtStarConfig, RrtStarProblem, Solution};
use crate::request::{Budget, Unlimited};

/// Memory of the solver of posed problems, kept between calls.
#[derive(Clone, Debug, Default)]
pub struct Solver {
    tree: Tree,
    boxes: Boxes,
    guides: Vec<Pose2>,
    corners: Vec<Pose2>,
    rounder: Rounder,
    bender: super::bend::Bender,
    pub bends: u32,
    pieces: Vec<Piece>,
    best: Vec<Piece>,
    /// Seed of the random numbers.
    pub seed: u64,
}

const SLACK_M: f64 = 1e-3;

impl Solver {
    fn bounds(problem: &RrtStarProblem, config: &RrtStarConfig) -> [f64; 4] {
        let (s, g, w) = (problem.start, problem.goal, config.lane_width);
        [s[0].min(g[0]) - w, s[1].min(g[1]) - w, s[0].max(g[0]) + w, s[1].max(g[1]) + w]
    }

    pub fn look(&mut self, problem: &RrtStarProblem, config: &RrtStarConfig, preset: Preset, budget: &mut dyn Budget) -> Option<(f64, f64, f64)> {
        let bounds = Self::bounds(problem, config);
        let mut rng = Rng::keyed(self.seed, "rrt_star", &[]);
        let ends = (Pose2::new(problem.start[0], problem.start[1], 0.0), Pose2::new(problem.goal[0], problem.goal[1], 0.0), bounds);
        let area = (bounds[2] - bounds[0]) * (bounds[3] - bounds[1]);
        match preset {
            Preset::Paper => {
                self.boxes.set(&problem.obstacles, config.obstacle_clearance, bounds);
                let growth = Growth {
                    step_m: config.step_size,
                    iterations_max: config.max_iterations,
                    goal_share: 0.01,
                    guide_share: 0.0,
                    gamma_m2: 6.0 * area,
                    radius_max_m: config.step_size,
                    until: Until::Arrival(config.end_dist_threshold),
                };
                if !self.tree.grow(&self.boxes, &growth, ends, &[], &mut rng, budget) { return None; }
                let c = self.tree.take_best(&mut self.corners)?;
                Some((c, c, 0.0))
            }
            Preset::Best => {
                self.boxes.set(&problem.obstacles, config.obstacle_clearance + SLACK_M, bounds);
                self.boxes.corners(&mut self.guides);
                let growth = Growth {
                    step_m: 10.0,
                    iterations_max: 4000,
                    goal_share: 0.05,
                    guide_share: 0.3,
                    gamma_m2: 6.0 * area,
                    radius_max_m: 10.0,
                    until: Until::Spent,
                };
                if !self.tree.grow(&self.boxes, &growth, ends, &self.guides, &mut rng, budget) { return None; }
                self.boxes.set(&problem.obstacles, config.obstacle_clearance, bounds);
                let mut smooth = f64::INFINITY;
                let mut radius = 0.0;
                let mut c0 = f64::INFINITY;
                let mut tries = 0;
                while tries < 4 && let Some(c) = self.tree.take_best(&mut self.corners) {
                    tries += 1;
                    c0 = c0.min(c);
                    self.corners.push(ends.1);
                    simplify(&self.boxes, &mut self.corners);
                    for r in [40.0, 25.0, 16.0, 10.0, 7.0, 5.5, 4.2] {
                        if let Some(h) = self.rounder.round(&self.corners, |_| r, &mut self.pieces) {
                            let pose = Pose2::new(problem.start[0], problem.start[1], h);
                            let ok = super::bend::pieces_free(&self.boxes, pose, &self.pieces);
                            let len = crate::hybrid_astar::search::length_m(&self.pieces);
                            if ok && len < smooth { smooth = len; radius = r; }
                            if ok && len < c * 1.002 { break; }
                        }
                    }
                    if !smooth.is_finite() {
                        for r in [6.0, 4.15] {
                            if self.bender.bend(&self.boxes, &self.corners, r, &mut self.pieces).is_some() {
                                smooth = crate::hybrid_astar::search::length_m(&self.pieces);
                                radius = -r;
                                self.bends += 1;
                                break;
                            }
                        }
                    }
                    if smooth.is_finite() { break; }
                }
                let c = c0;
                Some((c, smooth, radius))
            }
        }
    }
}

/// Leaves out corners that are not needed.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::posed::ProblemFile;

    #[test]
    fn look() {
        let text = std::fs::read_to_string("/work/shared/data/planner_problems.json").unwrap();
        let file: ProblemFile = serde_json::from_str(&text).unwrap();
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let mut solver = Solver::default();
        for (name, preset, units) in [("pylot_fast", Preset::Best, 300)] {
            let config = &file.configs.rrt_star[name];
            let (mut shares, mut peers) = (vec![], vec![]);
            let mut times = vec![];
            for p in &file.problems.rrt_star {
                let peer = &json["results"]["rrt_star"][name][&p.id];
                let optimum = peer["optimal_length"].as_f64().unwrap_or(f64::NAN);
                let (mut n, mut raw, mut smooth, mut radius) = (0.0, 0.0, 0.0, f64::INFINITY);
                let mut sm = 0.0;
                let runs = 10;
                let t = std::time::Instant::now();
                for seed in 0..runs {
                    solver.seed = seed;
                    let mut b = crate::testing::Capped::new(units);
                    if let Some((c, s, r)) = solver.look(p, config, preset, &mut b) { n += 1.0; raw += c; if s.is_finite() { sm += 1.0; smooth += s; radius = r.min(radius); } }
                }
                let ms = t.elapsed().as_secs_f64() * 1e3 / runs as f64;
                times.push(ms);
                shares.push(n / runs as f64);
                peers.push(peer["success_rate"].as_f64().unwrap());
                println!("{name} {preset:?} {} success {:.2} (peer {}) ratio {:.4} smooth {:.4} ({}) radius {radius} {ms:.3} ms bends {} peer {}", p.id, n / runs as f64, peer["success_rate"], raw / n / optimum, smooth / sm / optimum, sm / runs as f64, solver.bends, peer["cpu_ms_p50"]); solver.bends = 0;
            }
            times.sort_by(f64::total_cmp);
            println!("== {name} {preset:?} success {:.3} peer {:.3} median ms {:.3}", shares.iter().sum::<f64>() / 46.0, peers.iter().sum::<f64>() / 46.0, times[23]);
        }
    }
}
