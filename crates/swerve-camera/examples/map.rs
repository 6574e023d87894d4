//! Renders a road network: `cargo run --release -p swerve-camera --example map -- FILE out.png [POSE] [weather]`.
//!
//! The file is OpenDRIVE, SUMO, Lanelet2 or CommonRoad. `POSE` is `x,y,yaw` of the camera, metres and degrees in the frame
//! of the map, or `x,y,yaw,height,pitch`; without one, the camera is in the middle of the first lane for driving.

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;

use swerve_camera::{Camera, CameraSpec, Frame, Intrinsics, Outputs, RenderOptions, Renderer, View, mount};
use swerve_geom::{Ego, Point, Transform};
use swerve_map::{LaneKind, Map};
use swerve_map_io::commonroad::Centers;
use swerve_map_io::format::Format;
use swerve_map_io::{commonroad, import, lanelet2, links, opendrive, sumo};
use swerve_scene::{Instance, Kind, Scene, WeatherPreset, add_map, signal_masts};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), Some(out)) = (arguments.next(), arguments.next()) else {
        return Err("usage: map FILE out.png [x,y,yaw[,height,pitch]] [weather]".into());
    };
    let map = read(&file)?;
    let pose = match arguments.next() {
        Some(text) => text.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?,
        None => on_first_lane(&map).ok_or("the map has no lane for driving")?,
    };
    let [x, y, yaw, height, pitch] = match pose[..] {
        [x, y, yaw] => [x, y, yaw, 1.45, 2.0],
        [x, y, yaw, height, pitch] => [x, y, yaw, height, pitch],
        _ => return Err("expected x,y,yaw or x,y,yaw,height,pitch".into()),
    };
    let weather: WeatherPreset = arguments.next().unwrap_or_else(|| "clear_noon".to_owned()).parse()?;
    let scene = scene(&map, weather);
    let camera = Camera::new(CameraSpec {
        width_px: 640,
        height_px: 360,
        intrinsics: Intrinsics::HorizontalFovRad(1.2),
        ..CameraSpec::default()
    })?;
    let map_from_ego: Transform<swerve_geom::Map, Ego> =
        Transform::from_roll_pitch_yaw(Point::new(x, y, 0.0), 0.0, 0.0, yaw.to_radians());
    let map_from_camera = map_from_ego * mount([0.0, 0.0, height], 0.0, pitch.to_radians(), 0.0);
    let mut renderer = Renderer::new(RenderOptions { threads: 2, ..RenderOptions::default() })?;
    let mut frame = Frame::new(&camera, Outputs::RGB);
    renderer.render(&scene, &View::new(&camera, map_from_camera), frame.as_mut())?;
    let file = BufWriter::new(File::create(out)?);
    let mut encoder = png::Encoder::new(file, camera.width_px() as u32, camera.height_px() as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&frame.rgb)?;
    Ok(())
}

fn read(file: &str) -> Result<Map, Box<dyn Error>> {
    let text = std::fs::read_to_string(file)?;
    Ok(match Format::of(file, &text)? {
        Format::OpenDrive => {
            let network = opendrive::Network::read(file, &text).map_err(|problems| problems.to_string())?;
            import::import(&network, &links::Links::of(&network))?.map
        }
        Format::Lanelet2 => lanelet2::read(file, &text).map_err(|problems| problems.to_string())?.lanes.map,
        Format::Sumo => sumo::read(file, &text).map_err(|problems| problems.to_string())?.lanes.map,
        Format::CommonRoad => {
            let roads = commonroad::read(file, &text, Centers::Rounded);
            roads.map_err(|problems| problems.to_string())?.lanes.map
        }
    })
}

/// The map with its traffic lights.
fn scene(map: &Map, weather: WeatherPreset) -> Scene {
    let mut scene = Scene::new(weather);
    add_map(&mut scene, map, 1);
    let light = scene.meshes.model(Kind::TrafficLight, 1);
    for mast in signal_masts(map) {
        let foot = Point::new(mast.pose.x_m, mast.pose.y_m, mast.height_m);
        let pose = Transform::from_roll_pitch_yaw(foot, 0.0, 0.0, mast.pose.heading_rad);
        scene.add_static(Instance::placed(&light, pose));
    }
    scene
}

/// Pose in the middle of the first lane for driving.
fn on_first_lane(map: &Map) -> Option<Vec<f64>> {
    let lane = map.lanes().iter().find(|lane| lane.kind == LaneKind::Driving)?;
    let pose = lane.line.at(0.5 * lane.line.length()).pose;
    Some(vec![pose.x_m, pose.y_m, pose.heading_rad.to_degrees()])
}
