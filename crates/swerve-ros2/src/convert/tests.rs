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
fn stamps_count_from_another_zero() {
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
fn a_heading_to_the_north_is_a_quarter_turn_about_z() {
    let pose = pose_to_ros(Pose2::new(3.0, -4.0, FRAC_PI_2));
    let half = 0.5_f64.sqrt();
    assert!((pose.orientation.z - half).abs() < 1e-15 && (pose.orientation.w - half).abs() < 1e-15);
    let back = pose_from_ros(&pose);
    assert_eq!((back.x_m, back.y_m), (3.0, -4.0));
    assert!((back.heading_rad - FRAC_PI_2).abs() < 1e-15);
    // The same rotation written with the other sign.
    let q = pose.orientation;
    let other = Quaternion { x: -q.x, y: -q.y, z: -q.z, w: -q.w };
    let same = pose_from_ros(&crate::msg::geometry_msgs::Pose { orientation: other, ..pose });
    assert!((same.heading_rad - FRAC_PI_2).abs() < 1e-15);
}

#[test]
fn an_optical_frame_is_the_camera_frame() {
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
fn an_imu_that_lies_on_its_side_reads_gravity_sideways() {
    let imu = Imu { stamp: Time::from_ms(10), accel_mps2: [1.0, 2.0, 9.81], gyro_radps: [0.1, 0.2, 0.3] };
    let ros = imu_to_ros(&imu, EPOCH, "imu");
    passes(&ros);
    assert_eq!(ros.orientation_covariance.0[0], -1.0);
    let straight = Transform::from_roll_pitch_yaw(Point::new(1.0, 0.0, 1.0), 0.0, 0.0, 0.0);
    assert_eq!(imu_from_ros(&ros, EPOCH, &straight), Ok(imu));
    // Its x points to the car's left: what it reads along x is the car's y.
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
fn a_fix_has_a_deviation_from_its_covariance() {
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
fn the_ego_is_odometry_of_base_link_in_the_map() {
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
    let back = ego_from_ros(&ros, EPOCH, ("/map", "base_link"), (0.5, 0.1)).unwrap();
    assert!((back.pose.heading_rad + 0.5).abs() < 1e-12);
    assert_eq!(EgoState { pose: ego.pose, ..back }, ego);
    let wrong = ego_from_ros(&ros, EPOCH, ("odom", "base_link"), (0.0, 0.0));
    assert_eq!(wrong.unwrap_err().to_string(), "it is in frame `map`, not in `odom`");
    let tf = ego_to_transform(&ego, EPOCH, "map", "base_link");
    passes(&tf);
    assert_eq!(
        (tf.transforms[0].header.frame_id.as_str(), tf.transforms[0].transform.translation.y),
        ("map", 20.0)
    );
}

#[test]
fn a_pose_alone_gets_the_rest_from_the_wheels() {
    let wheels =
        WheelOdometry { speed_mps: 4.0, yaw_rate_radps: 0.5, steering_rad: 0.2, ..WheelOdometry::default() };
    let (header, pose) = (EPOCH.header(Time::from_ms(70), "map"), pose_to_ros(Pose2::new(1.0, 2.0, 0.5)));
    let ego = ego_from_pose(&header, &pose, EPOCH, "map", &wheels, 0.25).unwrap();
    assert_eq!((ego.stamp, ego.pose.x_m, ego.speed_mps), (Time::from_ms(70), 1.0, 4.0));
    assert_eq!((ego.lateral_accel_mps2, ego.steering_rad, ego.accel_mps2), (2.0, 0.2, 0.25));
    assert!(ego_from_pose(&header, &pose, EPOCH, "odom", &wheels, 0.0).is_err());
}

#[test]
fn a_sensors_place_is_an_edge_below_base_link() {
    let ego_from_lidar: Transform<Ego, Sensor> =
        Transform::from_roll_pitch_yaw(Point::new(1.5, 0.0, 1.9), 0.0, 0.0, PI);
    let edge = edge_to_ros(&ego_from_lidar, ("base_link", "lidar"), Time::ZERO, EPOCH);
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
fn wheels_come_from_speed_and_turn() {
    let velocity = crate::msg::autoware_vehicle_msgs::VelocityReport {
        header: EPOCH.header(Time::from_ms(100), "base_link"),
        longitudinal_velocity: 6.0,
        lateral_velocity: 0.0,
        heading_rate: 0.5,
    };
    passes(&velocity);
    let wheels = wheels_from_ros(&velocity, None, EPOCH, (0.3, 0.8));
    // Left of a turn to the left: 6 - 0.5 * 0.8 = 5.6 m/s on wheels of 0.3 m.
    assert!((wheels.wheel_speeds_radps[2] - 5.6 / 0.3).abs() < 1e-9);
    assert!((wheels.wheel_speeds_radps[3] - 6.4 / 0.3).abs() < 1e-9);
    assert_eq!((wheels.stamp, wheels.speed_mps, wheels.yaw_rate_radps), (Time::from_ms(100), 6.0, 0.5));
    let odometry = WheelOdometry { steering_rad: 0.25, ..wheels };
    assert_eq!(steering_to_ros(&odometry, EPOCH).steering_tire_angle, 0.25);
    assert_eq!(velocity_to_ros(&odometry, EPOCH, "base_link"), velocity);
}

#[test]
fn images_lose_their_padding_and_change_their_order() {
    let bgr = sm::Image {
        header: EPOCH.header(Time::from_ms(50), "camera"),
        height: 2,
        width: 2,
        encoding: "bgr8".to_owned(),
        step: 8,
        data: vec![1, 2, 3, 4, 5, 6, 99, 99, 7, 8, 9, 10, 11, 12, 99, 99],
        ..sm::Image::default()
    };
    passes(&bgr);
    let image = image_from_ros(&bgr, EPOCH, CameraInfo::default()).unwrap();
    assert_eq!(image.pixels, Pixels::Rgb8(vec![3, 2, 1, 6, 5, 4, 9, 8, 7, 12, 11, 10].into()));
    assert_eq!((image.stamp, image.check()), (Time::from_ms(50), Ok(())));
    let back = image_to_ros(&image, EPOCH, "camera");
    passes(&back);
    assert_eq!((back.encoding.as_str(), back.step, back.data[0]), ("rgb8", 6, 3));

    let grey = sm::Image {
        encoding: "mono8".to_owned(),
        width: 1,
        height: 1,
        step: 1,
        data: vec![7],
        ..bgr.clone()
    };
    let grey = image_from_ros(&grey, EPOCH, CameraInfo::default()).unwrap();
    assert_eq!(grey.pixels, Pixels::Rgb8(vec![7, 7, 7].into()));
    let other = sm::Image { encoding: "mono16".to_owned(), ..bgr };
    assert_eq!(
        image_from_ros(&other, EPOCH, CameraInfo::default()),
        Err(ConvertError::Encoding("mono16".to_owned()))
    );
}

#[test]
fn depth_keeps_its_metres_in_both_byte_orders() {
    let mut image = Image::new(2, 1, Encoding::DepthF32M);
    image.pixels = Pixels::DepthF32M(vec![1.5, f32::INFINITY].into());
    let ros = image_to_ros(&image, EPOCH, "camera");
    passes(&ros);
    assert_eq!((ros.encoding.as_str(), ros.step), ("32FC1", 8));
    let swapped: Vec<u8> = ros.data.chunks(4).flat_map(|n| n.iter().rev().copied()).collect();
    let big = sm::Image { is_bigendian: 1, data: swapped, ..ros.clone() };
    for one in [ros, big] {
        assert_eq!(image_from_ros(&one, EPOCH, CameraInfo::default()).unwrap().pixels, image.pixels);
    }
}

#[test]
fn the_first_pixels_centre_is_half_a_pixel_on() {
    let intrinsics = Intrinsics {
        fx_px: 400.0,
        fy_px: 410.0,
        cx_px: 320.0,
        cy_px: 240.0,
        distortion: [0.1, -0.2, 0.001, 0.002, 0.03],
        is_parallel: false,
    };
    let camera = CameraInfo { intrinsics, ..CameraInfo::default() };
    let ros = camera_to_ros(&camera, (640, 480), EPOCH.header(Time::ZERO, "camera"));
    passes(&ros);
    assert_eq!((ros.k.0[2], ros.k.0[5], ros.p.0[2]), (319.5, 239.5, 319.5));
    assert_eq!(camera_from_ros(&ros, camera.ego_from_camera), Ok(camera));
    let fisheye = sm::CameraInfo { distortion_model: "equidistant".to_owned(), ..ros };
    assert_eq!(
        camera_from_ros(&fisheye, camera.ego_from_camera),
        Err(ConvertError::Lens("equidistant".to_owned()))
    );
}

fn cloud() -> PointCloud {
    let mut cloud = PointCloud { stamp: Time::from_ms(100), ..PointCloud::default() };
    for i in 1..50_u16 {
        let x = f32::from(i);
        let time_offset_s = -0.0625 + x / 1024.0;
        cloud.push(LidarPoint { place_m: [x, -0.5 * x, 0.25], intensity: 0.6, ring: i % 4, time_offset_s });
    }
    cloud
}

#[test]
fn clouds_survive_a_round_trip() {
    let cloud = cloud();
    let ros = cloud_to_ros(&cloud, EPOCH, "lidar");
    passes(&ros);
    assert_eq!((ros.width, ros.point_step, ros.data.len()), (49, 24, 49 * 24));
    // The first point by hand: 1, -0.5, 0.25, 0.6 * 255 = 153.
    assert_eq!(ros.data[..16], [1.0_f32, -0.5, 0.25, 153.0].map(f32::to_le_bytes).concat());
    let mut back = cloud_from_ros(&ros, EPOCH).unwrap();
    for (found, wanted) in back.intensity.iter_mut().zip(&*cloud.intensity) {
        assert!((*found - wanted).abs() < 1e-6);
        *found = *wanted;
    }
    assert_eq!(back, cloud);
}

/// Fields in any order and of any type, both byte orders, absolute times, points without a place.
#[test]
fn clouds_of_other_drivers_are_read() {
    let field =
        |name: &str, offset, datatype| PointField { name: name.to_owned(), offset, datatype, count: 1 };
    let mut data = Vec::new();
    for (x, t) in [(4.0_f64, 0.01_f64), (f64::NAN, 0.02), (6.0, 0.03), (0.0, 0.03)] {
        data.push(255); // intensity
        data.extend_from_slice(&7_u16.to_be_bytes());
        for axis in [x, 0.0, 0.5 * x] {
            data.extend_from_slice(&axis.to_be_bytes());
        }
        data.extend_from_slice(&(EPOCH.ns as f64 * 1e-9 + t).to_be_bytes());
    }
    let ros = sm::PointCloud2 {
        header: EPOCH.header(Time::ZERO, "lidar"),
        height: 2,
        width: 2,
        fields: vec![
            field("intensity", 0, PointField::UINT8),
            field("channel", 1, PointField::UINT16),
            field("x", 3, PointField::FLOAT64),
            field("y", 11, PointField::FLOAT64),
            field("z", 19, PointField::FLOAT64),
            field("timestamp", 27, PointField::FLOAT64),
        ],
        is_bigendian: true,
        point_step: 35,
        row_step: 70,
        data,
        is_dense: false,
    };
    passes(&ros);
    let cloud = cloud_from_ros(&ros, EPOCH).unwrap();
    assert_eq!(cloud.len(), 2);
    let last = cloud.get(1).unwrap();
    assert_eq!((last.place_m, last.intensity, last.ring), ([6.0, 0.0, 3.0], 1.0, 7));
    assert!((last.time_offset_s - 0.03).abs() < 1e-5, "{}", last.time_offset_s);
    let mut flat = ros;
    flat.fields.remove(4);
    assert_eq!(cloud_from_ros(&flat, EPOCH), Err(ConvertError::Field("z")));
}

fn plan() -> Plan {
    let point = |i: i32| PlanPoint {
        at: Time::from_ms(1000 + 500 * i64::from(i)),
        pose: Pose2::new(4.0 * f64::from(i), 0.0, 0.0),
        curvature_1pm: 0.0,
        speed_mps: 8.0,
        accel_mps2: 0.25,
    };
    Plan {
        stamp: Time::from_ms(1000),
        status: PlanStatus::Found,
        points: (0..5).map(point).collect(),
        work: 3,
    }
}

#[test]
fn plans_are_trajectories_of_base_link() {
    let mut plan = plan();
    plan.points[2].curvature_1pm = 0.1;
    let ros = plan_to_ros(&plan, EPOCH, "map", 2.85);
    passes(&ros);
    assert_eq!(ros.points[2].time_from_start.ns(), 1_000_000_000);
    assert_eq!((ros.points[2].heading_rate_rps, ros.points[2].longitudinal_velocity_mps), (0.8, 8.0));
    assert!((f64::from(ros.points[2].front_wheel_angle_rad) - 0.277_639_1).abs() < 1e-6);
    plan.points[2].curvature_1pm = 0.0;
    let back = plan_from_ros(&ros, EPOCH, "map").unwrap();
    assert_eq!(back, Plan { work: 0, ..plan.clone() });
    let path = path_to_ros(&plan, EPOCH, "map");
    passes(&path);
    assert_eq!(EPOCH.time(path.poses[1].header.stamp), Time::from_ms(1500));
}

#[test]
fn times_that_are_left_out_come_from_the_speeds() {
    let plan = plan();
    let mut ros = plan_to_ros(&plan, EPOCH, "map", 2.85);
    for point in &mut ros.points {
        point.time_from_start = Default::default();
    }
    assert_eq!(plan_from_ros(&ros, EPOCH, "map").unwrap().points, plan.points);
    // It stops at the fourth: 4 m at a mean of 4 m/s; nothing follows.
    ros.points[3].longitudinal_velocity_mps = 0.0;
    ros.points[4].longitudinal_velocity_mps = 0.0;
    let stopping = plan_from_ros(&ros, EPOCH, "map").unwrap();
    assert_eq!((stopping.points.len(), stopping.end()), (4, Time::from_ms(3000)));
    for point in &mut ros.points {
        point.longitudinal_velocity_mps = 0.0;
    }
    assert_eq!(plan_from_ros(&ros, EPOCH, "map"), Err(ConvertError::NotLater(1)));
}

#[test]
fn curvature_comes_from_the_turn_between_points() {
    // A quarter of a circle of radius 10 m to the left, in steps of a tenth of a radian.
    let mut plan = plan();
    plan.points = (0..16)
        .map(|i| {
            let (sin, cos) = swerve_geom::math::sin_cos(0.1 * f64::from(i));
            let pose = Pose2::new(10.0 * sin, 10.0 * (1.0 - cos), 0.1 * f64::from(i));
            PlanPoint {
                at: Time::from_ms(1000 + 200 * i64::from(i)),
                pose,
                speed_mps: 5.0,
                ..PlanPoint::default()
            }
        })
        .collect();
    let back = plan_from_ros(&plan_to_ros(&plan, EPOCH, "map", 2.85), EPOCH, "map").unwrap();
    assert!(back.points.iter().all(|p| (p.curvature_1pm - 0.1).abs() < 1e-3));
}

fn tracks() -> (TrackList, PredictionList) {
    let stamp = Time::from_ms(400);
    let extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
    let pose = Pose2::new(20.0, 5.0, FRAC_PI_2);
    let history = vec![Sighting { at: stamp, point: pose.point() }];
    let velocity_mps = Vector2::new(-0.5, 3.0);
    let track = Track { id: ActorId(1), kind: ActorKind::Car, pose, extent, velocity_mps, history };
    let path = (0..4).map(|i| PredictedPose {
        at: stamp + Span::from_ms(500) * i,
        pose: Pose2::new(20.0, 5.0 + 1.5 * i as f64, FRAC_PI_2),
    });
    let prediction =
        Prediction { id: ActorId(1), kind: ActorKind::Car, extent, probability: 0.75, path: path.collect() };
    (TrackList { stamp, tracks: vec![track] }, PredictionList { stamp, predictions: vec![prediction] })
}

#[test]
fn tracks_and_their_futures_are_predicted_objects() {
    let (tracks, predictions) = tracks();
    let ros = objects_to_ros(&tracks, &predictions, EPOCH, "map");
    passes(&ros);
    let object = &ros.objects[0];
    // It heads north: 3 m/s along, and 0.5 m/s to its left, which is west.
    let linear = object.kinematics.initial_twist_with_covariance.twist.linear;
    assert!((linear.x - 3.0).abs() < 1e-12 && (linear.y - 0.5).abs() < 1e-12);
    assert_eq!(object.kinematics.initial_pose_with_covariance.pose.position.z, 0.75);
    assert_eq!(object.classification[0].label, ObjectClassification::CAR);
    assert_eq!((object.shape.type_, object.shape.dimensions.x), (Shape::BOUNDING_BOX, 4.5));
    let path = &object.kinematics.predicted_paths[0];
    assert_eq!((path.path.len(), path.time_step.ns(), path.confidence), (4, 500_000_000, 0.75));

    let mut names = Identities::default();
    let (back, futures) = objects_from_ros(&ros, EPOCH, "map", &mut names).unwrap();
    assert_eq!(
        (back.stamp, back.tracks[0].id, back.tracks[0].extent),
        (tracks.stamp, ActorId(1), tracks.tracks[0].extent)
    );
    let v = back.tracks[0].velocity_mps;
    assert!((v.x + 0.5).abs() < 1e-12 && (v.y - 3.0).abs() < 1e-12);
    assert_eq!(futures.predictions[0].path[3].at, predictions.predictions[0].path[3].at);
    assert!((futures.predictions[0].path[3].pose.y_m - 9.5).abs() < 1e-12);
    assert!(objects_from_ros(&ros, EPOCH, "odom", &mut names).is_err());
}

#[test]
fn names_keep_their_number_and_are_forgotten_oldest_first() {
    let name = |i: u32| {
        let mut uuid = [9; 16];
        uuid[12..].copy_from_slice(&i.to_le_bytes());
        UUID { uuid }
    };
    let mut names = Identities::default();
    assert_eq!(
        (names.id(name(7)), names.id(name(8)), names.id(name(7))),
        (ActorId(1), ActorId(2), ActorId(1))
    );
    for i in 0..Identities::MAX as u32 - 1 {
        names.id(name(1000 + i));
    }
    assert_eq!(names.id(name(7)), ActorId(1), "used later than the other");
    assert_ne!(names.id(name(8)), ActorId(2), "forgotten, and its number is not used again");
}

#[test]
fn commands_reach_road_wheels_and_steering_wheels() {
    let command =
        MotionCommand { stamp: Time::from_ms(30), steering_rad: 0.125, speed_mps: 10.0, accel_mps2: -1.5 };
    let control = control_to_ros(&command, EPOCH);
    passes(&control);
    assert_eq!(control_from_ros(&control, EPOCH), command);

    let gear = SteeringGear { ratio: 16.0, wheel_max_deg: 450.0, wheel_rate_degps: 300.0 };
    // A 32th of a half turn, times 16: a quarter turn of the steering wheel.
    assert_eq!(gear.wheel_deg(PI / 32.0), 90.0);
    assert_eq!(gear.wheel_deg(-FRAC_PI_4), -450.0);
    assert!((gear.steering_rad(90.0) - PI / 32.0).abs() < 1e-15);
    let dataspeed = Dataspeed { gear, epoch: EPOCH };
    let steering = dataspeed.steering(Time::ZERO, PI / 32.0, true, false);
    passes(&steering);
    assert_eq!(
        (steering.cmd, steering.cmd_rate, steering.cmd_type, steering.ignore),
        (90.0, 300.0, 2, false)
    );
    let pedals = Command { steering_rad: 0.0, throttle: 0.25, brake: 2.0 };
    let (throttle, brake) = dataspeed.pedals(Time::ZERO, &pedals, true, false);
    passes(&throttle);
    passes(&brake);
    assert_eq!((throttle.cmd, throttle.cmd_type, brake.cmd, brake.cmd_type), (25.0, 14, 100.0, 14));
    let speed = dataspeed.speed(&command, (2.0, 3.0), true, true);
    passes(&speed);
    assert_eq!((speed.cmd, speed.limit_decel, speed.clear), (10.0, 3.0, true));

    let raptor = Raptor { gear };
    let steering = raptor.steering(PI / 32.0, true, 258);
    passes(&steering);
    assert_eq!((steering.angle_cmd, steering.rolling_counter, steering.control_type.value), (90.0, 2, 1));
    let (accelerator, brake) = raptor.pedals(&pedals, true, 3);
    passes(&accelerator);
    passes(&brake);
    assert_eq!((accelerator.pedal_cmd, brake.pedal_cmd), (25.0, 100.0));
}

#[test]
fn reports_in_degrees_and_kilometres_per_hour_are_si_here() {
    let gear = SteeringGear { ratio: 16.0, ..SteeringGear::default() };
    let mut report =
        crate::msg::ds_dbw_msgs::SteeringReport { steering_wheel_angle: 90.0, ..Default::default() };
    assert!((dataspeed_steering_from_ros(&report, &gear).unwrap() - PI / 32.0).abs() < 1e-12);
    report.steering_wheel_angle = f32::NAN;
    assert_eq!(AnyMessage::DataspeedSteeringReport(report.clone()).check(), Ok(()));
    assert!(dataspeed_steering_from_ros(&report, &gear).is_err());
    let mut speed = crate::msg::ds_dbw_msgs::VehicleVelocity {
        vehicle_velocity_brake: 3.5,
        vehicle_velocity_propulsion: 3.25,
        ..Default::default()
    };
    assert_eq!(dataspeed_speed_from_ros(&speed), Ok(3.5));
    speed.vehicle_velocity_brake = f32::NAN;
    assert_eq!(dataspeed_speed_from_ros(&speed), Ok(3.25));
    speed.vehicle_velocity_propulsion = f32::NAN;
    assert!(dataspeed_speed_from_ros(&speed).is_err());
    let misc = crate::msg::raptor_dbw_msgs::MiscReport { vehicle_speed: 36.0, ..Default::default() };
    assert_eq!(raptor_speed_from_ros(&misc), 10.0);
}

#[test]
fn a_driver_who_acts_is_seen_in_every_interface() {
    use crate::msg::autoware_vehicle_msgs::ControlModeReport;
    use crate::msg::{ds_dbw_msgs, raptor_dbw_msgs};
    let mode = |mode| AnyMessage::ControlModeReport(ControlModeReport { mode, ..Default::default() });
    assert_eq!(driver_active(&mode(ControlModeReport::AUTONOMOUS)), Some(false));
    for other in [0, 2, 3, 4, 5, 6] {
        assert_eq!(driver_active(&mode(other)), Some(true), "{other}");
    }
    let brake = |override_active| ds_dbw_msgs::BrakeReport { override_active, ..Default::default() };
    assert_eq!(driver_active(&AnyMessage::DataspeedBrakeReport(brake(true))), Some(true));
    assert_eq!(driver_active(&AnyMessage::DataspeedBrakeReport(brake(false))), Some(false));
    let steering = raptor_dbw_msgs::SteeringReport { driver_activity: true, ..Default::default() };
    assert_eq!(driver_active(&AnyMessage::RaptorSteeringReport(steering)), Some(true));
    assert_eq!(driver_active(&AnyMessage::Empty(Default::default())), None);
}

#[test]
fn what_is_shown_is_where_it_is() {
    let (tracks, _) = tracks();
    let track = &tracks.tracks[0];
    let obstacle = swerve_msg::Obstacle {
        id: track.id,
        kind: ActorKind::Pedestrian,
        pose: track.pose,
        extent: track.extent,
        velocity_mps: track.velocity_mps,
        visible_share: 1.0,
    };
    let list = ObstacleList { stamp: tracks.stamp, obstacles: vec![obstacle] };
    let mut markers = obstacles_to_markers(&list, EPOCH, "map");
    markers.markers.push(plan_to_marker(&plan(), EPOCH, "map"));
    passes(&markers);
    let first = &markers.markers[0];
    assert_eq!((first.pose.position.x, first.pose.position.z, first.scale.x), (20.0, 0.75, 4.5));
    assert_eq!(markers.markers[1].points.len(), 5);
}
