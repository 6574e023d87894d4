use swerve_core::Time;
use swerve_geom::{Point, Pose2, Transform};
use swerve_msg::{ActorKind, Signal};

use swerve_scenario::SignalProgram;

use super::*;
use crate::sense::tests::{actor, world};
use crate::tests::{PERSON_BEHIND_TRUCK, scenario};
use swerve_vehicle::Shape;

/// Green for 2 s, yellow for 3, red for 10; 60 m ahead, 3 m to the right.
fn road() -> Road {
    let light = Light {
        name: "crossing".into(),
        pose: Pose2::new(60.0, -3.0, 0.0),
        stop_s_m: Some(58.0),
        signal: None,
        program: SignalProgram::green_yellow_red([2.0, 3.0, 10.0], 0.0),
    };
    Road { lights: vec![light], ..scenario(PERSON_BEHIND_TRUCK).road }
}

fn seen(ms: i64, x_m: f64, params: &SensorParams, truck_m: Option<f64>) -> Option<Signal> {
    let truck = truck_m.map(|height_m| actor(1, ActorKind::Truck, 30.0, -1.5, [6.0, 2.5, height_m]));
    let mut world = WorldState { stamp: Time::from_ms(ms), ..world(truck.into_iter().collect()) };
    world.ego.state.pose.x_m = x_m;
    world.ego.map_from_ego = Transform::from_roll_pitch_yaw(Point::new(x_m, 0.0, 0.0), 0.0, 0.0, 0.0);
    let list = TrafficLightSensor::new(&road()).sense(&world, &SensorMount::roof(&Shape::default()), params);
    assert_eq!(list.stamp, world.stamp);
    let light = list.lights.first()?;
    assert_eq!((light.name.as_deref(), light.stop_s_m), (Some("crossing"), Some(58.0)));
    assert!((light.distance_m - swerve_geom::math::hypot(60.0 - x_m, 3.0)).abs() < 1e-6);
    light.signal
}

#[test]
fn light_is_reported_with_its_signal_from_before_its_face() {
    let all = SensorParams::default();
    let signals = [0, 1999, 2000, 4999, 5000, 14999, 15000].map(|ms| seen(ms, 0.0, &all, None));
    let [green, yellow, red] = [Signal::Green, Signal::Yellow, Signal::Red].map(Some);
    assert_eq!(signals, [green, green, yellow, yellow, red, red, green]);
    assert_eq!(seen(0, 70.0, &all, None), None, "from behind");
}

#[test]
fn sight_is_limited_by_range_field_of_view_and_bodies() {
    let all = SensorParams::default();
    assert_eq!(seen(0, 0.0, &SensorParams { range_m: 50.0, ..all }, None), None);
    assert_eq!(seen(0, 20.0, &SensorParams { range_m: 50.0, ..all }, None), Some(Signal::Green));
    // 3 m aside and 5 m ahead of the sensor: 31 degrees.
    let [wide, narrow] = [70.0_f64, 50.0].map(|deg| SensorParams { fov_rad: deg.to_radians(), ..all });
    let near_m = 60.0 - 5.0 - Shape::default().center_ahead_m();
    assert_eq!(seen(0, near_m, &wide, None), Some(Signal::Green));
    assert_eq!(seen(0, near_m, &narrow, None), None);
    // The line of sight rises from 1.9 m to 2.9 m: half way it is 2.4 m high.
    assert_eq!(seen(0, 0.0, &all, Some(3.5)), None);
    assert_eq!(seen(0, 0.0, &all, Some(2.0)), Some(Signal::Green));
    assert_eq!(seen(0, 0.0, &SensorParams { occlusion: false, ..all }, Some(3.5)), Some(Signal::Green));
}
