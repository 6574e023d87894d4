use super::*;
use crate::image_box::tests::camera;
use proptest::prelude::*;
use swerve_core::Ranges as _;
use swerve_geom::{Ego, Point2, math};
use swerve_msg::{ActorKind, EgoState, Encoding, Extent, Image, Pixels, RadarDetection, RadarScan};

const CAR: Extent = Extent { length_m: 4.4, width_m: 1.8, height_m: 1.5 };
const PERSON: Extent = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.75 };

fn found(kind: ActorKind, x_m: f64, y_m: f64, score: f64) -> DetectedBox {
    DetectedBox {
        kind,
        score,
        pose: Pose2::new(x_m, y_m, 0.0),
        bottom_m: 0.0,
        extent: if kind.is_person() { PERSON } else { CAR },
        image_px: None,
        covariance_m2: None,
        radial_speed_mps: None,
    }
}

/// Camera detection: the image box of the true position, and a reported position that may be wrong.
fn seen(kind: ActorKind, at: [f64; 2], told: [f64; 2], score: f64) -> DetectedBox {
    let truth = found(kind, at[0], at[1], score);
    let image_px = camera().image_px(truth.pose, truth.bottom_m, truth.extent);
    DetectedBox { pose: Pose2::new(told[0], told[1], 0.0), image_px, ..truth }
}

fn list(ms: i64, boxes: Vec<DetectedBox>) -> Detections {
    Detections { stamp: Time::from_ms(ms), boxes }
}

fn origin() -> Pose2<Map> {
    Pose2::new(0.0, 0.0, 0.0)
}

fn by_camera(found: &Detections) -> CameraSight<'_> {
    CameraSight { boxes: Sighted { found, ego: origin(), is_new: true }, camera: camera(), depth: None }
}

fn by_lidar(found: &Detections) -> Sighted<'_> {
    Sighted { found, ego: origin(), is_new: true }
}

fn fused(sources: &Sources<'_>) -> Vec<DetectedBox> {
    fuse(sources, &Params::default()).unwrap().boxes
}

#[test]
fn fusion_takes_the_class_from_the_camera_and_the_position_from_the_lidar() {
    // The camera places both 4 m too far away; the lidar classifies the person as a cyclist.
    let camera = list(
        100,
        vec![
            seen(ActorKind::Pedestrian, [20.0, 3.0], [24.0, 3.6], 0.7),
            seen(ActorKind::Car, [30.0, -2.0], [34.0, -2.3], 0.8),
        ],
    );
    let lidar =
        list(100, vec![found(ActorKind::Car, 30.0, -2.0, 0.6), found(ActorKind::Cyclist, 20.0, 3.0, 0.5)]);
    let sources =
        Sources { camera: Some(by_camera(&camera)), lidar: Some(by_lidar(&lidar)), ..Sources::default() };
    let boxes = fused(&sources);
    let kinds: Vec<ActorKind> = boxes.iter().map(|b| b.kind).collect();
    assert_eq!(kinds, [ActorKind::Car, ActorKind::Pedestrian], "{boxes:?}");
    assert_eq!(boxes[0].pose.point(), Point2::new(30.0, -2.0));
    assert_eq!(boxes[1].pose.point(), Point2::new(20.0, 3.0));
    assert!((boxes[0].score - 0.92).abs() < 1e-12 && (boxes[1].score - 0.85).abs() < 1e-12);
    assert_eq!(boxes[1].image_px, camera.boxes[0].image_px);
    let [xx, _, yy] = boxes[0].covariance_m2.unwrap();
    assert!(xx < 0.15 && yy < 0.15, "that of the lidar: {xx} {yy}");
}

