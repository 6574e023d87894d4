use swerve_geom::{Ego, Map, Point, Transform};

use swerve_scene::hash::{Draws, Key};
use swerve_scene::town::town;
use swerve_scene::{
    Instance, Kind, Look, Material, Mesh, MeshId, MeshParts, Motion, Scene, SemanticClass, Size,
    WeatherPreset, lamps,
};

use crate::*;

mod geometry;
mod light;
mod pair;
mod signs;

type Pose = Transform<Map, swerve_geom::Camera>;

/// Camera pose at a position, looking along +x, pitched down.
fn looking(at: [f64; 3], pitch_rad: f64, yaw_rad: f64) -> Pose {
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    map_from_ego * mount(at, 0.0, pitch_rad, yaw_rad)
}

fn small(change: impl Fn(&mut CameraSpec)) -> Camera {
    let mut spec = CameraSpec { width_px: 160, height_px: 120, ..CameraSpec::default() };
    change(&mut spec);
    Camera::new(spec).unwrap()
}

fn renderer(threads: usize) -> Renderer {
    Renderer::new(RenderOptions { threads, ..RenderOptions::default() }).unwrap()
}

fn shot(scene: &Scene, view: &View<'_>) -> Frame {
    let mut frame = Frame::new(view.camera, Outputs::ALL);
    renderer(1).render(scene, view, frame.as_mut()).unwrap();
    frame
}

fn flat(size_m: f32) -> Mesh {
    Mesh::new(flat_parts(size_m)).unwrap()
}

fn flat_parts(size_m: f32) -> MeshParts {
    MeshParts {
        positions: vec![
            [-size_m, -size_m, 0.0],
            [size_m, -size_m, 0.0],
            [size_m, size_m, 0.0],
            [-size_m, size_m, 0.0],
        ],
        normals: vec![[0.0, 0.0, 1.0]; 4],
        uvs: vec![[0.0; 2]; 4],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        triangle_materials: vec![0; 2],
        materials: vec![Material::default()],
    }
}

fn instance(mesh: MeshId, at: [f64; 3], yaw_rad: f64, class: SemanticClass) -> Instance {
    let map_from_body = Transform::from_roll_pitch_yaw(Point::new(at[0], at[1], at[2]), 0.0, 0.0, yaw_rad);
    Instance { mesh, map_from_body, instance_id: 0, class, look: Look::default(), motion: Motion::default() }
}

#[test]
fn image_is_independent_of_the_thread_count() {
    let scene = town(WeatherPreset::WetNoon, 3, 60.0);
    let camera = small(|s| {
        s.noise = SensorNoise::TYPICAL;
        s.shutter = Shutter { exposure_s: 0.02, blur_samples: 2, readout_s: 0.03, readout_slabs: 3 };
    });
    let view = View::new(&camera, looking([0.0, -1.9, 1.4], 0.05, 0.0));
    let expected = shot(&scene, &view);
    for threads in [2, 3] {
        let mut frame = Frame::new(&camera, Outputs::ALL);
        renderer(threads).render(&scene, &view, frame.as_mut()).unwrap();
        assert!(frame == expected, "{threads} threads");
    }
}

#[test]
fn image_is_independent_of_earlier_passes() {
    let mut renderer = renderer(1);
    let camera = small(|_| {});
    let noon = town(WeatherPreset::ClearNoon, 3, 60.0);
    let mut other = town(WeatherPreset::ClearSunset, 4, 40.0);
    let pose = |x: f64| looking([x, -1.9, 1.4], 0.05, 0.0);
    let mut frame = Frame::new(&camera, Outputs::ALL);
    let mut pass = |scene: &Scene, x: f64| {
        renderer.render(scene, &View::new(&camera, pose(x)), frame.as_mut()).unwrap();
        frame.clone()
    };
    let first = pass(&noon, 0.0);
    for x in [100.0, -60.0, 0.0] {
        pass(&other, x);
        other.dynamics.iter_mut().for_each(|i| i.look.lamps ^= 4);
    }
    let mut moved = noon.clone();
    for thing in &mut moved.dynamics {
        let step = Transform::<Map, Map>::from_roll_pitch_yaw(Point::new(1.0, 0.5, 0.0), 0.0, 0.0, 0.0);
        thing.map_from_body = step * thing.map_from_body;
    }
    assert!(pass(&moved, 0.0) != first);
    assert!(pass(&noon, 0.0) == first);
}

