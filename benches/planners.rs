//! Posed problems: Swerve (`best`) compared with recorded figures of the C++ planners used in the paper.
//!
//! The problem file is beside the repository, not in it; without it the benchmark prints a note and ends.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Deserialize;
use swerve::plan::{Posed, read, solve_all};
use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, now, print};
use swerve_geom::{angle_between, math};
use swerve_planning::{Budget, Progress, Unlimited};
use swerve_pylot::Preset;
use swerve_pylot::posed::{FotConfig, ProblemFile, Solution, rrt_star};

/// Recorded figures of the peers: planner, configuration, problem.
#[derive(Deserialize)]
struct Recorded {
    results: Groups,
}

type ByProblem<T> = BTreeMap<String, BTreeMap<String, T>>;

#[derive(Deserialize)]
struct Groups {
    fot: ByProblem<FotPeer>,
    rrt_star: ByProblem<RrtPeer>,
    hybrid_astar: ByProblem<HybridPeer>,
}

#[derive(Deserialize)]
struct FotPeer {
    success: u32,
    #[serde(default)]
    cf: f64,
    #[serde(default)]
    min_clearance: f64,
    /// Maximum lateral offset, as reported by the planner.
    #[serde(default)]
    max_abs_d: f64,
    #[serde(default)]
    length: f64,
    #[serde(default)]
    v_end: f64,
    #[serde(default)]
    frenet_ic: Option<[f64; 5]>,
    cpu_ms: f64,
}

impl FotPeer {
    /// True if it found a path that keeps the clearance and the limits of the road.
    fn passes(&self, config: &FotConfig) -> bool {
        self.success == 1
            && self.min_clearance >= config.obstacle_clearance
            && self.max_abs_d <= config.max_road_width_l.max(config.max_road_width_r)
    }

    /// True if its quartic from `speed_mps` keeps the acceleration limit: the peak is 1.5 times the mean.
    fn keeps_acceleration(&self, speed_mps: f64, config: &FotConfig) -> bool {
        0.75 * (self.v_end * self.v_end - speed_mps * speed_mps) <= config.max_accel * self.length
    }
}

#[derive(Deserialize)]
struct RrtPeer {
    success_rate: f64,
    cpu_ms_p50: f64,
    optimal_length: Option<f64>,
    length_ratio_p50: Option<f64>,
}

#[derive(Deserialize)]
struct HybridPeer {
    reached: Option<u32>,
    cpu_ms: f64,
}

fn problem_file() -> Option<PathBuf> {
    swerve_tests::data("planner_problems.json")
}

fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole.max(1) as f64
}

/// `p50 and p99 of Swerve, p50 of the peer`
fn times(ours: &Sample, theirs: &Sample) -> String {
    format!("{:.3} ms, p99 {:.3}; peer {:.1} ms", ours.median(), ours.at(0.99), theirs.median())
}

