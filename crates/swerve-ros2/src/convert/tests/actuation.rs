//! Tests of command conversions.

use super::*;

#[test]
fn commands_convert_road_wheel_and_steering_wheel_angles() {
    let command =
        MotionCommand { stamp: Time::from_ms(30), steering_rad: 0.125, speed_mps: 10.0, accel_mps2: -1.5 };
    let control = control_to_ros(&command, EPOCH);
    passes(&control);
    assert_eq!(control_from_ros(&control, EPOCH), command);
    let ackermann = ackermann_to_ros(&command, EPOCH, "base_link");
    passes(&ackermann);
    let drive = ackermann.drive;
    assert_eq!((drive.steering_angle, drive.speed, drive.acceleration), (0.125, 10.0, -1.5));
    assert_eq!((drive.steering_angle_velocity, drive.jerk), (0.0, 0.0));
    assert_eq!((ackermann.header.stamp, ackermann.header.frame_id.as_str()), (control.stamp, "base_link"));
    assert_eq!(ackermann_from_ros(&ackermann, EPOCH), command);

    let gear = SteeringGear { ratio: 16.0, wheel_max_deg: 450.0, wheel_rate_degps: 300.0 };
    // PI / 32 times 16: a quarter turn of the steering wheel.
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
    let speed = dataspeed.speed(&command, AccelLimits { accel_mps2: 2.0, decel_mps2: 3.0 }, true, true);
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
fn drive_by_wire_reports_convert_to_si_units() {
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
fn driver_activity_is_detected_in_every_interface() {
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

/// A road-wheel angle of 35 degrees is half of CARLA's usual 70; its `steer` is positive to the right.
#[test]
fn carla_commands_are_shares_with_steering_positive_to_the_right() {
    let gear = SteeringGear { ratio: 1.0, wheel_max_deg: 70.0, ..SteeringGear::default() };
    let control = |degrees: f64, throttle: f64, brake: f64| {
        let command = Command { steering_rad: degrees.to_radians(), throttle, brake };
        let control = carla_control(&command, &gear, Time::from_ms(1750), EPOCH, "");
        passes(&control);
        control
    };
    let left = control(35.0, 0.25, 0.0);
    assert_eq!((left.steer, left.throttle, left.brake), (-0.5, 0.25, 0.0));
    assert_eq!((left.gear, left.reverse, left.hand_brake, left.manual_gear_shift), (1, false, false, false));
    assert_eq!(left.header.stamp, EPOCH.stamp(Time::from_ms(1750)));
    assert!((carla_steering_from_ros(&left, &gear) - 35.0_f64.to_radians()).abs() < 1e-7);
    let right = control(-80.0, 1.5, 2.0);
    assert_eq!((right.steer, right.throttle, right.brake), (1.0, 1.0, 1.0));
    assert!((carla_steering_from_ros(&right, &gear) + 70.0_f64.to_radians()).abs() < 1e-7);
}
