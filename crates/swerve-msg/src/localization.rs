use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Odom, Pose2};

/// Place and heading of the ego by what a lidar sees: on a map, or on from its own turns before.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PoseMatch {
    /// Instant that this describes: the end of the turn.
    pub stamp: Time,
    /// Ego origin in the map, metres.
    pub at_m: [f64; 3],
    /// Heading, radians.
    pub heading_rad: f64,
    /// Covariance of the place on the ground: xx, xy, yy, m². Along a direction in which nothing was seen it is large.
    pub covariance_m2: [f64; 3],
    /// Standard deviation of the height, metres.
    pub height_sigma_m: f64,
    /// Standard deviation of the heading, radians.
    pub heading_sigma_rad: f64,
}

/// How good the pose is that localization tells.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PoseQuality {
    /// Instant that this describes.
    pub stamp: Time,
    /// Whether it can be driven by.
    pub mode: PoseMode,
    /// Covariance of x (m), y (m) and heading (rad): xx, xy, yy, xh, yh, hh.
    pub covariance: [f64; 6],
}

/// Whether a pose can be driven by.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseMode {
    /// What tells the place comes and is believed.
    Good,
    /// By inertia and wheels alone for now.
    Coasting,
    /// Not to be driven by: no pose is told.
    #[default]
    Lost,
}

/// Pose of the odometry frame in the map, as localization estimates it: ROS REP 105's transform from `map` to `odom`.
///
/// The ego moves through the odometry frame without jumps. A correction by a satellite fix or a scan match moves this pose
/// and leaves the motion that control follows as it is.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct MapFromOdom {
    /// Instant that this describes.
    pub stamp: Time,
    /// Origin and heading of the odometry frame in the map.
    pub pose: Pose2,
}

impl MapFromOdom {
    /// The transform by which an ego at `odom` in the odometry frame is at `map` in the map.
    pub fn of(stamp: Time, map: Pose2, odom: Pose2<Odom>) -> Self {
        let turned = Pose2::new(0.0, 0.0, map.heading_rad - odom.heading_rad);
        let origin = map.point() - (turned.from_local(odom.point()) - turned.point());
        Self { stamp, pose: Pose2::new(origin.x_m, origin.y_m, turned.heading_rad) }
    }

    /// A pose of the map in the odometry frame.
    pub fn odom(&self, map: Pose2) -> Pose2<Odom> {
        let point = self.pose.to_local::<Odom>(map.point());
        Pose2::new(point.x_m, point.y_m, map.heading_rad - self.pose.heading_rad)
    }

    /// A pose of the odometry frame in the map.
    pub fn map(&self, odom: Pose2<Odom>) -> Pose2 {
        let point = self.pose.from_local(odom.point());
        Pose2::new(point.x_m, point.y_m, odom.heading_rad + self.pose.heading_rad)
    }
}

impl PoseQuality {
    /// Standard deviation of the place on the ground along its worst direction, metres.
    pub fn sigma_m(&self) -> f64 {
        let [xx, xy, yy, ..] = self.covariance;
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        (mean + (half * half + xy * xy).sqrt()).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_direction_counts() {
        // 0.3 m along the diagonal, 0.1 m across it.
        let covariance = [0.05, 0.04, 0.05, 0.0, 0.0, 1e-4];
        let quality = PoseQuality { covariance, ..PoseQuality::default() };
        assert!((quality.sigma_m() - 0.3).abs() < 1e-12, "{}", quality.sigma_m());
    }
}
