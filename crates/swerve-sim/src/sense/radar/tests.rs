use core::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_4, PI};

use swerve_core::{Span, Time, digest_of};
use swerve_geom::{Pose2, Transform, Vector, Vector2};
use swerve_msg::truth::Actor;
use swerve_msg::{ActorKind, Side};
use swerve_vehicle::Shape;

use super::decibel::ratio;
use super::*;
use crate::sense::tests::{actor, person, world};

/// A radar that detects and resolves everything within its limits exactly.
fn exact() -> RadarParams {
    RadarParams {
        half_range_m: 9_000.0,
        range_resolution_m: 0.0,
        range_noise_m: 0.0,
        range_rate_noise_mps: 0.0,
        azimuth_noise_rad: 0.0,
        clutter_per_scan: 0.0,
        false_alarms_per_scan: 0.0,
        measures_elevation: true,
        ..RadarParams::default()
    }
}

fn radar(params: RadarParams) -> Radar {
    let mount = SensorMount { x_m: 3.0, y_m: 0.0, z_m: 0.5, yaw_rad: 0.0 };
    Radar::new(params, mount, &VehicleParams::default())
}

fn scan(world: &WorldState, params: RadarParams) -> (RadarScan, RadarSources) {
    radar(params).scan(world, "radar", 1)
}

fn car(id: u32, x_m: f64, y_m: f64, velocity_mps: (f64, f64)) -> Actor {
    let velocity_mps = Vector2::new(velocity_mps.0, velocity_mps.1);
    Actor { velocity_mps, ..actor(id, ActorKind::Car, x_m, y_m, [4.0, 2.0, 1.5]) }
}

fn ego(speed_mps: f64, yaw_rate_radps: f64) -> WorldState {
    let mut world = world(Vec::new());
    world.ego.velocity_mps = Vector::new(speed_mps, 0.0, 0.0);
    world.ego.angular_velocity_radps = Vector::new(0.0, 0.0, yaw_rate_radps);
    world
}

#[test]
fn an_oncoming_car_closes_with_both_speeds() {
    let mut world = ego(20.0, 0.0);
    world.actors = vec![car(1, 65.0, 0.0, (-15.0, 0.0))];
    let (scan, sources) = scan(&world, exact());
    assert_eq!((scan.stamp, sources.stamp), (world.stamp, world.stamp));
    assert_eq!(sources.sources, [Some(ActorId(1)); 3], "its rear end and two corners");
    // The centre of the near end is 60 m ahead and 0.25 m up; the corners are one metre to the sides.
    let range = |side: f64| (60.0_f64 * 60.0 + side * side + 0.25 * 0.25).sqrt();
    for (detection, side) in scan.detections.iter().zip([0.0, 1.0, 1.0]) {
        assert!((detection.range_m - range(side)).abs() < 1e-9, "{detection:?}");
        assert!((detection.range_rate_mps + 35.0 * 60.0 / range(side)).abs() < 1e-9, "{detection:?}");
        assert!((detection.azimuth_rad.abs() - math::atan2(side, 60.0)).abs() < 1e-12, "{detection:?}");
        assert!(detection.elevation_rad.is_some_and(|e| (e - 0.25 / 60.0).abs() < 1e-5), "{detection:?}");
    }
}

#[test]
fn range_rate_is_zero_at_equal_speed_and_positive_for_a_faster_lead() {
    let rate = |speed: f64| {
        let mut world = ego(20.0, 0.0);
        world.actors = vec![car(1, 65.0, 0.0, (speed, 0.0))];
        scan(&world, exact()).0.detections[0].range_rate_mps
    };
    assert!(rate(20.0).abs() < 1e-12);
    assert!((rate(25.0) - 5.0).abs() < 1e-4, "positive for what goes away");
}

