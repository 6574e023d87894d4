//! Road users relative to the vehicle: a sensor on it places them by the pose that localization estimates, and trackers
//! follow them in the odometry frame.
//!
//! ```text
//! obstacle_sensor --ObstacleList (map by the estimate)--> tracker: map -> odom, follow, odom -> map of now
//! ```
//!
//! An error of the pose moves the ego and all road users alike: distances have the accuracy of the sensor. A correction
//! of the pose is not taken for motion of road users.

use swerve_core::Time;
use swerve_geom::{Ego, Point2, Pose2, Vector2};
use swerve_msg::{LocalPose, ObstacleList, TrackList};

/// Longest time over which a pose is extrapolated to an observation, seconds.
const AHEAD_MAX_S: f64 = 0.2;

/// Rigid motion from one pose to another. Frames are those of the poses: the stack's messages have positions in the map
/// frame, and so have those that are in the odometry frame inside a tracker.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    from: Pose2,
    to: Pose2,
}

impl Motion {
    /// From the true map to the map as localized at an instant, for an ego at `ego`.
    pub(super) fn of_sight(ego: Pose2, believed: Pose2) -> Self {
        Self { from: ego, to: believed }
    }

    /// From the odometry frame to the map.
    pub(super) fn to_map(local: &LocalPose) -> Self {
        Self { from: in_odom(local), to: local.to_map(local.odom) }
    }

    /// From the map to the odometry frame.
    pub(super) fn to_odom(local: &LocalPose) -> Self {
        Self { from: local.to_map(local.odom), to: in_odom(local) }
    }

    fn point(&self, point: Point2) -> Point2 {
        self.to.from_local(self.from.to_local::<Ego>(point))
    }

    fn pose(&self, pose: Pose2) -> Pose2 {
        let point = self.point(pose.point());
        Pose2::new(point.x_m, point.y_m, pose.heading_rad + self.to.heading_rad - self.from.heading_rad)
    }

    fn velocity(&self, velocity_mps: Vector2) -> Vector2 {
        self.point(self.from.point() + velocity_mps) - self.to.point()
    }

    /// Applies the motion to obstacles.
    pub(super) fn obstacles(&self, mut list: ObstacleList) -> ObstacleList {
        for obstacle in &mut list.obstacles {
            obstacle.pose = self.pose(obstacle.pose);
            obstacle.velocity_mps = self.velocity(obstacle.velocity_mps);
        }
        list
    }

    /// Applies the motion to tracks, including their past.
    pub(super) fn tracks(&self, mut list: TrackList) -> TrackList {
        for track in &mut list.tracks {
            track.pose = self.pose(track.pose);
            track.velocity_mps = self.velocity(track.velocity_mps);
            track.history.iter_mut().for_each(|sighting| sighting.point = self.point(sighting.point));
        }
        list
    }
}

/// Pose of the ego in the odometry frame, typed as in the map like those of messages.
pub(super) fn in_odom(local: &LocalPose) -> Pose2 {
    Pose2::new(local.odom.x_m, local.odom.y_m, local.odom.heading_rad)
}

/// Pose of the ego in the map at an instant, extrapolated from its two newest poses before.
pub(super) fn pose_at(stamp: Time, before: LocalPose, newest: LocalPose) -> Pose2 {
    let map = newest.to_map(newest.odom);
    let between_s = (newest.stamp - before.stamp).as_secs();
    if between_s <= 0.0 {
        return map;
    }
    let share = (stamp - newest.stamp).as_secs().clamp(0.0, AHEAD_MAX_S) / between_s;
    let step: Point2<Ego> = before.odom.to_local(newest.odom.point());
    let turn_rad = swerve_geom::angle_between(before.odom.heading_rad, newest.odom.heading_rad);
    let point = map.from_local(Point2::<Ego>::new(step.x_m * share, step.y_m * share));
    Pose2::new(point.x_m, point.y_m, map.heading_rad + turn_rad * share)
}

#[cfg(test)]
mod tests {
    use swerve_msg::{ActorId, ActorKind, Extent, Obstacle, Sighting, Track};

    use super::*;

    fn person(pose: Pose2, velocity_mps: Vector2) -> Obstacle {
        let extent = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 };
        Obstacle {
            id: ActorId(1),
            kind: ActorKind::Pedestrian,
            pose,
            extent,
            velocity_mps,
            visible_share: 1.0,
        }
    }

    #[test]
    fn distances_to_the_ego_do_not_depend_on_the_error_of_the_pose() {
        // 20 m ahead of an ego that looks along x, walking to its left, heading that way.
        let quarter = core::f64::consts::FRAC_PI_2;
        let list = ObstacleList {
            stamp: Time::ZERO,
            obstacles: vec![person(Pose2::new(30.0, 1.0, quarter), Vector2::new(0.0, 2.0))],
        };
        // The estimate: 3 m to the right, and turned left by a quarter.
        let believed = Pose2::new(10.0, -3.0, quarter);
        let seen = Motion::of_sight(Pose2::new(10.0, 0.0, 0.0), believed).obstacles(list);
        let one = &seen.obstacles[0];
        // Ahead is along y now, left along -x.
        assert!((one.pose.x_m - 9.0).abs() < 1e-12 && (one.pose.y_m - 17.0).abs() < 1e-12, "{one:?}");
        assert!((one.pose.heading_rad - 2.0 * quarter).abs() < 1e-12);
        assert!((one.velocity_mps.x + 2.0).abs() < 1e-12 && one.velocity_mps.y.abs() < 1e-12, "{one:?}");
    }

    #[test]
    fn pose_correction_moves_the_past_of_tracks_along() {
        let local =
            |off_m: f64| LocalPose::new(Time::ZERO, Pose2::new(5.0, 0.0, 0.0), Pose2::new(5.0, off_m, 0.0));
        let track = Track {
            id: ActorId(1),
            kind: ActorKind::Car,
            pose: Pose2::new(30.0, 0.0, 0.0),
            extent: Extent::default(),
            velocity_mps: Vector2::new(0.0, 0.0),
            history: vec![Sighting { at: Time::ZERO, point: Point2::new(30.0, 0.0) }],
        };
        let list = TrackList { stamp: Time::ZERO, tracks: vec![track] };
        let odom = Motion::to_odom(&local(0.0)).tracks(list);
        let map = Motion::to_map(&local(0.7)).tracks(odom);
        let one = &map.tracks[0];
        assert!((one.pose.y_m - 0.7).abs() < 1e-12 && (one.history[0].point.y_m - 0.7).abs() < 1e-12);
        assert!(one.velocity_mps.norm() < 1e-12);
    }

    #[test]
    fn ego_pose_is_extrapolated_to_the_observation() {
        // 10 m/s along x: 0.1 m in 10 ms; an observation 5 ms later is from 0.05 m further.
        let local = |ms: i64, x_m: f64| {
            let odom = Pose2::new(x_m, 0.0, 0.0);
            LocalPose::new(Time::from_ms(ms), odom, Pose2::new(x_m, 2.0, 0.0))
        };
        let (before, newest) = (local(10, 0.1), local(20, 0.2));
        let pose = pose_at(Time::from_ms(25), before, newest);
        assert!((pose.x_m - 0.25).abs() < 1e-12 && (pose.y_m - 2.0).abs() < 1e-12, "{pose:?}");
        assert_eq!(pose_at(Time::from_ms(25), newest, newest), newest.to_map(newest.odom));
    }
}