/// Frenet: the peer's times count where its recorded path keeps the clearance and the road; its costs count where its
/// reference frame is correct, on straight lines, and it keeps its configured acceleration limit.
fn fot(rows: &mut Rows, file: &ProblemFile, recorded: &Recorded) {
    for name in ["pylot_fast", "pylot_slow"] {
        let config = &file.configs.fot[name];
        let solutions = solve_all(file, &Posed::Fot(config), Preset::Best);
        let peers = &recorded.results.fot[name];
        let (mut ours_ms, mut theirs_ms, mut faster) = (vec![], vec![], vec![]);
        let (mut passing, mut found, mut compared) = (0, 0, 0);
        let (mut off_road, mut off_road_found) = (0, 0);
        let (mut missed, mut dearer) = (vec![], vec![]);
        let mut least_m = f64::INFINITY;
        for (problem, solution) in file.problems.fot.iter().zip(&solutions) {
            let peer = &peers[&problem.id];
            if solution.found {
                least_m = least_m.min(solution.clearance_m - config.obstacle_clearance);
            }
            if !peer.passes(config) {
                let clear = peer.success == 1 && peer.min_clearance >= config.obstacle_clearance;
                off_road += usize::from(clear);
                off_road_found += usize::from(clear && solution.found);
                continue;
            }
            passing += 1;
            found += usize::from(solution.found);
            ours_ms.push(solution.time_ms);
            theirs_ms.push(peer.cpu_ms);
            faster.push(peer.cpu_ms / solution.time_ms);
            if !solution.found {
                missed.push(problem.id.as_str());
            }
            let straight = problem.waypoints.iter().all(|p| p[1] == problem.waypoints[0][1]);
            let [x, y] = problem.vel.unwrap_or_default();
            let drivable = peer.keeps_acceleration(math::hypot(x, y), config);
            if straight && drivable && peer.frenet_ic.is_some() && solution.found {
                compared += 1;
                if solution.cost > peer.cf + 0.01 {
                    dearer.push(format!("{} {:.1} > {:.1}", problem.id, solution.cost, peer.cf));
                }
            }
        }
        let (ours, theirs, faster) = (Sample::new(ours_ms), Sample::new(theirs_ms), Sample::new(faster));
        let what = |text: &str| format!("fot {name}: {text}");
        let speed = format!("{:.1} x; {}", faster.median(), times(&ours, &theirs));
        let goal = Goal::Least(if name == "pylot_slow" { 400.0 } else { 60.0 });
        rows.row(&what("times the peer's speed"), faster.median(), &speed, goal);
        let reads = format!("{found} of {passing}; {off_road_found} of {off_road} where it leaves the road");
        rows.row(
            &what("found where the peer's path passes"),
            share(found, passing),
            &reads,
            Goal::Least(1.0),
        );
        let reads = format!("{} of {compared} dearer", dearer.len());
        rows.row(
            &what("cost at most the peer's, straight lines"),
            dearer.len() as f64,
            &reads,
            Goal::Most(0.0),
        );
        let reads = format!("{least_m:+.3} m over the required");
        rows.row(&what("least clearance"), least_m, &reads, Goal::Least(-0.001));
        if !missed.is_empty() || !dearer.is_empty() {
            print(&format!("  not found: {}; dearer: {}", missed.join(", "), dearer.join(", ")));
        }
    }
}

/// Budget that ends at a wall-clock instant.
struct UntilClock(std::time::Instant);

impl Budget for UntilClock {
    fn spend(&mut self, _: u64) -> Progress {
        if now() < self.0 { Progress::Continue } else { Progress::Stop }
    }
}

/// Termination of an RRT* search.
#[derive(Clone, Copy, PartialEq)]
enum Cut {
    Iterations,
    Millisecond,
}

fn rrt_star(rows: &mut Rows, file: &ProblemFile, recorded: &Recorded) {
    let config = &file.configs.rrt_star["pylot_fast"];
    let peers = &recorded.results.rrt_star["pylot_fast"];
    for (cut, label) in
        [(Cut::Iterations, "counted iterations"), (Cut::Millisecond, "stopped by the clock at 1 ms")]
    {
        let mut solver = rrt_star::Solver::default();
        if cut == Cut::Millisecond {
            solver.iterations_max = u64::MAX;
        }
        let (mut ours_ms, mut theirs_ms, mut faster, mut ratios) = (vec![], vec![], vec![], vec![]);
        let (mut solvable, mut found) = (0, 0);
        let (mut peer_found, mut peer_ratios) = (0.0, vec![]);
        for problem in &file.problems.rrt_star {
            let peer = &peers[&problem.id];
            for seed in 0..5 {
                solver.seed = seed;
                let began = now();
                let outcome = match cut {
                    Cut::Iterations => {
                        solver.search(problem, config, Preset::Best, &mut Unlimited::default())
                    }
                    Cut::Millisecond => {
                        let end = began + std::time::Duration::from_millis(1);
                        solver.search(problem, config, Preset::Best, &mut UntilClock(end))
                    }
                };
                let ms = began.elapsed().as_secs_f64() * 1e3;
                let Some(optimum_m) = peer.optimal_length else { continue };
                ours_ms.push(ms);
                theirs_ms.push(peer.cpu_ms_p50);
                faster.push(peer.cpu_ms_p50 / ms);
                solvable += 1;
                peer_found += peer.success_rate;
                peer_ratios.extend(peer.length_ratio_p50);
                if outcome.reason().is_empty() {
                    found += 1;
                    ratios.push(solver.length_m() / optimum_m);
                }
            }
        }
        let (ours, theirs, faster) = (Sample::new(ours_ms), Sample::new(theirs_ms), Sample::new(faster));
        let what = |text: &str| format!("rrt_star, {label}: {text}");
        let speed = format!("{:.1} x; {}", faster.median(), times(&ours, &theirs));
        rows.row(&what("times the peer's speed (fast)"), faster.median(), &speed, Goal::Least(30.0));
        let reads =
            format!("{:.3}; peer {:.3}, OMPL 0.912", share(found, solvable), peer_found / solvable as f64);
        rows.row(&what("success"), share(found, solvable), &reads, Goal::Least(0.93));
        let ratios = Sample::new(ratios);
        let reads =
            format!("{:.4}; peer {:.3}, OMPL 1.005", ratios.median(), Sample::new(peer_ratios).median());
        rows.row(&what("median length over the optimum"), ratios.median(), &reads, Goal::Most(1.005));
    }
}