#[test]
fn azimuth_is_to_the_left_of_the_axis_and_elevation_above_it() {
    let (params, vehicle) = (exact(), VehicleParams::default());
    let at = |world: &WorldState, yaw_rad: f64| {
        let mount = SensorMount { x_m: 3.0, y_m: 0.0, z_m: 0.5, yaw_rad };
        let (scan, _) = Radar::new(params, mount, &vehicle).scan(world, "radar", 1);
        (scan.detections[0].azimuth_rad, scan.detections[0].elevation_rad.unwrap())
    };
    // The near side of the person, who is round, is on the line to the centre.
    let mut world = ego(0.0, 0.0);
    world.actors = vec![person(1, 13.0, 10.0)];
    let (azimuth, elevation) = at(&world, 0.0);
    assert!((azimuth - FRAC_PI_4).abs() < 1e-12, "{azimuth}");
    let near = 200.0_f64.sqrt() - 0.25;
    assert!((elevation - math::atan2(0.8 - 0.5, near)).abs() < 1e-12, "{elevation}");
    assert!((at(&world, 0.3).0 - (FRAC_PI_4 - 0.3)).abs() < 1e-12);
    // For a car turned by 90 degrees to the left the person is at 45 degrees to the right.
    let turned =
        Transform::from_roll_pitch_yaw(Point::new(13.0 - 10.0, 10.0 - 13.0, 0.0), 0.0, 0.0, FRAC_PI_2);
    world.ego.map_from_ego = turned;
    world.ego.state.pose = Pose2::new(3.0, -3.0, FRAC_PI_2);
    assert!((at(&world, 0.0).0 + FRAC_PI_4).abs() < 1e-9, "{:?}", at(&world, 0.0));
    // Nose down: objects ahead are above the axis.
    world.ego.map_from_ego = Transform::from_roll_pitch_yaw(Point::new(0.0, 0.0, 0.0), 0.0, 0.05, 0.0);
    world.actors = vec![person(1, 40.0, 0.0)];
    assert!(at(&world, 0.0).1 > 0.04, "{:?}", at(&world, 0.0));
}

#[test]
fn turning_car_moves_its_sensors() {
    let (vehicle, shape) = (VehicleParams::default(), Shape::default());
    let mount = SensorMount::corner(&shape, true, Side::Left);
    let world = {
        let mut world = ego(0.0, 0.5);
        // On the sensor's axis, 20 m out: 45 degrees to the left of the heading.
        let out = 20.0 * FRAC_1_SQRT_2;
        world.actors = vec![person(1, mount.x_m + out, mount.y_m + out)];
        world
    };
    let (scan, _) = Radar::new(exact(), mount, &vehicle).scan(&world, "corner", 1);
    let detection = scan.detections[0];
    let (ahead, left) = (mount.x_m - vehicle.cg_to_rear_m(), mount.y_m);
    // The turn moves a point at (ahead, left) by (-left, ahead) times the yaw rate; along the axis, away.
    let moves = 0.5 * (ahead - left) * FRAC_1_SQRT_2;
    assert!(detection.azimuth_rad.abs() < 1e-12);
    assert!((detection.range_rate_mps + moves).abs() < 1e-3, "{detection:?} {moves}");
}

#[test]
fn corner_radars_face_outwards() {
    let shape = Shape::default();
    let corner = |at_front, side| {
        let mount = SensorMount::corner(&shape, at_front, side);
        [100.0 * mount.x_m, 100.0 * mount.y_m, mount.yaw_rad / FRAC_PI_4].map(f64::round)
    };
    assert_eq!(corner(true, Side::Left), [389.0, 93.0, 1.0]);
    assert_eq!(corner(true, Side::Right), [389.0, -93.0, -1.0]);
    assert_eq!(corner(false, Side::Left), [-104.0, 93.0, 3.0]);
    assert_eq!(corner(false, Side::Right), [-104.0, -93.0, -3.0]);
    assert!((SensorMount::front(&shape).x_m - 3.89).abs() < 1e-12);
}

#[test]
fn detection_probability_depends_on_cross_section_over_distance_to_the_fourth() {
    let params = RadarParams::default();
    let p = |rcs: f64, range: f64| params.detection_probability(rcs, range, 0.0);
    assert!((p(10.0, params.half_range_m) - 0.5).abs() < 1e-12);
    // Sixteen times the cross-section (12.04 dB) has the same probability at twice the distance.
    let sixteen_db = 12.041_199_826_559_248;
    for range in [20.0, 80.0, 150.0] {
        assert!((p(-8.0, range) - p(-8.0 + sixteen_db, 2.0 * range)).abs() < 1e-12);
        assert!(p(-8.0, range) > p(-8.0, 1.1 * range));
    }
    // At a large distance only noise exceeds the threshold.
    assert!((p(10.0, 1e6) - 1e-6).abs() < 1e-9);
    // Swerling's case 1 at an SNR of 20 dB and a false alarm probability of one in a million: 1e-6^(1/101).
    let range =
        params.half_range_m * math::pow(params.mean_snr(10.0, params.half_range_m, 0.0) / 100.0, 0.25);
    assert!((params.mean_snr(10.0, range, 0.0) - 100.0).abs() < 1e-9);
    assert!((p(10.0, range) - 0.872_156).abs() < 1e-6, "{}", p(10.0, range));
    // At the edge of the field of view the loss of 24 dB is equivalent to a factor 3.98 in distance.
    let edge = params.detection_probability(10.0, 50.0, 0.5 * params.fov_rad);
    assert!((edge - p(10.0, 50.0 * math::pow(10.0, 24.0 / 40.0))).abs() < 1e-12);
}

