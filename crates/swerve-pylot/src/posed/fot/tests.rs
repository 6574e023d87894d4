use super::*;
use crate::posed::ProblemFile;
use proptest::prelude::*;
use serde::Deserialize;
use std::collections::BTreeMap;
use swerve_planning::fot::candidate::{Outcome, Priced};
use swerve_planning::fot::motion::Hints;

use super::driven::driven_off_m;

/// Recorded result of one run of the original.
#[derive(Deserialize)]
struct Recorded {
    success: u32,
    #[serde(default)]
    cf: f64,
    #[serde(default)]
    c_lat: f64,
    #[serde(default)]
    c_lon: f64,
    #[serde(default)]
    end_d: f64,
    #[serde(default)]
    v_end: f64,
    cpu_ms: f64,
    #[serde(default)]
    frenet_ic: Option<[f64; 5]>,
}

#[derive(Deserialize)]
struct Results {
    results: Groups,
}

#[derive(Deserialize)]
struct Groups {
    fot: BTreeMap<String, BTreeMap<String, Recorded>>,
}

/// The problem file, if it is among the test data.
fn file() -> Option<(ProblemFile, Results)> {
    let text = std::fs::read_to_string(swerve_tests::data_or_skip("planner_problems.json")?).unwrap();
    Some((serde_json::from_str(&text).unwrap(), serde_json::from_str(&text).unwrap()))
}

fn config(dt: f64, d_road_w: f64) -> FotConfig {
    FotConfig {
        max_speed: 35.0,
        max_accel: 10.0,
        max_curvature: 4.0,
        max_road_width_l: 6.0,
        max_road_width_r: 1.0,
        d_road_w,
        dt,
        maxt: 5.0,
        mint: 2.0,
        d_t_s: 0.25,
        n_s_sample: 2.0,
        obstacle_clearance: 0.5,
        kd: 1.0,
        kv: 0.1,
        ka: 0.1,
        kj: 0.01,
        kt: 0.01,
        ko: 100.0,
        klat: 1.0,
        klon: 1.0,
        num_threads: 0,
    }
}

/// A problem along x, or along an arc of the given curvature.
fn problem(curvature_1pm: f64, speed_mps: f64, y_m: f64, obstacles: Vec<[f64; 4]>) -> FotProblem {
    let waypoints = (-30..100)
        .map(|k| {
            let s = f64::from(k);
            if curvature_1pm == 0.0 {
                return [s, 0.0];
            }
            let (sin, cos) = math::sin_cos(s * curvature_1pm);
            [sin / curvature_1pm, (1.0 - cos) / curvature_1pm]
        })
        .collect();
    FotProblem {
        id: "own".to_owned(),
        waypoints,
        obstacles,
        pos: Some([0.0, y_m]),
        vel: Some([speed_mps, 0.0]),
        target_speed: speed_mps + 1.0,
        ..FotProblem::default()
    }
}

/// Result of the search, compared with the exhaustive one.
fn searched(task: &Task<'_>, lattice: &Lattice) -> Option<Candidate> {
    let want = Search::default().exhaustive(task, lattice);
    let got = match Search::default().run(task, lattice, None, &mut 0) {
        Outcome::Found(candidate) => Some(candidate),
        Outcome::Nothing | Outcome::Stopped => None,
    };
    assert_eq!(got, want);
    want
}

/// Checks that the search finds the same as the exhaustive one.
fn same_as_exhaustive(problem: &FotProblem, config: &FotConfig, preset: Preset) {
    let posed = Posed::new(problem, config, preset).unwrap();
    let task = posed.task();
    let mut lattice = Lattice::default();
    lattice.set(&posed.params, task.target_mps);
    let mut want = searched(&task, &lattice);
    if want.is_none() && preset == Preset::Best {
        let mut slower = Lattice::default();
        slower.set_slower(&lattice, posed.params.slower_speeds);
        want = searched(&task, &slower);
    }
    let solution = solve(problem, config, preset);
    assert_eq!(solution.found, want.is_some(), "{}", problem.id);
    if let Some(want) = want {
        assert_eq!(solution.cost, want.cost, "{}", problem.id);
        holds_what_it_promises(&posed, &solution);
    }
}