#[test]
fn fusion_lowers_the_score_of_a_person_where_the_lidar_measures_free_space() {
    let score = |at: [f64; 2], lidar: Option<Vec<DetectedBox>>| {
        let camera = list(0, vec![seen(ActorKind::Pedestrian, at, at, 0.75)]);
        let lidar = lidar.map(|boxes| list(0, boxes));
        let sources = Sources {
            camera: Some(by_camera(&camera)),
            lidar: lidar.as_ref().map(by_lidar),
            ..Sources::default()
        };
        let boxes = fused(&sources);
        boxes.iter().find(|b| b.kind.is_person()).unwrap().score
    };
    // Of four such boxes three are people; the lidar misses 0.3 of those 3: 0.3 / (0.3 + 1).
    assert!((score([9.0, 3.0], Some(vec![])) - 0.3 / 1.3).abs() < 1e-12);
    // Unchanged without a lidar, beyond its range, and next to a car that may hide them or contain their points.
    assert_eq!(score([9.0, 3.0], None), 0.75);
    assert_eq!(score([24.0, 3.0], Some(vec![])), 0.75);
    assert_eq!(score([15.0, 3.0], Some(vec![found(ActorKind::Car, 10.0, 3.0, 0.6)])), 0.75);
    // A car elsewhere, or behind them, does not hide them.
    assert!(score([9.0, 3.0], Some(vec![found(ActorKind::Car, 15.0, -6.0, 0.6)])) < 0.3);
    assert!(score([9.0, 3.0], Some(vec![found(ActorKind::Car, 25.0, 8.0, 0.6)])) < 0.3);
}

#[test]
fn person_in_the_corner_of_a_truck_is_the_truck() {
    let truck = DetectedBox {
        extent: Extent { length_m: 6.0, width_m: 2.5, height_m: 3.0 },
        ..found(ActorKind::Truck, 9.0, 4.0, 0.95)
    };
    let lidar = list(100, vec![truck]);
    let picture = camera().image_px(truck.pose, truck.bottom_m, truck.extent);
    let score_at = |x_m: f64, y_m: f64, image_px: Option<[f64; 4]>| {
        let seen = seen(ActorKind::Pedestrian, [x_m, y_m], [x_m, y_m], 0.95);
        let person = DetectedBox { image_px: image_px.or(seen.image_px), ..seen };
        let camera = list(100, vec![person]);
        let sources =
            Sources { camera: Some(by_camera(&camera)), lidar: Some(by_lidar(&lidar)), ..Sources::default() };
        let found = fused(&sources);
        let trucks = found.iter().filter(|b| b.kind == ActorKind::Truck && b.pose.x_m == 9.0);
        assert_eq!(trucks.count(), 1, "the truck stays: {found:?}");
        found.iter().find(|b| b.kind == ActorKind::Pedestrian).map(|b| b.score).unwrap()
    };
    // The whole truck is taken for a person, who would stand in free space in front of it.
    let free = score_at(4.0, 1.0, picture);
    // The same in its near corner.
    let corner = score_at(6.2, 2.7, None);
    // A person who looks out from behind its far corner may be hidden from the lidar.
    let behind = score_at(13.0, 2.6, None);
    assert!(free < 0.7 && corner < 0.7 && behind > 0.9, "{free} {corner} {behind}");
}

#[test]
fn fusion_keeps_objects_of_a_single_source_with_their_errors() {
    let camera = list(0, vec![seen(ActorKind::Pedestrian, [30.0, 0.0], [30.0, 0.0], 0.7)]);
    let lidar = list(0, vec![found(ActorKind::Car, 15.0, 9.0, 0.6)]);
    let none = list(0, vec![]);
    let both = |camera, lidar| {
        fused(&Sources {
            camera: Some(by_camera(camera)),
            lidar: Some(by_lidar(lidar)),
            ..Sources::default()
        })
    };
    let kinds = |boxes: &[DetectedBox]| boxes.iter().map(|b| b.kind).collect::<Vec<_>>();
    assert_eq!(kinds(&both(&camera, &lidar)), [ActorKind::Pedestrian, ActorKind::Car]);
    assert_eq!(kinds(&both(&none, &lidar)), [ActorKind::Car]);
    let alone = both(&camera, &none);
    assert_eq!(kinds(&alone), [ActorKind::Pedestrian]);
    // Camera 1.4 m above the ground, object 28.25 m ahead, focal length 320 pixels.
    let [along, _, across] = alone[0].covariance_m2.unwrap().map(f64::sqrt);
    let expected = 28.25 * 28.25 / 1.4 * math::hypot(2.0 / 320.0, 0.003);
    assert!((along - expected).abs() < 0.01 && (across - 28.25 / 160.0).abs() < 0.01, "{along} {across}");
    // A covariance reported by the detector takes precedence.
    let told = list(0, vec![DetectedBox { covariance_m2: Some([2.0, 0.5, 1.0]), ..camera.boxes[0] }]);
    assert_eq!(both(&told, &none)[0].covariance_m2, Some([2.0, 0.5, 1.0]));
    assert_eq!(fuse(&Sources::default(), &Params::default()), None);
}

