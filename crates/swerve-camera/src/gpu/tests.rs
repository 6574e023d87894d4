use std::sync::Arc;

use swerve_geom::{Ego, Map, Point, Transform};
use swerve_gpu::{AdapterKind, Gpu};
use swerve_scene::town::town;
use swerve_scene::{Motion, Scene, WeatherPreset};

use crate::*;

type Pose = Transform<Map, swerve_geom::Camera>;

/// Device shared by tests: a GPU if available, else a software adapter.
fn device() -> Option<Arc<Gpu>> {
    let tried = Gpu::shared(AdapterKind::Gpu).or_else(|_| Gpu::shared(AdapterKind::Software));
    swerve_tests::or_skip(tried)
}

fn looking(at: [f64; 3], pitch_rad: f64, yaw_rad: f64) -> Pose {
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    map_from_ego * mount(at, 0.0, pitch_rad, yaw_rad)
}

fn camera(change: impl Fn(&mut CameraSpec)) -> Camera {
    let mut spec = CameraSpec { width_px: 240, height_px: 180, ..CameraSpec::default() };
    change(&mut spec);
    Camera::new(spec).unwrap()
}

fn shot(renderer: &mut Renderer, scene: &Scene, view: &View<'_>) -> Frame {
    let mut frame = Frame::new(view.camera, Outputs::ALL);
    renderer.render(scene, view, frame.as_mut()).unwrap();
    assert_eq!(renderer.fell_back(), None);
    frame
}

/// Differences of two frames: mean of colours, shares of pixels with another class or instance, or another depth.
#[derive(Debug)]
struct Difference {
    rgb: f64,
    ids: f64,
    depth: f64,
}

fn difference(a: &Frame, b: &Frame) -> Difference {
    let pixels = a.semantic.len();
    let rgb =
        a.rgb.iter().zip(&b.rgb).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.rgb.len() as f64;
    let share =
        |differs: &dyn Fn(usize) -> bool| (0..pixels).filter(|&k| differs(k)).count() as f64 / pixels as f64;
    let same_thing = |k: usize| a.semantic[k] == b.semantic[k] && a.instance[k] == b.instance[k];
    let ids = share(&|k| !same_thing(k));
    // Only where both see the same object; at outlines they may see the background.
    let depth = share(&|k| {
        let (a, b) = (a.depth_m[k], b.depth_m[k]);
        same_thing(k) && a.to_bits() != b.to_bits() && (a - b).abs() > 0.01 * a
    });
    Difference { rgb, ids, depth }
}

fn assert_agree(what: &str, cpu: &Frame, gpu: &Frame) {
    let found = difference(cpu, gpu);
    eprintln!("{what}: {found:?}");
    assert!(found.rgb <= 2.0 && found.ids <= 0.005 && found.depth <= 0.005, "{what}: {found:?}");
}

