use proptest::prelude::*;
use serde_json::Value;
use swerve_geom::math;
use swerve_tests::data_or_skip;

use super::*;
use crate::samples::Picture;

/// Camera of the photographs: calibrated with OpenCV from the accompanying chessboards, or with the same field of view
/// if there are none; height and pitch are set such that lanes are 3.7 m wide and meet at the horizon.
fn camera_of(image: &str) -> RoadCamera {
    let is_calibrated = image.contains("udacity");
    let pitch_deg: f64 = if is_calibrated { -1.5 } else { -2.5 };
    let ego_from_camera = RoadCamera::looking_ahead(1.2, pitch_deg.to_radians());
    if !is_calibrated {
        return RoadCamera::pinhole([960, 540], 57.9_f64.to_radians(), ego_from_camera);
    }
    RoadCamera {
        size_px: [1280, 720],
        focal_px: [1156.46, 1151.27],
        center_px: [671.32, 389.22],
        distortion: [-0.2467, -0.02544, -0.00067, 0.00013, 0.01067],
        ego_from_camera,
    }
}

fn finder(camera: RoadCamera, method: Method) -> LaneFinder {
    LaneFinder::new(camera, LaneSettings { method, ..LaneSettings::default() }).unwrap()
}

/// Distance, in columns, of a line from a pixel of the image; `None` if the line was not observed in that row.
fn miss_px(line: &LaneLine, camera: &RoadCamera, pitch_rad: f64, [column, row]: [f64; 2]) -> Option<f64> {
    let [from, to] = line.seen_m;
    let places = (0..=4000).map(|k| from + (to - from) * f64::from(k) / 4000.0);
    let pixels = places.filter_map(|x_m| camera.pixel([x_m, line.at(x_m)?.0], pitch_rad));
    let nearest = pixels.min_by(|a, b| (a[1] - row).abs().total_cmp(&(b[1] - row).abs()))?;
    ((nearest[1] - row).abs() < 2.0).then(|| (nearest[0] - column).abs())
}

#[test]
fn both_lines_of_real_roads_are_where_people_see_them() {
    let Some(_photographs) = data_or_skip("lanes_real") else { return };
    let read_by_eye = include_str!("../../../../tests/reference/vision/lanes.json");
    let cases: Value = serde_json::from_str(read_by_eye).unwrap();
    let mut worst_px = 0.0_f64;
    for case in cases.as_array().unwrap() {
        let image = case["image"].as_str().unwrap();
        let Some(path) = data_or_skip(image) else { continue };
        let (picture, camera) = (Picture::read(&path), camera_of(image));
        for method in Method::ALL {
            let lanes = finder(camera, method).find(picture.rgb()).unwrap();
            for (side, line) in [("left", lanes.left), ("right", lanes.right)] {
                let line = line.unwrap_or_else(|| panic!("{image}: {} finds no {side} line", method.name()));
                for mark in case[side].as_array().unwrap() {
                    let at = [0, 1].map(|k| mark[k].as_f64().unwrap());
                    let off = miss_px(&line, &camera, lanes.pitch_rad, at);
                    println!("{image} {} {side}: {off:.1?} px at {at:?}", method.name());
                    worst_px = worst_px.max(off.unwrap_or(f64::INFINITY));
                    assert!(
                        off.is_some_and(|px| px < 16.0),
                        "{image} {} {side} {at:?}: {off:?}",
                        method.name()
                    );
                }
            }
        }
    }
    println!("floor: lanes, both lines of the photographs, farthest from the eye's, px: {worst_px:.1} <= 16");
}

/// Photographs of roads with the lines of a lane that people see in them.
fn marked_roads() -> Vec<(String, Picture, RoadCamera)> {
    let cases: Value =
        serde_json::from_str(include_str!("../../../../tests/reference/vision/lanes.json")).unwrap();
    let names = cases.as_array().unwrap().iter().map(|case| case["image"].as_str().unwrap().to_owned());
    names
        .filter_map(|name| {
            let picture = Picture::read(&data_or_skip(&name)?);
            Some((name.clone(), picture, camera_of(&name)))
        })
        .collect()
}

/// Camera whose stated mounting is `off_deg` further down than its true one.
fn mounted(camera: RoadCamera, true_deg: f64, off_deg: f64) -> RoadCamera {
    let ego_from_camera = RoadCamera::looking_ahead(1.2, (true_deg + off_deg).to_radians());
    RoadCamera { ego_from_camera, ..camera }
}

