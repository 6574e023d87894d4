//! Renders a street: `cargo run --release -p swerve-camera --example town -- out.png [weather] [view]`.
//!
//! Views: `street` (default), `above`, `corner`, `people`, `semantic`, `depth`.

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;

use swerve_camera::{
    Camera, CameraSpec, Frame, Intrinsics, Outputs, RenderOptions, Renderer, SensorNoise, Shutter, View,
    mount,
};
use swerve_geom::{Ego, Map, Point, Transform};
use swerve_scene::town::town;
use swerve_scene::{Light, WeatherPreset};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().unwrap_or_else(|| "town.png".to_owned());
    let weather: WeatherPreset = arguments.next().unwrap_or_else(|| "clear_noon".to_owned()).parse()?;
    let view = arguments.next().unwrap_or_else(|| "street".to_owned());
    let mut scene = town(weather, 1, 200.0);
    let camera = Camera::new(CameraSpec {
        width_px: 1200,
        height_px: 750,
        intrinsics: Intrinsics::HorizontalFovRad(1.2),
        vignetting: 0.4,
        noise: SensorNoise::TYPICAL,
        shutter: Shutter { blur_samples: 8, exposure_s: 0.004, ..Shutter::default() },
        ..CameraSpec::default()
    })?;
    let (at, yaw_rad, pitch_rad) = match view.as_str() {
        "above" => ([-25.0, -12.0, 26.0], 0.30, 0.50),
        "corner" => ([22.0, -8.4, 1.8], 0.45, 0.02),
        "people" => ([2.0, 5.2, 1.6], 0.15, 0.03),
        "cars" => ([8.5, 1.5, 1.5], -0.42, 0.12),
        _ => ([0.0, -1.9, 1.45], 0.0, 0.03),
    };
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    let map_from_camera = map_from_ego * mount(at, 0.0, pitch_rad, yaw_rad);
    // Head lamps of the car that carries the camera.
    let map_from_body = Transform::from_roll_pitch_yaw(Point::new(0.0, -1.9, 0.0), 0.0, 0.0, 0.0);
    scene.lights.extend(Light::head_lamps(&map_from_body, 1.0, 0.7));
    let mut renderer = Renderer::new(RenderOptions { threads: 2, ..RenderOptions::default() })?;
    let mut frame = Frame::new(&camera, Outputs::ALL);
    renderer.render(&scene, &View::new(&camera, map_from_camera), frame.as_mut())?;
    let picture: Vec<u8> = match view.as_str() {
        "semantic" => frame.semantic.iter().flat_map(|id| colour(u32::from(*id))).collect(),
        "depth" => frame.depth_m.iter().flat_map(|d| [(2000.0 / (8.0 + d)) as u8; 3]).collect(),
        _ => frame.rgb,
    };
    let mut encoder = png::Encoder::new(
        BufWriter::new(File::create(file)?),
        camera.width_px() as u32,
        camera.height_px() as u32,
    );
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&picture)?;
    Ok(())
}

/// Colour of an id; neighbouring ids have different colours.
fn colour(id: u32) -> [u8; 3] {
    let mixed = id.wrapping_mul(0x9e37_79b1);
    [(mixed >> 24) as u8 | 31, (mixed >> 16) as u8 | 31, (mixed >> 8) as u8 | 31]
}
