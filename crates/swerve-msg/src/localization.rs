//! Results of localization: scan matches, pose quality, and the local pose for control.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Odom, Pose2, math};

/// Position and heading of the ego by lidar scan matching: against a map, or against its previous turns.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PoseMatch {
    /// Instant of the pose: the end of the turn.
    pub stamp: Time,
    /// Ego origin in the map, metres.
    pub at_m: [f64; 3],
    /// Heading, radians.
    pub heading_rad: f64,
    /// Covariance of the horizontal position: xx, xy, yy, m². Large along directions that the scan does not
    /// constrain.
    pub covariance_m2: [f64; 3],
    /// Standard deviation of the height, metres.
    pub height_sigma_m: f64,
    /// Standard deviation of the heading, radians.
    pub heading_sigma_rad: f64,
}

/// Quality of the pose that localization reports.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PoseQuality {
    /// Instant of the pose.
    pub stamp: Time,
    /// Usability of the pose for driving.
    pub mode: PoseMode,
    /// Covariance of x (m), y (m) and heading (rad): xx, xy, yy, xh, yh, hh.
    pub covariance: [f64; 6],
}

/// Usability of a pose for driving.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseMode {
    /// Position measurements arrive and are accepted.
    Good,
    /// Dead reckoning by inertial measurements and wheel odometry for now.
    Coasting,
    /// Unusable: no pose is reported.
    #[default]
    Lost,
    /// Position measurements are accepted, but their noise is measured to be far above the reported one.
    Noisy,
}

impl PoseMode {
    /// Position in the order from best to worst: good, noisy, coasting, lost.
    pub const fn rank(self) -> u8 {
        match self {
            Self::Good => 0,
            Self::Noisy => 1,
            Self::Coasting => 2,
            Self::Lost => 3,
        }
    }
}

/// Pose of the ego for control in the odometry frame of ROS REP 105, with the transform to the map.
///
/// `odom` is continuous and follows the motion of the car. Corrections by satellite fixes or scan matches change
/// only `map_from_odom`, at a bounded rate.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct LocalPose {
    /// Instant of the pose.
    pub stamp: Time,
    /// Ego origin in the odometry frame.
    pub odom: Pose2<Odom>,
    /// Origin of the odometry frame in the map.
    pub map_from_odom: Pose2,
}

impl LocalPose {
    /// Builds the message from the ego's pose in the odometry frame (`odom`) and in the map (`map`).
    pub fn new(stamp: Time, odom: Pose2<Odom>, map: Pose2) -> Self {
        let turn = Pose2::<swerve_geom::Map>::new(0.0, 0.0, map.heading_rad - odom.heading_rad);
        let origin = map.point() - (turn.from_local(odom.point()) - turn.point());
        Self { stamp, odom, map_from_odom: Pose2::new(origin.x_m, origin.y_m, turn.heading_rad) }
    }

    /// Transforms a pose from the map to the odometry frame.
    pub fn to_odom(&self, map: Pose2) -> Pose2<Odom> {
        let point = self.map_from_odom.to_local::<Odom>(map.point());
        Pose2::new(point.x_m, point.y_m, map.heading_rad - self.map_from_odom.heading_rad)
    }

    /// Transforms a pose from the odometry frame to the map.
    pub fn to_map(&self, odom: Pose2<Odom>) -> Pose2 {
        let point = self.map_from_odom.from_local(odom.point());
        Pose2::new(point.x_m, point.y_m, odom.heading_rad + self.map_from_odom.heading_rad)
    }
}

impl PoseQuality {
    /// Largest standard deviation of the horizontal position over all directions, metres.
    pub fn sigma_m(&self) -> f64 {
        let [xx, xy, yy, ..] = self.covariance;
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        (mean + (half * half + xy * xy).sqrt()).max(0.0).sqrt()
    }

    /// Standard deviation of the position perpendicular to a heading, metres.
    pub fn across_sigma_m(&self, heading_rad: f64) -> f64 {
        let [xx, xy, yy, ..] = self.covariance;
        let (sin, cos) = math::sin_cos(heading_rad);
        (sin * sin * xx - 2.0 * sin * cos * xy + cos * cos * yy).max(0.0).sqrt()
    }

