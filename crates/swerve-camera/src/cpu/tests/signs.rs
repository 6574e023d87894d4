//! Recognition of rendered signs by `swerve_vision`.

use swerve_vision::Rgb;
use swerve_vision::signs::{Meaning, SignFinder};

use super::*;

/// Numbers of correct and wrong readings of a sign beside a street at four distances from 7 to 16 m.
fn read(kind: Kind, expected: Meaning, weather: WeatherPreset) -> [usize; 2] {
    let camera = Camera::new(CameraSpec {
        width_px: 800,
        height_px: 600,
        intrinsics: Intrinsics::HorizontalFovRad(70.0_f64.to_radians()),
        ..CameraSpec::default()
    })
    .unwrap();
    let (mut finder, mut counts) = (SignFinder::default(), [0; 2]);
    for (seed, away_m) in [(0, 7.0), (1, 10.0), (2, 13.0), (3, 16.0)] {
        let mut scene = town(weather, seed, 40.0);
        let model = scene.meshes.model(kind, seed);
        let yaw = core::f64::consts::PI + 0.2 * (seed as f64 - 1.5);
        scene.dynamics.push(Instance::new(&model, away_m, -2.8, yaw).with_id(9000));
        let frame = shot(&scene, &View::new(&camera, looking([0.0, -1.0, 1.4], 0.0, 0.0)));
        let mut found = Vec::new();
        finder.find(Rgb::new(800, 600, &frame.rgb).unwrap(), &mut found);
        for sign in found {
            let [x, y, width, height] = sign.bbox;
            let middle = (y + 0.5 * height) as usize * 800 + (x + 0.5 * width) as usize;
            if frame.instance[middle] == 9000 {
                counts[usize::from(sign.meaning != expected)] += 1;
            }
        }
    }
    counts
}

#[test]
fn sign_finder_reads_rendered_signs() {
    let speeds = [30, 50, 80].map(|kmh| (Kind::SpeedSign { kmh }, Meaning::SpeedLimit(kmh)));
    for (kind, meaning) in speeds.into_iter().chain([(Kind::StopSign, Meaning::Stop)]) {
        for weather in [WeatherPreset::ClearNoon, WeatherPreset::SoftRainSunset] {
            let [right, wrong] = read(kind, meaning, weather);
            println!("{meaning:?} {weather:?}: {right} right, {wrong} wrong");
            assert!(
                right >= 3 && wrong == 0,
                "{meaning:?} in {weather:?}: {right} right, {wrong} wrong of 4"
            );
        }
    }
}
