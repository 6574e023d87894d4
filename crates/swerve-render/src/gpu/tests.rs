use std::sync::Arc;

use swerve_geom::{Ego, Map, Point, Transform};

use crate::gpu::{AdapterKind, Gpu};
use crate::town::town;
use crate::*;

type Pose = Transform<Map, swerve_geom::Camera>;

/// A device that tests share: of a graphics processor, else of software. `None` where there is neither, which
/// must not be so where `SWERVE_CI` is set.
fn device() -> Option<Arc<Gpu>> {
    let tried = Gpu::shared(AdapterKind::Gpu).or_else(|_| Gpu::shared(AdapterKind::Software));
    given(tried)
}

fn given<T>(tried: Result<T, gpu::NoAdapter>) -> Option<T> {
    match tried {
        Ok(gpu) => Some(gpu),
        Err(none) => {
            assert!(std::env::var_os("SWERVE_CI").is_none(), "{none}");
            eprintln!("skipped: {none}");
            None
        }
    }
}

fn looking(at: [f64; 3], pitch_rad: f64, yaw_rad: f64) -> Pose {
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    map_from_ego * mount(at, 0.0, pitch_rad, yaw_rad)
}

fn camera(change: impl Fn(&mut CameraSpec)) -> Camera {
    let mut spec = CameraSpec { width_px: 320, height_px: 240, ..CameraSpec::default() };
    change(&mut spec);
    Camera::new(spec).unwrap()
}

fn shot(renderer: &mut Renderer, scene: &Scene, view: &View<'_>) -> Frame {
    let mut frame = Frame::new(view.camera, Outputs::ALL);
    renderer.render(scene, view, frame.as_mut()).unwrap();
    assert_eq!(renderer.fell_back(), None);
    frame
}

/// How much two frames differ: mean of colours, shares of pixels whose class or instance, or depth, differ.
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
    // Where both see the same thing; at outlines they may see what is before or behind.
    let depth = share(&|k| {
        let (a, b) = (a.depth_m[k], b.depth_m[k]);
        same_thing(k) && a.to_bits() != b.to_bits() && !((a - b).abs() <= 0.01 * a)
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
fn images_agree_with_those_of_the_cpu() {
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
    for preset in presets {
        scene.set_weather(preset);
        for (k, pose) in [looking([0.0, -1.9, 1.45], 0.03, 0.0), looking([30.0, 4.0, 2.5], 0.1, 2.2)]
            .into_iter()
            .enumerate()
        {
            let view = View { frame: 7, hidden_instance: Some(3), ..View::new(&camera, pose) };
            let (a, b) = (shot(&mut cpu, &scene, &view), shot(&mut gpu, &scene, &view));
            save(&format!("{preset:?}{k}-cpu.png"), &a);
            save(&format!("{preset:?}{k}-gpu.png"), &b);
            assert_agree(&format!("{preset:?} {k}"), &a, &b);
        }
    }
}