fn hybrid_astar(rows: &mut Rows, file: &ProblemFile, recorded: &Recorded) {
    let name = "pylot_s3_r075";
    let config = &file.configs.hybrid_astar[name];
    let solutions = solve_all(file, &Posed::HybridAstar(config), Preset::Best);
    let peers = &recorded.results.hybrid_astar[name];
    let (mut ours_ms, mut theirs_ms, mut ratios) = (vec![], vec![], vec![]);
    let (mut known, mut exact, mut peer_reached) = (0, 0, 0);
    for (problem, solution) in file.problems.hybrid_astar.iter().zip(&solutions) {
        let peer = &peers[&problem.id];
        ours_ms.push(solution.time_ms);
        theirs_ms.push(peer.cpu_ms);
        let Some(best) = problem.best_known_length_ratio_exact_heading else { continue };
        known += 1;
        peer_reached += peer.reached.unwrap_or(0);
        if ends_in(solution, problem.goal) {
            exact += 1;
            let line_m = math::hypot(problem.goal[0] - problem.start[0], problem.goal[1] - problem.start[1]);
            ratios.push(solution.length_m / (line_m * best));
        }
    }
    let faster = Sample::new(theirs_ms.iter().zip(&ours_ms).map(|(theirs, ours)| theirs / ours).collect());
    let (ours, theirs) = (Sample::new(ours_ms), Sample::new(theirs_ms));
    let what = |text: &str| format!("hybrid_astar: {text}");
    let speed = format!("{:.1} x; {}", faster.median(), times(&ours, &theirs));
    rows.row(&what("times the peer's speed"), faster.median(), &speed, Goal::Least(40.0));
    let reads = format!("{exact} of {known}; peer near it in {peer_reached}");
    rows.row(&what("exact goal pose where a way is known"), share(exact, known), &reads, Goal::Least(1.0));
    let ratios = Sample::new(ratios);
    let reads = format!("{:.4}, p50 {:.4}", ratios.at(1.0), ratios.median());
    rows.row(&what("longest over the best known"), ratios.at(1.0), &reads, Goal::Most(1.03));
    rows.row(&what("median"), ours.median(), &format!("{:.2} ms", ours.median()), Goal::Most(3.0));
    rows.row(&what("p99"), ours.at(0.99), &format!("{:.2} ms", ours.at(0.99)), Goal::Most(25.0));
}

fn ends_in(solution: &Solution, goal: [f64; 3]) -> bool {
    solution.path.last().is_some_and(|end| {
        math::hypot(end[0] - goal[0], end[1] - goal[1]) < 1e-3 && angle_between(end[2], goal[2]).abs() < 1e-3
    })
}

fn main() -> anyhow::Result<()> {
    if !is_asked_to_measure() {
        return Ok(());
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "planners");
    match problem_file() {
        None => rows.skipped("posed problems", "no planner_problems.json among the test data"),
        Some(path) => {
            let file = read(&path)?;
            let recorded: Recorded = serde_json::from_str(&std::fs::read_to_string(&path)?)?;
            fot(&mut rows, &file, &recorded);
            rrt_star(&mut rows, &file, &recorded);
            hybrid_astar(&mut rows, &file, &recorded);
        }
    }
    rows.finish();
    Ok(())
}
