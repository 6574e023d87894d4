//! Conversion of localization data: inertial measurements, satellite fixes, odometry.

use swerve_geom::{Ego, Transform, Vector};
use swerve_msg::{EgoState, Gnss, Imu, WheelOdometry};

use super::pose::Sensor;
use super::{ConvertError, Epoch, expect_frame, pose_from_ros, pose_to_ros};
use crate::msg::std_msgs::Header;
use crate::msg::{Matrix, autoware_vehicle_msgs, geometry_msgs as geo, nav_msgs, sensor_msgs, tf2_msgs};

/// Assumed standard deviation of a fix without a covariance: plain GPS in a street, metres.
const UNKNOWN_DEVIATION_M: f64 = 10.0;

/// Converts a measurement to `sensor_msgs/Imu`: no orientation, unknown covariances. Both contain specific force: a
/// sensor at rest reads +9.81 upwards.
pub fn imu_to_ros(imu: &Imu, epoch: Epoch, frame_id: &str) -> sensor_msgs::Imu {
    let vector = |v: [f64; 3]| geo::Vector3 { x: v[0], y: v[1], z: v[2] };
    let mut no_orientation = Matrix::default();
    no_orientation.0[0] = -1.0;
    sensor_msgs::Imu {
        header: epoch.header(imu.stamp, frame_id),
        orientation_covariance: no_orientation,
        angular_velocity: vector(imu.gyro_radps),
        linear_acceleration: vector(imu.accel_mps2),
        ..sensor_msgs::Imu::default()
    }
}

/// Converts a measurement to the axes of the ego frame; applies the sensor's orientation but not its position.
///
/// # Errors
/// If the sensor reports that it does not measure acceleration or angular rate.
pub fn imu_from_ros(
    imu: &sensor_msgs::Imu,
    epoch: Epoch,
    ego_from_sensor: &Transform<Ego, Sensor>,
) -> Result<Imu, ConvertError> {
    for (covariance, what) in [
        (&imu.angular_velocity_covariance, "angular_velocity"),
        (&imu.linear_acceleration_covariance, "linear_acceleration"),
    ] {
        if covariance.0[0] == -1.0 {
            return Err(ConvertError::NotMeasured(what));
        }
    }
    let turned = |v: &geo::Vector3| {
        let ego = (*ego_from_sensor * Vector::<Sensor>::new(v.x, v.y, v.z)).coords;
        [ego.x, ego.y, ego.z]
    };
    Ok(Imu {
        stamp: epoch.time(imu.header.stamp),
        accel_mps2: turned(&imu.linear_acceleration),
        gyro_radps: turned(&imu.angular_velocity),
    })
}

/// Converts a fix, with the same variance in all directions.
pub fn gnss_to_ros(gnss: &Gnss, epoch: Epoch, frame_id: &str) -> sensor_msgs::NavSatFix {
    let variance = gnss.deviation_m * gnss.deviation_m;
    sensor_msgs::NavSatFix {
        header: epoch.header(gnss.stamp, frame_id),
        status: sensor_msgs::NavSatStatus {
            status: sensor_msgs::NavSatStatus::FIX,
            service: sensor_msgs::NavSatStatus::SERVICE_GPS,
        },
        latitude: gnss.latitude_deg,
        longitude: gnss.longitude_deg,
        altitude: gnss.altitude_m,
        position_covariance: Matrix([variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]),
        position_covariance_type: sensor_msgs::NavSatFix::COVARIANCE_TYPE_DIAGONAL_KNOWN,
    }
}

/// Converts a fix. The deviation is the root of the mean variance of east and north, 10 m if unknown; a missing
/// altitude becomes zero.
///
/// # Errors
/// If there is no fix.
pub fn gnss_from_ros(fix: &sensor_msgs::NavSatFix, epoch: Epoch) -> Result<Gnss, ConvertError> {
    if fix.status.status < sensor_msgs::NavSatStatus::FIX {
        return Err(ConvertError::NoFix);
    }
    let known = fix.position_covariance_type != sensor_msgs::NavSatFix::COVARIANCE_TYPE_UNKNOWN;
    let mean = 0.5 * (fix.position_covariance.0[0] + fix.position_covariance.0[4]);
    Ok(Gnss {
        stamp: epoch.time(fix.header.stamp),
        latitude_deg: fix.latitude,
        longitude_deg: fix.longitude,
        altitude_m: if fix.altitude.is_nan() { 0.0 } else { fix.altitude },
        deviation_m: if known { mean.sqrt() } else { UNKNOWN_DEVIATION_M },
    })
}

