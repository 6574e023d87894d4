//! Closed-loop drives of the vehicle model along paths of posed problems.

#![expect(clippy::print_stdout, reason = "a table for who looks")]

use swerve_geom::{Pose2, angle_between, math};
use swerve_planning::Unlimited;
use swerve_pylot::Preset;
use swerve_pylot::posed::{ProblemFile, Solution, hybrid_astar, rrt_star};
use swerve_vehicle::{Kinematic, KinematicState, VehicleParams};

/// A path by arc length.
struct Line {
    s_m: Vec<f64>,
    pose: Vec<Pose2>,
}

impl Line {
    fn new(path: &[[f64; 4]]) -> Self {
        let mut line = Self { s_m: vec![0.0], pose: vec![Pose2::new(path[0][0], path[0][1], path[0][2])] };
        for p in &path[1..] {
            let pose = Pose2::new(p[0], p[1], p[2]);
            let last = line.pose[line.pose.len() - 1];
            let gap_m = last.point().distance(pose.point());
            if gap_m > 1e-6 {
                line.s_m.push(line.s_m[line.s_m.len() - 1] + gap_m);
                line.pose.push(pose);
            }
        }
        line
    }

    fn length_m(&self) -> f64 {
        self.s_m[self.s_m.len() - 1]
    }

    /// Unwrapped heading, relative to the start, radians.
    fn heading(&self, s_m: f64) -> f64 {
        let i = self.s_m.partition_point(|&s| s <= s_m).clamp(1, self.s_m.len() - 1);
        let u = ((s_m - self.s_m[i - 1]) / (self.s_m[i] - self.s_m[i - 1])).clamp(0.0, 1.0);
        let base = self.pose[0].heading_rad;
        let turn = angle_between(self.pose[i - 1].heading_rad, self.pose[i].heading_rad);
        angle_between(base, self.pose[i - 1].heading_rad) + base + turn * u
    }

    /// Arc length and signed offset of the nearest place after `from_m`.
    fn nearest(&self, pose: Pose2, from_m: f64) -> (f64, f64) {
        let mut best = (f64::INFINITY, 0.0, 0.0);
        for i in 1..self.s_m.len() {
            if self.s_m[i] < from_m - 0.5 || self.s_m[i - 1] > from_m + 3.0 {
                continue;
            }
            let (a, b) = (self.pose[i - 1].point(), self.pose[i].point());
            let (along, to) = (b - a, pose.point() - a);
            let u = (to.dot(along) / along.norm_squared()).clamp(0.0, 1.0);
            let off = to - along * u;
            if off.norm() < best.0 {
                best = (off.norm(), self.s_m[i - 1] + u * along.norm(), along.cross(to) / along.norm());
            }
        }
        (best.1, best.2)
    }
}

/// Largest distance of the kinematic car from the path at a steady speed, metres: it steers by the mean curvature
/// around its place, with feedback on offset and heading.
fn worst_offset_m(path: &[[f64; 4]], speed_mps: f64, window_m: f64) -> f64 {
    let (line, car) = (Line::new(path), Kinematic::new(&VehicleParams::default()));
    // The wheels initially match the path.
    let first = (line.heading(0.2) - line.heading(0.0)) / 0.2;
    let steering_rad = math::atan(car.wheelbase_m * first);
    let mut state = KinematicState { pose: line.pose[0], speed_mps, steering_rad };
    let (mut s_m, mut worst_m) = (0.0, 0.0_f64);
    let dt_s = 0.01;
    let reach_m = 4.0;
    while s_m < line.length_m() - 0.05 {
        let (at_m, off_m) = line.nearest(state.pose, s_m);
        s_m = at_m;
        worst_m = worst_m.max(off_m.abs());
        let ahead_m = s_m + 0.02 * speed_mps;
        let mean =
            (line.heading(ahead_m + 0.5 * window_m) - line.heading(ahead_m - 0.5 * window_m)) / window_m;
        let off_rad = angle_between(line.heading(s_m), state.pose.heading_rad);
        let curvature = mean - off_m / (reach_m * reach_m) - 1.4 * off_rad / reach_m;
        state = car.step(state, math::atan(car.wheelbase_m * curvature), 0.0, dt_s);
    }
    worst_m
}

/// The problem file, if it is among the test data.
fn shared() -> Option<ProblemFile> {
    let path = swerve_tests::data_or_skip("planner_problems.json")?;
    let text = std::fs::read_to_string(path).expect("a text");
    Some(serde_json::from_str(&text).expect("a problem file"))
}

/// Prints a table at the path's own speed (at most 0.8 g), and at the speed of 0.8 g; at its own speed no path may be
/// left by more than 0.3 m.
fn table(name: &str, solutions: &[Solution]) {
    let (mut off, mut speeds) = (0, vec![]);
    let (mut own, mut fast): (Vec<f64>, Vec<f64>) = (vec![], vec![]);
    for solution in solutions.iter().filter(|s| s.found) {
        let end_s = solution.path[solution.path.len() - 1][3];
        let speed_mps = solution.length_m / end_s;
        speeds.push(speed_mps);
        let limit_mps = (0.8 * 9.81 / solution.curvature_max.max(1e-6)).sqrt().min(20.0);
        assert!(speed_mps <= limit_mps + 1e-6, "{}", solution.id);
        let windows_m = [1.0, 2.0, 3.0, 5.0, 8.0];
        let at = |v: f64| {
            windows_m.map(|w| worst_offset_m(&solution.path, v, w)).into_iter().fold(f64::INFINITY, f64::min)
        };
        own.push(at(speed_mps));
        fast.push(at(limit_mps));
        if own[own.len() - 1] > 0.3 {
            println!("{name} {}: {:.2} m off at {speed_mps:.1} m/s", solution.id, own[own.len() - 1]);
            off += 1;
        }
    }
    own.sort_by(f64::total_cmp);
    fast.sort_by(f64::total_cmp);
    let slowest_mps = speeds.iter().copied().fold(f64::INFINITY, f64::min);
    let over = fast.iter().filter(|m| **m > 0.3).count();
    println!(
        "{name}: off by p50 {:.3} worst {:.3} m at their own speed, the slowest {slowest_mps:.1} m/s",
        own[own.len() / 2],
        own[own.len() - 1]
    );
    println!("  at 0.8 g: p50 {:.3} m, {over} of {} further than 0.3 m", fast[fast.len() / 2], fast.len());
    assert!(off == 0, "{name}: {off}");
}

#[test]
fn car_follows_paths_of_posed_problems() {
    let Some(file) = shared() else { return };
    let config = &file.configs.rrt_star["pylot_fast"];
    let solve = |p| rrt_star::solve(p, config, Preset::Best, &mut Unlimited::default());
    table("RRT*", &file.problems.rrt_star.iter().map(solve).collect::<Vec<_>>());
    let config = &file.configs.hybrid_astar["pylot_s3_r075"];
    let solve = |p| hybrid_astar::solve(p, config, Preset::Best, &mut Unlimited::default());
    table("Hybrid A*", &file.problems.hybrid_astar.iter().map(solve).collect::<Vec<_>>());
}
