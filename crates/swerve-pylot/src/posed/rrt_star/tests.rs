use super::*;
use crate::posed::{AxisBox, ProblemFile};
use swerve_geom::math;
use swerve_planning::Unlimited;
use swerve_planning::testing::Capped;

fn config() -> RrtStarConfig {
    RrtStarConfig {
        step_size: 0.5,
        max_iterations: 2000,
        end_dist_threshold: 2.0,
        obstacle_clearance: 1.5,
        lane_width: 5.0,
    }
}

fn problem(start: [f64; 2], goal: [f64; 2], obstacles: &[AxisBox]) -> RrtStarProblem {
    RrtStarProblem { id: "test".into(), start, goal, obstacles: obstacles.to_vec(), ..Default::default() }
}

/// Two problems: a slalom, and a single box.
fn problems() -> [RrtStarProblem; 2] {
    [
        problem(
            [0.0, 0.0],
            [60.0, 0.0],
            &[[15.0, -1.0, 17.0, 3.0], [30.0, -4.0, 31.0, 0.5], [44.0, -0.5, 47.0, 1.0]],
        ),
        problem([0.0, 0.0], [30.0, 0.0], &[[13.75, -0.75, 14.25, 1.95]]),
    ]
}

/// The shared problems, if they are among the test data.
fn shared() -> Option<(ProblemFile, serde_json::Value)> {
    let text = std::fs::read_to_string(swerve_tests::data_or_skip("planner_problems.json")?).unwrap();
    Some((serde_json::from_str(&text).unwrap(), serde_json::from_str(&text).unwrap()))
}

/// Length of the shortest path, by Dijkstra's algorithm over all mutually visible corners. `None` without a path.
fn optimum_m(problem: &RrtStarProblem, config: &RrtStarConfig) -> Option<f64> {
    let at = |p: [f64; 2]| Pose2::new(p[0], p[1], 0.0);
    let bounds = around(&[at(problem.start), at(problem.goal)], config.lane_width);
    let mut boxes = Boxes::default();
    boxes.set(&problem.obstacles, config.obstacle_clearance, bounds);
    let mut places = Vec::new();
    boxes.corners(&mut places);
    places.insert(0, at(problem.start));
    places.push(at(problem.goal));
    let mut lengths = vec![f64::INFINITY; places.len()];
    lengths[0] = 0.0;
    let mut open: Vec<usize> = (0..places.len()).collect();
    while let Some(i) = (0..open.len()).min_by(|&a, &b| lengths[open[a]].total_cmp(&lengths[open[b]])) {
        let from = open.swap_remove(i);
        for &to in &open {
            let (a, b) = (places[from].point(), places[to].point());
            if lengths[from].is_finite() && boxes.segment_free(a, b) {
                lengths[to] = lengths[to].min(lengths[from] + a.distance(b));
            }
        }
    }
    Some(lengths[places.len() - 1]).filter(|l| l.is_finite())
}

/// Checks the path every centimetre against the raw boxes, grown as boxes.
fn check_free(solution: &Solution, problem: &RrtStarProblem, config: &RrtStarConfig) {
    for pair in solution.path.windows(2) {
        let n = (math::hypot(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]) / 0.01).ceil().max(1.0);
        // Between two points of an arc of curvature k the chord deviates by at most length² k / 8 = 1.9 mm.
        let chord_m = 2e-3 * f64::from(u8::from(solution.curvature_max > 0.0));
        let by = config.obstacle_clearance - chord_m;
        for k in 0..=n as usize {
            let u = k as f64 / n;
            let (x, y) =
                (pair[0][0] + (pair[1][0] - pair[0][0]) * u, pair[0][1] + (pair[1][1] - pair[0][1]) * u);
            for b in &problem.obstacles {
                let inside = b[0] - by < x && x < b[2] + by && b[1] - by < y && y < b[3] + by;
                assert!(!inside, "{}: ({x}, {y}) in {b:?}", problem.id);
            }
        }
    }
}

fn check_steerable(solution: &Solution, problem: &RrtStarProblem) {
    let (first, last) = (solution.path[0], solution.path[solution.path.len() - 1]);
    let off = |p: [f64; 4], q: [f64; 2]| math::hypot(p[0] - q[0], p[1] - q[1]);
    assert!(off(first, problem.start) < 1e-9 && off(last, problem.goal) < 1e-6, "{}", problem.id);
    assert!(solution.curvature_max <= 1.0 / 4.1, "{}: {}", problem.id, solution.curvature_max);
    for pair in solution.path.windows(2) {
        let length_m = off(pair[0], [pair[1][0], pair[1][1]]);
        let turn = swerve_geom::angle_between(pair[0][2], pair[1][2]).abs();
        assert!(turn <= 1.01 * solution.curvature_max * length_m + 1e-6, "{}: {pair:?}", problem.id);
        assert!(pair[1][3] > pair[0][3] || length_m < 1e-9, "{}: {pair:?}", problem.id);
    }
}

