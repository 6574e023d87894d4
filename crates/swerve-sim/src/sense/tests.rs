use swerve_core::{Ranges as _, Span, Time};
use swerve_geom::{Point, Pose2, Transform, Vector, Vector2, math};
use swerve_msg::truth::{Actor, EgoTruth, WorldState};
use swerve_msg::{ActorId, ActorKind, EgoState, Extent, Gnss, Imu, Side};
use swerve_vehicle::{Shape, VehicleParams};

use super::*;

const MOUNT: SensorMount = SensorMount { x_m: 1.0, y_m: 0.0, z_m: 1.9, yaw_rad: 0.0 };

pub(super) fn world(actors: Vec<Actor>) -> WorldState {
    let pose = Pose2::new(0.0, 0.0, 0.0);
    WorldState {
        stamp: Time::from_ms(500),
        ego: EgoTruth {
            id: ActorId::EGO,
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
fn all_nine_points_are_visible_without_occlusion() {
    let world = world(vec![person(1, 20.0, 0.0), actor(2, ActorKind::Car, -15.0, 3.0, [4.5, 1.8, 1.5])]);
    assert_eq!(shares(&world, &SensorParams::default()), [(1, 9.0), (2, 9.0)]);
}

#[test]
fn tall_wall_occludes_and_low_one_occludes_the_lower_points() {
    let wall = |height: f64| actor(2, ActorKind::Static, 10.0, 0.0, [1.0, 6.0, height]);
    let behind = |height: f64| world(vec![person(1, 12.0, 0.0), wall(height)]);
    let params = SensorParams::default();
    assert_eq!(shares(&behind(3.0), &params), [(2, 9.0)]);
    // Rays fall from 1.9 m at x = 1 to a rim at 1.8 m: above 1.8 m over the whole wall. To the centre at 0.9 m they
    // pass the far side of the wall (x = 10.5) at 1.04 m.
    assert_eq!(shares(&behind(1.0), &params), [(1, 5.0), (2, 9.0)]);
    assert_eq!(shares(&behind(1.1), &params), [(1, 4.0), (2, 9.0)]);
    let unoccluded = SensorParams { occlusion: false, ..params };
    assert_eq!(shares(&behind(3.0), &unoccluded), [(1, 9.0), (2, 9.0)]);
}

#[test]
fn people_occlude_as_cylinders() {
    // The ray to the far person's centre line passes the near one 0.3 m off centre: outside the cylinder (0.25 m) but
    // inside the corner of its box (0.35 m).
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
fn field_of_view_applies_to_each_point() {
    let quarter = core::f64::consts::FRAC_PI_2;
    // The axis goes through the person's centre, so half of its side points are left and right of the edge.
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
fn adjacent_boxes_do_not_occlude_each_other_entirely() {
    let world = world(vec![
        actor(1, ActorKind::Car, 20.0, 1.0, [4.0, 2.0, 1.5]),
        actor(2, ActorKind::Car, 20.0, -1.0, [4.0, 2.0, 1.5]),
    ]);
    let seen = shares(&world, &SensorParams::default());
    assert_eq!(seen.len(), 2);
    assert!(seen.iter().all(|s| s.1 >= 6.0), "{seen:?}");
}

#[test]
fn sensor_in_the_middle_of_the_car_is_inside_and_default_mounts_are_not() {
    let shape = Shape::default();
    let usual = [SensorMount::roof(&shape), SensorMount::front(&shape)];
    let corners = [Side::Left, Side::Right].map(|s| [true, false].map(|f| SensorMount::corner(&shape, f, s)));
    for mount in usual.iter().chain(corners.as_flattened()) {
        assert!(!mount.is_inside(&shape), "{mount:?}");
        assert_eq!(mount.out_of_range(), []);
    }
    assert!(SensorMount { z_m: 1.2, ..SensorMount::roof(&shape) }.is_inside(&shape));
    assert!(SensorMount { x_m: 3.5, ..SensorMount::front(&shape) }.is_inside(&shape));
    let wrong = SensorMount { z_m: -0.1, yaw_rad: f64::INFINITY, ..SensorMount::roof(&shape) };
    let said: Vec<String> = wrong.out_of_range().iter().map(ToString::to_string).collect();
    assert_eq!(said[0], "`z_m` is -0.1, expected 0 to 10");
    assert!(said.len() == 2 && said[1].starts_with("`yaw_rad` is inf, expected "));
}

#[test]
fn ego_sensors_without_noise_report_the_truth() {
    let world = world(Vec::new());
    let exact = pose(&world, "pose", &PoseParams::default(), 3);
    assert_eq!(exact, EgoState { stamp: world.stamp, ..world.ego.state });
    let reading = unit(ImuParams::default(), 3).sense(&world);
    assert_eq!((reading.accel_mps2, reading.gyro_radps), ([0.5, -0.2, 9.81], [0.0, 0.0, 0.1]));
    assert_eq!(reading.stamp, world.stamp);
}

fn unit(params: ImuParams, seed: u64) -> InertialUnit {
    InertialUnit::new(params, &VehicleParams::default(), Span::from_ms(10), "imu", seed)
}

#[test]
fn noise_is_keyed_by_seed_sensor_and_stamp_and_bias_by_seed_and_sensor() {
    let noisy = ImuParams { accel_noise_mps2: 0.1, ..ImuParams::default() };
    let biased = ImuParams { accel_bias_mps2: 0.1, ..ImuParams::default() };
    let at = |ms: i64| WorldState { stamp: Time::from_ms(ms), ..world(Vec::new()) };
    let (vehicle, period) = (VehicleParams::default(), Span::from_ms(10));
    let read = |params: &ImuParams, sensor: &str, ms: i64, seed: u64| {
        InertialUnit::new(*params, &vehicle, period, sensor, seed).sense(&at(ms)).accel_mps2
    };
    assert_eq!(read(&noisy, "imu", 10, 1), read(&noisy, "imu", 10, 1));
    assert_ne!(read(&noisy, "imu", 10, 1), read(&noisy, "imu", 20, 1));
    assert_ne!(read(&noisy, "imu", 10, 1), read(&noisy, "imu", 10, 2));
    assert_ne!(read(&noisy, "imu", 10, 1), read(&noisy, "other", 10, 1));
    assert_eq!(read(&biased, "imu", 10, 1), read(&biased, "imu", 20, 1));
    assert_ne!(read(&biased, "imu", 10, 1), read(&biased, "imu", 10, 2));
    assert_ne!(read(&biased, "imu", 10, 1)[0] - 0.5, read(&biased, "imu", 10, 1)[1] + 0.2, "axes differ");
}

#[test]
fn noise_has_the_configured_deviation() {
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
fn fix_matches_the_ellipsoid() {
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
    let fix = GnssReceiver::new(params, "gnss", 1).sense(&world).unwrap();
    assert!((fix.latitude_deg - 45.0 - 1.0 / 60.0).abs() < 1e-6, "{fix:?}");
    assert!((fix.longitude_deg - 7.0 - 1.0 / 60.0).abs() < 1e-6, "{fix:?}");
    assert_eq!(fix.altitude_m, 3.0);
}

/// World at an instant, with the ego at another position.
fn world_at(ms: i64, x_m: f64, y_m: f64) -> WorldState {
    let mut world = WorldState { stamp: Time::from_ms(ms), ..world(Vec::new()) };
    world.ego.map_from_ego = Transform::from_roll_pitch_yaw(Point::new(x_m, y_m, 0.0), 0.0, 0.0, 0.0);
    world
}

fn deviation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    (values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / values.len() as f64).sqrt()
}

#[test]
fn noise_density_scales_with_the_root_of_the_rate() {
    let params = ImuParams { accel_noise_density: 0.01, gyro_noise_density: 0.001, ..ImuParams::default() };
    for (ms, accel, gyro) in [(10, 0.1, 0.01), (40, 0.05, 0.005)] {
        let mut unit = InertialUnit::new(params, &VehicleParams::default(), Span::from_ms(ms), "imu", 4);
        let read: Vec<_> = (0..4000).map(|k| unit.sense(&world_at(ms * k, 0.0, 0.0))).collect();
        let [force, turn] = [|r: &Imu| r.accel_mps2[1], |r: &Imu| r.gyro_radps[2]]
            .map(|of: fn(&Imu) -> f64| deviation(&read.iter().map(of).collect::<Vec<_>>()));
        assert!((force / accel - 1.0).abs() < 0.05 && (turn / gyro - 1.0).abs() < 0.05, "{force} {turn}");
        let [a, g] = params.densities(ms as f64 * 1e-3);
        assert_eq!((a, g), (0.01, 0.001), "the filter has the same values");
    }
}

#[test]
fn bias_walks_with_the_root_of_time_and_scale_is_a_fraction() {
    let walk = ImuParams { accel_bias_walk: 0.02, gyro_bias_walk: 0.003, ..ImuParams::default() };
    let after = |seed: u64| {
        let mut unit = unit(walk, seed);
        (0..=400).map(|k| unit.sense(&world_at(10 * k, 0.0, 0.0))).last().unwrap()
    };
    let ends: Vec<_> = (0..400).map(after).collect();
    assert_eq!(after(7), ends[7]);
    let force = deviation(&ends.iter().map(|r| r.accel_mps2[0]).collect::<Vec<_>>());
    let turn = deviation(&ends.iter().map(|r| r.gyro_radps[1]).collect::<Vec<_>>());
    // Over 4 s: twice the random walk of one second.
    assert!((force / 0.04 - 1.0).abs() < 0.1 && (turn / 0.006 - 1.0).abs() < 0.1, "{force} {turn}");

    let scaled = ImuParams { accel_scale_error: 0.01, gyro_scale_error: 0.02, ..ImuParams::default() };
    let mut twice = world_at(20, 0.0, 0.0);
    twice.ego.specific_force_mps2 = Vector::new(1.0, -0.4, 2.0 * 9.81);
    let mut unit = unit(scaled, 3);
    let (once, twice) = (unit.sense(&world_at(10, 0.0, 0.0)).accel_mps2, unit.sense(&twice).accel_mps2);
    for axis in 0..3 {
        assert!((twice[axis] / once[axis] - 2.0).abs() < 1e-12);
    }
    let share = once[2] / 9.81 - 1.0;
    assert!(share != 0.0 && share.abs() < 0.05, "{share}");
}

#[test]
fn imu_off_the_centre_of_gravity_measures_the_rotation() {
    let vehicle = VehicleParams::default();
    let cg = [vehicle.cg_to_rear_m(), 0.0, vehicle.body.cg_height_m];
    let there = ImuParams { at_m: Some(cg), ..ImuParams::default() };
    let beside = ImuParams { at_m: Some([cg[0] + 1.0, cg[1] + 0.5, cg[2]]), ..ImuParams::default() };
    let (mut first, mut second) = (world_at(0, 0.0, 0.0), world_at(10, 0.0, 0.0));
    first.ego.angular_velocity_radps = Vector::new(0.0, 0.0, 0.4);
    second.ego.angular_velocity_radps = Vector::new(0.0, 0.0, 0.41);
    let [at_cg, off] = [there, beside].map(|params| {
        let mut unit = unit(params, 1);
        unit.sense(&first);
        unit.sense(&second)
    });
    assert_eq!(at_cg.accel_mps2, [0.5, -0.2, 9.81]);
    // Turn rate 0.41 rad/s, growing by 1 rad/s²: inwards ω² r, sideways along the lever turned left.
    let expected = [0.5 - 0.41 * 0.41 - 0.5, -0.2 - 0.41 * 0.41 * 0.5 + 1.0, 9.81];
    for (felt, expected) in off.accel_mps2.into_iter().zip(expected) {
        assert!((felt - expected).abs() < 1e-9, "{off:?}");
    }
    assert_eq!(off.gyro_radps, at_cg.gyro_radps);
}

/// East and north of the map's origin, metres; accurate near it.
fn place(fix: &Gnss) -> [f64; 2] {
    let north = (fix.latitude_deg - 37.4).to_radians() * 6_359_045.0;
    let east = (fix.longitude_deg + 122.0).to_radians() * 6_386_016.0 * math::cos(37.4_f64.to_radians());
    [east, north]
}

#[test]
fn gnss_bias_has_its_deviation_and_correlation_time() {
    let params = GnssParams { noise_m: 0.0, bias_m: 2.0, bias_time_s: 5.0, ..GnssParams::default() };
    // Two instants 5 s apart, over seeds.
    let pairs: Vec<[f64; 2]> = (0..600)
        .map(|seed| {
            let mut receiver = GnssReceiver::new(params.clone(), "gnss", seed);
            let fixes: Vec<_> =
                (0..=100).map(|k| receiver.sense(&world_at(100 * k, 0.0, 0.0)).unwrap()).collect();
            [place(&fixes[50])[0], place(&fixes[100])[0]]
        })
        .collect();
    let both: Vec<f64> = pairs.as_flattened().to_vec();
    assert!((deviation(&both) - 2.0).abs() < 0.1, "{}", deviation(&both));
    let kept = pairs.iter().map(|[a, b]| a * b).sum::<f64>() / 600.0 / 4.0;
    assert!((kept - math::exp(-1.0)).abs() < 0.1, "{kept}");
    let holds = GnssParams { bias_time_s: 0.0, ..params };
    let mut receiver = GnssReceiver::new(holds, "gnss", 1);
    let fixes = [0, 100_000].map(|ms| place(&receiver.sense(&world_at(ms, 0.0, 0.0)).unwrap()));
    assert_eq!(fixes[0], fixes[1]);
}

#[test]
fn no_fix_before_the_first_or_in_a_tunnel() {
    let tunnel = Zone { from_m: [20.0, 0.0], to_m: Some([40.0, 0.0]), radius_m: 5.0 };
    let circle = Zone { from_m: [0.0, 100.0], to_m: None, radius_m: 3.0 };
    let params = GnssParams {
        first_fix_s: 2.0,
        outages: vec![tunnel, circle],
        antenna_at_m: [1.0, 0.5, 1.5],
        noise_m: 0.0,
        bias_m: 0.0,
        ..GnssParams::default()
    };
    let mut receiver = GnssReceiver::new(params, "gnss", 1);
    let mut sees =
        |ms: i64, x: f64, y: f64| receiver.sense(&world_at(ms, x, y)).map(|fix| (place(&fix), fix));
    assert!(sees(1900, 0.0, 0.0).is_none());
    let (at, fix) = sees(2000, 0.0, 0.0).unwrap();
    assert!((at[0] - 1.0).abs() < 1e-3 && (at[1] - 0.5).abs() < 1e-3 && fix.altitude_m == 1.5, "{at:?}");
    // The antenna is one metre ahead.
    for (x, y, there) in
        [(13.9, 0.0, true), (14.1, -0.5, false), (44.1, -0.5, true), (30.0, 4.6, true), (30.0, 4.4, false)]
    {
        assert_eq!(sees(3000, x, y).is_some(), there, "{x} {y}");
    }
    assert!(sees(4000, 0.0, 99.0).is_none() && sees(4000, 0.0, 104.0).is_some());
}

#[test]
fn multipath_offsets_fixes_by_a_step_for_a_while() {
    let params = GnssParams {
        noise_m: 0.0,
        bias_m: 0.0,
        multipath_per_min: 6.0,
        multipath_m: 60.0,
        multipath_s: 4.0,
        ..GnssParams::default()
    };
    let offs = |seed: u64| -> Vec<f64> {
        let mut receiver = GnssReceiver::new(params.clone(), "gnss", seed);
        let mut off = |k: i64| {
            let [east, north] = place(&receiver.sense(&world_at(100 * k, 0.0, 0.0)).unwrap());
            math::hypot(east, north)
        };
        (0..6000).map(&mut off).collect()
    };
    let (mut steps, mut ticks) = (0, 0);
    for seed in 0..10 {
        let offs = offs(seed);
        assert!(offs.iter().all(|off| off.abs() < 0.01 || (off - 60.0).abs() < 0.1));
        let is_off: Vec<bool> = offs.iter().map(|off| *off > 1.0).collect();
        steps += is_off.windows(2).filter(|pair| !pair[0] && pair[1]).count();
        ticks += is_off.iter().filter(|off| **off).count();
    }
    // Steps come 10 s after the end of the last one, on average: one in 14 s of ten times 600 s.
    assert!((360..=500).contains(&steps), "{steps}");
    assert!((ticks as f64 / steps as f64 - 40.0).abs() < 1.5, "{ticks} {steps}");
    assert_eq!(offs(3), offs(3));
    assert_ne!(offs(3), offs(4));
}

#[test]
fn errors_out_of_range_are_reported_one_by_one() {
    let imu = ImuParams { gyro_bias_walk: -1.0, at_m: Some([0.0, f64::NAN, 0.0]), ..ImuParams::default() };
    let said: Vec<String> = imu.out_of_range().iter().map(ToString::to_string).collect();
    assert_eq!(said, ["`gyro_bias_walk` is -1, expected 0 to 1", "`at_m` is NaN, expected -20 to 20"]);
    let wrong = Zone { from_m: [0.0, 2e6], to_m: None, radius_m: -1.0 };
    let gnss = GnssParams { first_fix_s: -1.0, outages: vec![wrong], ..GnssParams::default() };
    let said: Vec<String> = gnss.out_of_range().iter().map(ToString::to_string).collect();
    assert_eq!(
        said,
        [
            "`first_fix_s` is -1, expected 0 to 3600",
            "`outages[0].from_m` is 2000000, expected -1000000 to 1000000",
            "`outages[0].radius_m` is -1, expected 0 to 100000"
        ]
    );
    assert!(
        ImuParams::default().out_of_range().is_empty() && GnssParams::default().out_of_range().is_empty()
    );
}