    /// Distance along a heading, metres, after which dead reckoning with an exact yaw rate has a lateral standard
    /// deviation of `most_m`, metres. The lateral error is `y + h w` with the present errors of position and
    /// heading. 0 if `most_m` is exceeded already.
    pub fn way_until_m(&self, heading_rad: f64, most_m: f64) -> f64 {
        let [_, _, _, xh, yh, hh] = self.covariance;
        let (sin, cos) = math::sin_cos(heading_rad);
        let (across_m, cross) = (self.across_sigma_m(heading_rad), cos * yh - sin * xh);
        // hh w² + 2 cross w = most² - across²
        let left = most_m * most_m - across_m * across_m;
        if left <= 0.0 {
            return 0.0;
        }
        let root = (cross * cross + hh * left).max(0.0).sqrt();
        // Avoids the difference of nearly equal numbers.
        if root + cross > 0.0 { left / (root + cross) } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pose_sigma_is_that_of_the_worst_direction() {
        // 0.3 m along the diagonal, 0.1 m across it.
        let covariance = [0.05, 0.04, 0.05, 0.0, 0.0, 1e-4];
        let quality = PoseQuality { covariance, ..PoseQuality::default() };
        assert!((quality.sigma_m() - 0.3).abs() < 1e-12, "{}", quality.sigma_m());
    }

    #[test]
    fn across_sigma_is_perpendicular_to_the_heading() {
        // The same ellipse: along its long axis the lateral deviation is the short axis, and vice versa.
        let quality =
            PoseQuality { covariance: [0.05, 0.04, 0.05, 0.0, 0.0, 1e-4], ..PoseQuality::default() };
        let diagonal = core::f64::consts::FRAC_PI_4;
        assert!((quality.across_sigma_m(diagonal) - 0.1).abs() < 1e-12);
        assert!((quality.across_sigma_m(-diagonal) - 0.3).abs() < 1e-12);
        assert!((quality.across_sigma_m(0.0) - f64::sqrt(0.05)).abs() < 1e-12);
    }

    #[test]
    fn dead_reckoning_reaches_the_lateral_deviation_after_the_predicted_distance() {
        // 0.3 m now and 0.01 rad: 0.3² + (0.01 w)² = 0.5² after 40 m.
        let along_x =
            |xy, xh, yh| PoseQuality { covariance: [0.04, xy, 0.09, xh, yh, 1e-4], ..PoseQuality::default() };
        assert!((along_x(0.0, 0.0, 0.0).way_until_m(0.0, 0.5) - 40.0).abs() < 1e-9);
        assert_eq!(along_x(0.0, 0.0, 0.0).way_until_m(0.0, 0.3), 0.0);
        // Half correlated: the term 2 * 0.0015 w is added: 0.0001 w² + 0.003 w = 0.16.
        let way_m = along_x(0.0, 0.0, 0.0015).way_until_m(0.0, 0.5);
        assert!((1e-4 * way_m * way_m + 0.003 * way_m - 0.16).abs() < 1e-9, "{way_m}");
        // For a heading along y, left is -x.
        let along_y = along_x(0.0, -0.001, 0.0).way_until_m(core::f64::consts::FRAC_PI_2, 0.5);
        assert!((1e-4 * along_y * along_y + 0.002 * along_y - 0.21).abs() < 1e-9, "{along_y}");
        let known = PoseQuality { covariance: [0.04, 0.0, 0.09, 0.0, 0.0, 0.0], ..PoseQuality::default() };
        assert_eq!(known.way_until_m(0.0, 0.5), f64::INFINITY);
    }

    #[test]
    fn local_pose_transforms_between_map_and_odometry_frame() {
        // The origin of the odometry frame is at (10, 5) in the map, rotated 90 degrees to the left.
        let odom = Pose2::<Odom>::new(3.0, 1.0, 0.2);
        let map = Pose2::new(9.0, 8.0, 0.2 + core::f64::consts::FRAC_PI_2);
        let local = LocalPose::new(Time::ZERO, odom, map);
        let origin = local.map_from_odom;
        assert!((origin.x_m - 10.0).abs() < 1e-12 && (origin.y_m - 5.0).abs() < 1e-12, "{origin:?}");
        assert!((origin.heading_rad - core::f64::consts::FRAC_PI_2).abs() < 1e-12);
        let there = local.to_map(odom);
        assert!(there.point().distance(map.point()) < 1e-12);
        let back = local.to_odom(there);
        assert!(back.point().distance(odom.point()) < 1e-12 && (back.heading_rad - 0.2).abs() < 1e-12);
    }
}