fn save(name: &str, frame: &Frame) {
    if let Some(folder) = std::env::var_os("SWERVE_SAVE") {
        let file = std::fs::File::create(std::path::Path::new(&folder).join(name)).unwrap();
        let mut encoder = png::Encoder::new(file, frame.width_px as u32, frame.height_px as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header().unwrap().write_image_data(&frame.rgb).unwrap();
    }
}

#[test]
fn gpu_images_agree_with_cpu_images() {
    let Some(device) = device() else { return };
    let mut gpu = Renderer::on(device, 1).unwrap();
    let mut cpu = Renderer::new(RenderOptions::default()).unwrap();
    let presets = [
        WeatherPreset::ClearNoon,
        WeatherPreset::ClearSunset,
        WeatherPreset::HardRainNoon,
        WeatherPreset::ClearNight,
    ];
    let camera = camera(|s| (s.noise, s.vignetting) = (SensorNoise::TYPICAL, 0.4));
    let mut scene = town(WeatherPreset::ClearNoon, 1, 60.0);
    let poses = [looking([0.0, -1.9, 1.45], 0.03, 0.0), looking([30.0, 4.0, 2.5], 0.1, 2.2)];
    for (k, preset) in presets.into_iter().enumerate() {
        scene.set_weather(preset);
        let view = View { frame: 7, hidden_instance: Some(3), ..View::new(&camera, poses[k % 2]) };
        let (a, b) = (shot(&mut cpu, &scene, &view), shot(&mut gpu, &scene, &view));
        save(&format!("{preset:?}-cpu.png"), &a);
        save(&format!("{preset:?}-gpu.png"), &b);
        assert_agree(&format!("{preset:?}"), &a, &b);
    }
}

#[test]
fn gpu_images_agree_with_lenses_shutters_and_any_size() {
    let Some(device) = device() else { return };
    let mut gpu = Renderer::on(device, 1).unwrap();
    let mut cpu = Renderer::new(RenderOptions::default()).unwrap();
    let lens = Distortion { k1: -0.2, k2: 0.04, p1: 0.001, p2: -0.001, k3: 0.0 };
    let rolling = Shutter { exposure_s: 0.03, blur_samples: 3, readout_s: 0.04, readout_slabs: 5 };
    let narrow = Intrinsics::HorizontalFovRad(0.01);
    let cameras = [
        ("lens", camera(|s| s.distortion = lens)),
        ("shutter", camera(|s| s.shutter = rolling)),
        ("both", camera(|s| (s.distortion, s.shutter) = (lens, rolling))),
        ("odd", camera(|s| (s.width_px, s.height_px) = (103, 57))),
        ("map", camera(|s| s.intrinsics = Intrinsics::OrthographicMPerPx(0.2))),
        ("tiny", camera(|s| (s.width_px, s.height_px, s.intrinsics) = (1, 1, narrow))),
    ];
    let scene = town(WeatherPreset::WetNoon, 3, 40.0);
    for (what, camera) in &cameras {
        let down = looking([15.0, -1.9, 30.0], core::f64::consts::FRAC_PI_2, 0.1);
        let pose = if camera.is_orthographic() { down } else { looking([5.0, -1.9, 1.4], 0.05, 0.1) };
        let mut view = View::new(camera, pose);
        view.motion = Motion { linear_mps: [9.0, 0.0, 0.0], angular_radps: [0.0, 0.0, 0.4] };
        let (a, b) = (shot(&mut cpu, &scene, &view), shot(&mut gpu, &scene, &view));
        save(&format!("{what}-cpu.png"), &a);
        save(&format!("{what}-gpu.png"), &b);
        assert_agree(what, &a, &b);
    }
}

#[test]
fn batches_and_submissions_match_single_frames() {
    let Some(device) = device() else { return };
    let scene = town(WeatherPreset::ClearSunset, 2, 40.0);
    let wide = camera(|s| (s.width_px, s.height_px) = (160, 90));
    let blurred = camera(|s| s.shutter.blur_samples = 2);
    let blurred = Camera::new(CameraSpec { width_px: 100, height_px: 75, ..*blurred.spec() }).unwrap();
    // The last is in another cell of the shadow maps.
    let views: Vec<View<'_>> = [0.0, 1.0, 2.0, 30.0]
        .into_iter()
        .zip([&wide, &blurred, &wide, &wide])
        .map(|(x, camera)| View::new(camera, looking([x, -1.9, 1.4], 0.05, 0.3 * x)))
        .collect();
    let mut renderer = Renderer::on(device.clone(), 2).unwrap();
    let single: Vec<Frame> = views.iter().map(|view| shot(&mut renderer, &scene, view)).collect();
    let empty = || -> Vec<Frame> { views.iter().map(|view| Frame::new(view.camera, Outputs::ALL)).collect() };
    fn outs(frames: &mut [Frame]) -> Vec<FrameMut<'_>> {
        frames.iter_mut().map(Frame::as_mut).collect()
    }
    let mut batch = empty();
    renderer.render_batch(&scene, &views, &mut outs(&mut batch)).unwrap();
    assert!(batch == single);
    // Two in flight at once; another renderer on the same device is independent.
    fn of<'a>(views: &[View<'a>], outputs: Outputs) -> Vec<(View<'a>, Outputs)> {
        views.iter().map(|view| (*view, outputs)).collect()
    }
    let first = renderer.submit(&scene, &of(&views, Outputs::ALL)).unwrap();
    let second = renderer.submit(&scene, &of(&views[2..], Outputs::GEOMETRY)).unwrap();
    let mut other = Renderer::on(device, 1).unwrap();
    assert!(shot(&mut other, &scene, &views[0]) == single[0]);
    let mut frames = empty();
    renderer.collect(first, &mut outs(&mut frames)).unwrap();
    assert!(frames == single);
    let mut frames: Vec<Frame> =
        views[2..].iter().map(|view| Frame::new(view.camera, Outputs::GEOMETRY)).collect();
    renderer.collect(second, &mut outs(&mut frames)).unwrap();
    for (frame, full) in frames.iter().zip(&single[2..]) {
        assert!(frame.depth_m == full.depth_m && frame.instance == full.instance);
        assert!(frame.semantic == full.semantic && frame.rgb.is_empty());
    }
    let third = renderer.submit(&scene, &of(&views[2..], Outputs::GEOMETRY)).unwrap();
    let mut frames = empty().split_off(2);
    let error = renderer.collect(third, &mut outs(&mut frames)).unwrap_err();
    assert_eq!(error, RenderError::NotSubmitted { image: "rgb" });
    let error = renderer.render_batch(&scene, &views, &mut []).unwrap_err();
    assert_eq!(error.to_string(), "4 views, but 0 frames");
}