#[test]
fn best_paths_are_short_free_and_can_be_steered() {
    for problem in problems() {
        let solution = solve(&problem, &config(), Preset::Best, &mut Unlimited::default());
        assert!(solution.found, "{}", solution.reason);
        check_free(&solution, &problem, &config());
        check_steerable(&solution, &problem);
        let optimum = optimum_m(&problem, &config()).unwrap();
        assert!(
            solution.length_m >= optimum && solution.length_m < 1.02 * optimum,
            "{}",
            solution.length_m / optimum
        );
        assert!(solution.clearance_m >= config().obstacle_clearance);
    }
}

/// Without guides and help from the corners, the tree alone converges to the optimum.
#[test]
fn the_tree_converges_to_the_optimum() {
    for problem in problems() {
        let at = |p: [f64; 2]| Pose2::new(p[0], p[1], 0.0);
        let (start, goal) = (at(problem.start), at(problem.goal));
        let bounds = around(&[start, goal], config().lane_width);
        let mut boxes = Boxes::default();
        boxes.set(&problem.obstacles, config().obstacle_clearance, bounds);
        let optimum = optimum_m(&problem, &config()).unwrap();
        let length = |iterations_max: u64| {
            let growth = Growth {
                step_m: 5.0,
                iterations_max,
                goal_share: 0.05,
                guide_share: 0.0,
                gamma_m2: gamma_m2(bounds),
                radius_max_m: 10.0,
                until: Until::Spent,
            };
            let mut tree = Tree::default();
            let mut rng = Rng::keyed(3, "test", &[]);
            let aim = Aim { start, goal, bounds, guides: &[] };
            tree.grow(&boxes, &growth, &aim, &mut rng, &mut Unlimited::default());
            tree.best_m() / optimum
        };
        let (few, many) = (length(300), length(5000));
        assert!(many <= few && (1.0 - 1e-9..1.003).contains(&many), "{few} {many}");
    }
}

#[test]
fn paper_ends_near_the_goal_on_free_lines() {
    for problem in problems() {
        let solution = solve(&problem, &config(), Preset::Paper, &mut Unlimited::default());
        if solution.found {
            check_free(&solution, &problem, &config());
            let last = solution.path[solution.path.len() - 1];
            assert!(math::hypot(last[0] - problem.goal[0], last[1] - problem.goal[1]) < 2.0);
            assert!(solution.path.windows(2).all(|p| path_length_m(p) <= 0.5 + 1e-9));
        }
    }
    assert!(solve(&problems()[1], &config(), Preset::Paper, &mut Unlimited::default()).found);
}

#[test]
fn degenerate_problems_have_a_defined_outcome() {
    let wall = [10.0, -20.0, 11.0, 20.0];
    let mut solver = Solver::default();
    let mut check = |problem: RrtStarProblem, paper: Outcome, best: Outcome| {
        for (preset, expected) in [(Preset::Paper, paper), (Preset::Best, best)] {
            let mut budget = Unlimited::default();
            assert_eq!(
                solver.search(&problem, &config(), preset, &mut budget),
                expected,
                "{problem:?} {preset:?}"
            );
            assert!(budget.spent <= 2000 && budget.spent == solver.work());
        }
    };
    use Outcome::{Found, GoalBlocked, Invalid, NoPath, StartBlocked};
    check(problem([0.0, 0.0], [30.0, 0.0], &[wall]), NoPath, NoPath);
    check(problem([10.5, 0.0], [30.0, 0.0], &[wall]), StartBlocked, StartBlocked);
    check(problem([0.0, 0.0], [10.5, 0.0], &[wall]), NoPath, GoalBlocked);
    check(problem([0.0, 0.0], [0.0, 0.0], &[]), Found, Found);
    check(problem([0.0, 0.0], [0.0, 0.0], &[wall]), Found, Found);
    check(problem([f64::NAN, 0.0], [0.0, 0.0], &[]), Invalid, Invalid);
    check(problem([0.0, 0.0], [30.0, 0.0], &[[f64::INFINITY; 4]]), Invalid, Invalid);
}

#[test]
fn result_depends_on_the_seed_alone_and_keeps_the_budget() {
    let [slalom, _] = problems();
    let path = |seed: u64, used: bool, preset: Preset| {
        let mut solver = Solver { seed, ..Solver::default() };
        if used {
            solver.search(&problems()[1], &config(), preset, &mut Unlimited::default());
        }
        solver.search(&slalom, &config(), preset, &mut Unlimited::default());
        solver.solution(&slalom, preset).path
    };
    for preset in [Preset::Paper, Preset::Best] {
        assert_eq!(path(4, false, preset), path(4, true, preset));
    }
    assert_ne!(path(4, false, Preset::Paper), path(5, false, Preset::Paper));
    let mut solver = Solver::default();
    let mut before_m = f64::INFINITY;
    for units in [60, 120, 500] {
        let mut capped = Capped::new(units);
        let outcome = solver.search(&slalom, &config(), Preset::Best, &mut capped);
        assert!(capped.spent <= units && !capped.asked_after_stop);
        if outcome == Outcome::Found {
            assert!(solver.length_m() <= before_m + 0.1);
            before_m = solver.length_m();
        }
    }
    assert!(before_m.is_finite());
}

