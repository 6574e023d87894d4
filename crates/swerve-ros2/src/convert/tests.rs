//! Tests of the conversions.

mod actuation;
mod planning;
mod sensors;

use core::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use swerve_core::{Span, Time};
use swerve_geom::{Camera, Ego, Point, Pose2, Transform, Vector2};
use swerve_msg::{
    ActorId, ActorKind, CameraInfo, Command, EgoState, Encoding, Extent, Gnss, Image, Imu, Intrinsics,
    LidarPoint, MotionCommand, ObstacleList, Pixels, Plan, PlanPoint, PlanStatus, PointCloud, PredictedPose,
    Prediction, PredictionList, Sighting, Track, TrackList, WheelOdometry,
};

use super::*;
use crate::AnyMessage;
use crate::message::RosMessage;
use crate::msg::autoware_perception_msgs::{ObjectClassification, Shape, UUID};
use crate::msg::geometry_msgs::{Quaternion, Vector3};
use crate::msg::sensor_msgs::{self as sm, PointField};

/// Run time zero is 2026-01-01 00:00:00.25 UTC.
const EPOCH: Epoch = Epoch { ns: 1_767_225_600_250_000_000 };

fn passes(message: &impl RosMessage) {
    assert_eq!(message.clone().into_any().check(), Ok(()));
}

#[test]
fn epoch_converts_between_stamps_and_run_time() {
    let stamp = EPOCH.stamp(Time::from_ms(1750));
    assert_eq!((stamp.sec, stamp.nanosec), (1_767_225_602, 0));
    assert_eq!(EPOCH.time(stamp), Time::from_ms(1750));
    let before = Epoch::default().stamp(Time::from_ms(-250));
    assert_eq!((before.sec, before.nanosec), (-1, 750_000_000));
    assert_eq!(Epoch::default().time(before), Time::from_ms(-250));
    assert_eq!(EPOCH.stamp(Time::MAX).sec, i32::MAX);
    assert_eq!(EPOCH.stamp(Time::MIN).sec, i32::MIN);
}

#[test]
fn pose_heading_north_is_a_quarter_turn_about_z() {
    let pose = pose_to_ros(Pose2::new(3.0, -4.0, FRAC_PI_2));
    let half = 0.5_f64.sqrt();
    assert!((pose.orientation.z - half).abs() < 1e-15 && (pose.orientation.w - half).abs() < 1e-15);
    let back = pose_from_ros(&pose);
    assert_eq!((back.x_m, back.y_m), (3.0, -4.0));
    assert!((back.heading_rad - FRAC_PI_2).abs() < 1e-15);
    // The same rotation with the opposite sign of the quaternion.
    let q = pose.orientation;
    let other = Quaternion { x: -q.x, y: -q.y, z: -q.z, w: -q.w };
    let same = pose_from_ros(&crate::msg::geometry_msgs::Pose { orientation: other, ..pose });
    assert!((same.heading_rad - FRAC_PI_2).abs() < 1e-15);
}

#[test]
fn camera_frame_matches_the_ros_optical_frame() {
    // REP 103's example: the optical frame's z is the car's x, its x is the car's -y.
    let rotation = Quaternion { x: -0.5, y: 0.5, z: -0.5, w: 0.5 };
    let translation = Vector3 { x: 1.5, y: 0.0, z: 1.2 };
    let ros = crate::msg::geometry_msgs::Transform { translation, rotation };
    let ego_from_camera: Transform<Ego, Camera> = transform_from_ros(&ros);
    let ahead = ego_from_camera * Point::<Camera>::new(0.0, 0.0, 10.0);
    assert!((ahead - Point::new(11.5, 0.0, 1.2)).norm() < 1e-12);
    let right = ego_from_camera * Point::<Camera>::new(2.0, 0.0, 0.0);
    assert!((right - Point::new(1.5, -2.0, 1.2)).norm() < 1e-12);
    let default = CameraInfo::default().ego_from_camera;
    let there = default * Point::<Camera>::new(0.0, 0.0, 10.0);
    assert!((there - Point::new(10.0, 0.0, 0.0)).norm() < 1e-12);
    assert_eq!(transform_to_ros(&ego_from_camera), ros);
}

#[test]
fn imu_readings_are_rotated_to_the_ego_frame() {
    let imu = Imu { stamp: Time::from_ms(10), accel_mps2: [1.0, 2.0, 9.81], gyro_radps: [0.1, 0.2, 0.3] };
    let ros = imu_to_ros(&imu, EPOCH, "imu");
    passes(&ros);
    assert_eq!(ros.orientation_covariance.0[0], -1.0);
    let straight = Transform::from_roll_pitch_yaw(Point::new(1.0, 0.0, 1.0), 0.0, 0.0, 0.0);
    assert_eq!(imu_from_ros(&ros, EPOCH, &straight), Ok(imu));
    // Its x axis points to the car's left, so its x reading is along the car's y.
    let turned = Transform::from_roll_pitch_yaw(Point::new(0.0, 0.0, 0.0), 0.0, 0.0, FRAC_PI_2);
    let read = imu_from_ros(&ros, EPOCH, &turned).unwrap();
    for (found, wanted) in read.accel_mps2.into_iter().zip([-2.0, 1.0, 9.81]) {
        assert!((found - wanted).abs() < 1e-12);
    }
    let mut without = ros;
    without.linear_acceleration_covariance.0[0] = -1.0;
    assert_eq!(
        imu_from_ros(&without, EPOCH, &straight),
        Err(ConvertError::NotMeasured("linear_acceleration"))
    );
}

