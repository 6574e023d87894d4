//! What each message has to hold beyond finite numbers.

use super::{Check, IMAGE_SIDE_MAX, Invalid, POINTS_MAX, Why, invalid, one_of, within, within_if_any};
use crate::msg::geometry_msgs::{Pose, Quaternion, Transform, Twist};
use crate::msg::{
    autoware_control_msgs, autoware_perception_msgs, autoware_planning_msgs, autoware_vehicle_msgs,
    ds_dbw_msgs, geometry_msgs, nav_msgs, raptor_dbw_msgs, rosgraph_msgs, sensor_msgs, std_msgs, tf2_msgs,
    visualization_msgs,
};

/// Nothing on a road is faster, m/s.
const SPEED_MAX_MPS: f64 = 150.0;
/// Nothing turns faster, rad/s.
const TURN_MAX_RADPS: f64 = 100.0;
/// No sensor measures more, m/s²: 50 g.
const ACCEL_MAX_MPS2: f64 = 500.0;
/// No road wheel turns further, radians.
const TIRE_ANGLE_MAX_RAD: f64 = 1.6;
/// No steering wheel turns further, degrees.
const WHEEL_ANGLE_MAX_DEG: f64 = 2000.0;
/// How far the length of a quaternion may be from one.
const QUATERNION_TOLERANCE: f64 = 0.01;
/// No road wheel spins faster, rad/s.
const WHEEL_SPEED_MAX_RADPS: f64 = 1000.0;

fn quaternion(field: &str, q: &Quaternion) -> Result<(), Invalid> {
    let length = (q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w).sqrt();
    if (length - 1.0).abs() <= QUATERNION_TOLERANCE {
        return Ok(());
    }
    invalid(field, Why::Quaternion(length))
}

fn pose(field: &str, pose: &Pose) -> Result<(), Invalid> {
    quaternion(&format!("{field}.orientation"), &pose.orientation)
}

