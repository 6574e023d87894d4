//! Allocation counts of a pass.

use crate::{Camera, CameraSpec, Distortion, Frame, Outputs, RenderOptions, Renderer, Shutter, View, mount};
use swerve_geom::{Ego, Map, Point, Transform};
use swerve_scene::WeatherPreset;
use swerve_scene::town::town;

#[test]
fn passes_into_used_memory_allocate_nothing() {
    let scene = town(WeatherPreset::WetNoon, 1, 60.0);
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    let pose = map_from_ego * mount([0.0, -1.9, 1.45], 0.0, 0.03, 0.0);
    let size = CameraSpec { width_px: 320, height_px: 240, ..CameraSpec::default() };
    let cameras = [
        size,
        CameraSpec { distortion: Distortion { k1: -0.05, ..Distortion::default() }, ..size },
        CameraSpec { shutter: Shutter { blur_samples: 2, ..Shutter::default() }, ..size },
    ]
    .map(|spec| Camera::new(spec).expect("the camera is fine"));
    let mut renderer = Renderer::new(RenderOptions::default()).expect("no threads are needed");
    let mut frame = Frame::new(&cameras[0], Outputs::ALL);
    for round in 0..3 {
        for camera in &cameras {
            let rendered = allocation_counter::measure(|| {
                let view = View::new(camera, pose);
                renderer.render(&scene, &view, frame.as_mut()).expect("scene and view are fine");
            });
            assert!(round < 2 || rendered.count_total == 0, "{rendered:?}");
        }
    }
}