#[test]
fn gpu_images_are_independent_of_earlier_passes() {
    let Some(device) = device() else { return };
    let camera = camera(|s| (s.width_px, s.height_px) = (160, 120));
    let noon = town(WeatherPreset::ClearNoon, 3, 60.0);
    let mut other = town(WeatherPreset::ClearNight, 4, 40.0);
    let mut renderer = Renderer::on(device, 1).unwrap();
    let mut pass = |scene: &Scene, x: f64| {
        shot(&mut renderer, scene, &View::new(&camera, looking([x, -1.9, 1.4], 0.05, 0.0)))
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

#[test]
fn renderer_falls_back_to_the_cpu_in_the_same_frame() {
    let Some(device) =
        swerve_tests::or_skip(Gpu::fresh(AdapterKind::Software).or_else(|_| Gpu::fresh(AdapterKind::Gpu)))
    else {
        return;
    };
    let scene = town(WeatherPreset::ClearNoon, 1, 30.0);
    let camera = camera(|s| (s.width_px, s.height_px) = (96, 64));
    let view = View::new(&camera, looking([0.0, -1.9, 1.4], 0.05, 0.0));
    let expected = shot(&mut Renderer::new(RenderOptions::default()).unwrap(), &scene, &view);
    let mut renderer = Renderer::on(device.clone(), 1).unwrap();
    assert!(!renderer.backend().is_portable() && renderer.adapter().is_some());
    shot(&mut renderer, &scene, &view);
    let pending = renderer.submit(&scene, &[(view, Outputs::ALL)]).unwrap();
    device.device().destroy();
    let mut frame = Frame::new(&camera, Outputs::ALL);
    let lost = renderer.collect(pending, &mut [frame.as_mut()]);
    if let Err(error) = lost {
        assert!(error.to_string().starts_with("the adapter failed: "), "{error}");
    }
    renderer.render(&scene, &view, frame.as_mut()).unwrap();
    assert!(frame == expected);
    assert_eq!((renderer.backend(), renderer.adapter()), (Backend::Cpu, None));
    let reason = renderer.fell_back().unwrap();
    assert!(reason.contains("lost") || reason.contains("destroyed"), "{reason}");
    let pending = renderer.submit(&scene, &[(view, Outputs::ALL)]).unwrap();
    let mut again = Frame::new(&camera, Outputs::ALL);
    renderer.collect(pending, &mut [again.as_mut()]).unwrap();
    assert!(again == expected);
}

/// Moving instances are drawn into persistent maps, of which only their old rectangles are erased.
#[test]
fn shadows_of_moved_instances_are_erased() {
    let Some(device) = device() else { return };
    let camera = camera(|_| ());
    let pose = looking([0.0, -1.9, 1.45], 0.03, 0.0);
    let mut scene = town(WeatherPreset::ClearNoon, 1, 60.0);
    let mut kept = Renderer::on(device.clone(), 1).unwrap();
    let start = scene.dynamics.clone();
    for step in 0..4 {
        scene.dynamics.clone_from(&start);
        for instance in &mut scene.dynamics {
            let [x, y, z] = instance.motion.linear_mps.map(|v| 0.4 * v * f64::from(step));
            let on: Transform<Map, Map> = Transform::from_roll_pitch_yaw(Point::new(x, y, z), 0.0, 0.0, 0.0);
            instance.map_from_body = on * instance.map_from_body;
        }
        match step {
            2 => scene.dynamics.truncate(start.len() / 2),
            3 => scene.dynamics.clear(),
            _ => {}
        }
        let view = View::new(&camera, pose);
        let fresh = shot(&mut Renderer::on(device.clone(), 1).unwrap(), &scene, &view);
        assert!(shot(&mut kept, &scene, &view) == fresh, "step {step}");
    }
    scene.dynamics.clone_from(&start);
    let view = View::new(&camera, pose);
    let fresh = shot(&mut Renderer::on(device, 1).unwrap(), &scene, &view);
    assert!(shot(&mut kept, &scene, &view) == fresh, "all are there again");
}
