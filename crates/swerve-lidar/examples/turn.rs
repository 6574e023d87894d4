//! Renders a turn of a lidar in a street: `cargo run --release -p swerve-lidar --example turn -- out.png [lidar]
//! [weather] [colour]`.
//!
//! Top: the points from above, 120 m wide, x to the right. Bottom: the ranges by ring and azimuth, x in the middle.
//! Colours: `height` (default), `intensity`, `ring`, `class`, `instance`.

use std::error::Error;
use std::fs::File;
use std::io::BufWriter;

use swerve_geom::{Lidar, Map, Point, Transform};
use swerve_lidar::{Cloud, Firing, LidarPreset, SceneTree, Sweeper};
use swerve_scene::WeatherPreset;
use swerve_scene::town::town;

const WIDTH: usize = 1200;
const ABOVE: usize = 720;
const RANGES: usize = 256;
const PIXELS_PER_M: f32 = 10.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().unwrap_or_else(|| "lidar.png".to_owned());
    let preset: LidarPreset = arguments.next().unwrap_or_else(|| "os1_64".to_owned()).parse()?;
    let weather: WeatherPreset = arguments.next().unwrap_or_else(|| "clear_noon".to_owned()).parse()?;
    let colours = arguments.next().unwrap_or_else(|| "height".to_owned());
    let tree = SceneTree::new(&town(weather, 1, 200.0))?;
    let spec = preset.spec();
    let rings = spec.beams.len();
    let mut cloud = Cloud::new(&spec, true);
    let mut sweeper = Sweeper::new(spec, 2)?;
    let pose: Transform<Map, Lidar> =
        Transform::from_roll_pitch_yaw(Point::new(0.0, -1.9, 1.9), 0.0, 0.0, 0.0);
    sweeper.begin_turn(0, &mut cloud.as_mut());
    sweeper.fire(&tree, &Firing::turn_at_rest(&sweeper, pose), &mut cloud.as_mut())?;

    let mut picture = vec![16_u8; 3 * WIDTH * (ABOVE + RANGES)];
    let mut paint = |column: usize, row: usize, colour: [u8; 3]| {
        let at = 3 * (row * WIDTH + column);
        picture[at..at + 3].copy_from_slice(&colour);
    };
    for k in 0..cloud.len {
        let [x, y, z] = cloud.point_m(k);
        let colour = match colours.as_str() {
            "intensity" => rainbow(cloud.intensity[k].sqrt()),
            "ring" => rainbow(f32::from(cloud.ring[k]) / rings as f32),
            "class" => id_colour(u32::from(cloud.class[k])),
            "instance" => id_colour(cloud.instance[k]),
            _ => rainbow((z + 2.2) / 9.0),
        };
        let (column, row) = (600.0 + PIXELS_PER_M * x, 360.0 - PIXELS_PER_M * y);
        if column >= 0.0 && row >= 0.0 && (column as usize) < WIDTH && (row as usize) < ABOVE {
            paint(column as usize, row as usize, colour);
        }
        // Backwards is at both edges; left of the middle is left.
        let azimuth = swerve_geom::math::atan2(f64::from(y), f64::from(x));
        let turned = 0.5 - azimuth / core::f64::consts::TAU;
        let column = ((turned * WIDTH as f64) as usize).min(WIDTH - 1);
        let band = RANGES / rings;
        let top = ABOVE + (rings - 1 - usize::from(cloud.ring[k])) * band;
        let range = (x * x + y * y + z * z).sqrt();
        let colour = if colours == "height" { rainbow((range / 60.0).sqrt()) } else { colour };
        (top..top + band).for_each(|row| paint(column, row, colour));
    }
    let mut encoder =
        png::Encoder::new(BufWriter::new(File::create(file)?), WIDTH as u32, (ABOVE + RANGES) as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header()?.write_image_data(&picture)?;
    Ok(())
}

/// Colour map from blue over green to red.
fn rainbow(share: f32) -> [u8; 3] {
    let share = share.clamp(0.0, 1.0);
    let part = |middle: f32| (255.0 * (1.6 - 4.0 * (share - middle).abs()).clamp(0.1, 1.0)) as u8;
    [part(0.8), part(0.5), part(0.2)]
}

/// Colour of an id; neighbouring ids have different colours; grey for id 0.
fn id_colour(id: u32) -> [u8; 3] {
    if id == 0 {
        return [90; 3];
    }
    let mixed = id.wrapping_mul(0x9e37_79b1);
    [(mixed >> 24) as u8 | 63, (mixed >> 16) as u8 | 63, (mixed >> 8) as u8 | 63]
}
