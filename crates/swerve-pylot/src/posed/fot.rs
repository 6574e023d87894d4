//! Posed problems for the Frenet planner.

use swerve_core::{ParamError, Time};
use swerve_geom::{Point2, Polyline, Pose2, angle_between, math};
use swerve_planning::fot::FrenetState;
use swerve_planning::fot::candidate::Candidate;
use swerve_planning::fot::lattice::Lattice;
use swerve_planning::fot::line::{Line, smoothed};
use swerve_planning::fot::motion::Checks;
use swerve_planning::fot::search::{Search, Task};
use swerve_planning::fot::{Params, anytime, curvature_max_1pm, places};
use swerve_planning::{CollisionMode, Obstacles, Unlimited};
use swerve_vehicle::{Limits, Shape};

use super::{CLEARANCE_CAP_M, FotConfig, FotProblem, Solution, obb, path_length_m};
use crate::Preset;
use crate::fot::build_all;

/// Time step of the points of a solution's path, seconds.
const PATH_STEP_S: f64 = 0.05;

/// Smallest time step to which the points are refined, seconds.
const PATH_STEP_MIN_S: f64 = 0.004;

/// Sampling distance for a solution's clearance, metres.
pub(super) const CLEARANCE_STEP_M: f64 = 0.1;

/// Sampling distance for a clearance near the required one, metres.
const CLEARANCE_FINE_M: f64 = 0.02;

/// Distance over which a solution's curvature is measured, metres.
const CURVATURE_BASE_M: f64 = 0.5;

/// The Lincoln of the other problems with its reference point at the centre, as in these problems.
pub(super) fn centered_shape() -> Shape {
    let shape = Shape::default();
    Shape { rear_overhang_m: 0.5 * shape.length_m, ..shape }
}

/// Parameters of a posed problem. In its frame `d` is positive along heading + 90 degrees, as in ours.
fn params(config: &FotConfig) -> Params {
    Params {
        collision: CollisionMode::TimeIndexed,
        obstacle_range_m: 1e9,
        max_speed_mps: config.max_speed,
        max_accel_mps2: config.max_accel,
        max_curvature_1pm: config.max_curvature,
        left_m: config.max_road_width_r,
        right_m: config.max_road_width_l,
        lateral_step_m: config.d_road_w,
        time_step_s: config.dt,
        horizon_min_s: config.mint,
        horizon_max_s: config.maxt,
        speed_step_mps: config.d_t_s,
        speed_steps: config.n_s_sample.clamp(0.0, 1e6) as u32,
        slower_speeds: 6,
        follow_gap_m: 0.0,
        follow_time_s: 0.0,
        clearance_m: config.obstacle_clearance,
        road_margin_m: 0.0,
        tail_s: 0.0,
        weight_offset: config.kd,
        weight_lateral_speed: config.kv,
        weight_accel: config.ka,
        weight_jerk: config.kj,
        weight_time: config.kt,
        weight_obstacle: config.ko,
        weight_lateral: config.klat,
        weight_longitudinal: config.klon,
    }
}

/// Name of a parameter in the file.
fn key_in_file(ours: &str) -> String {
    let file = match ours {
        "max_speed_mps" => "max_speed",
        "max_accel_mps2" => "max_accel",
        "max_curvature_1pm" => "max_curvature",
        "left_m" => "max_road_width_r",
        "right_m" => "max_road_width_l",
        "lateral_step_m" => "d_road_w",
        "time_step_s" => "dt",
        "horizon_min_s" => "mint",
        "horizon_max_s" => "maxt",
        "speed_step_mps" => "d_t_s",
        "speed_steps" => "n_s_sample",
        "clearance_m" => "obstacle_clearance",
        "weight_offset" => "kd",
        "weight_lateral_speed" => "kv",
        "weight_accel" => "ka",
        "weight_jerk" => "kj",
        "weight_time" => "kt",
        "weight_obstacle" => "ko",
        "weight_lateral" => "klat",
        "weight_longitudinal" => "klon",
        same => same,
    };
    file.to_owned()
}