/// Checks collision, clearance, range and curvature on the returned path.
fn holds_what_it_promises(posed: &Posed, solution: &Solution) {
    let (id, clearance_m) = (&solution.id, posed.params.clearance_m);
    let poses: Vec<(Pose2, Time)> =
        solution.path.iter().map(|p| (Pose2::new(p[0], p[1], p[2]), Time::ZERO)).collect();
    let outline = |pose: Pose2| posed.shape.footprint(pose);
    let kept_m = posed.obstacles.path_clearance_m(outline, &poses, 0.02);
    assert!(kept_m > clearance_m - 1e-4, "{id}: {kept_m}");
    assert!((kept_m.min(CLEARANCE_CAP_M) - solution.clearance_m).abs() < 0.06, "{id}");
    if posed.preset == Preset::Paper {
        return;
    }
    // The car's limit, plus the error of measuring over half a metre of points.
    let limit_1pm = 1.05 * posed.task().checks.curvature_max_1pm + 0.03;
    assert!(solution.curvature_max < limit_1pm, "{id}: {}", solution.curvature_max);
    let slack_m = 0.01 + (posed.start.d[0] - 1.0).max(0.0).max(-6.0 - posed.start.d[0]) * 1.2;
    let mut s_m = posed.start.s[0];
    for p in &solution.path {
        let d_m;
        (s_m, d_m) = posed.line.project(Point2::new(p[0], p[1]), s_m);
        let (low, high) = posed.task().checks.offset_m;
        assert!(d_m > low - slack_m && d_m < high + slack_m, "{id}: {d_m}");
    }
}