#[test]
fn finder_finds_the_pitch_of_photographs_from_any_mounting_in_its_range() {
    let roads = marked_roads();
    for (deviation_rad, offs_deg) in [
        (LaneSettings::default().pitch_deviation_rad, [-2.0, -1.0, 0.0, 1.0, 2.0]),
        (LaneSettings::PITCH_UNKNOWN_RAD, [-4.0, -2.5, 0.0, 2.5, 4.0]),
    ] {
        for (method, lanes_floor, pitches_floor) in [(Method::Ridge, 0.97, 0.97), (Method::Hough, 0.97, 0.82)]
        {
            let (mut lanes, mut pitches, mut all) = (0, 0, 0);
            for (name, picture, camera) in &roads {
                let true_deg = if name.contains("udacity") { -1.5 } else { -2.5 };
                for off_deg in offs_deg {
                    let settings = LaneSettings {
                        method,
                        pitch_deviation_rad: deviation_rad,
                        ..LaneSettings::default()
                    };
                    let camera = mounted(*camera, true_deg, off_deg);
                    let found = LaneFinder::new(camera, settings).unwrap().find(picture.rgb()).unwrap();
                    let error_deg = found.pitch_rad.to_degrees() + off_deg;
                    all += 1;
                    lanes += u32::from(found.left.is_some() && found.right.is_some());
                    pitches += u32::from(error_deg.abs() < 0.5);
                    println!("{name} {} {off_deg:+}: {error_deg:+.2} degrees", method.name());
                }
            }
            if all == 0 {
                continue;
            }
            let [lanes, pitches] = [lanes, pitches].map(|count| f64::from(count) / f64::from(all));
            let range_deg = 3.0 * deviation_rad.to_degrees();
            let what =
                format!("lanes of photographs, {}, mounting within {range_deg:.1} degrees", method.name());
            println!("floor: {what}, both lines: {lanes:.3} >= {lanes_floor}");
            println!("floor: {what}, pitch within 0.5 degrees: {pitches:.3} >= {pitches_floor}");
            assert!(lanes >= lanes_floor && pitches >= pitches_floor, "{what}: {lanes} {pitches}");
        }
    }
}

#[test]
fn finder_finds_the_pitch_of_painted_roads_up_to_the_ends_of_its_range() {
    let camera = level_camera([800, 600]);
    for (deviation_rad, pitches_rad) in
        [(0.015, [-0.043, -0.03, 0.03, 0.043]), (LaneSettings::PITCH_UNKNOWN_RAD, [-0.1, -0.06, 0.06, 0.1])]
    {
        for pitch_rad in pitches_rad {
            let picture = painted(&camera, [1.4, -2.0], pitch_rad);
            for method in Method::ALL {
                let settings =
                    LaneSettings { method, pitch_deviation_rad: deviation_rad, ..LaneSettings::default() };
                let lanes = LaneFinder::new(camera, settings).unwrap().find(picture.rgb()).unwrap();
                assert!((lanes.pitch_rad - pitch_rad).abs() < 2e-3, "{method:?} {pitch_rad}: {lanes:?}");
                for (line, truth_m) in [(lanes.left, 1.4), (lanes.right, -2.0)] {
                    let (y_m, _) = line.unwrap().at(20.0).unwrap();
                    assert!((y_m - truth_m).abs() < 0.08, "{method:?} {pitch_rad}: {y_m}");
                }
            }
        }
    }
}

/// Photographs of streets without painted lanes: a residential road with kerbs, and slabs.
#[test]
fn finder_reports_no_lane_on_unmarked_roads() {
    let Some(folder) = data_or_skip("perception/kitti_frames") else { return };
    let (mut roads, mut slabs) = (0, 0);
    for name in
        ["t_0001_000010", "t_0001_000015", "t_0001_000020", "t_0016_000002", "t_0016_000007", "t_0016_000012"]
    {
        let picture = Picture::read(&folder.join(format!("{name}.png")));
        for method in Method::ALL {
            for pitch_deviation_rad in
                [LaneSettings::default().pitch_deviation_rad, LaneSettings::PITCH_UNKNOWN_RAD]
            {
                let camera = RoadCamera {
                    size_px: [picture.width, picture.height],
                    focal_px: [721.54; 2],
                    center_px: [609.6, 172.9],
                    distortion: [0.0; 5],
                    ego_from_camera: RoadCamera::looking_ahead(1.65, 0.0),
                };
                let settings = LaneSettings { method, pitch_deviation_rad, ..LaneSettings::default() };
                let lanes = LaneFinder::new(camera, settings).unwrap().find(picture.rgb()).unwrap();
                let lines = u32::from(lanes.left.is_some()) + u32::from(lanes.right.is_some());
                assert!(lines < 2, "{name} {method:?}: {lanes:?}");
                if name.contains("0001") { roads += lines } else { slabs += lines }
            }
        }
    }
    println!(
        "floor: lanes, lines on 3 photographs of an unmarked road, both methods and ranges: {roads} <= 0"
    );
    println!("floor: lanes, lines on 3 photographs of slabs, both methods and ranges: {slabs} <= 4");
    assert!(roads == 0 && slabs <= 4, "{roads} {slabs}");
}