#[test]
fn fusion_pairs_boxes_by_their_errors_without_image_boxes() {
    let plain = |x, y| found(ActorKind::Pedestrian, x, y, 0.7);
    // Camera errors are long in range: 3 m farther is the same object, 3 m to the side is not.
    for (at, is_one) in [([33.0, 0.0], true), ([30.0, 3.0], false)] {
        let (camera, lidar) = (list(0, vec![plain(at[0], at[1])]), list(0, vec![plain(30.0, 0.0)]));
        let sources =
            Sources { camera: Some(by_camera(&camera)), lidar: Some(by_lidar(&lidar)), ..Sources::default() };
        assert_eq!(fused(&sources).len(), if is_one { 1 } else { 2 }, "{at:?}");
    }
}

#[test]
fn fusion_takes_the_distance_from_depth_without_a_lidar() {
    let camera = list(40, vec![seen(ActorKind::Pedestrian, [21.75, 2.0], [26.0, 2.4], 0.7)]);
    let [left, top, right, bottom] = camera.boxes[0].image_px.unwrap();
    let mut depth = Image::new(320, 180, Encoding::DepthF32M);
    depth.stamp = Time::from_ms(40);
    let Pixels::DepthF32M(metres) = &mut depth.pixels else { panic!("it has depths") };
    for (k, metres) in metres.iter_mut().enumerate() {
        // Half the size of the camera's image; the wall behind is 60 m away, and some pixels are invalid.
        let (u, v) = (2.0 * (k % 320) as f64 + 1.0, 2.0 * (k / 320) as f64 + 1.0);
        let is_on = (left..right).contains(&u) && (top..bottom).contains(&v);
        *metres = if k % 7 == 0 {
            f32::NAN
        } else if is_on {
            19.75
        } else {
            60.0
        };
    }
    let at = |depth: Option<&Image>| {
        let sight = CameraSight { depth, ..by_camera(&camera) };
        fused(&Sources { camera: Some(sight), ..Sources::default() })[0]
    };
    let measured = at(Some(&depth));
    assert!(measured.pose.point().distance(Point2::new(21.75, 2.0)) < 0.15, "{measured:?}");
    assert!(measured.covariance_m2.unwrap()[0] < 0.3, "{measured:?}");
    // An image of another instant, or with missing bytes, is ignored.
    depth.stamp = Time::from_ms(41);
    assert_eq!(at(Some(&depth)).pose, camera.boxes[0].pose);
    (depth.stamp, depth.width_px) = (Time::from_ms(40), 999);
    assert_eq!(at(Some(&depth)).pose, camera.boxes[0].pose);
}

/// Radar at the front of a car that drives at 10 m/s and turns.
fn echoes(scan: &RadarScan) -> Echoes<'_> {
    let ego = EgoState { speed_mps: 10.0, yaw_rate_radps: 0.2, ..EgoState::default() };
    Echoes { scan, ego, ego_from_radar: Pose2::new(3.5, 0.5, 0.1) }
}

/// Echo of an object at a position in the ego frame with a velocity over ground.
fn echo(at: [f64; 2], speed_mps: [f64; 2], snr_db: f64) -> RadarDetection {
    let way = [at[0] - 3.5, at[1] - 0.5];
    let range_m = math::hypot(way[0], way[1]);
    let own_mps = [10.0 - 0.2 * 0.5, 0.2 * 3.5];
    let range_rate_mps = (0..2).map(|k| (speed_mps[k] - own_mps[k]) * way[k] / range_m).sum::<f64>();
    let azimuth_rad = math::atan2(way[1], way[0]) - 0.1;
    RadarDetection { range_m, range_rate_mps, azimuth_rad, elevation_rad: None, rcs_dbsm: 10.0, snr_db }
}

