//! Stereo depth from a rendered camera pair, compared with the rendered depth.

use swerve_vision::stereo::{Stereo, StereoSettings};
use swerve_vision::{Plane, Rgb};

use super::*;

/// Baseline of the cameras.
const BASE_M: f64 = 0.5;

/// Median relative error of stereo depth for pixels between two distances, and their number.
fn median_error(pairs: &[(f32, f32)], [near_m, far_m]: [f32; 2]) -> (f32, usize) {
    let within = pairs.iter().filter(|(truth_m, _)| (near_m..far_m).contains(truth_m));
    let mut errors: Vec<f32> = within.map(|(truth_m, found_m)| (found_m / truth_m - 1.0).abs()).collect();
    errors.sort_by(f32::total_cmp);
    (errors[errors.len() / 2], errors.len())
}

#[test]
fn stereo_finds_the_rendered_depth() {
    let camera = small(|spec| {
        (spec.width_px, spec.height_px) = (800, 600);
        spec.intrinsics = Intrinsics::HorizontalFovRad(70_f64.to_radians());
    });
    let (focal_px, ..) = camera.focal_px();
    assert!((focal_px - 571.0).abs() < 1.0);
    let scene = town(WeatherPreset::ClearNoon, 7, 100.0);
    let mut stereo = Stereo::new(StereoSettings::default()).unwrap();
    let (mut pairs, mut disparities) = (Vec::new(), Plane::default());
    for x_m in [-60.0, -30.0, 0.0, 30.0] {
        // The left camera is farther to the left: +y.
        let shots = [0.5 * BASE_M, -0.5 * BASE_M].map(|left_m| {
            let pose = looking([x_m, -1.9 + left_m, 1.45], 0.0, 0.0);
            shot(&scene, &View::new(&camera, pose))
        });
        let [left, right] = shots.each_ref().map(|frame| {
            let mut gray = Plane::default();
            Rgb::new(800, 600, &frame.rgb).unwrap().gray(&mut gray);
            gray
        });
        stereo.disparities(&left, &right, &mut disparities).unwrap();
        let known = disparities.pixels().iter().zip(&shots[0].depth_m).filter(|(d, _)| **d > 0.0);
        pairs.extend(known.map(|(d, truth_m)| (*truth_m, (focal_px * BASE_M) as f32 / d)));
    }
    for (range_m, most) in [([18.0, 22.0], 0.02), ([36.0, 44.0], 0.04)] {
        let (error, count) = median_error(&pairs, range_m);
        println!("{range_m:?} m: median error {error:.4}, {count} pixels");
        assert!(error <= most && count > 10_000, "{range_m:?} m: {error} of {count} pixels");
    }
}