/// A budget ends an unbounded search exactly where an iteration limit would.
#[test]
fn budget_ends_a_search_like_counted_iterations() {
    for problem in &problems() {
        let length_m = |iterations_max: u64, units: u64| {
            let mut solver = Solver { iterations_max, ..Solver::default() };
            let outcome = solver.search(problem, &config(), Preset::Best, &mut Capped::new(units));
            (outcome, solver.work(), solver.length_m())
        };
        assert_eq!(length_m(u64::MAX, 200), length_m(200, u64::MAX), "{}", problem.id);
    }
}

/// The optima in the file match the visibility graph, and the original's success rates are reproduced.
#[test]
fn shared_problems_paper() {
    let Some((file, json)) = shared() else { return };
    let mut solver = Solver::default();
    for name in ["pylot_fast", "pylot_slow"] {
        let config = &file.configs.rrt_star[name];
        let (mut ours, mut peers, mut runs) = (0.0, 0.0, 0.0);
        for problem in &file.problems.rrt_star {
            let peer = &json["results"]["rrt_star"][name][&problem.id];
            let (known, optimum) = (peer["optimal_length"].as_f64(), optimum_m(problem, config));
            assert_eq!(known.is_some(), optimum.is_some(), "{}", problem.id);
            if let (Some(a), Some(b)) = (known, optimum) {
                assert!((a - b).abs() < 2e-3, "{}: {a} {b}", problem.id);
            }
            let (weight, seeds) = (peer["runs"].as_f64().unwrap(), 6);
            let mut found = 0;
            for seed in 0..seeds {
                solver.seed = seed;
                let outcome = solver.search(problem, config, Preset::Paper, &mut Unlimited::default());
                found += u64::from(outcome == Outcome::Found);
            }
            ours += weight * found as f64 / seeds as f64;
            peers += weight * peer["success_rate"].as_f64().unwrap();
            runs += weight;
        }
        let (ours, peers): (f64, f64) = (ours / runs, peers / runs);
        println!("paper, {name}: reaches the goal in {ours:.3} of runs, the peer in {peers:.3}");
        assert!((ours - peers).abs() < 0.08, "{name}: {ours} {peers}");
    }
}

/// Runs `best` on all shared problems, in one table with the recorded figures.
#[test]
fn shared_problems_best() {
    let Some((file, json)) = shared() else { return };
    let name = "pylot_fast";
    let config = &file.configs.rrt_star[name];
    let mut solver = Solver::default();
    let (mut found, mut solvable, mut ratios, mut times, mut speedups) = (0, 0, vec![], vec![], vec![]);
    for problem in &file.problems.rrt_star {
        let peer = &json["results"]["rrt_star"][name][&problem.id];
        let optimum = peer["optimal_length"].as_f64();
        for seed in 0..5 {
            solver.seed = seed;
            #[expect(clippy::disallowed_methods, reason = "the table shows times; nothing depends on them")]
            let began = std::time::Instant::now();
            let outcome = solver.search(problem, config, Preset::Best, &mut Unlimited::default());
            let time_ms = began.elapsed().as_secs_f64() * 1e3;
            times.push(time_ms);
            speedups.push(peer["cpu_ms_p50"].as_f64().unwrap() / time_ms);
            let Some(optimum) = optimum else {
                assert_eq!(outcome, Outcome::NoPath, "{}", problem.id);
                continue;
            };
            solvable += 1;
            if outcome != Outcome::Found {
                println!("{}: {}", problem.id, outcome.reason());
                continue;
            }
            found += 1;
            let solution = solver.solution(problem, Preset::Best);
            check_free(&solution, problem, config);
            check_steerable(&solution, problem);
            ratios.push(solution.length_m / optimum);
            if solution.length_m > 1.005 * optimum && seed == 0 {
                println!("{}: {:.4} of the optimum", problem.id, solution.length_m / optimum);
            }
        }
    }
    for list in [&mut ratios, &mut times, &mut speedups] {
        list.sort_by(f64::total_cmp);
    }
    let at = |list: &[f64], share: f64| list[((list.len() - 1) as f64 * share) as usize];
    let success = f64::from(found) / f64::from(solvable);
    println!("best, {name}, {ITERATIONS_PER_MS} iterations: success {success:.3} (goal 0.93)");
    println!(
        "  length / optimum p50 {:.4} p90 {:.4} p99 {:.4} (goal p50 1.005)",
        at(&ratios, 0.5),
        at(&ratios, 0.9),
        at(&ratios, 0.99)
    );
    println!("  ms p50 {:.3} p99 {:.3} (goal 1)", at(&times, 0.5), at(&times, 0.99));
    println!(
        "  times the peer's speed p10 {:.1} p50 {:.1} (goal p50 10)",
        at(&speedups, 0.1),
        at(&speedups, 0.5)
    );
    assert!(success >= 0.93);
    assert!(at(&ratios, 0.5) <= 1.005);
}