fn twist(field: &str, twist: &Twist) -> Result<(), Invalid> {
    for (axis, v) in [("x", twist.linear.x), ("y", twist.linear.y), ("z", twist.linear.z)] {
        within(&format!("{field}.linear.{axis}"), v, -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
    }
    for (axis, v) in [("x", twist.angular.x), ("y", twist.angular.y), ("z", twist.angular.z)] {
        within(&format!("{field}.angular.{axis}"), v, -TURN_MAX_RADPS, TURN_MAX_RADPS)?;
    }
    Ok(())
}

/// Variances are not negative; `row` is the side of the matrix.
fn variances(field: &str, covariance: &[f64], row: usize) -> Result<(), Invalid> {
    for i in 0..row {
        within(&format!("{field}[{}]", i * (row + 1)), covariance[i * (row + 1)], 0.0, f64::MAX)?;
    }
    Ok(())
}

/// A covariance that may say with -1 that the quantity is not measured.
fn variances_or_none(field: &str, covariance: &[f64; 9]) -> Result<(), Invalid> {
    if covariance[0] == -1.0 { Ok(()) } else { variances(field, covariance, 3) }
}

fn transform(field: &str, transform: &Transform) -> Result<(), Invalid> {
    quaternion(&format!("{field}.rotation"), &transform.rotation)
}

fn frame(field: &str, frame_id: &str) -> Result<(), Invalid> {
    if frame_id.is_empty() { invalid(field, Why::Name(String::new())) } else { Ok(()) }
}

/// Bytes of a pixel of the encodings that `sensor_msgs/image_encodings` has; `None` for others.
pub(crate) fn bytes_per_pixel(encoding: &str) -> Option<u32> {
    Some(match encoding {
        "mono8" | "8UC1" | "8SC1" => 1,
        "bayer_rggb8" | "bayer_bggr8" | "bayer_gbrg8" | "bayer_grbg8" => 1,
        "mono16" | "16UC1" | "16SC1" | "8UC2" | "yuv422" | "yuv422_yuy2" | "uyvy" | "yuyv" => 2,
        "bayer_rggb16" | "bayer_bggr16" | "bayer_gbrg16" | "bayer_grbg16" => 2,
        "rgb8" | "bgr8" | "8UC3" => 3,
        "rgba8" | "bgra8" | "8UC4" | "32FC1" | "32SC1" => 4,
        "rgb16" | "bgr16" | "16UC3" => 6,
        "rgba16" | "bgra16" | "16UC4" | "64FC1" | "32FC2" => 8,
        "32FC3" => 12,
        _ => return None,
    })
}

impl Check for sensor_msgs::Image {
    fn check(&self) -> Result<(), Invalid> {
        for (field, side) in [("height", self.height), ("width", self.width)] {
            within(field, f64::from(side), 1.0, f64::from(IMAGE_SIDE_MAX))?;
        }
        let Some(bytes) = bytes_per_pixel(&self.encoding) else {
            return invalid("encoding", Why::Name(self.encoding.chars().take(32).collect()));
        };
        let row = u64::from(self.width) * u64::from(bytes);
        if u64::from(self.step) < row {
            return invalid("step", Why::Length { found: u64::from(self.step), wanted: row });
        }
        let (found, wanted) = (self.data.len() as u64, u64::from(self.step) * u64::from(self.height));
        if found != wanted {
            return invalid("data", Why::Length { found, wanted });
        }
        Ok(())
    }
}

impl Check for sensor_msgs::CompressedImage {
    fn check(&self) -> Result<(), Invalid> {
        if self.data.is_empty() {
            return invalid("data", Why::Length { found: 0, wanted: 1 });
        }
        if self.format.is_empty() { invalid("format", Why::Name(String::new())) } else { Ok(()) }
    }
}

impl Check for sensor_msgs::CameraInfo {
    fn check(&self) -> Result<(), Invalid> {
        for (field, side) in [("height", self.height), ("width", self.width)] {
            within(field, f64::from(side), 1.0, f64::from(IMAGE_SIDE_MAX))?;
        }
        let wanted = match self.distortion_model.as_str() {
            "" => Some(0),
            "plumb_bob" => Some(5),
            "rational_polynomial" => Some(8),
            "equidistant" => Some(4),
            _ => None,
        };
        match wanted {
            None => {
                return invalid(
                    "distortion_model",
                    Why::Name(self.distortion_model.chars().take(32).collect()),
                );
            }
            Some(wanted) if !self.d.is_empty() && self.d.len() != wanted => {
                return invalid("d", Why::Length { found: self.d.len() as u64, wanted: wanted as u64 });
            }
            Some(_) => {}
        }
        // An uncalibrated camera has zeros here; a focal length below zero is none.
        within("k[0]", self.k.0[0], 0.0, 1e6)?;
        within("k[4]", self.k.0[4], 0.0, 1e6)
    }
}

impl Check for sensor_msgs::PointCloud2 {
    fn check(&self) -> Result<(), Invalid> {
        let points = u64::from(self.height) * u64::from(self.width);
        if points > POINTS_MAX {
            return invalid("width", Why::Length { found: points, wanted: POINTS_MAX });
        }
        let row = u64::from(self.width) * u64::from(self.point_step);
        if u64::from(self.row_step) < row {
            return invalid("row_step", Why::Length { found: u64::from(self.row_step), wanted: row });
        }
        let (found, wanted) = (self.data.len() as u64, u64::from(self.row_step) * u64::from(self.height));
        if found != wanted {
            return invalid("data", Why::Length { found, wanted });
        }
        let mut taken: Vec<(u64, u64, &str)> = Vec::new();
        if self.fields.len() > 64 {
            return invalid("fields", Why::Length { found: self.fields.len() as u64, wanted: 64 });
        }
        for (i, field) in self.fields.iter().enumerate() {
            let at = |part: &str| format!("fields[{i}].{part}");
            let Some(bytes) = field_bytes(field.datatype) else {
                return invalid(at("datatype"), Why::NoSuchValue(i64::from(field.datatype)));
            };
            let start = u64::from(field.offset);
            let end = start + u64::from(bytes) * u64::from(field.count.max(1));
            if end > u64::from(self.point_step) {
                return invalid(at("offset"), Why::Length { found: end, wanted: u64::from(self.point_step) });
            }
            if taken.iter().any(|(_, _, name)| *name == field.name) {
                return invalid(at("name"), Why::Twice);
            }
            if let Some((_, _, other)) = taken.iter().find(|(s, e, _)| start < *e && *s < end) {
                return invalid(at("offset"), Why::Overlaps((*other).to_owned()));
            }
            taken.push((start, end, &field.name));
        }
        Ok(())
    }
}

/// Bytes of a number of a point field's type.
pub(crate) fn field_bytes(datatype: u8) -> Option<u32> {
    use sensor_msgs::PointField as F;
    Some(match datatype {
        F::INT8 | F::UINT8 => 1,
        F::INT16 | F::UINT16 => 2,
        F::INT32 | F::UINT32 | F::FLOAT32 => 4,
        F::FLOAT64 => 8,
        _ => return None,
    })
}

impl Check for sensor_msgs::Imu {
    fn check(&self) -> Result<(), Invalid> {
        if self.orientation_covariance.0[0] != -1.0 {
            // All zero is what a sensor without orientation leaves when it forgets the -1.
            let q = &self.orientation;
            if [q.x, q.y, q.z, q.w] != [0.0; 4] {
                quaternion("orientation", q)?;
            }
        }
        variances_or_none("orientation_covariance", &self.orientation_covariance.0)?;
        variances_or_none("angular_velocity_covariance", &self.angular_velocity_covariance.0)?;
        variances_or_none("linear_acceleration_covariance", &self.linear_acceleration_covariance.0)?;
        let (w, a) = (&self.angular_velocity, &self.linear_acceleration);
        for (axis, v) in [("x", w.x), ("y", w.y), ("z", w.z)] {
            within(&format!("angular_velocity.{axis}"), v, -TURN_MAX_RADPS, TURN_MAX_RADPS)?;
        }
        for (axis, v) in [("x", a.x), ("y", a.y), ("z", a.z)] {
            within(&format!("linear_acceleration.{axis}"), v, -ACCEL_MAX_MPS2, ACCEL_MAX_MPS2)?;
        }
        Ok(())
    }
}

impl Check for sensor_msgs::NavSatFix {
    fn check(&self) -> Result<(), Invalid> {
        within("status.status", f64::from(self.status.status), -2.0, 2.0)?;
        within("latitude", self.latitude, -90.0, 90.0)?;
        within("longitude", self.longitude, -180.0, 180.0)?;
        if !self.altitude.is_nan() {
            within("altitude", self.altitude, -1e3, 1e5)?;
        }
        within("position_covariance_type", f64::from(self.position_covariance_type), 0.0, 3.0)?;
        variances("position_covariance", &self.position_covariance.0, 3)
    }
}

impl Check for nav_msgs::Odometry {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        frame("child_frame_id", &self.child_frame_id)?;
        pose("pose.pose", &self.pose.pose)?;
        twist("twist.twist", &self.twist.twist)?;
        variances("pose.covariance", &self.pose.covariance.0, 6)?;
        variances("twist.covariance", &self.twist.covariance.0, 6)
    }
}