#[test]
fn gnss_deviation_comes_from_the_covariance() {
    let stamp = Time::from_ms(200);
    let gnss = Gnss { stamp, latitude_deg: 48.1, longitude_deg: 11.6, altitude_m: 500.0, deviation_m: 1.5 };
    let mut ros = gnss_to_ros(&gnss, EPOCH, "gnss");
    passes(&ros);
    assert_eq!(ros.position_covariance.0[0], 2.25);
    assert_eq!(gnss_from_ros(&ros, EPOCH), Ok(gnss));
    (ros.position_covariance.0[0], ros.position_covariance.0[4]) = (1.0, 7.0);
    assert_eq!(gnss_from_ros(&ros, EPOCH).unwrap().deviation_m, 2.0);
    ros.position_covariance_type = 0;
    ros.altitude = f64::NAN;
    let unknown = gnss_from_ros(&ros, EPOCH).unwrap();
    assert_eq!((unknown.deviation_m, unknown.altitude_m), (10.0, 0.0));
    ros.status.status = -1;
    assert_eq!(gnss_from_ros(&ros, EPOCH), Err(ConvertError::NoFix));
}

#[test]
fn ego_state_round_trips_through_odometry() {
    let ego = EgoState {
        stamp: Time::from_ms(500),
        pose: Pose2::new(10.0, 20.0, -0.5),
        speed_mps: 8.0,
        accel_mps2: 0.5,
        lateral_accel_mps2: 8.0 * 0.25,
        yaw_rate_radps: 0.25,
        steering_rad: 0.1,
    };
    let ros = ego_to_ros(&ego, EPOCH, "map", "base_link");
    passes(&ros);
    assert_eq!((ros.twist.twist.linear.x, ros.twist.twist.angular.z), (8.0, 0.25));
    let back = ego_from_ros(&ros, EPOCH, "/map", "base_link", Beside { accel_mps2: 0.5, steering_rad: 0.1 })
        .unwrap();
    assert!((back.pose.heading_rad + 0.5).abs() < 1e-12);
    assert_eq!(EgoState { pose: ego.pose, ..back }, ego);
    let wrong = ego_from_ros(&ros, EPOCH, "odom", "base_link", Beside::default());
    assert_eq!(wrong.unwrap_err().to_string(), "it is in frame `map`, not in `odom`");
    let tf = ego_to_transform(&ego, EPOCH, "map", "base_link");
    passes(&tf);
    assert_eq!(
        (tf.transforms[0].header.frame_id.as_str(), tf.transforms[0].transform.translation.y),
        ("map", 20.0)
    );
}

#[test]
fn ego_state_from_a_pose_takes_motion_from_the_wheels() {
    let wheels =
        WheelOdometry { speed_mps: 4.0, yaw_rate_radps: 0.5, steering_rad: 0.2, ..WheelOdometry::default() };
    let (header, pose) = (EPOCH.header(Time::from_ms(70), "map"), pose_to_ros(Pose2::new(1.0, 2.0, 0.5)));
    let ego = ego_from_pose(&header, &pose, EPOCH, "map", &wheels, 0.25).unwrap();
    assert_eq!((ego.stamp, ego.pose.x_m, ego.speed_mps), (Time::from_ms(70), 1.0, 4.0));
    assert_eq!((ego.lateral_accel_mps2, ego.steering_rad, ego.accel_mps2), (2.0, 0.2, 0.25));
    assert!(ego_from_pose(&header, &pose, EPOCH, "odom", &wheels, 0.0).is_err());
}

#[test]
fn sensor_mount_is_a_transform_below_base_link() {
    let ego_from_lidar: Transform<Ego, Sensor> =
        Transform::from_roll_pitch_yaw(Point::new(1.5, 0.0, 1.9), 0.0, 0.0, PI);
    let edge = edge_to_ros(&ego_from_lidar, "base_link", "lidar", Time::ZERO, EPOCH);
    passes(&edge);
    assert_eq!((edge.header.frame_id.as_str(), edge.child_frame_id.as_str()), ("base_link", "lidar"));
    let (t, q) = (edge.transform.translation, edge.transform.rotation);
    assert_eq!((t.x, t.z), (1.5, 1.9));
    assert!((q.z - 1.0).abs() < 1e-12 && q.w.abs() < 1e-12);
    let back: Transform<Ego, Sensor> = transform_from_ros(&edge.transform);
    let ahead_of_sensor = back * Point::<Sensor>::new(10.0, 0.0, 0.0);
    assert!((ahead_of_sensor - Point::new(-8.5, 0.0, 1.9)).norm() < 1e-12);
}

#[test]
fn wheel_odometry_converts_to_velocity_and_steering_reports() {
    let wheels = WheelOdometry {
        stamp: Time::from_ms(100),
        speed_mps: 6.0,
        yaw_rate_radps: 0.5,
        steering_rad: 0.25,
        ..WheelOdometry::default()
    };
    let velocity = velocity_to_ros(&wheels, EPOCH, "base_link");
    passes(&velocity);
    assert_eq!(velocity.header, EPOCH.header(Time::from_ms(100), "base_link"));
    assert_eq!((velocity.longitudinal_velocity, velocity.heading_rate), (6.0, 0.5));
    let steering = steering_to_ros(&wheels, EPOCH);
    assert_eq!((steering.stamp, steering.steering_tire_angle), (velocity.header.stamp, 0.25));
}
