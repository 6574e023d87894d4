//! Consistency of lidar ranges with camera depth images.

use crate::{Cloud, Firing, LidarPreset, LidarSpec, SceneTree, Sweeper};
use swerve_camera::{Camera, CameraSpec, Frame, Intrinsics, Outputs, RenderOptions, Renderer, View, mount};
use swerve_geom::{Ego, Lidar, Map, Point, Transform};
use swerve_scene::WeatherPreset;
use swerve_scene::town::town;

/// Whole turn of a sensor at rest.
fn turn(spec: LidarSpec, tree: &SceneTree, pose: Transform<Map, Lidar>) -> Cloud {
    let mut cloud = Cloud::new(&spec, true);
    let mut sweeper = Sweeper::new(spec, 1).expect("the description is fine");
    let firing = Firing::turn_at_rest(&sweeper, pose);
    sweeper.begin_turn(5, &mut cloud.as_mut());
    sweeper.fire(tree, &firing, &mut cloud.as_mut()).expect("pose and room are fine");
    cloud
}

#[test]
fn lidar_and_depth_image_agree() {
    let scene = town(WeatherPreset::ClearNoon, 2, 120.0);
    let tree = SceneTree::new(&scene).unwrap();
    let spec = CameraSpec {
        width_px: 160,
        height_px: 120,
        intrinsics: Intrinsics::HorizontalFovRad(1.2),
        ..CameraSpec::default()
    };
    let camera = Camera::new(spec).unwrap();
    let map_from_ego: Transform<Map, Ego> =
        Transform::from_roll_pitch_yaw(Point::new(0.0, -1.9, 0.0), 0.0, 0.0, 0.1);
    let map_from_camera = map_from_ego * mount([0.0, 0.0, 1.5], 0.0, 0.03, 0.0);
    let mut frame = Frame::new(&camera, Outputs::GEOMETRY);
    let mut renderer = Renderer::new(RenderOptions::default()).unwrap();
    renderer.render(&scene, &View::new(&camera, map_from_camera), frame.as_mut()).unwrap();
    let (mut agree, mut pixels) = (0, 0);
    for row in 0..120_usize {
        for column in 0..160_usize {
            let [x, y] = camera.ray([column as f64 + 0.5, row as f64 + 0.5]);
            let to = map_from_camera * swerve_geom::Vector::new(x, y, 1.0);
            let from = map_from_camera.origin().coords;
            let hit = tree.cast(from.into(), to.coords.into(), 300.0);
            let index = row * 160 + column;
            let depth = frame.depth_m[index];
            let by_ray = hit.map_or(f64::INFINITY, |h| f64::from(h.distance_m) / to.norm());
            pixels += 1;
            let close = (by_ray - f64::from(depth)).abs() <= 0.01 * by_ray;
            let same = hit.is_none_or(|h| {
                frame.semantic[index] == h.class as u8 && frame.instance[index] == h.instance_id
            });
            agree += u32::from((close || (hit.is_none() && depth > 250.0)) && same);
        }
    }
    // The others are at edges, or on surfaces that the image shows from one side only.
    assert!(agree * 1000 > pixels * 985, "{agree} of {pixels}");
}

/// Inverse depth at a point of the image from the pixel there and the slopes around it; `None` at edges: where a
/// neighbour shows another object, or the inverse depth, which is linear over a plane, bends by more than 1 %.
fn smooth_inverse_depth(frame: &Frame, width: usize, [column, row]: [f64; 2]) -> Option<f64> {
    let (x, y) = (column as usize, row as usize);
    let height = frame.depth_m.len() / width;
    if x == 0 || y == 0 || x + 1 >= width || y + 1 >= height {
        return None;
    }
    let at = y * width + x;
    let inverse = |k: usize| 1.0 / f64::from(frame.depth_m[k]);
    let same = |k: usize| (frame.instance[k], frame.semantic[k]) == (frame.instance[at], frame.semantic[at]);
    let around = (y - 1..=y + 1).flat_map(|y| (x - 1..=x + 1).map(move |x| y * width + x));
    let middle = inverse(at);
    let bends = |a: usize, b: usize| (inverse(a) + inverse(b) - 2.0 * middle).abs() > 0.01 * middle;
    let corners = bends(at - width - 1, at + width + 1) || bends(at - width + 1, at + width - 1);
    if !around.clone().all(same) || bends(at - 1, at + 1) || bends(at - width, at + width) || corners {
        return None;
    }
    let slope = |a: usize, b: usize| 0.5 * (inverse(b) - inverse(a));
    let (dx, dy) = (column - x as f64 - 0.5, row - y as f64 - 0.5);
    Some(middle + dx * slope(at - 1, at + 1) + dy * slope(at - width, at + width))
}

#[test]
fn lidar_points_match_the_depth_image_at_their_pixels() {
    let scene = town(WeatherPreset::ClearNoon, 4, 100.0);
    let tree = SceneTree::new(&scene).unwrap();
    let width = 480;
    let spec = CameraSpec {
        width_px: width,
        height_px: 240,
        intrinsics: Intrinsics::HorizontalFovRad(1.2),
        ..CameraSpec::default()
    };
    let camera = Camera::new(spec).unwrap();
    // Both sensors are at the same position, so that occlusions are equal.
    let map_from_ego: Transform<Map, Ego> =
        Transform::from_roll_pitch_yaw(Point::new(0.0, -1.9, 0.0), 0.0, 0.0, 0.1);
    let place = Point::new(0.0, 0.0, 1.8);
    let map_from_lidar = map_from_ego * Transform::<Ego, Lidar>::from_roll_pitch_yaw(place, 0.02, -0.01, 0.2);
    let map_from_camera = map_from_ego * mount([0.0, 0.0, 1.8], 0.0, 0.03, 0.0);
    let mut frame = Frame::new(&camera, Outputs::GEOMETRY);
    let mut renderer = Renderer::new(RenderOptions::default()).unwrap();
    renderer.render(&scene, &View::new(&camera, map_from_camera), frame.as_mut()).unwrap();
    let spec = LidarSpec { columns: 1024, ..LidarPreset::Os1.spec() };
    let cloud = turn(spec.without_noise(), &tree, map_from_lidar);
    let camera_from_lidar = map_from_camera.inverse() * map_from_lidar;
    let (mut seen, mut smooth, mut agree) = (0, 0, 0);
    for k in 0..cloud.len {
        let [x, y, z] = cloud.point_m(k).map(f64::from);
        let point = camera_from_lidar * Point::new(x, y, z);
        let Some(pixel) = camera.project(point) else { continue };
        if pixel[0] < 0.0 || pixel[1] < 0.0 || pixel[0] >= f64::from(width) || pixel[1] >= 240.0 {
            continue;
        }
        seen += 1;
        let Some(inverse) = smooth_inverse_depth(&frame, width as usize, pixel) else { continue };
        smooth += 1;
        agree += usize::from((inverse * point.coords.z - 1.0).abs() < 0.005);
    }
    println!("{agree} of {smooth} smooth of {seen} points in the image");
    // The rest are objects thinner than a pixel, between pixel centres.
    assert!(smooth > 4000 && smooth * 2 > seen, "{smooth} of {seen}");
    assert!(agree * 1000 >= smooth * 998, "{agree} of {smooth}");
}
