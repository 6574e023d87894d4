//! Draws a road given by its course alone: `cargo run --release -p swerve-render --example road -- out.png
//! [weather] [x y height yaw pitch]`.

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;

use swerve_geom::{Ego, Map, Point, Point2, Transform, math};
use swerve_render::{
    Camera, CameraSpec, Frame, Furnishing, Instance, Intrinsics, Kind, Outputs, RenderOptions, Renderer,
    RoadLayout, Scene, Shutter, SideOfRoad, View, WeatherPreset, furnish, ground_pieces, mount, road_pieces,
};

/// 100 m straight on, 60 m to the left, 100 m straight on.
fn course() -> Vec<Point2<Map>> {
    let (mut x, mut y, mut heading) = (-20.0, 0.0, 0.0);
    (0..130)
        .map(|k| {
            let here = Point2::new(x, y);
            heading += if (60..90).contains(&k) { 0.02 } else { 0.0 };
            let (sin, cos) = math::sin_cos(heading);
            (x, y) = (x + 2.0 * cos, y + 2.0 * sin);
            here
        })
        .collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().unwrap_or_else(|| "road.png".to_owned());
    let weather: WeatherPreset = arguments.next().unwrap_or_else(|| "clear_noon".to_owned()).parse()?;
    let place: Vec<f64> = arguments.map(|a| a.parse()).collect::<Result<_, _>>()?;
    let [x, y, height, yaw, pitch] = place[..] else {
        return draw(&file, weather, [40.0, 0.0, 1.5, 0.1, 0.02]);
    };
    draw(&file, weather, [x, y, height, yaw, pitch])
}

fn draw(
    file: &str,
    weather: WeatherPreset,
    [x, y, height, yaw, pitch]: [f64; 5],
) -> Result<(), Box<dyn Error>> {
    let mut scene = Scene::new(weather);
    let layout = RoadLayout { right_side: SideOfRoad::Verge, ..RoadLayout::street(course(), 6.0, 2.0) };
    road_pieces(&layout, 1).into_iter().for_each(|piece| scene.add_piece(piece));
    let ground = ground_pieces(Point2::new(-300.0, -300.0), Point2::new(500.0, 400.0), -0.06);
    ground.into_iter().for_each(|piece| scene.add_piece(piece));
    let truck = scene.meshes.model(Kind::BoxTruck, 3);
    scene.dynamics.push(Instance::new(&truck, 62.0, -0.6, 0.0).with_id(1));
    let free = |at: Point2<Map>, radius: f64| math::hypot(at.x_m - 62.0, at.y_m) > radius + 6.0;
    furnish(&mut scene, &layout, &Furnishing { seed: 1, ..Furnishing::default() }, &free);
    let camera = Camera::new(CameraSpec {
        width_px: 1200,
        height_px: 750,
        intrinsics: Intrinsics::HorizontalFovRad(1.2),
        shutter: Shutter { blur_samples: 8, ..Shutter::default() },
        ..CameraSpec::default()
    })?;
    let map_from_ego: Transform<Map, Ego> = Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
    let view = View::new(&camera, map_from_ego * mount([x, y, height], 0.0, pitch, yaw));
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
