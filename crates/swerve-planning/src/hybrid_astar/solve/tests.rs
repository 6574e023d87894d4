use super::*;
use crate::posed::ProblemFile;
use crate::request::Unlimited;
use swerve_geom::angle_between;

fn problem(start: [f64; 3], goal: [f64; 3], obstacles: &[[f64; 4]]) -> HybridAstarProblem {
    HybridAstarProblem { id: "test".into(), start, goal, obstacles: obstacles.to_vec(), ..Default::default() }
}

fn config() -> HybridAstarConfig {
    HybridAstarConfig {
        step_size: 3.0,
        max_iterations: 500,
        completion_threshold: 1.0,
        angle_completion_threshold: 100.0,
        rad_step: 0.75,
        rad_upper_range: 4.0,
        rad_lower_range: 4.0,
        obstacle_clearance: 0.5,
        lane_width: 6.0,
        radius: 6.0,
        car_length: 4.8,
        car_width: 1.8,
    }
}

fn solve(problem: &HybridAstarProblem, preset: Preset) -> Solution {
    solve_posed(problem, &config(), preset, &mut Unlimited::default())
}

/// The shared problems, where the checkout has them.
fn shared() -> Option<(ProblemFile, serde_json::Value)> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/planner_problems.json");
    let Ok(text) = std::fs::read_to_string(path) else {
        eprintln!("skipped: no shared problems at {path}");
        return None;
    };
    Some((serde_json::from_str(&text).unwrap(), serde_json::from_str(&text).unwrap()))
}

#[test]
fn look() {
    let path = "/work/shared/data/planner_problems.json";
    let text = std::fs::read_to_string(path).unwrap();
    let file: ProblemFile = serde_json::from_str(&text).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (name, preset) in [("pylot_s3_r075", Preset::Best), ("pylot_s3_r075", Preset::Paper), ("pylot_s3_r025", Preset::Paper), ("pylot_s6_r075", Preset::Paper), ("pylot_s6_r025", Preset::Paper)] {
        let config = &file.configs.hybrid_astar[name];
        let mut solver = Solver::default();
        let mut times = vec![];
        let (mut reached, mut peers) = (0, 0);
        for p in &file.problems.hybrid_astar {
            let mut best = f64::INFINITY;
            let mut o = Outcome::NoPath;
            for _ in 0..3 {
                let t = std::time::Instant::now();
                o = solver.search(p, config, preset, &mut Unlimited::default());
                best = best.min(t.elapsed().as_secs_f64() * 1e3);
            }
            let s = if o == Outcome::Found { solver.solution(p, config) } else { Solution::default() };
            let line = swerve_geom::math::hypot(p.goal[0] - p.start[0], p.goal[1] - p.start[1]);
            times.push(best);
            let known = p.best_known_length_ratio_exact_heading;
            let peer = &json["results"]["hybrid_astar"][name][&p.id];
            reached += i32::from(s.found);
            peers += peer["reached"].as_i64().unwrap() as i32;
            let mark = match known { Some(_) if !s.found => "MISSED", Some(k) if s.length_m / line > 1.03 * k => "LONG", _ => "" };
            if preset == Preset::Best || p.group == "avoid" {
            println!("{} {o:?} {:?} ours {:.4} work {} clearance {:.3} {best:.3} ms {mark} peer reached {} {}", p.id, known, s.length_m / line, solver.work(), s.clearance_m, peer["reached"], peer["length_ratio_euclid"]);
            }
        }
        times.sort_by(f64::total_cmp);
        println!("{name} {preset:?} reached {reached} peer {peers} median {} max {}", times[times.len() / 2], times[times.len() - 1]);
    }
}
