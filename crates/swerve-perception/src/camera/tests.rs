use proptest::prelude::*;
use swerve_geom::{Camera, Ego, Point, Point2, Transform, Vector2};
use swerve_msg::{ActorId, ActorKind, CameraInfo, Encoding, Intrinsics, Track};
use swerve_vision::acf::{Calibration, Model, Scorer, Template};
use swerve_vision::shipped;

use super::*;
use crate::image_box::ImageCamera;

const SIZE: [u32; 2] = [800, 600];

/// Camera of 800 x 600 pixels, 70 degrees, 1.35 m up, looking ahead except for these angles, nose down and to the left
/// positive.
fn camera(pitch_rad: f64, yaw_rad: f64) -> CameraInfo {
    let focal_px = 571.26;
    let intrinsics = Intrinsics {
        fx_px: focal_px,
        fy_px: focal_px,
        cx_px: 400.0,
        cy_px: 300.0,
        distortion: [0.0; 5],
        is_parallel: false,
    };
    let quarter = core::f64::consts::FRAC_PI_2;
    let turned: Transform<Ego, Ego> =
        Transform::from_roll_pitch_yaw(Point::new(1.75, 0.0, 1.35), 0.0, pitch_rad, yaw_rad);
    let looking: Transform<Ego, Camera> =
        Transform::from_roll_pitch_yaw(Point::default(), -quarter, 0.0, -quarter);
    CameraInfo { intrinsics, ego_from_camera: turned * looking }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
    /// Objects of typical size on level ground, observed without error, are placed correctly.
    #[test]
    fn place_recovers_the_position_of_a_projected_object(
        x in 8.0..60.0, share in -0.45..0.45, class in 0_usize..4, pitch in -0.06..0.06, yaw in -0.5..0.5, body in -0.03..0.03,
    ) {
        let class = CLASSES[class];
        let mounted = camera(pitch, yaw);
        let (sin, cos) = swerve_geom::math::sin_cos(yaw);
        let (ahead, left) = (x + 0.5 * class.extent.length_m, share * x);
        let there = Pose2::<Ego>::new(1.75 + ahead * cos - left * sin, ahead * sin + left * cos, 0.0);
        // The camera's view from a pitched body.
        let tilt: Transform<Ego, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, body, 0.0);
        let at = mounted.ego_from_camera.origin();
        let turned = Transform::new(at, (tilt * mounted.ego_from_camera).rotation());
        let seen = ImageCamera { info: CameraInfo { ego_from_camera: turned, ..mounted }, width_px: 100_000, height_px: 100_000 };
        let Some([l, t, r, b]) = seen.image_px(there, 0.0, class.extent) else { return Ok(()) };
        prop_assume!(l > 0.0 && t > 0.0 && b < 600.0);
        let road = Road::new(None, Pose2::default());
        let placed = Eye::new(&mounted, body).place(&class, [l, t, r - l, b - t], 600.0, &road);
        let (found, [xx, xy, yy]) = placed.unwrap();
        let off = found.point().distance(there.point());
        // The highest and lowest pixel of a box seen from a corner are at different depths.
        prop_assert!(off < 0.02 * x + 0.3 * class.extent.width_m, "{found:?} {there:?}");
        // The covariance is positive definite and corresponds to an error of a few percent of the distance.
        prop_assert!(xx > 0.0 && yy > 0.0 && xx * yy > xy * xy, "{xx} {xy} {yy}");
        prop_assert!((xx + yy).sqrt() < 1.0 + 0.4 * x, "{xx} {yy} at {x}");
    }
}

#[test]
fn horizon_follows_the_pitch() {
    let at = |mount: f64, body: f64| Eye::new(&camera(mount, 0.0), body).ground().horizon_px;
    assert!((at(0.0, 0.0) - 300.0).abs() < 1e-9);
    for (mount, body) in [(0.05, 0.0), (0.0, 0.05), (0.03, 0.02)] {
        let expected = 300.0 - 571.26 * swerve_geom::math::tan(0.05);
        assert!((at(mount, body) - expected).abs() < 1e-6, "{mount} {body}");
    }
}

fn shot(image: &Image) -> Shot<'_> {
    Shot { image, ego: Pose2::default(), pitch_rad: 0.0, route: None }
}

fn street() -> CameraObjects {
    let weights = shipped::detector("street").unwrap().unwrap();
    let rung = weights.rungs[0].clone();
    CameraObjects::new(weights, rung, 0.3).unwrap()
}