/// Grey road with two painted lines, seen without lens distortion; the noise is a hash of the position.
fn painted(camera: &RoadCamera, offsets_m: [f64; 2], pitch_rad: f64) -> Picture {
    let [width, height] = camera.size_px;
    let (height_m, focal) = (camera.ego_from_camera.origin().coords.z, camera.focal_px[0]);
    let mut rng = swerve_core::Rng::keyed(3, "road", &[]);
    let mut bytes = Vec::new();
    for k in 0..width * height {
        let (column, row) = ((k % width) as f64 + 0.5, (k / width) as f64 + 0.5);
        let mark = Mark {
            left: (camera.center_px[0] - column) / focal,
            down: (row - camera.center_px[1]) / focal,
            contrast: 0.0,
        };
        let place = mark.on_road(height_m, math::sin_cos(pitch_rad).into());
        let is_paint = |[x, y]: [f64; 2]| x < 80.0 && offsets_m.iter().any(|line| (y - line).abs() < 0.075);
        let level = if place.is_some_and(is_paint) { 190.0 } else { 90.0 };
        bytes.extend([(level + 4.0 * rng.normal()) as u8; 3]);
    }
    Picture { width, height, bytes }
}

fn level_camera(size_px: [usize; 2]) -> RoadCamera {
    RoadCamera::pinhole(size_px, 1.2, RoadCamera::looking_ahead(1.35, 0.0))
}

#[test]
fn finder_estimates_painted_lines_and_pitch() {
    let camera = level_camera([800, 600]);
    for pitch_rad in [-0.02, 0.0, 0.015] {
        let picture = painted(&camera, [1.4, -2.0], pitch_rad);
        for method in Method::ALL {
            let lanes = finder(camera, method).find(picture.rgb()).unwrap();
            assert!((lanes.pitch_rad - pitch_rad).abs() < 2e-3, "{method:?} {pitch_rad}: {lanes:?}");
            for (line, truth_m) in [(lanes.left, 1.4), (lanes.right, -2.0)] {
                let line = line.unwrap();
                assert!(line.seen_m[0] < 5.0 && line.seen_m[1] > 30.0, "{method:?}: {line:?}");
                let (y_m, deviation_m) = line.at(20.0).unwrap();
                assert!((y_m - truth_m).abs() < 0.08 && deviation_m < 0.1, "{method:?} {pitch_rad}: {y_m}");
                assert_eq!(line.at(line.seen_m[1] + 0.1), None);
            }
        }
    }
}

#[test]
fn finder_reports_a_single_line() {
    let camera = level_camera([800, 600]);
    let picture = painted(&camera, [1.4, 100.0], 0.0);
    let lanes = finder(camera, Method::Ridge).find(picture.rgb()).unwrap();
    assert!(lanes.left.is_some() && lanes.right.is_none(), "{lanes:?}");
}

#[test]
fn finder_keeps_no_state_and_allocates_nothing_after_the_first_image() {
    let camera = level_camera([400, 300]);
    let pictures = [[1.4, -2.0], [2.0, -1.5]].map(|offsets_m| painted(&camera, offsets_m, 0.01));
    for method in Method::ALL {
        let mut used = finder(camera, method);
        pictures.iter().for_each(|picture| assert!(used.find(picture.rgb()).is_ok()));
        let mut again = Lanes::default();
        let memory = allocation_counter::measure(|| again = used.find(pictures[0].rgb()).unwrap());
        assert_eq!((memory.count_total, again), (0, finder(camera, method).find(pictures[0].rgb()).unwrap()));
    }
}

