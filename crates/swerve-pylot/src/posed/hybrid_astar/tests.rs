use super::*;
use crate::posed::ProblemFile;
use swerve_geom::{angle_between, math};
use swerve_planning::Unlimited;
use swerve_planning::collision::between;
use swerve_planning::testing::Capped;

fn problem(start: [f64; 3], goal: [f64; 3], obstacles: &[[f64; 4]]) -> HybridAstarProblem {
    HybridAstarProblem { id: "test".into(), start, goal, obstacles: obstacles.to_vec(), ..Default::default() }
}

pub(in crate::posed) fn config() -> HybridAstarConfig {
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

/// Two problems: a car across the way, and a turn around a block.
fn problems() -> [HybridAstarProblem; 2] {
    [
        problem([0.0, 0.0, 0.0], [35.0, 1.0, 0.0], &[[14.0, -3.0, 18.5, -1.0], [17.0, 1.5, 21.5, 3.4]]),
        problem([0.0, 0.0, 0.0], [30.0, 30.0, 0.5 * core::f64::consts::PI], &[[10.0, 6.0, 22.0, 30.0]]),
    ]
}

fn solved(problem: &HybridAstarProblem, preset: Preset) -> Solution {
    solve(problem, &config(), preset, &mut Unlimited::default())
}

/// The shared problems, if they are among the test data.
fn shared() -> Option<(ProblemFile, serde_json::Value)> {
    let text = std::fs::read_to_string(swerve_tests::data_or_skip("planner_problems.json")?).unwrap();
    Some((serde_json::from_str(&text).unwrap(), serde_json::from_str(&text).unwrap()))
}

/// Checks the path every two centimetres against the raw boxes.
fn check_free(solution: &Solution, problem: &HybridAstarProblem, config: &HybridAstarConfig) {
    let raw = Obstacles::from_boxes(&problem.obstacles.iter().map(obb).collect::<Vec<_>>());
    let outline = outline(config);
    for pair in solution.path.windows(2) {
        let at = |p: [f64; 4]| Pose2::new(p[0], p[1], p[2]);
        for k in 0..13 {
            let here = between(at(pair[0]), at(pair[1]), f64::from(k) / 12.0);
            let solid = outline.at(here.point(), [here.direction().x, here.direction().y]);
            // The chord of an arc 0.25 m long and 6 m in radius is 1.3 mm inside it.
            let near_m = raw.distance_below(&solid, Time::ZERO, 1.0);
            assert!(near_m >= config.obstacle_clearance - 2e-3, "{}: {near_m} at {here:?}", problem.id);
        }
    }
}

/// Checks for the exact goal pose, and turns no tighter than the radius.
fn check_drivable(solution: &Solution, problem: &HybridAstarProblem, config: &HybridAstarConfig) {
    let last = solution.path[solution.path.len() - 1];
    let off_m = math::hypot(last[0] - problem.goal[0], last[1] - problem.goal[1]);
    let off_rad = angle_between(last[2], problem.goal[2]).abs();
    assert!(off_m < 1e-6 && off_rad < 1e-6, "{}: {off_m} m, {off_rad} rad", problem.id);
    assert_eq!([solution.path[0][0], solution.path[0][1]], [problem.start[0], problem.start[1]]);
    assert!(solution.curvature_max <= 1.0 / config.radius + 1e-9);
    for pair in solution.path.windows(2) {
        let length_m = math::hypot(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
        let turn = angle_between(pair[0][2], pair[1][2]).abs();
        assert!(turn <= 1.01 * length_m / config.radius + 1e-6, "{}: {pair:?}", problem.id);
    }
}

#[test]
fn best_ends_in_the_goal_pose_on_a_free_path() {
    for problem in problems() {
        let solution = solved(&problem, Preset::Best);
        assert!(solution.found, "{}", solution.reason);
        check_free(&solution, &problem, &config());
        check_drivable(&solution, &problem, &config());
        assert!(solution.clearance_m >= config().obstacle_clearance);
        let straight = math::hypot(problem.goal[0], problem.goal[1]);
        assert!(solution.length_m < 1.2 * straight, "{}", solution.length_m / straight);
    }
}

#[test]
fn without_obstacles_best_is_the_shortest_path() {
    let turn = problem([0.0, 0.0, 0.0], [12.0, 12.0, 0.5 * core::f64::consts::PI], &[]);
    let solution = solved(&turn, Preset::Best);
    // An eighth of a circle, a straight, an eighth. Turns may be wider than necessary, by two per cent at most.
    let shortest_m = 3.0 * core::f64::consts::PI + 72.0_f64.sqrt();
    assert!((1.0..1.02).contains(&(solution.length_m / shortest_m)), "{}", solution.length_m / shortest_m);
    assert_eq!(solution.work, 0);
}

#[test]
fn paper_ends_near_the_goal_without_regard_to_its_heading() {
    let [across, _] = problems();
    let solution = solved(&across, Preset::Paper);
    assert!(solution.found);
    check_free(&solution, &across, &config());
    let last = solution.path[solution.path.len() - 1];
    assert!(math::hypot(last[0] - across.goal[0], last[1] - across.goal[1]) <= 1.0);
}

/// The scan is around the car's own heading, so rotating the whole problem rotates the path and changes nothing else.
/// (The grid that prunes poses is aligned with x and y: a quarter turn preserves it.)
#[test]
fn path_is_independent_of_north() {
    let boxes = [[14.0, -1.2, 15.0, 1.3]];
    let plain = solved(&problem([0.0, 0.0, 0.0], [30.0, 0.0, 0.0], &boxes), Preset::Paper);
    let quarter = 0.5 * core::f64::consts::PI;
    let turned_boxes = boxes.map(|b: [f64; 4]| [-b[3], b[0], -b[1], b[2]]);
    let turned = solved(&problem([0.0, 0.0, quarter], [0.0, 30.0, quarter], &turned_boxes), Preset::Paper);
    assert!(plain.found && turned.found);
    assert!(
        (plain.length_m - turned.length_m).abs() < 0.05 * plain.length_m,
        "{} {}",
        plain.length_m,
        turned.length_m
    );
}

#[test]
fn degenerate_problems_have_a_defined_outcome() {
    use Outcome::{Found, GoalBlocked, Invalid, NoPath, StartBlocked};
    let wall = [12.0, -30.0, 13.0, 30.0];
    let mut solver = Solver::default();
    let mut check = |problem: HybridAstarProblem, paper: Outcome, best: Outcome| {
        for (preset, expected) in [(Preset::Paper, paper), (Preset::Best, best)] {
            let mut budget = Unlimited::default();
            assert_eq!(
                solver.search(&problem, &config(), preset, &mut budget),
                expected,
                "{problem:?} {preset:?}"
            );
            assert!(
                budget.spent <= 5 * EXPANSIONS_MAX as u64 && budget.spent == solver.work(),
                "{problem:?}"
            );
        }
    };
    let origin = [0.0; 3];
    check(problem(origin, [30.0, 0.0, 0.0], &[wall]), NoPath, NoPath);
    check(problem(origin, [30.0, 0.0, 0.0], &[[3.0, -0.5, 3.5, 0.5]]), StartBlocked, StartBlocked);
    check(problem(origin, [12.5, 0.0, 0.0], &[wall]), NoPath, GoalBlocked);
    // The original rejects a path without pieces.
    check(problem(origin, origin, &[]), NoPath, Found);
    check(problem(origin, [f64::NAN, 0.0, 0.0], &[]), Invalid, Invalid);
    check(problem(origin, [30.0, 0.0, 0.0], &[[0.0, f64::INFINITY, 1.0, 1.0]]), Invalid, Invalid);
}

#[test]
fn solver_is_stateless_and_keeps_the_budget() {
    let [across, around] = problems();
    for preset in [Preset::Paper, Preset::Best] {
        let mut used = Solver::default();
        used.search(&around, &config(), preset, &mut Unlimited::default());
        used.search(&across, &config(), preset, &mut Unlimited::default());
        let fresh = solved(&across, preset);
        assert_eq!(used.solution(&across, &config()), fresh);
        for units in [1, 40, 200] {
            let mut capped = Capped::new(units);
            let outcome = used.search(&across, &config(), preset, &mut capped);
            assert!(!capped.asked_after_stop && capped.spent == used.work());
            // At most one expansion more than the remaining budget.
            assert!(capped.spent <= units + 30, "{outcome:?} {}", capped.spent);
        }
    }
}

/// Runs all shared problems, in one table with the recorded figures.
#[test]
fn shared_problems_best() {
    let Some((file, json)) = shared() else { return };
    let name = "pylot_s3_r075";
    let config = &file.configs.hybrid_astar[name];
    let mut solver = Solver::default();
    let (mut times, mut ratios, mut speedups) = (vec![], vec![], vec![]);
    for problem in &file.problems.hybrid_astar {
        #[expect(clippy::disallowed_methods, reason = "the table shows times; nothing depends on them")]
        let began = std::time::Instant::now();
        let outcome = solver.search(problem, config, Preset::Best, &mut Unlimited::default());
        let time_ms = began.elapsed().as_secs_f64() * 1e3;
        times.push(time_ms);
        let peer = &json["results"]["hybrid_astar"][name][&problem.id];
        speedups.push(peer["cpu_ms"].as_f64().unwrap() / time_ms);
        let line_m = math::hypot(problem.goal[0] - problem.start[0], problem.goal[1] - problem.start[1]);
        let Some(known) = problem.best_known_length_ratio_exact_heading else {
            println!("{}: none known, ours {outcome:?}", problem.id);
            continue;
        };
        assert_eq!(outcome, Outcome::Found, "{}", problem.id);
        let solution = solver.solution(problem, config);
        check_free(&solution, problem, config);
        check_drivable(&solution, problem, config);
        let ratio = solution.length_m / (line_m * known);
        assert!(ratio <= 1.03, "{}: {ratio}", problem.id);
        ratios.push(ratio);
    }
    for list in [&mut ratios, &mut times, &mut speedups] {
        list.sort_by(f64::total_cmp);
    }
    let at = |list: &[f64], share: f64| list[((list.len() - 1) as f64 * share) as usize];
    println!("best, {name}: goal pose reached in all {} where a way is known", ratios.len());
    println!("  length / best known p50 {:.4} worst {:.4} (goal 1.03)", at(&ratios, 0.5), at(&ratios, 1.0));
    println!(
        "  ms p50 {:.2} p99 {:.2} worst {:.2} (goals 3 and 25)",
        at(&times, 0.5),
        at(&times, 0.99),
        at(&times, 1.0)
    );
    println!("  times the peer's speed p10 {:.0} p50 {:.0}", at(&speedups, 0.1), at(&speedups, 0.5));
}

#[test]
fn shared_problems_paper() {
    let Some((file, json)) = shared() else { return };
    let mut solver = Solver::default();
    for (name, config) in &file.configs.hybrid_astar {
        let (mut ours, mut peers, mut n) = (0, 0, 0);
        for problem in &file.problems.hybrid_astar {
            let peer = &json["results"]["hybrid_astar"][name][&problem.id];
            if let Some(reached) = peer["reached"].as_i64() {
                let outcome = solver.search(problem, config, Preset::Paper, &mut Unlimited::default());
                ours += i64::from(outcome == Outcome::Found);
                peers += reached;
                n += 1;
            }
        }
        println!("paper, {name}: reaches the goal in {ours} of {n}, the peer in {peers}");
        // The coarse scan reaches few poses: problems that the reference cannot solve, ours cannot either.
        assert!((ours - peers).abs() <= n / 4, "{name}: {ours} {peers}");
    }
}