/// Converts the ego's state to `nav_msgs/Odometry`: pose in the map, twist in `base_link`.
pub fn ego_to_ros(ego: &EgoState, epoch: Epoch, map: &str, base_link: &str) -> nav_msgs::Odometry {
    nav_msgs::Odometry {
        header: epoch.header(ego.stamp, map),
        child_frame_id: base_link.to_owned(),
        pose: geo::PoseWithCovariance { pose: pose_to_ros(ego.pose), covariance: Matrix::default() },
        twist: geo::TwistWithCovariance {
            twist: geo::Twist {
                linear: geo::Vector3 { x: ego.speed_mps, y: 0.0, z: 0.0 },
                angular: geo::Vector3 { x: 0.0, y: 0.0, z: ego.yaw_rate_radps },
            },
            covariance: Matrix::default(),
        },
    }
}

/// Parts of the ego's state that an odometry message lacks.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Beside {
    /// Acceleration along the heading, m/s².
    pub accel_mps2: f64,
    /// Angle of the front road wheels, radians; positive to the left.
    pub steering_rad: f64,
}

/// Converts odometry to the ego's state, with the acceleration and steering angle that the message lacks.
///
/// # Errors
/// If the frames are not `map` and `base_link`.
pub fn ego_from_ros(
    odometry: &nav_msgs::Odometry,
    epoch: Epoch,
    map: &str,
    base_link: &str,
    Beside { accel_mps2, steering_rad }: Beside,
) -> Result<EgoState, ConvertError> {
    expect_frame(&odometry.header.frame_id, map)?;
    expect_frame(&odometry.child_frame_id, base_link)?;
    let twist = &odometry.twist.twist;
    Ok(EgoState {
        stamp: epoch.time(odometry.header.stamp),
        pose: pose_from_ros(&odometry.pose.pose),
        speed_mps: twist.linear.x,
        accel_mps2,
        lateral_accel_mps2: twist.linear.x * twist.angular.z,
        yaw_rate_radps: twist.angular.z,
        steering_rad,
    })
}

/// Converts a pose (`PoseStamped`, or `PoseWithCovarianceStamped` without its covariance) to the ego's state, with
/// motion data from the vehicle.
///
/// # Errors
/// If the frame is not `map`.
pub fn ego_from_pose(
    header: &Header,
    pose: &geo::Pose,
    epoch: Epoch,
    map: &str,
    wheels: &WheelOdometry,
    accel_mps2: f64,
) -> Result<EgoState, ConvertError> {
    expect_frame(&header.frame_id, map)?;
    Ok(EgoState {
        stamp: epoch.time(header.stamp),
        pose: pose_from_ros(pose),
        speed_mps: wheels.speed_mps,
        accel_mps2,
        lateral_accel_mps2: wheels.speed_mps * wheels.yaw_rate_radps,
        yaw_rate_radps: wheels.yaw_rate_radps,
        steering_rad: wheels.steering_rad,
    })
}

/// Transform from the map to `base_link`.
pub fn ego_to_transform(ego: &EgoState, epoch: Epoch, map: &str, base_link: &str) -> tf2_msgs::TFMessage {
    let pose = pose_to_ros(ego.pose);
    let transform = geo::Transform {
        translation: geo::Vector3 { x: pose.position.x, y: pose.position.y, z: pose.position.z },
        rotation: pose.orientation,
    };
    let header = epoch.header(ego.stamp, map);
    let child_frame_id = base_link.to_owned();
    tf2_msgs::TFMessage { transforms: vec![geo::TransformStamped { header, child_frame_id, transform }] }
}

/// Converts wheel odometry to Autoware's velocity report.
pub fn velocity_to_ros(
    wheels: &WheelOdometry,
    epoch: Epoch,
    base_link: &str,
) -> autoware_vehicle_msgs::VelocityReport {
    autoware_vehicle_msgs::VelocityReport {
        header: epoch.header(wheels.stamp, base_link),
        longitudinal_velocity: wheels.speed_mps as f32,
        lateral_velocity: 0.0,
        heading_rate: wheels.yaw_rate_radps as f32,
    }
}

/// Converts the angle of the front road wheels to Autoware's steering report.
pub fn steering_to_ros(wheels: &WheelOdometry, epoch: Epoch) -> autoware_vehicle_msgs::SteeringReport {
    let stamp = epoch.stamp(wheels.stamp);
    autoware_vehicle_msgs::SteeringReport { stamp, steering_tire_angle: wheels.steering_rad as f32 }
}