fn digest(frame: &Frame) -> u64 {
    let mut key = Key::default();
    frame.rgb.iter().chain(&frame.semantic).for_each(|byte| key.word(u32::from(*byte)));
    frame.depth_m.iter().for_each(|depth| key.number(*depth));
    frame.instance.iter().for_each(|id| key.word(*id));
    key.0
}

/// Changes only on purpose: with shapes, textures or shading, after visual inspection of the images.
const GOLDEN: [(WeatherPreset, u64); 3] = [
    (WeatherPreset::ClearNoon, 48_576_911_804_073_683),
    (WeatherPreset::HardRainSunset, 16_421_500_597_745_274_222),
    (WeatherPreset::ClearNight, 6_797_866_638_597_694_767),
];

#[test]
fn images_have_the_same_digest_on_every_machine() {
    let camera = small(|s| {
        (s.width_px, s.height_px) = (96, 64);
        s.noise = SensorNoise::TYPICAL;
        s.vignetting = 0.5;
    });
    let digests = GOLDEN.map(|(preset, _)| {
        let scene = town(preset, 1, 60.0);
        (preset, digest(&shot(&scene, &View::new(&camera, looking([0.0, -1.9, 1.4], 0.03, 0.0)))))
    });
    assert_eq!(digests, GOLDEN);
}

#[test]
fn geometry_outputs_match_those_of_a_full_pass() {
    let scene = town(WeatherPreset::ClearNoon, 2, 60.0);
    for distortion in [Distortion::default(), Distortion { k1: -0.05, ..Distortion::default() }] {
        let camera = small(|s| s.distortion = distortion);
        let view = View::new(&camera, looking([0.0, -1.9, 1.4], 0.05, 0.0));
        let full = shot(&scene, &view);
        let mut frame = Frame::new(&camera, Outputs::GEOMETRY);
        renderer(1).render(&scene, &view, frame.as_mut()).unwrap();
        assert!(frame.rgb.is_empty());
        assert!(
            frame.depth_m == full.depth_m
                && frame.semantic == full.semantic
                && frame.instance == full.instance
        );
    }
}

#[test]
fn render_rejects_invalid_scenes_views_and_frames() {
    let camera = small(|_| {});
    let scene = Scene::new(WeatherPreset::ClearNoon);
    let view = View::new(&camera, looking([0.0; 3], 0.0, 0.0));
    let mut renderer = renderer(1);
    let mut short = vec![0_u8; 10];
    let error =
        renderer.render(&scene, &view, FrameMut { semantic: Some(&mut short), ..FrameMut::default() });
    assert_eq!(error.unwrap_err().to_string(), "the semantic image has 10 elements, the camera writes 19200");
    let mut frame = Frame::new(&camera, Outputs::ALL);
    let mut refused = |scene: &Scene, view: &View<'_>| {
        renderer.render(scene, view, frame.as_mut()).unwrap_err().to_string()
    };
    let mut odd = scene.clone();
    odd.weather.rain = 7.0;
    assert_eq!(refused(&odd, &view), "weather: `rain` is 7, expected 0 to 1");
    let mut odd = scene.clone();
    odd.sun.azimuth_rad = f64::NAN;
    assert_eq!(refused(&odd, &view), "the sun's direction is not finite");
    let nowhere = View::new(&camera, looking([f64::NAN, 0.0, 0.0], 0.0, 0.0));
    assert_eq!(refused(&scene, &nowhere), "the camera's pose is not finite");
    // An empty scene and a frame without images are valid.
    renderer.render(&scene, &view, FrameMut::default()).unwrap();
}

#[test]
fn orthographic_image_is_independent_of_threads_and_slabs() {
    let scene = town(WeatherPreset::ClearNoon, 3, 60.0);
    let map = |s: &mut CameraSpec| s.intrinsics = Intrinsics::OrthographicMPerPx(0.4);
    let (plain, slabs) = (
        small(map),
        small(|s| {
            map(s);
            s.shutter = Shutter { readout_s: 1e-9, readout_slabs: 4, ..Shutter::default() };
        }),
    );
    let pose = looking([20.0, 0.0, 60.0], core::f64::consts::FRAC_PI_2, 0.3);
    let expected = shot(&scene, &View::new(&plain, pose));
    let mut frame = Frame::new(&plain, Outputs::ALL);
    renderer(2).render(&scene, &View::new(&plain, pose), frame.as_mut()).unwrap();
    assert!(frame == expected);
    let sliced = shot(&scene, &View::new(&slabs, pose));
    assert!(sliced.semantic == expected.semantic && sliced.instance == expected.instance);
}