impl Check for nav_msgs::Path {
    fn check(&self) -> Result<(), Invalid> {
        for (i, stamped) in self.poses.iter().enumerate() {
            pose(&format!("poses[{i}].pose"), &stamped.pose)?;
        }
        Ok(())
    }
}

impl Check for geometry_msgs::PoseStamped {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        pose("pose", &self.pose)
    }
}

impl Check for geometry_msgs::PoseWithCovarianceStamped {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        pose("pose.pose", &self.pose.pose)?;
        variances("pose.covariance", &self.pose.covariance.0, 6)
    }
}

impl Check for geometry_msgs::TwistStamped {
    fn check(&self) -> Result<(), Invalid> {
        twist("twist", &self.twist)
    }
}

impl Check for geometry_msgs::TwistWithCovarianceStamped {
    fn check(&self) -> Result<(), Invalid> {
        twist("twist.twist", &self.twist.twist)?;
        variances("twist.covariance", &self.twist.covariance.0, 6)
    }
}

impl Check for geometry_msgs::AccelWithCovarianceStamped {
    fn check(&self) -> Result<(), Invalid> {
        let a = &self.accel.accel.linear;
        for (axis, v) in [("x", a.x), ("y", a.y), ("z", a.z)] {
            within(&format!("accel.accel.linear.{axis}"), v, -ACCEL_MAX_MPS2, ACCEL_MAX_MPS2)?;
        }
        variances("accel.covariance", &self.accel.covariance.0, 6)
    }
}

impl Check for geometry_msgs::TransformStamped {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        frame("child_frame_id", &self.child_frame_id)?;
        transform("transform", &self.transform)
    }
}

impl Check for tf2_msgs::TFMessage {
    fn check(&self) -> Result<(), Invalid> {
        for (i, edge) in self.transforms.iter().enumerate() {
            edge.check().map_err(|e| Invalid { field: format!("transforms[{i}].{}", e.field), ..e })?;
        }
        Ok(())
    }
}

impl Check for rosgraph_msgs::Clock {
    fn check(&self) -> Result<(), Invalid> {
        within("clock.sec", f64::from(self.clock.sec), 0.0, f64::from(i32::MAX))
    }
}

