//! A kinematic bicycle with a steering-rate limit, for tests.

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Polyline, Pose2, math};
use swerve_msg::{Command, EgoState, Plan, PlanPoint, PlanStatus, Route};

use crate::LinearPedals;

pub(crate) const DRIVE: LinearPedals = LinearPedals { accel_max_mps2: 3.0, brake_max_mps2: 8.0 };
pub(crate) const WHEELBASE_M: f64 = 2.85;
const STEERING_RATE_MAX_RADPS: f64 = 0.7;

/// Advances `ego` by `dt` under `command`, in steps of 1 ms.
pub(crate) fn drive(ego: &mut EgoState, command: Command, dt: Span) {
    let steps = dt.ns() / 1_000_000;
    let h = 1e-3;
    for _ in 0..steps {
        let turn = (command.steering_rad - ego.steering_rad)
            .clamp(-STEERING_RATE_MAX_RADPS * h, STEERING_RATE_MAX_RADPS * h);
        ego.steering_rad += turn;
        ego.accel_mps2 = DRIVE.accel_max_mps2 * command.throttle - DRIVE.brake_max_mps2 * command.brake;
        let before = ego.speed_mps;
        ego.speed_mps = (before + ego.accel_mps2 * h).max(0.0);
        let mean = 0.5 * (before + ego.speed_mps);
        ego.yaw_rate_radps = mean * math::tan(ego.steering_rad) / WHEELBASE_M;
        let (sin, cos) = math::sin_cos(ego.pose.heading_rad + 0.5 * ego.yaw_rate_radps * h);
        ego.pose = Pose2::new(
            ego.pose.x_m + mean * cos * h,
            ego.pose.y_m + mean * sin * h,
            ego.pose.heading_rad + ego.yaw_rate_radps * h,
        );
    }
    ego.stamp += dt;
}

pub(crate) fn ego(pose: Pose2, speed_mps: f64) -> EgoState {
    EgoState { pose, speed_mps, ..Default::default() }
}

/// A road of 600 m along x.
pub(crate) fn road() -> Route {
    let line = Polyline::new(&[Point2::new(-50.0, 0.0), Point2::new(550.0, 0.0)]).unwrap();
    Route::uniform(line, 6.0, 2.0)
}

/// The curve `y(x)` with slope and second derivative, driven at `speed_mps` from x = 0 at instant 0.
pub(crate) fn curve(y: impl Fn(f64) -> (f64, f64, f64), speed_mps: f64, seconds: f64) -> Plan {
    let mut points = Vec::new();
    let mut x = 0.0;
    let dt = 0.005;
    for k in 0..=(seconds / dt) as i64 {
        let (y_m, slope, bend) = y(x);
        let stretch = (1.0 + slope * slope).sqrt();
        if k % 10 == 0 {
            points.push(PlanPoint {
                at: Time::ZERO + Span::from_secs(dt * k as f64),
                pose: Pose2::new(x, y_m, math::atan(slope)),
                curvature_1pm: bend / (stretch * stretch * stretch),
                speed_mps,
                accel_mps2: 0.0,
            });
        }
        // Midpoint rule for equal steps along the curve.
        let (_, middle, _) = y(x + 0.5 * speed_mps * dt / stretch);
        x += speed_mps * dt / (1.0 + middle * middle).sqrt();
    }
    Plan { stamp: Time::ZERO, status: PlanStatus::Found, points, work: 0 }
}

/// y = 2 sin(x / 12).
pub(crate) fn slalom(x: f64) -> (f64, f64, f64) {
    let (sin, cos) = math::sin_cos(x / 12.0);
    (2.0 * sin, cos / 6.0, -sin / 72.0)
}

/// A lane change by 3.5 m to the left between x = 20 and x = 80: a quintic.
pub(crate) fn lane_change(x: f64) -> (f64, f64, f64) {
    let t = ((x - 20.0) / 60.0).clamp(0.0, 1.0);
    let y = 3.5 * t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
    let slope = 3.5 / 60.0 * 30.0 * t * t * (1.0 - t) * (1.0 - t);
    let bend = 3.5 / 3600.0 * 60.0 * t * (1.0 - t) * (1.0 - 2.0 * t);
    (y, slope, bend)
}
