//! Renders every kind of shape in rows: `cargo run --release -p swerve-camera --example kinds -- out.png
//! [weather]`.

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;

use swerve_camera::{
    Camera, CameraSpec, Frame, Intrinsics, Outputs, RenderOptions, Renderer, Shutter, View, mount,
};
use swerve_geom::{Ego, Map, Point, Point2, Transform};
use swerve_scene::{
    Instance, Kind, RoadLayout, Scene, SemanticClass, SideOfRoad, WeatherPreset, lamps, road_pieces,
};

/// Kinds, nearest row first, each row from the left.
const ROWS: [&[Kind]; 4] = [
    &[
        Kind::Pedestrian { phase: 0 },
        Kind::Pedestrian { phase: 4 },
        Kind::Pedestrian { phase: 10 },
        Kind::Standing,
        Kind::Cyclist { phase: 2 },
        Kind::Motorcycle,
        Kind::Bin,
        Kind::StopSign,
        Kind::YieldSign,
        Kind::SpeedSign { kmh: 30 },
        Kind::SpeedSign { kmh: 80 },
        Kind::TrafficLight,
        Kind::Pole,
    ],
    &[Kind::Sedan, Kind::Hatchback, Kind::Suv, Kind::Sedan, Kind::Hatchback],
    &[Kind::Van, Kind::BoxTruck, Kind::Bus, Kind::GuardRail, Kind::Block, Kind::Bush],
    &[Kind::Tree, Kind::StreetLamp, Kind::Building, Kind::Tree, Kind::Building],
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().unwrap_or_else(|| "kinds.png".to_owned());
    let weather: WeatherPreset = arguments.next().unwrap_or_else(|| "clear_noon".to_owned()).parse()?;
    let mut scene = Scene::new(weather);
    let verge = SideOfRoad::Verge;
    let square = RoadLayout {
        lines: Vec::new(),
        left_side: verge,
        right_side: verge,
        ..RoadLayout::street(vec![Point2::new(-5.0, 0.0), Point2::new(80.0, 0.0)], 30.0, 30.0)
    };
    road_pieces(&square, 1).into_iter().for_each(|piece| scene.add_piece(piece));
    let mut id = 0;
    for (kinds, (x, spread, yaw)) in
        ROWS.iter().zip([(8.5, 10.5, 2.6), (15.0, 18.0, 2.5), (26.0, 34.0, 3.8), (50.0, 60.0, 3.1)])
    {
        for (k, kind) in kinds.iter().enumerate() {
            id += 1;
            let y = spread * (0.5 - (k as f64 + 0.5) / kinds.len() as f64);
            let model = scene.meshes.model(*kind, u64::from(id));
            let faces_us = kind.class() == SemanticClass::TrafficSign || *kind == Kind::TrafficLight;
            let yaw =
                if faces_us { 3.1 } else { yaw + 0.4 * (k as f64 - 2.0) * f64::from(x > 10.0 && x < 20.0) };
            let mut instance = Instance::new(&model, x, y, yaw).with_id(id);
            instance.look = instance.look.with_lamp(lamps::GREEN, *kind == Kind::TrafficLight);
            scene.dynamics.push(instance);
        }
    }
    let camera = Camera::new(CameraSpec {
        width_px: 1400,
        height_px: 700,
        intrinsics: Intrinsics::HorizontalFovRad(1.15),
        shutter: Shutter { blur_samples: 8, ..Shutter::default() },
        ..CameraSpec::default()
    })?;
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    let view = View::new(&camera, map_from_ego * mount([0.0, 0.0, 3.2], 0.0, 0.14, 0.0));
    let mut renderer = Renderer::new(RenderOptions { threads: 2, ..RenderOptions::default() })?;
    let mut frame = Frame::new(&camera, Outputs::RGB);
    renderer.render(&scene, &view, frame.as_mut())?;
    let (width, height) = (camera.width_px() as u32, camera.height_px() as u32);
    let mut encoder = png::Encoder::new(BufWriter::new(File::create(file)?), width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&frame.rgb)?;
    Ok(())
}
