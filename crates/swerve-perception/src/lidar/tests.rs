use proptest::prelude::*;
use swerve_core::{Rng, Time, digest_of};
use swerve_geom::{Point, Transform, math};
use swerve_map::{Border, Borders};
use swerve_msg::{EgoState, LidarPoint, PointCloud, Route};

use super::*;

/// Mounting position of the lidar, metres.
const ROOF_M: [f64; 3] = [1.4, 0.0, 1.9];

fn scan(cloud: &PointCloud) -> Scan<'_> {
    let [x, y, z] = ROOF_M;
    let ego_from_lidar = Transform::from_roll_pitch_yaw(Point::new(x, y, z), 0.0, 0.0, 0.0);
    Scan { cloud, ego_from_lidar, ego: EgoState::default(), own_m: [-1.0, 3.9, 1.0], route: None }
}

/// Box in the scene: x, y, heading, length, width, height.
type Block = [f64; 6];

/// Cars ahead and beside, a person, and a house.
const SCENE: [Block; 5] = [
    [14.0, 3.5, 0.05, 4.4, 1.8, 1.5],
    [20.0, -3.2, 0.0, 4.4, 1.8, 1.5],
    [9.0, -4.0, 0.0, 0.5, 0.5, 1.75],
    [-12.0, 3.6, 0.0, 4.4, 1.8, 1.5],
    [10.0, 16.0, 0.0, 24.0, 8.0, 6.0],
];

