use swerve_core::{Span, Time};
use swerve_geom::{Point, Pose2, Transform, Vector, Vector2};
use swerve_msg::truth::{Actor, EgoTruth, WorldState};
use swerve_msg::{ActorId, ActorKind, EgoState, Extent, Side};
use swerve_vehicle::Shape;

use super::*;

const MOUNT: SensorMount = SensorMount { x_m: 1.0, y_m: 0.0, z_m: 1.9, yaw_rad: 0.0 };

pub(super) fn world(actors: Vec<Actor>) -> WorldState {
    let pose = Pose2::new(0.0, 0.0, 0.0);
    WorldState {
        stamp: Time::from_ms(500),
        ego: EgoTruth {
            map_from_ego: Transform::from_roll_pitch_yaw(Point::new(0.0, 0.0, 0.0), 0.0, 0.0, 0.0),
            state: EgoState { pose, speed_mps: 10.0, ..EgoState::default() },
            velocity_mps: Vector::new(10.0, 0.0, 0.0),
            specific_force_mps2: Vector::new(0.5, -0.2, 9.81),
            angular_velocity_radps: Vector::new(0.0, 0.0, 0.1),
        },
        actors,
        collisions: Vec::new(),
        infractions: Vec::new(),
        ended: None,
    }
}

pub(super) fn actor(id: u32, kind: ActorKind, x_m: f64, y_m: f64, size: [f64; 3]) -> Actor {
    let [length_m, width_m, height_m] = size;
    Actor {
        id: ActorId(id),
        kind,
        pose: Pose2::new(x_m, y_m, 0.0),
        z_m: 0.0,
        extent: Extent { length_m, width_m, height_m },
        velocity_mps: Vector2::default(),
    }
}

pub(super) fn person(id: u32, x_m: f64, y_m: f64) -> Actor {
    actor(id, ActorKind::Pedestrian, x_m, y_m, [0.5, 0.5, 1.8])
}

fn shares(world: &WorldState, params: &SensorParams) -> Vec<(u32, f64)> {
    let list = visible_obstacles(world, &MOUNT, params);
    assert_eq!(list.stamp, world.stamp);
    list.obstacles.iter().map(|o| (o.id.0, (o.visible_share * 9.0).round())).collect()
}

#[test]
fn nothing_in_between_shows_all_nine_points() {
    let world = world(vec![person(1, 20.0, 0.0), actor(2, ActorKind::Car, -15.0, 3.0, [4.5, 1.8, 1.5])]);
    assert_eq!(shares(&world, &SensorParams::default()), [(1, 9.0), (2, 9.0)]);
}

#[test]
fn a_tall_wall_hides_and_a_low_one_hides_the_lower_points() {
    let wall = |height: f64| actor(2, ActorKind::Static, 10.0, 0.0, [1.0, 6.0, height]);
    let behind = |height: f64| world(vec![person(1, 12.0, 0.0), wall(height)]);
    let params = SensorParams::default();
    assert_eq!(shares(&behind(3.0), &params), [(2, 9.0)]);
    // Rays fall from 1.9 m at x = 1 to a rim at 1.8 m: above 1.8 m over the whole wall. To the centre at 0.9 m
    // they pass the far side of the wall (x = 10.5) at 1.04 m.
    assert_eq!(shares(&behind(1.0), &params), [(1, 5.0), (2, 9.0)]);
    assert_eq!(shares(&behind(1.1), &params), [(1, 4.0), (2, 9.0)]);
    let unoccluded = SensorParams { occlusion: false, ..params };
    assert_eq!(shares(&behind(3.0), &unoccluded), [(1, 9.0), (2, 9.0)]);
}

#[test]
fn people_block_as_cylinders() {
    // The ray to the far person's centre line passes the near one 0.3 m off its middle: beside the cylinder
    // (0.25 m) though through the corner of its box (0.35 m).
    let near = actor(2, ActorKind::Pedestrian, 10.0, 0.3, [0.5, 0.5, 2.5]);
    let far = |y| actor(1, ActorKind::Static, 30.0, y, [0.001, 0.001, 1.0]);
    let params = SensorParams::default();
    assert_eq!(shares(&world(vec![far(0.0), near.clone()]), &params), [(1, 9.0), (2, 9.0)]);
    let straight_behind = 0.3 * 29.0 / 9.0;
    assert_eq!(shares(&world(vec![far(straight_behind), near]), &params), [(2, 9.0)]);
}

#[test]
fn range_is_to_the_centre_and_may_differ_for_people() {
    let world = world(vec![
        person(1, 41.5, 0.0),
        actor(2, ActorKind::Car, 41.5, 8.0, [4.5, 1.8, 1.5]),
        person(3, 30.9, 0.0),
    ]);
    let params = SensorParams { range_m: 50.0, range_person_m: Some(30.0), ..SensorParams::default() };
    assert_eq!(shares(&world, &params), [(2, 9.0), (3, 9.0)]);
    let near = SensorParams { range_person_m: Some(29.8), ..params };
    assert_eq!(shares(&world, &near), [(2, 9.0)]);
}

#[test]
fn the_field_of_view_cuts_point_by_point() {
    let quarter = core::f64::consts::FRAC_PI_2;
    // The axis goes through the person's middle, so half of its side points are left and right of the edge.
    let world = world(vec![person(1, 11.0, 10.0), person(2, 11.0, 5.0), person(3, -5.0, 0.0)]);
    let params = SensorParams { fov_rad: quarter, ..SensorParams::default() };
    let seen = shares(&world, &params);
    assert_eq!(seen[1], (2, 9.0));
    assert!(seen[0].0 == 1 && seen[0].1 > 3.0 && seen[0].1 < 6.0, "{seen:?}");
    assert_eq!(seen.len(), 2, "what is behind is not seen");
    let turned = SensorMount { yaw_rad: 2.0 * quarter, ..MOUNT };
    let behind = visible_obstacles(&world, &turned, &params);
    assert_eq!(behind.obstacles.len(), 1);
    assert_eq!(behind.obstacles[0].id, ActorId(3));
}