#[test]
fn detection_rate_matches_the_closed_form() {
    let params = RadarParams { half_range_m: 120.0, ..RadarParams { edge_loss_db: 0.0, ..exact() } };
    for range in [25.0, 40.0, 50.0, 70.0] {
        let mut world = ego(10.0, 0.0);
        world.actors = vec![person(1, 3.0 + range + 0.25, 0.0)];
        let n = 3000_u32;
        let seen = (0..u64::from(n)).filter(|seed| {
            let (scan, _) = radar(params).scan(&world, "radar", *seed);
            !scan.detections.is_empty()
        });
        let share = seen.count() as f64 / f64::from(n);
        let want = params.detection_probability(-8.0, range, 0.0);
        let four_sigma = 4.0 * (want * (1.0 - want) / f64::from(n)).sqrt();
        assert!((share - want).abs() < four_sigma + 1e-3, "{range} m: {share}, expected {want}");
    }
}

#[test]
fn measured_cross_section_is_unbiased() {
    let mut world = ego(0.0, 0.0);
    world.actors = vec![person(1, 30.0, 2.0)];
    let n = 4000_u64;
    let mut sum = 0.0;
    for seed in 0..n {
        let detection = radar(exact()).scan(&world, "radar", seed).0.detections[0];
        sum += ratio(detection.rcs_dbsm);
    }
    // A mean of exponentials of mean 10^-0.8, each with a standard deviation equal to its mean.
    let (mean, want) = (sum / n as f64, math::pow(10.0, -0.8));
    assert!((mean / want - 1.0).abs() < 4.0 / (n as f64).sqrt(), "{mean} {want}");
}

#[test]
fn noise_has_the_configured_deviations() {
    let noisy = RadarParams {
        range_noise_m: 0.2,
        range_rate_noise_mps: 0.03,
        azimuth_noise_rad: 0.004,
        elevation_noise_rad: 0.01,
        ..exact()
    };
    let mut world = ego(10.0, 0.0);
    world.actors = vec![person(1, 43.0, 0.0)];
    let truth = scan(&world, exact()).0.detections[0];
    let n = 2000_u64;
    let mut squares = [0.0; 4];
    for seed in 0..n {
        let d = radar(noisy).scan(&world, "radar", seed).0.detections[0];
        let off = [
            d.range_m - truth.range_m,
            d.range_rate_mps - truth.range_rate_mps,
            d.azimuth_rad - truth.azimuth_rad,
            d.elevation_rad.unwrap() - truth.elevation_rad.unwrap(),
        ];
        for (square, x) in squares.iter_mut().zip(off) {
            *square += x * x / n as f64;
        }
    }
    for (square, want) in squares.iter().zip([0.2, 0.03, 0.004, 0.01]) {
        assert!((square.sqrt() / want - 1.0).abs() < 0.08, "{squares:?}");
    }
}

#[test]
fn limits_of_range_and_view_are_applied() {
    let seen = |x: f64, y: f64, params: RadarParams| {
        let mut world = ego(0.0, 0.0);
        world.actors = vec![person(1, 3.0 + x, y)];
        !scan(&world, params).0.detections.is_empty()
    };
    let params = RadarParams { range_min_m: 5.0, range_max_m: 50.0, fov_rad: FRAC_PI_2, ..exact() };
    assert!(seen(50.2, 0.0, params) && !seen(50.3, 0.0, params), "0.25 m to its near side");
    assert!(seen(5.3, 0.0, params) && !seen(5.2, 0.0, params));
    assert!(seen(20.0, 19.9, params) && !seen(20.0, 20.1, params) && !seen(-20.0, 0.0, params));
    // Half of the default vertical field is 8 degrees: an object 0.3 m above the sensor leaves it at 2.1 m.
    assert!(seen(2.6, 0.0, exact()) && !seen(2.2, 0.0, exact()));
    let mut fast = ego(40.0, 0.0);
    fast.actors = vec![car(1, 65.0, 0.0, (-31.0, 0.0))];
    assert!(scan(&fast, exact()).0.detections.is_empty(), "71 m/s is beyond what it measures");
}