#[test]
fn finder_reports_no_lines_in_uniform_images() {
    for size_px in [[1, 1], [2, 500], [500, 2], [64, 48], [800, 600]] {
        for level in [0, 128, 255] {
            let bytes = vec![level; 3 * size_px[0] * size_px[1]];
            let image = Rgb::new(size_px[0], size_px[1], &bytes).unwrap();
            for method in Method::ALL {
                let lanes = finder(level_camera(size_px), method).find(image).unwrap();
                assert_eq!(lanes, Lanes::default(), "{size_px:?} {level} {method:?}");
            }
        }
    }
}

#[test]
fn finder_reports_no_lines_in_noise() {
    for seed in 0..8 {
        let mut rng = swerve_core::Rng::keyed(seed, "noise", &[]);
        let bytes: Vec<u8> = (0..3 * 800 * 600).map(|_| (128.0 + 30.0 * rng.normal()) as u8).collect();
        for method in Method::ALL {
            let lanes = finder(level_camera([800, 600]), method).find(Rgb::new(800, 600, &bytes).unwrap());
            let Lanes { left, right, .. } = lanes.unwrap();
            assert!(left.is_none() && right.is_none(), "{seed} {method:?}: {left:?} {right:?}");
        }
    }
}

#[test]
fn finder_rejects_invalid_cameras_and_settings() {
    let fine = level_camera([64, 48]);
    let placed = |height_m, pitch_rad| RoadCamera::looking_ahead(height_m, pitch_rad);
    for (camera, expected) in [
        (
            RoadCamera { focal_px: [f64::NAN, 50.0], ..fine },
            "`focal length across` is NaN, expected 0.001 to",
        ),
        (RoadCamera { focal_px: [50.0, 0.0], ..fine }, "`focal length down` is 0, expected 0.001 to"),
        (
            RoadCamera { center_px: [f64::INFINITY, 0.0], ..fine },
            "`optical axis, column` is inf, expected within",
        ),
        (
            RoadCamera { distortion: [0.0, f64::NAN, 0.0, 0.0, 0.0], ..fine },
            "`distortion` is NaN, expected -10",
        ),
        (RoadCamera { size_px: [0, 48], ..fine }, "`width` is 0, expected 1 to 8192 pixels"),
        (
            RoadCamera { ego_from_camera: placed(0.0, 0.0), ..fine },
            "`camera height` is 0, expected 0.1 to 100 m",
        ),
        (RoadCamera { ego_from_camera: placed(f64::NAN, 0.0), ..fine }, "`camera height` is NaN, expected"),
        (
            RoadCamera { ego_from_camera: placed(1.0, 1.5), ..fine },
            "expected less than 60 degrees from straight",
        ),
        (RoadCamera { ego_from_camera: placed(1.0, f64::NAN), ..fine }, "`camera height` is NaN, expected"),
    ] {
        let told = LaneFinder::new(camera, LaneSettings::default()).unwrap_err().to_string();
        assert!(told.contains(expected), "{told}");
    }
    let settings = LaneSettings { width_m: [4.0, 3.0], ..LaneSettings::default() };
    let told = LaneFinder::new(fine, settings).unwrap_err().to_string();
    assert_eq!(told, "`width_m` is 3, expected a widest lane beyond the narrowest, at most 20 m");
    let told = finder(fine, Method::Ridge).find(Rgb::new(2, 1, &[0; 6]).unwrap()).unwrap_err().to_string();
    assert_eq!(told, "an image of [2, 1] pixels, expected [64, 48], which the camera is calibrated for");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn finder_reports_finite_lines_for_any_image_and_camera(
        (width, height) in (1_usize..120, 1_usize..90),
        bytes in proptest::collection::vec(any::<u8>(), 120 * 90 * 3),
        (fov_rad, height_m, pitch_rad) in (0.05_f64..2.8, 0.1_f64..5.0, -0.9_f64..0.9),
        distortion in proptest::array::uniform5(-1.0_f64..1.0),
    ) {
        let camera = RoadCamera::pinhole([width, height], fov_rad, RoadCamera::looking_ahead(height_m, pitch_rad));
        let camera = RoadCamera { distortion, ..camera };
        let image = Rgb::new(width, height, &bytes[..3 * width * height]).unwrap();
        for method in Method::ALL {
            let lanes = finder(camera, method).find(image).unwrap();
            for line in [lanes.left, lanes.right].into_iter().flatten() {
                prop_assert!(line.coefficients.iter().all(|c| c.is_finite()) && line.seen_m[0] < line.seen_m[1]);
                prop_assert!(line.at(line.seen_m[0]).is_some_and(|(_, deviation_m)| deviation_m.is_finite()));
            }
        }
    }
}