#[test]
fn fusion_takes_the_speed_over_ground_from_the_radar() {
    let lidar = list(0, vec![found(ActorKind::Car, 40.0, 3.0, 0.9), found(ActorKind::Car, 40.0, -6.0, 0.8)]);
    let strong = echo([38.0, 3.0], [-8.0, 0.0], 20.0);
    let scan = RadarScan {
        stamp: Time::ZERO,
        detections: vec![
            echo([37.5, 2.8], [5.0, 0.0], 12.0),
            strong,
            RadarDetection { range_rate_mps: f64::NAN, ..strong },
            RadarDetection { range_m: f64::INFINITY, ..strong },
            echo([70.0, 0.0], [1.0, 0.0], 30.0),
        ],
    };
    let sources = Sources { lidar: Some(by_lidar(&lidar)), radar: Some(echoes(&scan)), ..Sources::default() };
    let boxes = fused(&sources);
    let speed = boxes[0].radial_speed_mps.unwrap();
    assert!((-8.0..-7.9).contains(&speed), "of its strongest echo: {speed}");
    assert_eq!(boxes[1].radial_speed_mps, None, "no echo, no speed");
    assert_eq!(boxes.len(), 2, "an echo alone is no object");
    assert_eq!(boxes[0].pose, lidar.boxes[0].pose, "a lidar's distance is better than a radar's");
}

#[test]
fn static_object_that_moves_is_a_vehicle() {
    let extent = Extent { length_m: 0.6, width_m: 0.4, height_m: 0.8 };
    let lidar = list(0, vec![DetectedBox { extent, ..found(ActorKind::Static, 40.0, 3.0, 0.8) }]);
    let kind = |speed_mps| {
        let scan =
            RadarScan { stamp: Time::ZERO, detections: vec![echo([40.0, 3.0], [speed_mps, 0.0], 20.0)] };
        let sources =
            Sources { lidar: Some(by_lidar(&lidar)), radar: Some(echoes(&scan)), ..Sources::default() };
        let found = fused(&sources)[0];
        (found.kind, found.extent.length_m, found.score)
    };
    assert_eq!([-5.0, 0.5].map(kind), [(ActorKind::Car, 4.4, 0.9), (ActorKind::Static, 0.6, 0.8)]);
}

#[test]
fn fusion_takes_the_distance_from_the_radar_instead_of_the_ground_plane() {
    let camera = list(0, vec![seen(ActorKind::Car, [45.0, 4.0], [52.0, 4.7], 0.8)]);
    let scan = RadarScan { stamp: Time::ZERO, detections: vec![echo([42.8, 4.0], [0.0, 0.0], 15.0)] };
    let sources =
        Sources { camera: Some(by_camera(&camera)), radar: Some(echoes(&scan)), ..Sources::default() };
    let [only] = fused(&sources)[..] else { panic!("one object") };
    assert!(only.pose.point().distance(Point2::new(45.0, 4.0)) < 0.7, "{only:?}");
    assert!(only.radial_speed_mps.unwrap().abs() < 1e-9, "it stands: {only:?}");
    let [xx, _, _] = only.covariance_m2.unwrap();
    assert!((0.5..1.2).contains(&xx.sqrt()), "{xx}");
}

#[test]
fn clutter_does_not_place_a_vehicle_nor_a_fast_echo_a_person() {
    let none = list(0, vec![]);
    let placed = |kind, speed_mps: f64, lidar: Option<&Detections>| {
        let camera = list(0, vec![seen(kind, [17.0, 0.5], [16.0, 0.5], 0.9)]);
        let scan =
            RadarScan { stamp: Time::ZERO, detections: vec![echo([15.0, 0.5], [speed_mps, 0.0], 15.0)] };
        let lidar = lidar.map(by_lidar);
        let sources = Sources { camera: Some(by_camera(&camera)), lidar, radar: Some(echoes(&scan)) };
        fused(&sources)[0].radial_speed_mps.is_some()
    };
    use ActorKind::{Car, Pedestrian};
    // Where the lidar finds nothing, a still echo is clutter, and a moving one is not.
    assert_eq!([None, Some(&none)].map(|lidar| placed(Car, 0.0, lidar)), [true, false]);
    assert!(placed(Car, 9.0, Some(&none)));
    assert_eq!([1.5, 9.0].map(|mps| placed(Pedestrian, mps, Some(&none))), [true, false]);
}

