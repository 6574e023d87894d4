//! Problems of a road, for any planner: a line to follow, boxes in the way, a target speed.

use swerve_core::{Span, Time};
use swerve_geom::{FrenetPoint, Point2, Polyline, Pose2, Vector2};
use swerve_msg::{
    ActorId, ActorKind, EgoState, Extent, Plan, PlanPoint, PlanStatus, PredictedPose, Prediction, Route,
};
use swerve_planning::fot::Params;
use swerve_planning::fot::line::smoothed;
use swerve_planning::{Obstacles, Request};
use swerve_vehicle::{Limits, Shape};

use super::fot::{CLEARANCE_STEP_M, centered_shape, curvature_max_of};
use super::{AxisBox, CLEARANCE_CAP_M, FotConfig, FotProblem, Solution, obb, path_length_m};

/// Time between the predicted poses of a box, seconds.
const STEP_S: f64 = 0.1;

/// Number of predicted steps: 10 s.
const STEPS: i32 = 100;

/// A road problem in the form of a planner's request: the owner of the data that the request refers to.
pub struct RoadProblem {
    route: Route,
    predictions: Vec<Prediction>,
    start: EgoState,
    shape: Shape,
    limits: Limits,
    target_speed_mps: f64,
}

impl RoadProblem {
    /// Converts a problem. The road extends half the car's width beyond the lateral range of `range`, or of FOT's
    /// default parameters.
    ///
    /// # Errors
    /// The problem's error in words.
    pub fn new(problem: &FotProblem, range: Option<&FotConfig>) -> Result<Self, String> {
        let shape = centered_shape();
        let points: Vec<Point2> = problem.waypoints.iter().map(|p| Point2::new(p[0], p[1])).collect();
        let line = smoothed(&points).map_err(|error| format!("the waypoints: {error}"))?;
        let start = start(problem, &line)?;
        if problem.obstacles.iter().flatten().any(|x| !x.is_finite()) {
            return Err("an obstacle is not finite".to_owned());
        }
        if !problem.target_speed.is_finite() {
            return Err("the target speed is not finite".to_owned());
        }
        let defaults = Params::default();
        let [left_m, right_m] = range
            .map_or([defaults.left_m, defaults.right_m], |of| [of.max_road_width_r, of.max_road_width_l])
            .map(|offset_m| offset_m + 0.5 * shape.width_m);
        if !(left_m > 0.0 && right_m > 0.0 && left_m.is_finite() && right_m.is_finite()) {
            return Err("the road has no width".to_owned());
        }
        Ok(Self {
            route: Route::uniform(line, left_m, right_m),
            predictions: (1..).zip(&problem.obstacles).map(|(k, b)| standing(ActorId(k), b)).collect(),
            start,
            shape,
            limits: Limits::default(),
            target_speed_mps: problem.target_speed,
        })
    }

    /// The request to a planner.
    pub fn request(&self) -> Request<'_> {
        Request {
            stamp: self.start.stamp,
            start: self.start,
            route: &self.route,
            along_m: None,
            target_speed_mps: self.target_speed_mps,
            overtake_max_m: f64::INFINITY,
            predictions: &self.predictions,
            changed_lately: &[],
            shape: &self.shape,
            limits: &self.limits,
            previous: None,
            seed: 0,
        }
    }

    /// Result of a plan. Its cost is its length.
    pub fn solution(&self, problem: &FotProblem, plan: &Plan) -> Solution {
        let solved = matches!(plan.status, PlanStatus::Found | PlanStatus::Route | PlanStatus::Comfortable);
        if !solved || plan.points.len() < 2 {
            let reason = format!("the plan's status is {:?}", plan.status);
            return Solution::not_found(&problem.id, &reason, plan.work);
        }
        let mut obstacles = Obstacles::default();
        obstacles.set_boxes(problem.obstacles.iter().map(obb));
        let poses: Vec<(Pose2, Time)> = plan.points.iter().map(|p| (p.pose, Time::ZERO)).collect();
        let clearance_m =
            obstacles.path_clearance_m(|pose| self.shape.footprint(pose), &poses, CLEARANCE_STEP_M);
        let point =
            |p: &PlanPoint| [p.pose.x_m, p.pose.y_m, p.pose.heading_rad, (p.at - self.start.stamp).as_secs()];
        let path: Vec<[f64; 4]> = plan.points.iter().map(point).collect();
        let length_m = path_length_m(&path);
        Solution {
            id: problem.id.clone(),
            found: true,
            work: plan.work,
            length_m,
            cost: length_m,
            clearance_m: clearance_m.min(CLEARANCE_CAP_M),
            curvature_max: curvature_max_of(&path),
            path,
            ..Solution::default()
        }
    }
}

/// Start state: at the problem's position, in the direction of its velocity or, at standstill, of the line.
fn start(problem: &FotProblem, line: &Polyline) -> Result<EgoState, String> {
    let (point, velocity_mps) = match (problem.frenet_ic, problem.pos, problem.vel) {
        (Some([s_m, s_mps, d_m, d_mps, _]), ..) => {
            let at = line.at(s_m);
            let along_mps = s_mps * (1.0 - at.curvature_1pm * d_m);
            let along = at.pose.direction();
            let velocity_mps = along * along_mps + Vector2::new(-along.y, along.x) * d_mps;
            (line.to_map(FrenetPoint { s_m, d_m }), velocity_mps)
        }
        (None, Some(pos), Some(vel)) => (Point2::new(pos[0], pos[1]), Vector2::new(vel[0], vel[1])),
        _ => return Err("a start needs pos and vel, or frenet_ic".to_owned()),
    };
    let speed_mps = velocity_mps.norm();
    if ![point.x_m, point.y_m, speed_mps].iter().all(|value| value.is_finite()) {
        return Err("the start is not finite".to_owned());
    }
    let heading_rad = match speed_mps > 1e-3 {
        true => velocity_mps.heading(),
        false => line.at(line.project(point).s_m).pose.heading_rad,
    };
    Ok(EgoState { pose: Pose2::new(point.x_m, point.y_m, heading_rad), speed_mps, ..EgoState::default() })
}

/// Prediction of a box: it stays in place.
fn standing(id: ActorId, b: &AxisBox) -> Prediction {
    let pose = Pose2::new(0.5 * (b[0] + b[2]), 0.5 * (b[1] + b[3]), 0.0);
    let at = |k: i32| PredictedPose { at: Time::ZERO + Span::from_secs(STEP_S * f64::from(k)), pose };
    let extent = Extent { length_m: b[2] - b[0], width_m: b[3] - b[1], height_m: 1.8 };
    Prediction::single(id, ActorKind::Static, extent, (0..=STEPS).map(at).collect())
}