/// Distance along a ray from the sensor to the ground or a block, metres.
fn range_m(scene: &[Block], [dx, dy, dz]: [f64; 3]) -> f64 {
    let ground = if dz < -1e-6 { -ROOF_M[2] / dz } else { f64::INFINITY };
    scene.iter().fold(ground, |nearest, &[x, y, heading, length, width, height]| {
        let (sin, cos) = math::sin_cos(heading);
        let (ox, oy) = (ROOF_M[0] - x, ROOF_M[1] - y);
        let from = [ox * cos + oy * sin, oy * cos - ox * sin, ROOF_M[2]];
        let way = [dx * cos + dy * sin, dy * cos - dx * sin, dz];
        // Light passes under cars.
        let bottom = if length < 1.0 { 0.0 } else { 0.25 };
        let slabs = [[-0.5 * length, 0.5 * length], [-0.5 * width, 0.5 * width], [bottom, height]];
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for ((o, d), [low, high]) in from.into_iter().zip(way).zip(slabs) {
            let (a, b) = ((low - o) / d, (high - o) / d);
            (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
        }
        if enter < leave && enter > 0.0 { nearest.min(enter) } else { nearest }
    })
}

/// Sweep of 32 beams over the scene, from an ego with this speed and yaw rate.
fn turn(speed_mps: f64, yaw_rate_radps: f64) -> PointCloud {
    turn_over(&SCENE, speed_mps, yaw_rate_radps)
}

/// The same over another scene.
fn turn_over(scene: &[Block], speed_mps: f64, yaw_rate_radps: f64) -> PointCloud {
    let mut rng = Rng::keyed(7, "noise", &[]);
    let mut cloud = PointCloud { stamp: Time::from_ms(500), ..PointCloud::default() };
    let columns = 1200_u32;
    for column in 0..columns {
        let offset_s = -0.1 * f64::from(columns - column) / f64::from(columns);
        let azimuth = core::f64::consts::TAU * f64::from(column) / f64::from(columns) + 0.001;
        for beam in 0..32_u16 {
            let elevation = -0.35 + 0.013 * f64::from(beam);
            let ((sa, ca), (se, ce)) = (math::sin_cos(azimuth), math::sin_cos(elevation));
            let range = range_m(scene, [ca * ce, sa * ce, se]) + 0.01 * rng.normal();
            if range > 100.0 {
                continue;
            }
            let [x, y, z] = [ROOF_M[0] + range * ca * ce, range * sa * ce, ROOF_M[2] + range * se];
            // Relative to the ego's pose at the time of the beam.
            let (sin, cos) = math::sin_cos(-yaw_rate_radps * offset_s);
            let (half_sin, half_cos) = math::sin_cos(0.5 * yaw_rate_radps * offset_s);
            let (x, y) = (x - speed_mps * offset_s * half_cos, y - speed_mps * offset_s * half_sin);
            let seen = [x * cos - y * sin - ROOF_M[0], x * sin + y * cos, z - ROOF_M[2]];
            cloud.push(LidarPoint {
                place_m: seen.map(|m| m as f32),
                intensity: 0.3,
                ring: beam,
                time_offset_s: offset_s as f32,
            });
        }
    }
    cloud
}

fn objects(params: Params) -> LidarObjects {
    LidarObjects::new(params).unwrap()
}

fn detect(objects: &mut LidarObjects, scan: &Scan<'_>) -> Detections {
    let mut out = Detections::default();
    objects.detect(scan, &mut out);
    out
}

#[test]
fn detector_finds_cars_and_people_with_both_ground_methods() {
    let cloud = turn(0.0, 0.0);
    for ground in [Method::Rays, Method::Zones] {
        let found = detect(&mut objects(Params { ground, ..Params::default() }), &scan(&cloud));
        for (block, kind) in
            SCENE.iter().zip([ActorKind::Car, ActorKind::Car, ActorKind::Pedestrian, ActorKind::Car])
        {
            let there = Point2::new(block[0], block[1]);
            let is_it = |b: &&DetectedBox| b.kind == kind && b.pose.point().distance(there) < 0.5;
            let found = found.boxes.iter().find(is_it);
            assert!(found.is_some_and(|b| b.score > 0.2), "{ground:?} {kind:?} at {there:?}: {found:?}");
        }
    }
}

#[test]
fn points_are_compensated_for_ego_motion() {
    let (still, moved) = (turn(0.0, 0.0), turn(20.0, 0.4));
    let mut ego = EgoState { speed_mps: 20.0, yaw_rate_radps: 0.4, ..EgoState::default() };
    ego.stamp = moved.stamp;
    let (mut a, mut b) = (Vec::new(), Vec::new());
    in_ego_frame(&scan(&still), 1e3, &mut a);
    in_ego_frame(&Scan { ego, ..scan(&moved) }, 1e3, &mut b);
    assert!(a.len() > 20_000 && a.len() == b.len(), "{} {}", a.len(), b.len());
    let off = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
    let most = a.iter().zip(&b).map(off).fold(0.0, f32::max);
    assert!(most < 1e-3, "{most} m");
}

/// Straight route with 4 m of drivable ground to the left and 5 m to the right.
fn straight_route() -> Route {
    let line = swerve_geom::Polyline::new(&[Point2::new(-50.0, 0.0), Point2::new(80.0, 0.0)]).unwrap();
    Route::new(line, Borders::new(Border::constant(4.0), Border::constant(5.0)))
}

#[test]
fn objects_of_no_class_are_static_if_they_are_on_the_road() {
    // A pallet in the lane, another one beside the road, and a car.
    let pallet = |y: f64| [18.0, y, 0.3, 1.0, 0.8, 0.4];
    let cloud = turn_over(&[pallet(0.4), pallet(-6.5), SCENE[0]], 0.0, 0.0);
    let route = straight_route();
    let found = detect(&mut objects(Params::default()), &Scan { route: Some(&route), ..scan(&cloud) });
    let fixed: Vec<&DetectedBox> = found.boxes.iter().filter(|b| b.kind == ActorKind::Static).collect();
    let [pallet] = fixed.as_slice() else { panic!("{fixed:?}") };
    // Its near side is at 17.5 m.
    assert!((17.4..18.2).contains(&pallet.pose.x_m) && (pallet.pose.y_m - 0.4).abs() < 0.2, "{pallet:?}");
    assert!(pallet.score > 0.6 && pallet.extent.height_m < 0.45, "{pallet:?}");
    assert!(found.boxes.iter().any(|b| b.kind == ActorKind::Car), "{found:?}");
    let without = detect(&mut objects(Params::default()), &scan(&cloud));
    assert!(without.boxes.iter().all(|b| b.kind != ActorKind::Static), "the road is not known: {without:?}");
}

#[test]
fn hidden_part_of_an_object_of_no_class_is_behind_what_hides_it() {
    // The nose of a car that turns into the lane from in front of a truck, in the points of few beams.
    let (cos, sin) = (libm::cosf(0.4), libm::sinf(0.4));
    let nose: Vec<[f32; 4]> =
        (0..13).map(|k| 0.1 * k as f32).map(|m| [20.0 + m * cos, -2.9 + m * sin, 0.6, 0.6]).collect();
    let fit = fit(&nose, Some(0.0));
    let of = |hidden| whole(&fit, 0.0, ([1.4, 0.0], hidden));
    let visible = of([false, false]);
    assert!((visible.size_m[0].max(visible.size_m[1]) - 1.2).abs() < 0.1, "{visible:?}");
    let car = of([false, true]);
    let front = [car.middle[0] + 2.2 * cos, car.middle[1] + 2.2 * sin];
    // The nose ends at 21.1, -2.4; the middle of the front is 0.9 m to the right of it.
    let off = libm::hypotf(front[0] - 21.1 - 0.9 * sin, front[1] + 2.43 + 0.9 * cos);
    assert!(off < 0.15 && car.size_m == [4.4, 1.8], "{off} {car:?}");
}

#[test]
fn part_of_a_vehicle_is_no_object_of_its_own() {
    // A bumper a metre in front of the cab, whose far end is hidden.
    let cloud = turn_over(&[[30.9, 0.0, 1.3, 5.0, 2.4, 2.4], [27.2, 0.0, 0.4, 0.3, 2.3, 0.6]], 0.0, 0.0);
    let route = straight_route();
    let found = detect(&mut objects(Params::default()), &Scan { route: Some(&route), ..scan(&cloud) });
    assert!(found.boxes.iter().any(|b| b.kind == ActorKind::Truck), "{found:?}");
    assert!(found.boxes.iter().all(|b| b.kind != ActorKind::Static), "{found:?}");
}

#[test]
fn rear_of_a_vehicle_beside_its_front_is_no_vehicle_of_its_own() {
    let candidate = |x_m: f64, y_m: f64, [length_m, width_m]: [f64; 2], seen: [f64; 2]| {
        let extent = Extent { length_m, width_m, height_m: 2.4 };
        let found = DetectedBox::on_ground(ActorKind::Truck, 0.0, Pose2::new(x_m, y_m, 0.05), extent);
        Candidate { found, seen: Point2::new(seen[0], seen[1]), features: [0.0; FEATURES], class: 1 }
    };
    let truck = candidate(28.3, 3.7, [6.0, 2.5], [26.5, 3.4]);
    // A strip of its side, completed away from the truck; and the rear of another one in the next lane.
    let strip = candidate(33.15, 1.3, [6.0, 2.5], [30.2, 2.6]);
    let other = candidate(33.15, 0.5, [6.0, 2.5], [30.2, 0.5]);
    let kept = |candidates: &[Candidate]| {
        let (mut footprints, mut boxes) = (Vec::new(), Vec::new());
        keep_disjoint(candidates, &mut footprints, &mut boxes);
        boxes.len()
    };
    assert_eq!([kept(&[truck, strip]), kept(&[truck, other]), kept(&[truck, truck])], [1, 2, 1]);
}

#[test]
fn boxes_are_aligned_with_a_known_route() {
    let cloud = turn(0.0, 0.0);
    let route = straight_route();
    let found = detect(&mut objects(Params::default()), &Scan { route: Some(&route), ..scan(&cloud) });
    let cars = found.boxes.iter().filter(|b| b.kind == ActorKind::Car && b.score > 0.5);
    assert!(cars.clone().count() >= 3);
    assert!(cars.into_iter().all(|b| math::sin(b.pose.heading_rad).abs() < 0.1));
}

#[test]
fn detector_accepts_degenerate_sweeps() {
    let good = turn(0.0, 0.0);
    let of = |points: Vec<[f32; 3]>| {
        let mut cloud = PointCloud::default();
        for place_m in points {
            cloud.push(LidarPoint { place_m, ..LidarPoint::default() });
        }
        cloud
    };
    let mut used = objects(Params::default());
    detect(&mut used, &scan(&good));
    for (what, cloud, most) in [
        ("none", PointCloud::default(), 0),
        ("one", of(vec![[5.0, 1.0, -1.0]]), 0),
        ("no numbers", of(vec![[f32::NAN, 1.0, -1.0]; 500]), 0),
        ("far away", of(vec![[f32::INFINITY, f32::MAX, 1e30]; 500]), 0),
        ("in one place", of(vec![[9.0, 2.0, -1.0]; 5000]), 1),
    ] {
        let found = detect(&mut used, &scan(&cloud));
        assert!(found.boxes.len() <= most, "{what}: {found:?}");
        assert_eq!(found, detect(&mut objects(Params::default()), &scan(&cloud)), "{what}");
    }
}

#[test]
fn detector_uses_only_complete_points_of_unequal_arrays() {
    let whole = turn(0.0, 0.0);
    let (mut cut, mut short) = (PointCloud { stamp: whole.stamp, ..PointCloud::default() }, whole.clone());
    (0..whole.len() - 3000).filter_map(|k| whole.get(k)).for_each(|point| cut.push(point));
    short.z_m.truncate(whole.len() - 3000);
    let mut objects = objects(Params::default());
    assert_eq!(detect(&mut objects, &scan(&short)), detect(&mut objects, &scan(&cut)));
}

#[test]
fn detector_accepts_many_points() {
    let mut rng = Rng::keyed(3, "many", &[]);
    let mut cloud = PointCloud::default();
    for _ in 0..200_000 {
        let place_m = [40.0, 40.0, 2.0].map(|m| rng.uniform(-m, m) as f32);
        cloud.push(LidarPoint { place_m, ..LidarPoint::default() });
    }
    let found = detect(&mut objects(Params::default()), &scan(&cloud));
    assert!(found.boxes.iter().all(|b| b.pose.is_finite()));
}

#[test]
fn detector_allocates_nothing_after_the_first_sweep() {
    let cloud = turn(0.0, 0.0);
    for ground in [Method::Rays, Method::Zones] {
        let mut objects = objects(Params { ground, ..Params::default() });
        let mut out = Detections::default();
        objects.detect(&scan(&cloud), &mut out);
        let used = allocation_counter::measure(|| objects.detect(&scan(&cloud), &mut out));
        assert_eq!(used.count_total, 0, "{ground:?}: {used:?}");
    }
}

/// Same digest on every machine; recorded when the weights were trained.
#[test]
fn detections_have_the_recorded_digest() {
    let found = detect(&mut objects(Params::default()), &scan(&turn(10.0, 0.1)));
    assert_eq!(digest_of(&found).to_string(), include_str!("digest.txt").trim());
}

#[test]
fn validate_rejects_parameters_out_of_range() {
    let told = |params: Params| LidarObjects::new(params).unwrap_err().to_string();
    assert_eq!(told(Params { reach_m: 1e4, ..Params::default() }), "`reach_m` is 10000, expected 5 to 200");
    assert_eq!(told(Params { points_min: 0, ..Params::default() }), "`points_min` is 0, expected 2 to 1000");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn boxes_are_valid_for_any_points(
        points in prop::collection::vec((-30.0_f32..30.0, -30.0_f32..30.0, -2.5_f32..3.0, -0.2_f32..0.2), 0..400),
        speed_mps in -10.0_f64..40.0,
        zones: bool,
    ) {
        let mut cloud = PointCloud::default();
        for (x, y, z, time_offset_s) in points {
            // Rounded, so that points share positions and cells.
            let place_m = [(x * 2.0).round() * 0.5, (y * 4.0).round() * 0.25, z];
            cloud.push(LidarPoint { place_m, time_offset_s, ..LidarPoint::default() });
        }
        let ground = if zones { Method::Zones } else { Method::Rays };
        let mut objects = objects(Params { ground, score_min: 0.0, ..Params::default() });
        let scan = Scan { ego: EgoState { speed_mps, ..EgoState::default() }, ..scan(&cloud) };
        let found = detect(&mut objects, &scan);
        prop_assert!(found.boxes.is_sorted_by(|a, b| a.score >= b.score));
        for b in &found.boxes {
            let Extent { length_m, width_m, height_m } = b.extent;
            prop_assert!(b.pose.is_finite() && (0.0..=1.0).contains(&b.score));
            prop_assert!([length_m, width_m, height_m].iter().all(|m| (0.1..20.0).contains(m)), "{b:?}");
        }
        prop_assert_eq!(found, detect(&mut objects, &scan));
    }
}