/// A problem in internal form: the owner of the data that a [`Task`] refers to.
struct Posed {
    preset: Preset,
    params: Params,
    line: Line,
    start: FrenetState,
    obstacles: Obstacles,
    shape: Shape,
    target_mps: f64,
}

impl Posed {
    /// Converts a problem; returns the error in words.
    fn new(problem: &FotProblem, config: &FotConfig, preset: Preset) -> Result<Self, String> {
        let params = params(config);
        // Every obstacle counts, at any distance.
        let ranged = Params { obstacle_range_m: Params::default().obstacle_range_m, ..params };
        ranged.validate().map_err(|e| ParamError { key: key_in_file(&e.key).into(), ..e }.to_string())?;
        let points: Vec<Point2> = problem.waypoints.iter().map(|p| Point2::new(p[0], p[1])).collect();
        let polyline = smoothed(&points).map_err(|e| format!("the waypoints: {e}"))?;
        let mut line = Line::default();
        line.set(&polyline);
        let start = frenet(problem, &polyline, &line)?;
        let mut obstacles = Obstacles::default();
        if problem.obstacles.iter().flatten().any(|x| !x.is_finite()) {
            return Err("an obstacle is not finite".to_owned());
        }
        obstacles.set_boxes(problem.obstacles.iter().map(obb));
        if !problem.target_speed.is_finite() {
            return Err("the target speed is not finite".to_owned());
        }
        let (shape, target_mps) = (centered_shape(), problem.target_speed);
        Ok(Self { preset, params, line, start, obstacles, shape, target_mps })
    }

    /// Direction of the start's velocity, or of the line at standstill (cosine, sine).
    fn heading(&self) -> (f64, f64) {
        let node = self.line.at(self.start.s[0]);
        let along = self.start.s[1] * (1.0 - node.curvature_1pm * self.start.d[0]);
        let speed = math::hypot(along, self.start.d[1]);
        if speed < 1e-3 {
            return (node.cos, node.sin);
        }
        let (c, s) = (along / speed, self.start.d[1] / speed);
        (node.cos * c - node.sin * s, node.sin * c + node.cos * s)
    }

    fn task(&self) -> Task<'_> {
        let p = &self.params;
        let best = self.preset == Preset::Best;
        let tightest = curvature_max_1pm(&Limits::default(), &self.shape);
        let checks = Checks {
            obstacles: &self.obstacles,
            shape: &self.shape,
            at: Time::ZERO,
            clearance_m: p.clearance_m,
            exact: true,
            curvature_max_1pm: if best { p.max_curvature_1pm.min(tightest) } else { p.max_curvature_1pm },
            speed_max_mps: if best { p.max_speed_mps } else { f64::INFINITY },
            accel_max_mps2: if best { p.max_accel_mps2 } else { f64::INFINITY },
            offset_m: if best { (-p.right_m, p.left_m) } else { (f64::NEG_INFINITY, f64::INFINITY) },
            smooth: best,
            drivable: None,
            heading: self.heading(),
            tail_s: 0.0,
        };
        Task {
            params: p,
            line: &self.line,
            cut_m: self.line.length_m(),
            start: self.start,
            target_mps: self.target_mps,
            checks,
        }
    }
}

/// Start state as in the original: all speed along the line, lateral velocity from the heading, no acceleration.
fn frenet(problem: &FotProblem, polyline: &Polyline, line: &Line) -> Result<FrenetState, String> {
    let finite = |values: &[f64]| {
        let all = values.iter().all(|v| v.is_finite());
        if all { Ok(()) } else { Err("the start is not finite".to_owned()) }
    };
    if let Some([s, s1, d, d1, d2]) = problem.frenet_ic {
        finite(&[s, s1, d, d1, d2])?;
        return Ok(FrenetState { s: [s, s1, 0.0], d: [d, d1, d2], d_by_s: None });
    }
    let (Some(pos), Some(vel)) = (problem.pos, problem.vel) else {
        return Err("a start needs pos and vel, or frenet_ic".to_owned());
    };
    finite(&[pos[0], pos[1], vel[0], vel[1]])?;
    let point = Point2::new(pos[0], pos[1]);
    let (s_m, d_m) = line.project(point, polyline.project(point).s_m);
    let node = line.at(s_m);
    let across_mps = node.cos * vel[1] - node.sin * vel[0];
    Ok(FrenetState { s: [s_m, math::hypot(vel[0], vel[1]), 0.0], d: [d_m, across_mps, 0.0], d_by_s: None })
}