#[test]
fn boxes_side_by_side_do_not_hide_each_other_entirely() {
    let world = world(vec![
        actor(1, ActorKind::Car, 20.0, 1.0, [4.0, 2.0, 1.5]),
        actor(2, ActorKind::Car, 20.0, -1.0, [4.0, 2.0, 1.5]),
    ]);
    let seen = shares(&world, &SensorParams::default());
    assert_eq!(seen.len(), 2);
    assert!(seen.iter().all(|s| s.1 >= 6.0), "{seen:?}");
}

#[test]
fn a_sensor_in_the_middle_of_the_car_is_inside_it_and_the_usual_places_are_not() {
    let shape = Shape::default();
    let usual = [SensorMount::roof(&shape), SensorMount::front(&shape)];
    let corners = [Side::Left, Side::Right].map(|s| [true, false].map(|f| SensorMount::corner(&shape, f, s)));
    for mount in usual.iter().chain(corners.as_flattened()) {
        assert!(!mount.is_inside(&shape), "{mount:?}");
        assert_eq!(mount.faults(), []);
    }
    assert!(SensorMount { z_m: 1.2, ..SensorMount::roof(&shape) }.is_inside(&shape));
    assert!(SensorMount { x_m: 3.5, ..SensorMount::front(&shape) }.is_inside(&shape));
    let wrong = SensorMount { z_m: -0.1, yaw_rad: f64::INFINITY, ..SensorMount::roof(&shape) };
    let problems: Vec<String> = wrong.faults().iter().map(ToString::to_string).collect();
    assert_eq!(problems[0], "z_m: expected 0 to 10, found -0.1");
    assert!(
        problems.len() == 2
            && problems[1].starts_with("yaw_rad: expected ")
            && problems[1].ends_with("found inf")
    );
}

#[test]
fn without_noise_the_ego_sensors_tell_the_truth() {
    let world = world(Vec::new());
    let exact = pose(&world, "pose", &PoseParams::default(), 3);
    assert_eq!(exact, EgoState { stamp: world.stamp, ..world.ego.state });
    let reading = imu(&world, "imu", &ImuParams::default(), 3);
    assert_eq!((reading.accel_mps2, reading.gyro_radps), ([0.5, -0.2, 9.81], [0.0, 0.0, 0.1]));
    assert_eq!(reading.stamp, world.stamp);
}

#[test]
fn noise_is_keyed_by_seed_sensor_and_stamp_and_bias_by_seed_and_sensor() {
    let noisy = ImuParams { accel_noise_mps2: 0.1, ..ImuParams::default() };
    let biased = ImuParams { accel_bias_mps2: 0.1, ..ImuParams::default() };
    let at = |ms: i64| WorldState { stamp: Time::from_ms(ms), ..world(Vec::new()) };
    let read =
        |params: &ImuParams, sensor: &str, ms: i64, seed: u64| imu(&at(ms), sensor, params, seed).accel_mps2;
    assert_eq!(read(&noisy, "imu", 10, 1), read(&noisy, "imu", 10, 1));
    assert_ne!(read(&noisy, "imu", 10, 1), read(&noisy, "imu", 20, 1));
    assert_ne!(read(&noisy, "imu", 10, 1), read(&noisy, "imu", 10, 2));
    assert_ne!(read(&noisy, "imu", 10, 1), read(&noisy, "other", 10, 1));
    assert_eq!(read(&biased, "imu", 10, 1), read(&biased, "imu", 20, 1));
    assert_ne!(read(&biased, "imu", 10, 1), read(&biased, "imu", 10, 2));
    assert_ne!(read(&biased, "imu", 10, 1)[0] - 0.5, read(&biased, "imu", 10, 1)[1] + 0.2, "axes differ");
}

#[test]
fn noise_has_the_deviation_asked_for() {
    let params = PoseParams { position_noise_m: 0.3, ..PoseParams::default() };
    let n = 4000;
    let (mut sum, mut square) = (0.0, 0.0);
    for k in 0..n {
        let world = WorldState { stamp: Time::ZERO + Span::from_ms(10) * k, ..world(Vec::new()) };
        let x = pose(&world, "pose", &params, 5).pose.x_m;
        sum += x;
        square += x * x;
    }
    let mean = sum / n as f64;
    let deviation = (square / n as f64 - mean * mean).sqrt();
    assert!(mean.abs() < 0.02 && (deviation - 0.3).abs() < 0.015, "{mean} {deviation}");
}

#[test]
fn a_fix_is_where_the_ellipsoid_says() {
    // One minute of arc north of the origin at 45 degrees is 1852.2 m on WGS 84, one minute east 1314.1 m.
    let params = GnssParams {
        origin_latitude_deg: 45.0,
        origin_longitude_deg: 7.0,
        noise_m: 0.0,
        bias_m: 0.0,
        ..GnssParams::default()
    };
    let mut world = world(Vec::new());
    let place = Point::new(1314.1, 1852.2, 3.0);
    world.ego.map_from_ego = Transform::from_roll_pitch_yaw(place, 0.0, 0.0, 0.0);
    let fix = gnss(&world, "gnss", &params, 1);
    assert!((fix.latitude_deg - 45.0 - 1.0 / 60.0).abs() < 1e-6, "{fix:?}");
    assert!((fix.longitude_deg - 7.0 - 1.0 / 60.0).abs() < 1e-6, "{fix:?}");
    assert_eq!(fix.altitude_m, 3.0);
}