#[test]
fn detect_reports_nothing_in_empty_images_and_rejects_unsupported_ones() {
    let mut objects = street();
    let mut found = Detections::default();
    for size in [SIZE, [1, 1], [0, 0], [640, 360]] {
        let mut image = Image::new(size[0], size[1], Encoding::Rgb8);
        image.camera = camera(0.0, 0.0);
        image.stamp = swerve_core::Time::from_ms(40);
        assert_eq!(objects.detect(&shot(&image), None, &mut found), Ok(()));
        assert_eq!((found.boxes.len(), found.stamp), (0, image.stamp), "{size:?}");
    }
    let depth = Image::new(8, 8, Encoding::DepthF32M);
    assert_eq!(objects.detect(&shot(&depth), None, &mut found), Err(ShotError::NoColour));
    let mut cut = Image::new(8, 8, Encoding::Rgb8);
    cut.width_px = 9;
    assert!(matches!(objects.detect(&shot(&cut), None, &mut found), Err(ShotError::Size(_))));
    let mut parallel = Image::new(8, 8, Encoding::Rgb8);
    parallel.camera.intrinsics.is_parallel = true;
    assert_eq!(objects.detect(&shot(&parallel), None, &mut found), Err(ShotError::Parallel));
}

#[test]
fn detectors_with_unknown_classes_or_scores_are_rejected() {
    let weights = shipped::detector("acf_inria").unwrap().unwrap();
    let rung = weights.rungs[0].clone();
    let said = CameraObjects::new(weights.clone(), rung.clone(), 0.3).unwrap_err().to_string();
    assert!(
        said.contains("scores are sums") || said.contains("expected classes of pedestrian, car"),
        "{said}"
    );
    let named = Weights { classes: vec!["sheep".into()], ..weights };
    let said = CameraObjects::new(named, rung, 0.3).unwrap_err();
    assert_eq!(said, DetectorError::Class("sheep".into()));
}

/// Detector that reports people of one size in every window that is searched.
fn people_anywhere(whole_every: u32) -> CameraObjects {
    let template = Template { weights: vec![0.0; 10 * 5 * 10], offset: 1.0 };
    let model = Model {
        class: 0,
        cells: [5, 10],
        object_px: [12.0, 32.0],
        heights_m: [1.4, 2.0],
        scorer: Scorer::Template(template),
    };
    let rung = Rung {
        name: "tracked".into(),
        first_octave: 0,
        per_octave: 2,
        stride: 5,
        trees: 1,
        reject: 0.0,
        whole_every,
        tolerance_rad: Some(0.02),
        calibrations: vec![Calibration { slope: 1.0, offset: 0.0 }],
    };
    let weights = Weights {
        source: "by hand".into(),
        shrink: 4,
        decay: [0.0; 3],
        filters: Vec::new(),
        classes: vec!["pedestrian".into()],
        models: vec![model],
        rungs: vec![rung.clone()],
        overlap: (0.3, Overlap::Union),
    };
    CameraObjects::new(weights, rung, 0.3).unwrap()
}

#[test]
fn detect_searches_at_the_predicted_positions_of_tracks() {
    let mut image = Image::new(800, 600, Encoding::Rgb8);
    image.camera = camera(0.0, 0.0);
    image.stamp = swerve_core::Time::from_ms(500);
    // 20 m ahead and 3 m to the left of a stationary ego looking elsewhere; 1 m away from there half a second earlier.
    let ego = Pose2::new(5.0, 7.0, 1.0);
    let there = ego.from_local(Point2::<Ego>::new(20.0, 3.0));
    let person = Track {
        id: ActorId(1),
        kind: ActorKind::Pedestrian,
        pose: Pose2::new(there.x_m - 1.0, there.y_m, 0.3),
        extent: CLASSES[0].extent,
        velocity_mps: Vector2::new(2.0, 0.0),
        history: Vec::new(),
    };
    let tracks = TrackList { stamp: swerve_core::Time::ZERO, tracks: vec![person] };
    let (mut objects, mut counts) = (people_anywhere(3), Vec::new());
    for _ in 0..4 {
        let mut found = Detections::default();
        let shot = Shot { image: &image, ego, pitch_rad: 0.0, route: None };
        objects.found.clear();
        objects.detect(&shot, Some(&tracks), &mut found).unwrap();
        let near = |one: &&DetectedBox| one.pose.point().distance(Point2::new(20.0, 3.0)) < 8.0;
        counts.push((found.boxes.len(), found.boxes.iter().filter(near).count()));
    }
    let [whole, first, second, again] = counts[..] else { unreachable!() };
    assert!(whole == again && whole.0 > 10 && whole.1 == 0, "{counts:?}");
    assert!(first == second && first.1 > first.0 / 2, "{counts:?}");
    // With an empty track list nothing is searched until the next complete search; without a track list everything is.
    let look = |objects: &mut CameraObjects, tracks: Option<&TrackList>| {
        let mut found = Detections::default();
        let shot = Shot { image: &image, ego, pitch_rad: 0.0, route: None };
        objects.detect(&shot, tracks, &mut found).unwrap();
        found.boxes.len()
    };
    objects.found.clear();
    assert_eq!(look(&mut objects, Some(&TrackList::default())), 0);
    assert_eq!(look(&mut objects, None), whole.0);
    // Detections of the previous image are searched again.
    let mut objects = people_anywhere(9);
    assert_eq!(look(&mut objects, Some(&TrackList::default())), whole.0);
    assert!(look(&mut objects, Some(&TrackList::default())) > whole.0 / 2);
}