/// Solves one problem. The caller times the call.
pub fn solve(problem: &FotProblem, config: &FotConfig, preset: Preset) -> Solution {
    let posed = match Posed::new(problem, config, preset) {
        Ok(posed) => posed,
        Err(reason) => return Solution::invalid(&problem.id, &reason),
    };
    let task = posed.task();
    let (mut search, mut lattice, mut coarse) = (Search::default(), Lattice::default(), Lattice::default());
    lattice.set(&posed.params, task.target_mps);
    let mut budget = Unlimited::default();
    let found = match preset {
        Preset::Best => anytime(&mut search, &task, &lattice, &mut coarse, &mut budget),
        Preset::Paper => {
            let any = build_all(&mut lattice, &mut budget);
            any.then(|| search.run(&task, &lattice, None, &mut 0).found()).flatten()
        }
    };
    match found {
        Some(candidate) => solution(&problem.id, &task, &candidate, budget.spent),
        None => Solution::not_found(&problem.id, "no candidate keeps all limits", budget.spent),
    }
}

/// Largest change of heading over distance between points at least [`CURVATURE_BASE_M`] apart, 1/m.
pub(super) fn curvature_max_of(path: &[[f64; 4]]) -> f64 {
    let mut last = path[0];
    let mut most = 0.0_f64;
    for &p in path {
        let moved_m = math::hypot(p[0] - last[0], p[1] - last[1]);
        if moved_m >= CURVATURE_BASE_M {
            most = most.max(angle_between(last[2], p[2]).abs() / moved_m);
            last = p;
        }
    }
    most
}

fn solution(id: &str, task: &Task<'_>, candidate: &Candidate, work: u64) -> Solution {
    let needed_m = task.checks.clearance_m;
    let (mut path, mut clearance_m) = path_of(task, candidate, PATH_STEP_S, CLEARANCE_STEP_M);
    let mut step_s = PATH_STEP_S;
    // The straight pieces between the points cut corners of the motion: if that reduces the clearance below the
    // required one, points are placed closer together.
    while clearance_m < needed_m + CLEARANCE_STEP_M * CLEARANCE_STEP_M {
        (path, clearance_m) = path_of(task, candidate, step_s, CLEARANCE_FINE_M);
        if clearance_m >= needed_m || step_s < PATH_STEP_MIN_S {
            break;
        }
        step_s *= 0.5;
    }
    Solution {
        id: id.to_owned(),
        found: true,
        work,
        length_m: path_length_m(&path),
        cost: candidate.cost,
        clearance_m: clearance_m.min(CLEARANCE_CAP_M),
        curvature_max: curvature_max_of(&path),
        path,
        ..Solution::default()
    }
}

/// The candidate's path with points at most `step_s` apart, and the clearance along the straight lines between them.
fn path_of(task: &Task<'_>, candidate: &Candidate, step_s: f64, look_m: f64) -> (Vec<[f64; 4]>, f64) {
    let mut path = Vec::new();
    let mut poses: Vec<(Pose2, Time)> = Vec::new();
    for (t_s, place) in places(task, candidate, step_s) {
        let heading_rad = math::atan2(place.sin, place.cos);
        path.push([place.x_m, place.y_m, heading_rad, t_s]);
        poses.push((Pose2::new(place.x_m, place.y_m, heading_rad), Time::ZERO));
    }
    let outline = |pose: Pose2| task.checks.shape.footprint(pose);
    let clearance_m = task.checks.obstacles.path_clearance_m(outline, &poses, look_m);
    (path, clearance_m)
}

#[cfg(test)]
mod driven;
#[cfg(test)]
mod tests;
