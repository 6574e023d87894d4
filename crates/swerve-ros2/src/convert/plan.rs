//! Conversion of plans.

use swerve_core::Span;
use swerve_geom::{angle_between, math};
use swerve_msg::{Plan, PlanPoint, PlanStatus};

use super::{ConvertError, Epoch, expect_frame, pose_from_ros, pose_to_ros};
use crate::msg::autoware_planning_msgs::{Trajectory, TrajectoryPoint};
use crate::msg::builtin_interfaces::Duration;
use crate::msg::{geometry_msgs, nav_msgs};

/// Minimum mean speed from which instants are computed, m/s.
const CRAWL_MPS: f64 = 0.05;

/// Converts a plan to Autoware's trajectory of `base_link`; wheel angles are kinematic, without slip.
pub fn plan_to_ros(plan: &Plan, epoch: Epoch, map: &str, wheelbase_m: f64) -> Trajectory {
    let point = |p: &PlanPoint| TrajectoryPoint {
        time_from_start: Duration::from_ns((p.at - plan.stamp).ns()),
        pose: pose_to_ros(p.pose),
        longitudinal_velocity_mps: p.speed_mps as f32,
        lateral_velocity_mps: 0.0,
        acceleration_mps2: p.accel_mps2 as f32,
        heading_rate_rps: (p.curvature_1pm * p.speed_mps) as f32,
        front_wheel_angle_rad: math::atan(wheelbase_m * p.curvature_1pm) as f32,
        rear_wheel_angle_rad: 0.0,
    };
    Trajectory { header: epoch.header(plan.stamp, map), points: plan.points.iter().map(point).collect() }
}

/// Converts a trajectory to a plan.
///
/// Autoware leaves `time_from_start` at zero in most trajectories; if the times do not increase, they are computed
/// from the distance between points and the mean speed. The curvature is the heading change between points over
/// their distance. Points after the first standstill are dropped.
///
/// # Errors
/// If the frame is not `map`, or a point's instant cannot be determined.
pub fn plan_from_ros(trajectory: &Trajectory, epoch: Epoch, map: &str) -> Result<Plan, ConvertError> {
    expect_frame(&trajectory.header.frame_id, map)?;
    let stamp = epoch.time(trajectory.header.stamp);
    let mut plan = Plan { stamp, status: PlanStatus::Found, points: Vec::new(), work: 0 };
    let given = trajectory.points.windows(2).all(|w| w[0].time_from_start.ns() < w[1].time_from_start.ns());
    for (i, point) in trajectory.points.iter().enumerate() {
        let pose = pose_from_ros(&point.pose);
        let speed_mps = f64::from(point.longitudinal_velocity_mps);
        let mut at = stamp.saturating_add(Span::from_ns(point.time_from_start.ns()));
        let mut curvature_1pm = 0.0;
        if let Some(before) = plan.points.last_mut() {
            let way_m = before.pose.point().distance(pose.point());
            if way_m > 1e-6 {
                curvature_1pm = angle_between(before.pose.heading_rad, pose.heading_rad) / way_m;
                before.curvature_1pm = curvature_1pm;
            }
            if !given {
                let mean_mps = 0.5 * (before.speed_mps + speed_mps).abs();
                if mean_mps < CRAWL_MPS {
                    if i > 1 {
                        break;
                    }
                    return Err(ConvertError::NotLater(i));
                }
                at = before.at.saturating_add(Span::from_secs((way_m / mean_mps).max(1e-9)));
            }
        }
        let accel_mps2 = f64::from(point.acceleration_mps2);
        plan.points.push(PlanPoint { at, pose, curvature_1pm, speed_mps, accel_mps2 });
    }
    Ok(plan)
}

/// Converts a plan to `nav_msgs/Path` for visualisation; each pose is stamped with the instant at which it is
/// reached.
pub fn path_to_ros(plan: &Plan, epoch: Epoch, map: &str) -> nav_msgs::Path {
    let pose = |p: &PlanPoint| geometry_msgs::PoseStamped {
        header: epoch.header(p.at, map),
        pose: pose_to_ros(p.pose),
    };
    nav_msgs::Path { header: epoch.header(plan.stamp, map), poses: plan.points.iter().map(pose).collect() }
}