#[test]
fn own_problems_are_solved_like_exhaustively() {
    let person = |x: f64, y: f64| [x - 0.25, y - 0.25, x + 0.25, y + 0.25];
    let car = |x: f64, y: f64| [x - 2.25, y - 0.9, x + 2.25, y + 0.9];
    for preset in [Preset::Paper, Preset::Best] {
        for (curvature, speed, y, obstacles) in [
            (0.0, 16.0, 0.0, vec![]),
            (0.0, 0.0, 0.0, vec![person(30.0, 0.0)]),
            (0.0, 16.0, 0.4, vec![person(25.0, 0.3), car(12.0, -3.6)]),
            (0.0, 12.0, 0.0, vec![car(20.0, 0.0), car(20.0, -2.5), car(20.0, -5.0), car(20.0, 2.5)]),
            (0.02, 14.0, -0.3, vec![person(22.0, 4.0), car(30.0, 5.0)]),
            (-0.05, 8.0, 0.2, vec![car(18.0, -8.0)]),
        ] {
            let problem = problem(curvature, speed, y, obstacles);
            same_as_exhaustive(&problem, &config(0.3, 0.5), preset);
            same_as_exhaustive(&problem, &config(0.2, 0.2), preset);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
    #[test]
    fn random_problems_are_solved_like_exhaustively(
        curvature in -0.03..0.03, speed in 0.0..22.0, y in -1.0..1.0,
        boxes in prop::collection::vec((5.0..60.0, -8.0..4.0, 0.2..3.0, 0.2..1.2), 0..6),
    ) {
        let boxes = boxes.into_iter().map(|(x, y, l, w): (f64, f64, f64, f64)| [x - l, y - w, x + l, y + w]).collect();
        let problem = problem(curvature, speed, y, boxes);
        for preset in [Preset::Paper, Preset::Best] {
            same_as_exhaustive(&problem, &config(0.3, 0.5), preset);
        }
    }
}

#[test]
fn invalid_problems_are_rejected_with_a_reason() {
    let good = problem(0.0, 10.0, 0.0, vec![]);
    let bad = [
        FotProblem { waypoints: vec![], ..good.clone() },
        FotProblem { waypoints: vec![[1.0, 1.0]; 5], ..good.clone() },
        FotProblem { pos: None, ..good.clone() },
        FotProblem { vel: Some([f64::NAN, 0.0]), ..good.clone() },
        FotProblem { obstacles: vec![[f64::INFINITY; 4]], ..good.clone() },
        FotProblem { target_speed: f64::NAN, ..good.clone() },
    ];
    for problem in bad {
        let solution = solve(&problem, &config(0.3, 0.5), Preset::Best);
        assert!(!solution.found && !solution.reason.is_empty(), "{solution:?}");
    }
    let none = solve(&good, &FotConfig { dt: 0.0, ..config(0.3, 0.5) }, Preset::Best);
    assert!(none.reason.starts_with("`dt` is 0, expected "), "{}", none.reason);
}

#[test]
fn recorded_problems_are_solved_like_exhaustively() {
    let Some((file, _)) = file() else { return };
    for (name, config) in &file.configs.fot {
        for (i, problem) in file.problems.fot.iter().enumerate() {
            // The whole set takes a minute; this keeps a part of each group.
            if i % (if name == "pylot_slow" { 31 } else { 3 }) != 0 {
                continue;
            }
            for preset in [Preset::Paper, Preset::Best] {
                same_as_exhaustive(problem, config, preset);
            }
        }
    }
}

/// The candidate of our lattice that the original returned, if its frame was right.
fn recorded_candidate(posed: &Posed, recorded: &Recorded) -> Option<Candidate> {
    let ic = recorded.frenet_ic?;
    let ours = [posed.start.s[0], posed.start.s[1], posed.start.d[0], posed.start.d[1], posed.start.d[2]];
    if recorded.success == 0 || ours.iter().zip(ic).any(|(a, b)| (a - b).abs() > 0.02) {
        return None;
    }
    let task = posed.task();
    let mut lattice = Lattice::default();
    lattice.set(&posed.params, task.target_mps);
    Search::default()
        .all(&task, &lattice)
        .into_iter()
        .find(|Priced { candidate: c, lateral, longitudinal }| {
            let end = c.motion.at(&posed.line, c.last_s, (1.0, 0.0));
            (lateral - recorded.c_lat).abs() < 2e-3
                && (longitudinal - recorded.c_lon).abs() < 2e-3
                && (end.d_m - recorded.end_d).abs() < 5e-3
                && (end.along_mps - recorded.v_end).abs() < 5e-3
        })
        .map(|found| found.candidate)
}

/// Costs equal the original's to the printed digits, if its frame is right (straight roads).
#[test]
fn costs_match_the_originals() {
    let Some((file, recorded)) = file() else { return };
    for name in ["pylot_fast", "pylot_slow"] {
        let mut compared = 0;
        for problem in
            file.problems.fot.iter().filter(|p| p.group.starts_with("avoid") || p.group == "random_straight")
        {
            let recorded = &recorded.results.fot[name][&problem.id];
            let posed = Posed::new(problem, &file.configs.fot[name], Preset::Paper).unwrap();
            if recorded.success == 0 {
                continue;
            }
            let candidate = recorded_candidate(&posed, recorded);
            let candidate = candidate.unwrap_or_else(|| panic!("{name} {}: not in the lattice", problem.id));
            assert!(
                (candidate.cost - recorded.cf).abs() < 0.02,
                "{name} {}: {} {}",
                problem.id,
                candidate.cost,
                recorded.cf
            );
            compared += 1;
        }
        assert!(compared > 60, "{compared}");
    }
}

/// The table of the goals: speed, success and cost next to the original's recorded figures.
#[test]
#[expect(clippy::disallowed_methods, reason = "the figures are run times; nothing is asserted of them")]
fn table() {
    let Some((file, recorded)) = file() else { return };
    for name in ["pylot_fast", "pylot_slow"] {
        let config = &file.configs.fot[name];
        for preset in [Preset::Best, Preset::Paper] {
            if name == "pylot_slow" && preset == Preset::Paper {
                continue;
            }
            let (mut ours_ms, mut theirs_ms, mut work, mut found) = (vec![], vec![], vec![], 0);
            let (mut missed, mut dearer, mut compared) = (vec![], vec![], 0);
            for problem in &file.problems.fot {
                let theirs = &recorded.results.fot[name][&problem.id];
                let started = std::time::Instant::now();
                let solution = solve(problem, config, preset);
                ours_ms.push(started.elapsed().as_secs_f64() * 1e3);
                theirs_ms.push(theirs.cpu_ms);
                work.push(solution.work as f64);
                found += usize::from(solution.found);
                if theirs.success == 1 && !solution.found {
                    missed.push(problem.id.clone());
                }
                let posed = Posed::new(problem, config, preset).unwrap();
                let task = posed.task();
                let passes = recorded_candidate(&posed, theirs)
                    .is_some_and(|c| task.checks.hold(task.line, &c.motion, c.last_s, &mut Hints::default()));
                compared += usize::from(passes);
                if solution.found && theirs.success == 1 && solution.cost > theirs.cf + 0.01 {
                    dearer.push(format!(
                        "{}{} {:.1}>{:.1}",
                        if passes { "PASSES " } else { "" },
                        problem.id,
                        solution.cost,
                        theirs.cf
                    ));
                }
                assert!(!passes || (solution.found && solution.cost <= theirs.cf + 0.01), "{}", problem.id);
            }
            let mid = |v: &mut Vec<f64>| {
                v.sort_by(f64::total_cmp);
                (v[v.len() / 2], v[v.len() * 99 / 100])
            };
            let (o, t, w) = (mid(&mut ours_ms), mid(&mut theirs_ms), mid(&mut work));
            println!(
                "{name} {preset:?}: p50 {:.3} ms p99 {:.3} (original {:.1} {:.1}, {:.0}x) work p50 {} p99 {} found {found}/{}",
                o.0,
                o.1,
                t.0,
                t.1,
                t.0 / o.0,
                w.0,
                w.1,
                file.problems.fot.len()
            );
            println!(
                "  original's path passes our check: {compared}; missed {missed:?}; dearer {}: {dearer:?}",
                dearer.len()
            );
        }
    }
}

/// The car's dynamic model can follow the paths found by `best`.
#[test]
fn car_follows_the_paths_found() {
    let Some((file, _)) = file() else { return };
    let mut worst = (0.0, String::new());
    for (name, every) in [("pylot_fast", 1), ("pylot_slow", 9)] {
        for problem in file.problems.fot.iter().step_by(every) {
            let solution = solve(problem, &file.configs.fot[name], Preset::Best);
            if solution.found {
                let off_m = driven_off_m(&solution.path);
                assert!(off_m < 0.3, "{name} {}: {off_m}", solution.id);
                if off_m > worst.0 {
                    worst = (off_m, solution.id);
                }
            }
        }
    }
    println!("furthest off its path: {worst:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
    #[test]
    fn solutions_from_far_aside_keep_the_problems_limits(
        aside in -80.0..80.0, speed in 0.0..20.0, across in -4.0..4.0, target in 2.0..25.0, max_accel in 3.0..10.0,
    ) {
        let mut config = config(0.3, 0.5);
        (config.max_accel, config.max_speed) = (max_accel, 28.0);
        let text = format!(
            r#"{{ "id": "a", "waypoints": [[0, 0], [40, 0], [90, 15], [200, 60]], "pos": [30, {aside}],
                "vel": [{speed}, {across}], "target_speed": {target}, "obstacles": [] }}"#
        );
        let problem: FotProblem = serde_json::from_str(&text).unwrap();
        let posed = Posed::new(&problem, &config, Preset::Best).unwrap();
        let task = posed.task();
        let mut lattice = Lattice::default();
        lattice.set(&posed.params, task.target_mps);
        let found = Search::default().run(&task, &lattice, None, &mut 0).found();
        if let Some(candidate) = found {
            let step_s = 0.01;
            let path: Vec<Point2> = (0..=(candidate.last_s / step_s) as usize)
                .map(|k| candidate.motion.at(&posed.line, k as f64 * step_s, posed.heading()))
                .map(|place| Point2::new(place.x_m, place.y_m))
                .collect();
            let velocity = |p: &[Point2]| (p[1] - p[0]) * (1.0 / step_s);
            let fastest = path.windows(2).map(|p| velocity(p).norm()).fold(0.0, f64::max);
            // Over a tenth of a second: between its entries the line is a chord.
            let accels = (0..path.len().saturating_sub(20)).map(|k| {
                let (a, b, c) = (path[k], path[k + 10], path[k + 20]);
                ((c - b) - (b - a)).norm() / 0.01
            });
            let hardest = accels.fold(0.0, f64::max);
            prop_assert!(fastest <= 28.0 * 1.01 && hardest <= max_accel * 1.03, "{fastest} {hardest}");
        }
    }
}