#[test]
fn bodies_block_the_view() {
    let mut world = ego(0.0, 0.0);
    let truck = actor(2, ActorKind::Truck, 20.0, 0.0, [5.0, 2.6, 2.5]);
    world.actors = vec![person(1, 30.0, 0.0), truck];
    let of = |world: &WorldState, params: RadarParams| -> Vec<u32> {
        let mut ids: Vec<u32> = scan(world, params).1.sources.iter().map(|s| s.unwrap().0).collect();
        ids.dedup();
        ids
    };
    assert_eq!(of(&world, exact()), [2]);
    assert_eq!(of(&world, RadarParams { occlusion: false, ..exact() }), [2, 1]);
    // The truck's shadow ends at 1.3 * 27 / 14.5 = 2.42 m beside the axis.
    world.actors[0] = person(1, 30.0, 2.35);
    assert_eq!(of(&world, exact()), [2]);
    world.actors[0] = person(1, 30.0, 2.5);
    assert_eq!(of(&world, exact()), [2, 1]);
}

#[test]
fn unresolved_scatterers_are_one_echo_with_the_power_of_both() {
    let coarse = RadarParams {
        range_resolution_m: 1.0,
        range_rate_resolution_mps: 0.5,
        azimuth_resolution_rad: 0.04,
        ..exact()
    };
    let two = |apart: f64, speed: f64| {
        let mut world = ego(0.0, 0.0);
        let walks = Actor { velocity_mps: Vector2::new(speed, 0.0), ..person(2, 33.0, apart) };
        world.actors = vec![person(1, 33.0, 0.0), walks];
        scan(&world, coarse).1.sources.len()
    };
    assert_eq!((two(0.6, 0.0), two(1.5, 0.0), two(0.6, 0.6)), (1, 2, 2));
    let mut echo = Echo {
        range_m: 30.0,
        range_rate_mps: 0.0,
        azimuth_rad: 0.0,
        elevation_rad: 0.0,
        snr: 5.0,
        actor: ActorId(1),
        part: 0,
    };
    let weak = echo;
    (echo.snr, echo.actor, echo.range_m) = (7.0, ActorId(2), 30.5);
    let one = resolved(vec![weak, echo], &coarse);
    assert_eq!(one, [Echo { snr: 12.0, ..echo }]);
}

#[test]
fn clutter_is_at_rest_in_the_map_at_the_configured_rate() {
    let params = RadarParams { clutter_per_scan: 5.0, ..exact() };
    let mut world = ego(20.0, 0.0);
    let n = 400;
    let (mut count, mut left) = (0, 0);
    for k in 0..n {
        world.stamp = Time::ZERO + Span::from_ms(50) * k;
        let (scan, sources) = scan(&world, params);
        assert!(
            sources.sources.iter().all(Option::is_none) && sources.sources.len() == scan.detections.len()
        );
        for d in &scan.detections {
            let want = -20.0 * math::cos(d.azimuth_rad) * math::cos(d.elevation_rad.unwrap());
            assert!((d.range_rate_mps - want).abs() < 1e-9, "{d:?} {want}");
            assert!((0.2..=250.0).contains(&d.range_m) && d.azimuth_rad.abs() <= PI / 3.0, "{d:?}");
            assert!(d.snr_db > 10.0, "above the threshold: {d:?}");
            left += usize::from(d.azimuth_rad > 0.0);
        }
        assert!(scan.detections.is_sorted_by(|a, b| a.range_m <= b.range_m));
        count += scan.detections.len();
    }
    // Poisson: the standard deviation of the sum is the root of its mean, 2000.
    assert!((count as f64 - 2000.0).abs() < 4.0 * 2000.0_f64.sqrt(), "{count}");
    assert!((left as f64 / count as f64 - 0.5).abs() < 0.05, "{left} of {count}");
}

#[test]
fn false_alarms_have_any_range_rate() {
    let params = RadarParams { false_alarms_per_scan: 3.0, ..exact() };
    let mut rates = Vec::new();
    for seed in 0..500 {
        let (scan, _) = radar(params).scan(&ego(20.0, 0.0), "radar", seed);
        rates.extend(scan.detections.iter().map(|d| d.range_rate_mps));
    }
    assert!((rates.len() as f64 - 1500.0).abs() < 4.0 * 1500.0_f64.sqrt(), "{}", rates.len());
    let mean = rates.iter().sum::<f64>() / rates.len() as f64;
    assert!(
        mean.abs() < 5.0 && rates.iter().any(|r| *r > 60.0) && rates.iter().any(|r| *r < -60.0),
        "{mean}"
    );
}