impl Check for visualization_msgs::MarkerArray {
    fn check(&self) -> Result<(), Invalid> {
        for (i, marker) in self.markers.iter().enumerate() {
            within(&format!("markers[{i}].type"), f64::from(marker.type_), 0.0, 12.0)?;
            within(&format!("markers[{i}].action"), f64::from(marker.action), 0.0, 3.0)?;
        }
        Ok(())
    }
}

impl Check for std_msgs::Bool {
    fn check(&self) -> Result<(), Invalid> {
        Ok(())
    }
}

impl Check for std_msgs::Empty {
    fn check(&self) -> Result<(), Invalid> {
        Ok(())
    }
}

impl Check for autoware_control_msgs::Control {
    fn check(&self) -> Result<(), Invalid> {
        let (lateral, longitudinal) = (&self.lateral, &self.longitudinal);
        let angle = f64::from(lateral.steering_tire_angle);
        within("lateral.steering_tire_angle", angle, -TIRE_ANGLE_MAX_RAD, TIRE_ANGLE_MAX_RAD)?;
        let speed = f64::from(longitudinal.velocity);
        within("longitudinal.velocity", speed, -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
        let accel = f64::from(longitudinal.acceleration);
        within("longitudinal.acceleration", accel, -ACCEL_MAX_MPS2, ACCEL_MAX_MPS2)
    }
}

impl Check for autoware_vehicle_msgs::VelocityReport {
    fn check(&self) -> Result<(), Invalid> {
        let speed = f64::from(self.longitudinal_velocity);
        within("longitudinal_velocity", speed, -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
        within("lateral_velocity", f64::from(self.lateral_velocity), -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
        within("heading_rate", f64::from(self.heading_rate), -TURN_MAX_RADPS, TURN_MAX_RADPS)
    }
}

impl Check for autoware_vehicle_msgs::SteeringReport {
    fn check(&self) -> Result<(), Invalid> {
        let angle = f64::from(self.steering_tire_angle);
        within("steering_tire_angle", angle, -TIRE_ANGLE_MAX_RAD, TIRE_ANGLE_MAX_RAD)
    }
}

impl Check for autoware_vehicle_msgs::ControlModeReport {
    fn check(&self) -> Result<(), Invalid> {
        within("mode", f64::from(self.mode), 0.0, 6.0)
    }
}

impl Check for autoware_vehicle_msgs::GearCommand {
    fn check(&self) -> Result<(), Invalid> {
        let last = f64::from(autoware_vehicle_msgs::GearReport::LAST);
        within("command", f64::from(self.command), 0.0, last)
    }
}

impl Check for autoware_vehicle_msgs::GearReport {
    fn check(&self) -> Result<(), Invalid> {
        within("report", f64::from(self.report), 0.0, f64::from(Self::LAST))
    }
}

impl Check for autoware_vehicle_msgs::TurnIndicatorsCommand {
    fn check(&self) -> Result<(), Invalid> {
        within("command", f64::from(self.command), 0.0, 3.0)
    }
}

impl Check for autoware_vehicle_msgs::TurnIndicatorsReport {
    fn check(&self) -> Result<(), Invalid> {
        within("report", f64::from(self.report), 0.0, 3.0)
    }
}

impl Check for autoware_vehicle_msgs::HazardLightsCommand {
    fn check(&self) -> Result<(), Invalid> {
        within("command", f64::from(self.command), 0.0, 2.0)
    }
}

impl Check for autoware_vehicle_msgs::HazardLightsReport {
    fn check(&self) -> Result<(), Invalid> {
        within("report", f64::from(self.report), 0.0, 2.0)
    }
}

impl Check for autoware_vehicle_msgs::Engage {
    fn check(&self) -> Result<(), Invalid> {
        Ok(())
    }
}

impl Check for autoware_planning_msgs::Trajectory {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        for (i, point) in self.points.iter().enumerate() {
            let at = |part: &str| format!("points[{i}].{part}");
            pose(&at("pose"), &point.pose)?;
            let speed = f64::from(point.longitudinal_velocity_mps);
            within(&at("longitudinal_velocity_mps"), speed, -SPEED_MAX_MPS, SPEED_MAX_MPS)?;
            let angle = f64::from(point.front_wheel_angle_rad);
            within(&at("front_wheel_angle_rad"), angle, -TIRE_ANGLE_MAX_RAD, TIRE_ANGLE_MAX_RAD)?;
        }
        Ok(())
    }
}

impl Check for autoware_perception_msgs::PredictedObjects {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        for (i, object) in self.objects.iter().enumerate() {
            let at = |part: &str| format!("objects[{i}].{part}");
            within(&at("existence_probability"), f64::from(object.existence_probability), 0.0, 1.0)?;
            for label in &object.classification {
                within(&at("classification.label"), f64::from(label.label), 0.0, 11.0)?;
                within(&at("classification.probability"), f64::from(label.probability), 0.0, 1.0)?;
            }
            let kinematics = &object.kinematics;
            pose(
                &at("kinematics.initial_pose_with_covariance.pose"),
                &kinematics.initial_pose_with_covariance.pose,
            )?;
            twist(
                &at("kinematics.initial_twist_with_covariance.twist"),
                &kinematics.initial_twist_with_covariance.twist,
            )?;
            for path in &kinematics.predicted_paths {
                within(&at("kinematics.predicted_paths.confidence"), f64::from(path.confidence), 0.0, 1.0)?;
                for one in &path.path {
                    pose(&at("kinematics.predicted_paths.path"), one)?;
                }
            }
            within(&at("shape.type"), f64::from(object.shape.type_), 0.0, 2.0)?;
            let size = &object.shape.dimensions;
            for (axis, v) in [("x", size.x), ("y", size.y), ("z", size.z)] {
                within(&at(&format!("shape.dimensions.{axis}")), v, 0.0, 1000.0)?;
            }
        }
        Ok(())
    }
}

impl Check for ds_dbw_msgs::SteeringCmd {
    fn check(&self) -> Result<(), Invalid> {
        one_of("cmd_type", self.cmd_type, &[0, 1, 2, 3, 4, 14, 15])?;
        within("cmd", f64::from(self.cmd), -WHEEL_ANGLE_MAX_DEG, WHEEL_ANGLE_MAX_DEG)?;
        within("cmd_rate", f64::from(self.cmd_rate), 0.0, 2000.0)
    }
}

impl Check for ds_dbw_msgs::BrakeCmd {
    fn check(&self) -> Result<(), Invalid> {
        one_of("cmd_type", self.cmd_type, &[0, 1, 2, 8, 9, 10, 13, 14])
    }
}

impl Check for ds_dbw_msgs::ThrottleCmd {
    fn check(&self) -> Result<(), Invalid> {
        one_of("cmd_type", self.cmd_type, &[0, 13, 14])
    }
}

impl Check for ds_dbw_msgs::UlcCmd {
    fn check(&self) -> Result<(), Invalid> {
        one_of("cmd_type", self.cmd_type, &[0, 1, 2])?;
        within("cmd", f64::from(self.cmd), -SPEED_MAX_MPS, SPEED_MAX_MPS)
    }
}

fn dataspeed_gear(field: &str, gear: ds_dbw_msgs::Gear) -> Result<(), Invalid> {
    one_of(field, gear.value, &[0, 1, 2, 3, 4, 5, 6, 7, 15])
}

impl Check for ds_dbw_msgs::GearCmd {
    fn check(&self) -> Result<(), Invalid> {
        dataspeed_gear("cmd.value", self.cmd)
    }
}

impl Check for ds_dbw_msgs::SteeringReport {
    fn check(&self) -> Result<(), Invalid> {
        let most = WHEEL_ANGLE_MAX_DEG;
        within_if_any("steering_wheel_angle", self.steering_wheel_angle, -most, most)?;
        within("cmd_type", f64::from(self.cmd_type), 0.0, 15.0)
    }
}

impl Check for ds_dbw_msgs::BrakeReport {
    fn check(&self) -> Result<(), Invalid> {
        within("cmd_type", f64::from(self.cmd_type), 0.0, 15.0)?;
        within_if_any("percent_input", self.percent_input, -1.0, 110.0)?;
        within_if_any("percent_output", self.percent_output, -1.0, 110.0)
    }
}

impl Check for ds_dbw_msgs::ThrottleReport {
    fn check(&self) -> Result<(), Invalid> {
        within("cmd_type", f64::from(self.cmd_type), 0.0, 15.0)?;
        within_if_any("percent_input", self.percent_input, -1.0, 110.0)?;
        within_if_any("percent_output", self.percent_output, -1.0, 110.0)
    }
}

impl Check for ds_dbw_msgs::UlcReport {
    fn check(&self) -> Result<(), Invalid> {
        within("cmd_type", f64::from(self.cmd_type), 0.0, 15.0)?;
        within_if_any("vel_meas", self.vel_meas, -SPEED_MAX_MPS, SPEED_MAX_MPS)
    }
}

impl Check for ds_dbw_msgs::GearReport {
    fn check(&self) -> Result<(), Invalid> {
        for (field, gear) in
            [("gear.value", self.gear), ("cmd.value", self.cmd), ("driver.value", self.driver)]
        {
            dataspeed_gear(field, gear)?;
        }
        within("reject.value", f64::from(self.reject.value), 0.0, 15.0)
    }
}

impl Check for ds_dbw_msgs::VehicleVelocity {
    fn check(&self) -> Result<(), Invalid> {
        let most = SPEED_MAX_MPS;
        within_if_any("vehicle_velocity_brake", self.vehicle_velocity_brake, -most, most)?;
        within_if_any("vehicle_velocity_propulsion", self.vehicle_velocity_propulsion, -most, most)
    }
}

impl Check for ds_dbw_msgs::WheelSpeeds {
    fn check(&self) -> Result<(), Invalid> {
        let most = WHEEL_SPEED_MAX_RADPS;
        within_if_any("front_left", self.front_left, -most, most)?;
        within_if_any("front_right", self.front_right, -most, most)?;
        within_if_any("rear_left", self.rear_left, -most, most)?;
        within_if_any("rear_right", self.rear_right, -most, most)
    }
}

fn raptor_mode(field: &str, mode: raptor_dbw_msgs::ActuatorControlMode) -> Result<(), Invalid> {
    one_of(field, mode.value, &[0, 1, 2, 255])
}

impl Check for raptor_dbw_msgs::AcceleratorPedalCmd {
    fn check(&self) -> Result<(), Invalid> {
        within("pedal_cmd", f64::from(self.pedal_cmd), 0.0, 100.0)?;
        within("speed_cmd", f64::from(self.speed_cmd), 0.0, SPEED_MAX_MPS)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for raptor_dbw_msgs::BrakeCmd {
    fn check(&self) -> Result<(), Invalid> {
        within("pedal_cmd", f64::from(self.pedal_cmd), 0.0, 100.0)?;
        within("park_brake_cmd.status", f64::from(self.park_brake_cmd.status), 0.0, 3.0)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for raptor_dbw_msgs::SteeringCmd {
    fn check(&self) -> Result<(), Invalid> {
        within("angle_cmd", f64::from(self.angle_cmd), -WHEEL_ANGLE_MAX_DEG, WHEEL_ANGLE_MAX_DEG)?;
        within("angle_velocity", f64::from(self.angle_velocity), 0.0, 2000.0)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for raptor_dbw_msgs::GearCmd {
    fn check(&self) -> Result<(), Invalid> {
        within("cmd.gear", f64::from(self.cmd.gear), 0.0, 8.0)
    }
}

impl Check for raptor_dbw_msgs::GlobalEnableCmd {
    fn check(&self) -> Result<(), Invalid> {
        Ok(())
    }
}

impl Check for raptor_dbw_msgs::SteeringReport {
    fn check(&self) -> Result<(), Invalid> {
        let angle = f64::from(self.steering_wheel_angle);
        within("steering_wheel_angle", angle, -WHEEL_ANGLE_MAX_DEG, WHEEL_ANGLE_MAX_DEG)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for raptor_dbw_msgs::AcceleratorPedalReport {
    fn check(&self) -> Result<(), Invalid> {
        within("pedal_output", f64::from(self.pedal_output), -1.0, 110.0)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for raptor_dbw_msgs::BrakeReport {
    fn check(&self) -> Result<(), Invalid> {
        within("pedal_output", f64::from(self.pedal_output), -1.0, 110.0)?;
        within("parking_brake.status", f64::from(self.parking_brake.status), 0.0, 3.0)?;
        raptor_mode("control_type.value", self.control_type)
    }
}

impl Check for raptor_dbw_msgs::MiscReport {
    fn check(&self) -> Result<(), Invalid> {
        within("vehicle_speed", f64::from(self.vehicle_speed), -500.0, 500.0)?;
        within("fuel_level", f64::from(self.fuel_level), -1.0, 110.0)
    }
}

impl Check for raptor_dbw_msgs::WheelSpeedReport {
    fn check(&self) -> Result<(), Invalid> {
        let most = WHEEL_SPEED_MAX_RADPS;
        within("front_left", f64::from(self.front_left), -most, most)?;
        within("front_right", f64::from(self.front_right), -most, most)?;
        within("rear_left", f64::from(self.rear_left), -most, most)?;
        within("rear_right", f64::from(self.rear_right), -most, most)
    }
}
