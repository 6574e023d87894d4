//! Lane detection in rendered streets, compared with the true positions of the paint.

use swerve_camera::{Camera, CameraSpec, Frame, Intrinsics, Outputs, RenderOptions, Renderer, View, mount};
use swerve_core::Rng;
use swerve_geom::{Map, Point, Point2, Transform, math};
use swerve_scene::{RoadLayout, Scene, WeatherPreset, ground_pieces, road_pieces};

use super::{LaneFinder, LaneLine, LaneSettings, Method, RoadCamera};
use crate::Rgb;

const FOV_RAD: f64 = 1.2217;
/// Camera position on the ego, metres, and its downward pitch, radians.
const AT_M: [f64; 3] = [1.6, 0.0, 1.35];
const DOWN_RAD: f64 = 0.03;
/// Distance ahead of the ego's origin at which lines are compared, metres.
const AHEAD_M: f64 = 20.0;
/// Width of the lanes, metres; the middle line is broken, the right one is solid.
const LANE_M: f64 = 3.5;
/// Standard deviation of the pitch, radians: half a degree.
const PITCH_RAD: f64 = 0.008727;

/// Street from the origin along +x with this curvature to the left, 1/m.
fn street(weather: WeatherPreset, bend_1pm: f64) -> Scene {
    let at = |k: i32| {
        let s = 2.0 * f64::from(k);
        let angle = s * bend_1pm;
        let (x, y) = match bend_1pm {
            0.0 => (s, 0.0),
            _ => (math::sin(angle) / bend_1pm, (1.0 - math::cos(angle)) / bend_1pm),
        };
        Point2::new(x, y)
    };
    let side_m = (LANE_M + 0.25) as f32;
    let layout = RoadLayout::street((-5..75).map(at).collect(), side_m, side_m);
    let mut scene = Scene::new(weather);
    let ground = ground_pieces(Point2::new(-100.0, -200.0), Point2::new(300.0, 200.0), -0.06);
    ground.into_iter().chain(road_pieces(&layout, 1)).for_each(|piece| scene.add_piece(piece));
    scene
}

/// Lateral position, metres to the ego's left and `AHEAD_M` ahead, of a line `offset_m` to the left of the street's
/// centre, for an ego that is `d_m` to the left of the centre and turned left by `turn_rad`.
fn truth_m(bend_1pm: f64, offset_m: f64, d_m: f64, turn_rad: f64) -> f64 {
    let (sin, cos) = math::sin_cos(turn_rad);
    // Along a lateral line AHEAD_M ahead of the ego, until the distance from the street's centre is the line's offset.
    let off = |y_m: f64| {
        let (x, y) = (AHEAD_M * cos - y_m * sin, d_m + AHEAD_M * sin + y_m * cos);
        let middle_m = match bend_1pm {
            0.0 => y,
            _ => 1.0 / bend_1pm - math::hypot(x, 1.0 / bend_1pm - y) * bend_1pm.signum(),
        };
        middle_m - offset_m
    };
    let (mut low, mut high) = (-15.0, 15.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if off(middle) > 0.0 { high = middle } else { low = middle }
    }
    low
}

/// Errors of detected lines, in metres and in standard deviations, and the number of frames.
#[derive(Default)]
struct Errors {
    frames: usize,
    errors_m: Vec<f64>,
    normal: Vec<f64>,
}

impl Errors {
    fn take(&mut self, line: Option<LaneLine>, truth_m: f64) {
        self.frames += 1;
        if let Some((y_m, deviation_m)) = line.and_then(|line| line.at(AHEAD_M)) {
            self.errors_m.push(y_m - truth_m);
            self.normal.push((y_m - truth_m) / deviation_m);
        }
    }

    /// RMS error in metres and in standard deviations, and the share of frames with a detection.
    fn figures(&self) -> [f64; 3] {
        let root = |all: &[f64]| (all.iter().map(|e| e * e).sum::<f64>() / all.len() as f64).sqrt();
        [root(&self.errors_m), root(&self.normal), self.errors_m.len() as f64 / self.frames as f64]
    }
}

/// Drives along a street with noise in position, heading and pitch.
fn drive(weather: WeatherPreset, bend_1pm: f64, method: Method, frames: i64) -> Errors {
    let scene = street(weather, bend_1pm);
    let intrinsics = Intrinsics::HorizontalFovRad(FOV_RAD);
    let camera = Camera::new(CameraSpec { intrinsics, ..CameraSpec::default() }).unwrap();
    let size_px = [camera.width_px(), camera.height_px()];
    let ego_from_camera = mount(AT_M, 0.0, DOWN_RAD, 0.0);
    let settings = LaneSettings { method, ..LaneSettings::default() };
    let mut finder =
        LaneFinder::new(RoadCamera::pinhole(size_px, FOV_RAD, ego_from_camera), settings).unwrap();
    let mut renderer = Renderer::new(RenderOptions { threads: 1, ..RenderOptions::default() }).unwrap();
    let mut frame = Frame::new(&camera, Outputs::RGB);
    let mut errors = Errors::default();
    for k in 0..frames {
        let mut rng = Rng::keyed(5, "frame", &[k]);
        let (s, d) = (rng.uniform(5.0, 60.0), -0.5 * LANE_M + 0.3 * rng.normal());
        let (turn_rad, pitch_rad) = (0.02 * rng.normal(), PITCH_RAD * rng.normal());
        let along = s * bend_1pm;
        let (sin, cos) = math::sin_cos(along);
        let middle = match bend_1pm {
            0.0 => [s, 0.0],
            _ => [sin / bend_1pm, (1.0 - cos) / bend_1pm],
        };
        let place = Point::new(middle[0] - d * sin, middle[1] + d * cos, 0.0);
        let map_from_ego =
            Transform::<Map, swerve_geom::Ego>::from_roll_pitch_yaw(place, 0.0, 0.0, along + turn_rad);
        let pitched = mount(AT_M, 0.0, DOWN_RAD + pitch_rad, 0.0);
        renderer.render(&scene, &View::new(&camera, map_from_ego * pitched), frame.as_mut()).unwrap();
        let lanes = finder.find(Rgb::new(size_px[0], size_px[1], &frame.rgb).unwrap()).unwrap();
        errors.take(lanes.left, truth_m(bend_1pm, 0.0, d, turn_rad));
        errors.take(lanes.right, truth_m(bend_1pm, -LANE_M, d, turn_rad));
    }
    errors
}

#[test]
fn lines_of_rendered_streets_are_where_their_paint_is() {
    for (weather, bend_1pm) in
        [(WeatherPreset::ClearNoon, 0.0), (WeatherPreset::WetNoon, 0.0), (WeatherPreset::WetNoon, 0.005)]
    {
        for method in Method::ALL {
            let [rmse_m, normal, seen] = drive(weather, bend_1pm, method, 20).figures();
            let what = format!("{weather:?} {bend_1pm} 1/m, {}", method.name());
            println!("{what}: {normal:.2} deviations, seen {seen:.2}");
            println!("floor: lanes, {what}, RMSE in m at {AHEAD_M} m: {rmse_m:.3} <= 0.15");
            assert!(rmse_m <= 0.15, "{what}: {rmse_m} m");
            assert!((0.2..2.0).contains(&normal), "{what}: {normal} of the deviations that are told");
            assert!(seen >= 0.9, "{what}: seen in {seen} of the frames");
        }
    }
}