#[test]
fn scans_are_keyed_by_seed_sensor_and_stamp_and_independent_of_other_actors() {
    let mut world = ego(10.0, 0.0);
    world.actors = vec![car(1, 60.0, 0.0, (5.0, 0.0)), person(2, 40.0, 8.0)];
    let of =
        |world: &WorldState, sensor: &str, seed: u64| radar(RadarParams::default()).scan(world, sensor, seed);
    let base = digest_of(&of(&world, "radar", 1));
    assert_eq!(base, digest_of(&of(&world, "radar", 1)));
    assert_ne!(base, digest_of(&of(&world, "radar", 2)));
    assert_ne!(base, digest_of(&of(&world, "left", 1)));
    let later = WorldState { stamp: world.stamp + Span::from_ms(50), ..world.clone() };
    assert_ne!(base, digest_of(&of(&later, "radar", 1)));
    let more = {
        let mut more = world.clone();
        more.actors.push(person(3, 90.0, -9.0));
        more
    };
    let only_of = |world: &WorldState, id: u32| {
        let (scan, sources) = of(world, "radar", 1);
        let both = scan.detections.into_iter().zip(sources.sources);
        both.filter(|(_, s)| *s == Some(ActorId(id))).map(|(d, _)| d).collect::<Vec<_>>()
    };
    assert!(!only_of(&world, 1).is_empty());
    assert_eq!((only_of(&world, 1), only_of(&world, 2)), (only_of(&more, 1), only_of(&more, 2)));
}

#[test]
fn sensor_inside_a_body_and_target_on_the_sensor_give_no_echo() {
    let mut world = ego(0.0, 0.0);
    world.actors = vec![car(1, 3.0, 0.0, (0.0, 0.0)), person(2, 3.0, 0.0), person(3, 3.25, 0.0)];
    let params = RadarParams { occlusion: false, ..exact() };
    let (scan, sources) = scan(&world, params);
    assert!(scan.detections.is_empty(), "{sources:?}");
}

#[test]
fn parameters_default_to_the_preset() {
    let read = |text: &str| serde_json::from_str::<RadarParams>(text);
    assert_eq!(read("{}").unwrap(), RadarPreset::LongRange.params());
    assert_eq!(read(r#"{"preset": "corner"}"#).unwrap(), RadarPreset::Corner.params());
    let changed = read(r#"{"preset": "corner", "range_max_m": 80.0, "occlusion": false}"#).unwrap();
    assert_eq!(changed, RadarParams { range_max_m: 80.0, occlusion: false, ..RadarPreset::Corner.params() });
    let text = serde_json::to_string(&changed).unwrap();
    assert_eq!(read(&text).unwrap(), changed, "spelled out, it needs no preset");
    let problem = |text: &str| read(text).unwrap_err().to_string();
    assert!(problem(r#"{"range_m": 80.0}"#).contains("unknown field `range_m`"));
    assert!(problem(r#"{"preset": "short"}"#).contains("expected `long_range` or `corner`"));
    assert!(problem(r#"{"fov_rad": "wide"}"#).contains("invalid type"));
}

#[test]
fn parameters_that_cannot_be_are_all_named() {
    for preset in [RadarPreset::LongRange, RadarPreset::Corner] {
        assert_eq!(preset.params().problems(), []);
        assert_eq!(preset.period().ns() % Span::from_ms(5).ns(), 0);
    }
    let wrong = RadarParams {
        range_min_m: 90.0,
        range_max_m: 80.0,
        fov_rad: 0.0,
        false_alarm_probability: 1.0,
        range_noise_m: f64::NAN,
        clutter_per_scan: -1.0,
        ..RadarParams::default()
    };
    let problems: Vec<String> = wrong.problems().iter().map(ToString::to_string).collect();
    assert_eq!(
        problems,
        [
            "`fov_rad` is 0, expected 0.001 to 6.283185307179586",
            "`false_alarm_probability` is 1, expected 0.000000000001 to 0.1",
            "`range_noise_m` is NaN, expected 0 to 100",
            "`clutter_per_scan` is -1, expected 0 to 500",
            "`range_min_m` is 90, expected a number below range_max_m",
        ]
    );
}