#[test]
fn fusion_takes_the_distance_from_the_near_end_of_an_object() {
    let camera = list(0, vec![seen(ActorKind::Car, [45.0, 4.0], [52.0, 4.7], 0.8)]);
    let near = echo([42.8, 4.0], [0.0, 0.0], 15.0);
    let at_m = |others: Vec<RadarDetection>| {
        let detections = [vec![near], others].concat();
        let scan = RadarScan { stamp: Time::ZERO, detections };
        let sources =
            Sources { camera: Some(by_camera(&camera)), radar: Some(echoes(&scan)), ..Sources::default() };
        fused(&sources)[0].pose.x_m
    };
    let alone_m = at_m(vec![]);
    assert_eq!(at_m(vec![echo([46.8, 4.0], [0.0, 0.0], 25.0)]), alone_m, "the rear end is stronger");
    let behind_m = at_m(vec![echo([49.0, 4.3], [0.0, 0.0], 25.0)]);
    assert!(behind_m > alone_m + 4.0, "the near echo is of something else: {behind_m} {alone_m}");
}

#[test]
fn fusion_reports_each_position_once() {
    let camera = list(50, vec![seen(ActorKind::Pedestrian, [20.0, 3.0], [20.0, 3.0], 0.7)]);
    let lidar =
        list(0, vec![found(ActorKind::Pedestrian, 20.0, 3.0, 0.5), found(ActorKind::Car, 40.0, -8.0, 0.6)]);
    let told = |[by_camera_is_new, by_lidar_is_new]: [bool; 2]| {
        let mut sight = by_camera(&camera);
        sight.boxes.is_new = by_camera_is_new;
        let turn = Sighted { is_new: by_lidar_is_new, ..by_lidar(&lidar) };
        fused(&Sources { camera: Some(sight), lidar: Some(turn), ..Sources::default() })
    };
    let kinds = |boxes: Vec<DetectedBox>| boxes.iter().map(|b| b.kind).collect::<Vec<_>>();
    assert_eq!(kinds(told([true, true])), [ActorKind::Pedestrian, ActorKind::Car]);
    assert_eq!(kinds(told([true, false])), [ActorKind::Pedestrian], "the turn's car was told before");
    assert_eq!(told([false, false]), []);
}

#[test]
fn fusion_moves_older_boxes_with_the_ego() {
    // The ego has driven 2 m and turned by 0.1 rad since the camera image.
    let then = Pose2::new(100.0, 50.0, 1.0);
    let there = then.ahead(2.0);
    let now = Pose2::new(there.x_m, there.y_m, 1.1);
    let camera_list = list(0, vec![seen(ActorKind::Pedestrian, [25.0, 2.0], [25.5, 2.0], 0.7)]);
    let at = now.to_local::<Ego>(then.from_local::<Ego>(Point2::new(25.0, 2.0)));
    let lidar_list = list(80, vec![found(ActorKind::Pedestrian, at.x_m, at.y_m, 0.5)]);
    let sight = CameraSight {
        boxes: Sighted { found: &camera_list, ego: then, is_new: true },
        ..by_camera(&camera_list)
    };
    let lidar = Sighted { found: &lidar_list, ego: now, is_new: true };
    let both =
        fuse(&Sources { camera: Some(sight), lidar: Some(lidar), ..Sources::default() }, &Params::default());
    let both = both.unwrap();
    assert_eq!((both.stamp, both.boxes.len()), (Time::from_ms(80), 1), "{both:?}");
    let none = list(80, vec![]);
    let lidar = Sighted { found: &none, ego: now, is_new: true };
    let alone =
        fuse(&Sources { camera: Some(sight), lidar: Some(lidar), ..Sources::default() }, &Params::default());
    let moved = now.to_local::<Ego>(then.from_local::<Ego>(Point2::new(25.5, 2.0)));
    assert!(alone.unwrap().boxes[0].pose.point().distance(moved) < 1e-9);
}

#[test]
fn validate_rejects_parameters_out_of_range() {
    let told = Params { iou_min: 2.0, ..Params::default() }.check_ranges().unwrap_err().to_string();
    assert_eq!(told, "`iou_min` is 2, expected 0.01 to 1");
}

