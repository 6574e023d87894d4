use swerve_core::Time;
use swerve_msg::{Encoding, Intrinsics};

use super::*;

const SIZE: [u32; 2] = [800, 600];

/// Grey image of 800 x 600 pixels and 70 degrees, from 1.35 m above the ground, with the head of a light at this
/// position ahead and to the left, showing this lamp.
fn image([ahead_m, left_m]: [f64; 2], lamp: Option<Lamp>) -> Image {
    let mut image = Image::new(SIZE[0], SIZE[1], Encoding::Rgb8);
    let (fx_px, quarter) = (571.26, core::f64::consts::FRAC_PI_2);
    image.camera.intrinsics =
        Intrinsics { fx_px, fy_px: fx_px, cx_px: 400.0, cy_px: 300.0, ..Intrinsics::default() };
    image.camera.ego_from_camera =
        Transform::from_roll_pitch_yaw(Point::new(0.0, 0.0, 1.35), -quarter, 0.0, -quarter);
    let Params { head_m: [width_m, height_m], top_m, .. } = Params::default();
    let Pixels::Rgb8(bytes) = &mut image.pixels else { unreachable!() };
    for (k, rgb) in bytes.chunks_exact_mut(3).enumerate() {
        let (x, y) = ((k % 800) as f64 + 0.5, (k / 800) as f64 + 0.5);
        let right_m = (x - 400.0) * ahead_m / fx_px + left_m;
        let down_m = top_m - 1.35 + (y - 300.0) * ahead_m / fx_px;
        let on_head = right_m.abs() < 0.5 * width_m && (0.0..height_m).contains(&down_m);
        let is_lit = lamp.is_some_and(|lamp| {
            let place_m = [0.8, 0.5, 0.2][lamp as usize] * height_m;
            right_m * right_m + (down_m - place_m) * (down_m - place_m) < 0.14 * 0.14
        });
        rgb.copy_from_slice(match lamp {
            Some(lamp) if is_lit => &[[20, 230, 120], [240, 190, 30], [235, 40, 30]][lamp as usize],
            _ if on_head => &[25, 27, 22],
            _ => &[120, 122, 126],
        });
    }
    image
}

fn place(x_m: f64, y_m: f64, heading_rad: f64) -> LightPlace {
    LightPlace { name: "crossing".into(), pose: Pose2::new(x_m, y_m, heading_rad), stop_s_m: x_m - 2.0 }
}

fn look(watch: &mut LightWatch, image: &Image) -> Vec<TrafficLight> {
    let mut out = TrafficLights::default();
    let shot = Shot { image, ego: Pose2::default(), pitch_rad: 0.0, route: None };
    watch.look(&shot, &mut out).unwrap();
    out.lights
}

#[test]
fn watch_reports_lights_with_and_without_a_map() {
    for lamp in Lamp::ALL {
        for ahead_m in [12.0, 15.0, 25.0, 40.0] {
            let image = image([ahead_m, -3.0], Some(lamp));
            for places in [vec![place(ahead_m, -3.0, 0.0)], Vec::new()] {
                let has_map = !places.is_empty();
                let mut watch = LightWatch::new(Params::default(), places);
                let first = look(&mut watch, &image);
                let what = format!("{lamp:?} {ahead_m} m, map {has_map}: {first:?}");
                assert_eq!(first.len(), 1, "{what}");
                assert_eq!((first[0].signal, first[0].seen), (None, Some(signal(lamp))), "{what}");
                let off_m = (first[0].distance_m - ahead_m).abs();
                assert!(first[0].score > 0.7 && off_m < 0.2 * ahead_m, "{what}");
                look(&mut watch, &image);
                assert_eq!(look(&mut watch, &image)[0].signal, Some(signal(lamp)), "{what}");
                assert_eq!(first[0].name.is_some() && first[0].stop_s_m.is_some(), has_map);
            }
        }
    }
}

