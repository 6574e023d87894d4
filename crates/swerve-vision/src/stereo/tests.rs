use std::path::Path;

use serde_json::Value;
use swerve_geom::simd::both;
use swerve_tests::data_or_skip;

use super::*;
use crate::samples::Picture;

/// Non-repeating texture, smooth enough for interpolation between pixels.
fn texture(x: f64, y: f64) -> f64 {
    let noise =
        |x: f64, y: f64, key: i64| swerve_core::Rng::keyed(7, "texture", &[key, x as i64, y as i64]).unit();
    [(2.5, 60.0), (7.0, 60.0)].iter().zip(0..).fold(60.0, |sum, (&(size, height), key)| {
        let (u, v) = (x / size + 1000.0, y / size + 1000.0);
        let (fx, fy) = (u - u.floor(), v - v.floor());
        let across = |v: f64| noise(u, v, key) * (1.0 - fx) + noise(u + 1.0, v, key) * fx;
        sum + height * (across(v) * (1.0 - fy) + across(v + 1.0) * fy)
    })
}

/// Image pair of a fronto-parallel plane at this disparity, pixels.
fn wall(disparity: f64) -> [Plane<u8>; 2] {
    const SIZE: (usize, usize) = (160, 60);
    [0.0, disparity].map(|shift| {
        let all = (0..SIZE.0 * SIZE.1)
            .map(|at| texture((at % SIZE.0) as f64 + shift, (at / SIZE.0) as f64).round() as u8);
        Plane::from_pixels(SIZE.0, SIZE.1, all.collect()).unwrap()
    })
}

fn matched(settings: StereoSettings, [left, right]: &[Plane<u8>; 2]) -> Plane<f32> {
    let mut found = Plane::default();
    Stereo::new(settings).unwrap().disparities(left, right, &mut found).unwrap();
    found
}

#[test]
fn distances_to_a_wall() {
    // Focal length 571 px, baseline 0.5 m.
    for (paths, depth_m, most) in [
        (PathCount::Four, 20.0, 0.02),
        (PathCount::Eight, 20.0, 0.02),
        (PathCount::Four, 40.0, 0.04),
        (PathCount::Eight, 40.0, 0.04),
    ] {
        let found =
            matched(StereoSettings { paths, ..StereoSettings::default() }, &wall(571.0 * 0.5 / depth_m));
        let depths = found.pixels().iter().filter(|d| !d.is_nan()).map(|d| 571.0 * 0.5 / f64::from(*d));
        let mut errors: Vec<f64> = depths.map(|depth| (depth / depth_m - 1.0).abs()).collect();
        errors.sort_by(f64::total_cmp);
        let (median, share) = (errors[errors.len() / 2], errors.len() as f64 / found.pixels().len() as f64);
        println!("{depth_m} m, {paths:?}: density {share:.2}");
        println!("floor: stereo, {paths:?} paths, median error at {depth_m} m: {median:.4} <= {most}");
        assert!(median <= most && share > 0.8, "{depth_m} m: {median} of {share}");
    }
}

#[test]
fn disparities_do_not_lock_to_whole_pixels() {
    for tenths in 0..10 {
        let truth = 12.0 + f64::from(tenths) / 10.0;
        let found = matched(StereoSettings::default(), &wall(truth));
        let all: Vec<f64> = found.pixels().iter().filter(|d| !d.is_nan()).map(|d| f64::from(*d)).collect();
        let bias = all.iter().sum::<f64>() / all.len() as f64 - truth;
        println!("{truth:.1} px: bias {bias:.3}");
        assert!(bias.abs() < 0.2, "{truth}: {bias}");
    }
}

#[test]
fn matcher_rejects_mismatched_pairs_and_invalid_settings() {
    let mut stereo = Stereo::new(StereoSettings::default()).unwrap();
    let mut told = |left: (usize, usize), right: (usize, usize)| {
        let (left, right) = (Plane::new(left.0, left.1), Plane::new(right.0, right.1));
        stereo.disparities(&left, &right, &mut Plane::default()).unwrap_err().to_string()
    };
    for size in [(0, 0), (1, 1), (6, 100), (100, 6)] {
        let text = format!("images of {} x {} pixels, expected at least 7 x 7", size.0, size.1);
        assert!(told(size, size).starts_with(&text), "{}", told(size, size));
    }
    assert_eq!(
        told((20, 10), (21, 10)),
        "a left image of (20, 10) pixels and a right one of (21, 10), expected the same size"
    );
    for disparities in [0, 8, 40, 272] {
        let told = Stereo::new(StereoSettings { disparities, ..StereoSettings::default() }).unwrap_err();
        assert_eq!(told, StereoError::Disparities(disparities));
    }
    let share = StereoSettings { uniqueness_percent: 100, ..StereoSettings::default() };
    assert_eq!(Stereo::new(share).unwrap_err(), StereoError::Uniqueness(100));
}

#[test]
fn uniform_images_have_no_disparity() {
    for level in [0, 128, 255] {
        for size in [(7, 7), (40, 30)] {
            let image = Plane::from_pixels(size.0, size.1, vec![level; size.0 * size.1]).unwrap();
            let found = matched(StereoSettings::default(), &[image.clone(), image]);
            assert!(found.pixels().iter().all(|d| d.is_nan()), "{level} {size:?}");
        }
    }
}