#[test]
fn fusion_uses_only_the_highest_scoring_boxes_and_needs_a_finite_ego_pose() {
    let place = |k: u32| [5.0 + f64::from(k % 100), f64::from(k / 100) - 50.0];
    let boxes: Vec<DetectedBox> = (0..10_000)
        .map(|k| seen(ActorKind::Pedestrian, place(k), place(k), if k % 10 == 3 { 0.9 } else { 0.7 }))
        .collect();
    let many = list(0, boxes);
    let sources =
        Sources { camera: Some(by_camera(&many)), lidar: Some(by_lidar(&many)), ..Sources::default() };
    let boxes = fused(&sources);
    assert!((1000..=2000).contains(&boxes.len()) && boxes.iter().all(|b| b.score >= 0.9), "{}", boxes.len());
    let lost = Sighted { found: &many, ego: Pose2::new(f64::NAN, 0.0, 0.0), is_new: true };
    assert_eq!(fuse(&Sources { lidar: Some(lost), ..Sources::default() }, &Params::default()), None);
}

/// Boxes with arbitrary values.
fn any_box() -> impl Strategy<Value = DetectedBox> {
    let number =
        prop_oneof![8 => -60.0..60.0_f64, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(1e300)];
    let place = prop::array::uniform3(number.clone());
    let picture = prop::option::of(prop::array::uniform4(prop_oneof![8 => 0.0..640.0_f64, 1 => number]));
    let spread = prop::option::of(prop::array::uniform3(-1.0..9.0_f64));
    (place, 0.0..1.2_f64, 0.1..5.0_f64, picture, spread, any::<bool>()).prop_map(
        |([x, y, heading], score, size, image_px, covariance_m2, is_person)| DetectedBox {
            pose: Pose2::new(x, y, heading),
            extent: Extent { length_m: size, width_m: 0.5 * size, height_m: 1.5 },
            image_px,
            covariance_m2,
            ..found(if is_person { ActorKind::Pedestrian } else { ActorKind::Car }, 0.0, 0.0, score)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
    /// For any input: at most as many objects as valid boxes and at least as many as the larger source has, each with a
    /// position and a covariance, by falling score, and deterministic.
    #[test]
    fn fused_lists_are_valid_for_any_input(
        camera in prop::collection::vec(any_box(), 0..8),
        lidar in prop::collection::vec(any_box(), 0..8),
        echoes in prop::collection::vec((0.0..80.0_f64, -1.0..1.0_f64, -30.0..30.0_f64), 0..8),
    ) {
        let scan = RadarScan {
            stamp: Time::ZERO,
            detections: echoes
                .iter()
                .map(|&(range_m, azimuth_rad, range_rate_mps)| RadarDetection {
                    range_m, azimuth_rad, range_rate_mps, elevation_rad: None, rcs_dbsm: 0.0, snr_db: range_m,
                })
                .collect(),
        };
        let (camera, lidar) = (list(20, camera), list(0, lidar));
        let sources = Sources {
            camera: Some(by_camera(&camera)),
            lidar: Some(by_lidar(&lidar)),
            radar: Some(super::tests::echoes(&scan)),
        };
        let told = fuse(&sources, &Params::default()).unwrap();
        let sound = |list: &Detections, within_m: f64| {
            let is_sound = |b: &&DetectedBox| {
                b.is_finite() && b.score <= 1.0 && b.pose.point().distance(Point2::default()) <= within_m
            };
            list.boxes.iter().filter(is_sound).count()
        };
        // Covariances overflow at 1e300 m, so such objects may be kept or dropped.
        let most = sound(&camera, f64::INFINITY) + sound(&lidar, f64::INFINITY);
        let least = sound(&camera, 1e3).max(sound(&lidar, 1e3));
        prop_assert!((least..=most).contains(&told.boxes.len()), "{} {} {:?}", least, most, told);
        prop_assert!(told.boxes.iter().all(|b| b.is_finite() && b.covariance_m2.is_some()), "{told:?}");
        prop_assert!(told.boxes.is_sorted_by(|a, b| a.score >= b.score));
        prop_assert_eq!(told.stamp, Time::from_ms(20));
        prop_assert_eq!(Some(told), fuse(&sources, &Params::default()));
    }
}