#[test]
fn watch_searches_heads_around_their_places_on_the_map() {
    // The map has the mast, 3 m to the right of the head and 5 m before it, turned in any direction.
    let params = Params { search_m: 5.0, ..Params::default() };
    let red = image([30.0, -3.0], Some(Lamp::Red));
    let found = |there: LightPlace| look(&mut LightWatch::new(params, vec![there]), &red);
    for heading_rad in [0.0, 2.3, 3.1] {
        let seen = found(place(25.0, -6.0, heading_rad));
        assert_eq!(
            (seen.len(), seen[0].seen, seen[0].stop_s_m),
            (1, Some(Signal::Red), Some(23.0)),
            "{seen:?}"
        );
        assert!(seen[0].score > 0.7 && seen[0].name.as_deref() == Some("crossing"), "{seen:?}");
    }
    // At its place alone there is none.
    let exact = look(&mut LightWatch::new(Params::default(), vec![place(25.0, -6.0, 0.0)]), &red);
    assert_eq!(exact[0].seen, None);
    for (reason, there) in [
        ("more than 5 m beside it", place(25.0, -9.0, 0.0)),
        ("so near that its head would be taller", place(8.0, -1.0, 0.0)),
    ] {
        let seen = found(there);
        assert!(seen.iter().all(|light| light.seen.is_none()), "{reason}: {seen:?}");
    }
    for (reason, there) in [("behind", place(-25.0, -3.0, 0.0)), ("far", place(61.0, -3.0, 0.0))] {
        assert_eq!(found(there), [], "{reason}");
    }
    assert_eq!(
        look(&mut LightWatch::new(params, vec![place(30.0, -3.0, 0.0)]), &image([30.0, -3.0], None))[0].seen,
        None
    );
}

#[test]
fn watch_omits_distant_clipped_and_averted_lights_and_reports_dark_ones_as_unknown() {
    let red = image([25.0, -3.0], Some(Lamp::Red));
    for (what, there) in [
        ("behind", place(-25.0, -3.0, 0.0)),
        ("far", place(61.0, -3.0, 0.0)),
        ("above the image", place(4.0, -1.0, 0.0)),
        ("beside it", place(25.0, -20.0, 0.0)),
        ("turned away", place(25.0, -3.0, 3.1)),
        ("nowhere", place(f64::NAN, -3.0, 0.0)),
    ] {
        assert_eq!(look(&mut LightWatch::new(Params::default(), vec![there]), &red), [], "{what}");
    }
    let dark = image([25.0, -3.0], None);
    let mut watch = LightWatch::new(Params::default(), vec![place(25.0, -3.0, 0.0)]);
    let seen = look(&mut watch, &dark);
    assert_eq!((seen[0].signal, seen[0].seen, seen[0].score), (None, None, 0.0));
    assert_eq!(look(&mut LightWatch::new(Params::default(), Vec::new()), &dark), []);
}

#[test]
fn watch_tracks_and_forgets_lights_without_a_map() {
    let mut watch = LightWatch::new(Params::default(), Vec::new());
    for ahead_m in [30.0, 29.5, 29.0] {
        look(&mut watch, &image([ahead_m, -3.0], Some(Lamp::Red)));
    }
    let seen = look(&mut watch, &image([28.5, -3.0], Some(Lamp::Green)));
    assert_eq!((seen[0].signal, seen[0].seen), (Some(Signal::Red), Some(Signal::Green)));
    let dark = image([28.5, -3.0], None);
    (0..10).for_each(|_| assert_eq!(look(&mut watch, &dark), []));
    assert_eq!(look(&mut watch, &image([28.5, -3.0], Some(Lamp::Red)))[0].signal, None);
}

#[test]
fn watch_rejects_unsupported_images() {
    let mut watch = LightWatch::new(Params::default(), Vec::new());
    let mut told = |image: &Image| {
        let shot = Shot { image, ego: Pose2::default(), pitch_rad: 0.0, route: None };
        watch.look(&shot, &mut TrafficLights { stamp: Time::ZERO, lights: Vec::new() })
    };
    for (width, height) in [(0, 0), (1, 1), (800, 600)] {
        assert_eq!(told(&Image::new(width, height, Encoding::Rgb8)), Ok(()));
    }
    assert_eq!(told(&Image::new(8, 8, Encoding::DepthF32M)), Err(ShotError::NoColour));
    let mut other = Image::new(8, 8, Encoding::Rgb8);
    other.width_px = 9;
    assert!(matches!(told(&other), Err(ShotError::Size(_))));
    other.camera.intrinsics.is_parallel = true;
    assert_eq!(told(&other), Err(ShotError::Parallel));
}

#[test]
fn problems_lists_settings_out_of_range() {
    assert_eq!(Params::default().problems(), []);
    let wrong = Params { top_m: 0.5, within_m: f64::NAN, search_m: -1.0, ..Params::default() };
    let told: Vec<String> = wrong.problems().into_iter().map(|(key, why)| format!("{key}: {why}")).collect();
    let expected = [
        "top_m: expected 1 to 20, found 0.5",
        "within_m: expected 1 to 200, found NaN",
        "search_m: expected 0 to 30, found -1",
    ];
    assert_eq!(told, expected);
}