#[test]
fn matcher_keeps_no_state_and_allocates_nothing_after_the_first_pair() {
    let [left, right] = wall(14.3);
    for paths in [PathCount::Four, PathCount::Eight] {
        let settings = StereoSettings { paths, ..StereoSettings::default() };
        let mut stereo = Stereo::new(settings.clone()).unwrap();
        let mut found = Plane::default();
        stereo.disparities(&right, &left, &mut found).unwrap();
        let used = allocation_counter::measure(|| stereo.disparities(&left, &right, &mut found).unwrap());
        assert_eq!(used.count_total, 0);
        let bits = |plane: &Plane<f32>| plane.pixels().iter().map(|d| d.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&found), bits(&matched(settings, &[left.clone(), right.clone()])));
    }
}

#[test]
fn disparities_are_bit_identical_with_wide_vectors() {
    for disparities in [64, 80] {
        let settings = StereoSettings { disparities, ..StereoSettings::default() };
        let bits = || {
            let found = matched(settings.clone(), &wall(14.3));
            found.pixels().iter().map(|d| d.to_bits()).collect::<Vec<_>>()
        };
        let [wide, narrow] = both(bits);
        assert_eq!(wide, narrow);
    }
}

/// True disparities, NaN where unknown.
fn truth(folder: &Path, pair: &str) -> Vec<f32> {
    let (file, from) = match pair {
        "motorcycle" => {
            let archive = std::fs::read(folder.join("middlebury_motorcycle/motorcycle_disp.npz")).unwrap();
            // Single member: 30 bytes, the name, the extra field, then the deflated numbers.
            let length = |at: usize| usize::from(u16::from_le_bytes([archive[at], archive[at + 1]]));
            let member = &archive[30 + length(26) + length(28)..];
            let inflated = match miniz_oxide::inflate::decompress_to_vec(member) {
                Ok(numbers) => numbers,
                Err(error) => error.output,
            };
            let from = 10 + usize::from(u16::from_le_bytes([inflated[8], inflated[9]]));
            (inflated, from)
        }
        _ => {
            let file = std::fs::read(folder.join("middlebury_2003").join(pair).join("disp2.pgm")).unwrap();
            let from = file.len() - 450 * 375;
            (file, from)
        }
    };
    let numbers = &file[from..];
    match pair {
        "motorcycle" => numbers
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .map(|d| if d.is_finite() { d } else { f32::NAN })
            .collect(),
        _ => numbers.iter().map(|&d| if d == 0 { f32::NAN } else { f32::from(d) / 4.0 }).collect(),
    }
}

fn images(folder: &Path, pair: &str) -> [Plane<u8>; 2] {
    let names = match pair {
        "motorcycle" => ["left", "right"].map(|side| format!("middlebury_motorcycle/motorcycle_{side}.png")),
        _ => ["2", "6"].map(|side| format!("middlebury_2003/{pair}/im{side}.png")),
    };
    names.map(|name| Picture::read(&folder.join(name)).gray())
}

/// Share of known pixels that have a disparity, and the share of these with an error above 2 pixels.
fn figures(found: &Plane<f32>, truth: &[f32]) -> (f64, f64) {
    let known = truth.iter().filter(|d| !d.is_nan()).count() as f64;
    let errors = found.pixels().iter().zip(truth).map(|(f, t)| (f - t).abs()).filter(|e| !e.is_nan());
    let (told, bad) = errors.fold((0.0, 0.0), |(n, bad), e| (n + 1.0, bad + f64::from(u8::from(e > 2.0))));
    (told / known, bad / told)
}

#[test]
fn real_pairs_are_matched_as_opencv_does() {
    let pairs = ["perception/middlebury_2003", "perception/middlebury_motorcycle"].map(data_or_skip);
    let [Some(_), Some(folder)] = pairs else { return };
    let folder = folder.parent().unwrap();
    let opencv = include_str!("../../../../tests/reference/vision/stereo.json");
    let cases: Value = serde_json::from_str(opencv).unwrap();
    for case in cases.as_array().unwrap() {
        let pair = case["pair"].as_str().unwrap();
        let (images, truth) = (images(folder, pair), truth(folder, pair));
        let disparities = case["disparities"].as_u64().unwrap() as usize;
        let theirs = ["density", "bad_2px"].map(|key| case["3way"][key].as_f64().unwrap());
        for paths in [PathCount::Four, PathCount::Eight] {
            let settings = StereoSettings { disparities, paths, ..StereoSettings::default() };
            let (density, bad) = figures(&matched(settings, &images), &truth);
            println!("{pair} {paths:?}: density {density:.3}; OpenCV's 3WAY {theirs:.4?}");
            let most = theirs[1] + 0.01;
            println!("floor: stereo {pair}, {paths:?} paths, bad by more than 2 px: {bad:.4} <= {most:.4}");
            assert!(density >= theirs[0], "{pair} {paths:?}: {density} of pixels, OpenCV {}", theirs[0]);
            assert!(bad <= most, "{pair} {paths:?}: {bad} bad, OpenCV {}", theirs[1]);
        }
    }
}
