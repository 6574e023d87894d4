use std::fs;
use std::path::Path;

use serde_json::json;
use swerve_core::Rng;
use swerve_report::files::write_png;
use swerve_stack::Registry;

use super::kitti;
use crate::train::by_recipe::{RecipeArgs, Trained as _};
use crate::train::detector::labelled::Extent;
use crate::train::detector::recipe::{Class, Recipe};
use crate::train::detector::tests::{Drawing, problem_of};

/// Recipe with tables of pictures for training, calibration and test.
fn recipe(pictures: [&str; 3]) -> String {
    let purposes = ["training", "calibration", "test"];
    let set = |(purpose, pictures): (&str, &str)| {
        format!("[[set]]\nname = \"{purpose}\"\npurpose = \"{purpose}\"\npictures = {pictures}\n")
    };
    let sets: String = purposes.into_iter().zip(pictures).map(set).collect();
    format!(
        "seed = 1\n{sets}\
         [[window]]\nclass = \"car\"\nobject_px = [32.0, 20.0]\ncells = [11, 8]\naspects = [0.0, 9.0]\nheights_m = [1.4, 2.4]\n\
         [learning]\nshrink = 4\nmethod.svm = {{ cost = 0.1, rounds = 2 }}\nnegatives = [28, 32000]\noverlap = 0.4\n\
         [[rung]]\nname = \"full\"\nfirst_octave = 1\nper_octave = 4\nstride = 1\nreject = -1.0\n"
    )
}

/// Table of pictures: a folder and other keys.
fn of(folder: &str, rest: &str) -> String {
    format!("{{ folder = \"{folder}\", {rest} }}")
}

/// Trains by a recipe in a folder of data. Returns the rows of the test, or the error.
fn trained(data: &Path, text: &str) -> Result<Vec<Vec<String>>, String> {
    let path = data.join("recipe.toml");
    fs::write(&path, text).unwrap();
    let run = || {
        let (recipe, _) = Recipe::read(&path)?;
        let (args, registry) = (RecipeArgs::of(&path, data), Registry::standard());
        let weights = recipe.train("a test".into(), &args, &registry)?;
        recipe.test(&weights, &args, &registry)
    };
    run().map_err(|error| format!("{error:#}").replace(&data.display().to_string(), "DATA"))
}

/// Picture of two cars, of one of two sizes.
fn street(seed: u64) -> Drawing {
    let mut rng = Rng::keyed(seed, "street", &[]);
    let size = if seed.is_multiple_of(3) { [150, 80] } else { [170, 96] };
    let mut drawing = Drawing::empty(size, &mut rng);
    for k in 0..2 {
        let height = 18 + rng.below(14);
        drawing.car([8 + 72 * k + rng.below(8), 14 + rng.below(20), 8 * height / 5, height]);
    }
    drawing
}

/// Writes pictures of cars in KITTI's layout.
fn kitti_streets(folder: &Path, seeds: core::ops::Range<u64>) {
    seeds.for_each(|seed| street(seed).kitti(folder, &format!("{seed:03}")));
}

/// Writes pictures of cars and COCO's labels, with a crowd of cars, a box without an area and a dog.
fn coco_streets(folder: &Path, seeds: core::ops::Range<u64>) -> serde_json::Value {
    let (mut images, mut annotations) = (Vec::new(), Vec::new());
    for seed in seeds {
        let (drawing, file_name) = (street(seed), format!("{seed:03}.jpg"));
        drawing.write(&folder.join(&file_name));
        let [width, height] = drawing.size();
        images.push(json!({ "id": 10 + seed, "file_name": file_name, "width": width, "height": height }));
        let cars =
            drawing.boxes.iter().map(|bbox| json!({ "category_id": 3, "image_id": 10 + seed, "bbox": bbox }));
        annotations.extend(cars);
        annotations
            .push(json!({ "category_id": 18, "image_id": 10 + seed, "bbox": [0, 0, 9, 9], "iscrowd": 0 }));
    }
    let last = &annotations[annotations.len() - 1]["image_id"].clone();
    annotations.push(json!({ "category_id": 3, "image_id": last, "bbox": [5, 0, 50, 10], "iscrowd": 1 }));
    annotations.push(json!({ "category_id": 3, "image_id": last, "bbox": [5, 5, 0, 10] }));
    let categories = json!([{ "id": 3, "name": "automobile" }, { "id": 18, "name": "dog" }]);
    json!({ "images": images, "annotations": annotations, "categories": categories })
}

/// Writes cut-outs of cars with a margin of a fifth, and pictures without one.
fn cut_outs(folder: &Path) {
    for seed in 0..24 {
        let mut rng = Rng::keyed(seed, "cut-out", &[]);
        let height = 20 + 5 * rng.below(4);
        let size = [8 * height / 3, 5 * height / 3];
        let mut drawing = Drawing::empty(size, &mut rng);
        drawing.car([size[0] / 5, size[1] / 5, 8 * height / 5, height]);
        drawing.write(&folder.join(format!("car/{seed}.png")));
        Drawing::empty([130, 90], &mut rng).write(&folder.join(format!("background/{seed}.png")));
    }
}

#[test]
fn detector_learns_from_pictures_of_each_format() {
    let data = tempfile::tempdir().unwrap();
    let data = data.path();
    kitti_streets(&data.join("kitti"), 0..30);
    let instances = coco_streets(&data.join("coco"), 40..60);
    fs::write(data.join("cars.json"), instances.to_string()).unwrap();
    cut_outs(&data.join("folders"));
    let part = |share: &str| of("kitti", &format!("format = \"kitti\", share = {share}"));
    let held_out = [part("[0.5, 0.7]"), part("[0.7, 1.0]")];
    let cars = "format = \"coco\", labels = \"cars.json\", categories = { car = [\"automobile\"] }";
    for training in
        [part("[0.0, 0.5]"), of("coco", cars), of("folders", "format = \"folders\", margin = [0.2, 0.2]")]
    {
        let rows = trained(data, &recipe([&training, &held_out[0], &held_out[1]])).unwrap();
        assert_eq!(rows[1][..3], ["full", "test", "car"]);
        let ap: f64 = rows[1][3].parse().unwrap();
        assert!(ap > 0.9 && rows[1][4] == "18", "{training}: {rows:?}");
    }
}

/// Damage to a folder of data.
type Spoil = Box<dyn Fn(&Path)>;

#[test]
fn wrong_pictures_are_reported() {
    let label =
        |text: &'static str| move |data: &Path| fs::write(data.join("kitti/label_2/001.txt"), text).unwrap();
    let image = |bytes: &'static [u8]| {
        move |data: &Path| fs::write(data.join("kitti/image_2/001.png"), bytes).unwrap()
    };
    let other = |file: &'static str| move |data: &Path| fs::write(data.join("kitti").join(file), "").unwrap();
    let huge = |data: &Path| {
        let bits = (png::ColorType::Grayscale, png::BitDepth::One);
        write_png(&data.join("kitti/image_2/001.png"), (8000, 2001), bits, &vec![0; 1000 * 2001]).unwrap();
    };
    let all_people = |data: &Path| {
        for path in swerve_report::files::entries(&data.join("kitti/label_2")).unwrap() {
            fs::write(&path, fs::read_to_string(&path).unwrap().replace("Car", "Pedestrian")).unwrap();
        }
    };
    let cases: Vec<(Spoil, &str)> = vec![
        (
            Box::new(label("Car 0 0\n")),
            "recipe.toml:5: set[0].pictures: DATA/kitti/label_2/001.txt:1: expected 15 columns",
        ),
        (
            Box::new(label("\nCar 0 0 0 x 0 9 9 0 0 0 0 0 9 0\n")),
            "001.txt:2: left: expected a number, found `x`",
        ),
        (
            Box::new(label("Carr 0 0 0 0 0 9 9 0 0 0 0 0 9 0\n")),
            "type: expected one of KITTI's, found `Carr`; did you mean `Car`?",
        ),
        (
            Box::new(label("Car 0 4 0 0 0 9 9 0 0 0 0 0 9 0\n")),
            "001.txt:1: occluded: expected 0 to 3, found `4`",
        ),
        (Box::new(label("Car 0 0 0 9 0 9 9 0 0 0 0 0 9 0\n")), "expected edges in order, found 9 0 9 9"),
        (
            Box::new(label("Car 0 0 0 900 0 990 9 0 0 0 0 0 9 0\n")),
            "expected a box in the picture of 170 x 96 pixels",
        ),
        (Box::new(image(b"text")), "reading DATA/kitti/image_2/001.png: neither a PNG nor a JPEG image"),
        (Box::new(image(b"\x89PNG\r\n\x1a\n")), "reading DATA/kitti/image_2/001.png: "),
        (Box::new(huge), "8000 x 2001 pixels: expected at most 16 megapixels"),
        (
            Box::new(other("image_2/99.png")),
            "image_2/99.png: expected a file of labels in label_2; it may be empty",
        ),
        (Box::new(other("label_2/99.txt")), "label_2/99.txt: expected a picture of this name in image_2"),
        (
            Box::new(all_people),
            "recipe.toml:14: window[0]: expected a car with a width of 0 to 9 heights in the sets for training, found none in 4 images",
        ),
        (
            Box::new(|data| fs::remove_dir_all(data.join("kitti")).unwrap()),
            "recipe.toml:5: set[0].pictures: reading DATA/kitti/label_2: ",
        ),
    ];
    let part = |share: &str| of("kitti", &format!("format = \"kitti\", share = {share}"));
    for (spoil, expected) in cases {
        let data = tempfile::tempdir().unwrap();
        kitti_streets(&data.path().join("kitti"), 0..6);
        spoil(data.path());
        let sets = [part("[0.0, 0.6]"), part("[0.6, 0.8]"), part("[0.8, 1.0]")];
        let error = trained(data.path(), &recipe(sets.each_ref().map(String::as_str))).unwrap_err();
        assert!(error.contains(expected), "{error}\nexpected: {expected}");
    }
}

#[test]
fn wrong_coco_labels_are_reported() {
    let cases: [(&str, serde_json::Value, &str); 8] = [
        (
            "/annotations/0/category_id",
            json!(4),
            "annotations[0].category_id: expected one of `categories`, found 4",
        ),
        ("/annotations/1/image_id", json!(4), "annotations[1].image_id: expected one of `images`, found 4"),
        (
            "/annotations/0/bbox",
            json!([1, 2, -3, 4]),
            "annotations[0].bbox: expected a width and a height of at least 0",
        ),
        ("/annotations/0/bbox", json!([500, 2, 3, 4]), "annotations[0].bbox: expected a box in the picture"),
        ("/annotations/0/bbox", json!([1, 2, 3]), "instances.json:1: annotations[0].bbox: "),
        (
            "/images/0/width",
            json!(151),
            "000.jpg: expected 151 x 80 pixels as in DATA/coco/instances.json, found 150 x 80",
        ),
        ("/images/1/id", json!(10), "images: expected different `id`, found 10 twice"),
        ("/categories/0/name", json!("automobiles"), "found `automobile`; did you mean `automobiles`?"),
    ];
    let data = tempfile::tempdir().unwrap();
    let (folder, cars) =
        (data.path().join("coco"), "format = \"coco\", categories = { car = [\"automobile\"] }");
    kitti_streets(&data.path().join("kitti"), 10..14);
    let set = of("coco", cars);
    let part = |share: &str| of("kitti", &format!("format = \"kitti\", share = {share}"));
    let text = recipe([&set, &part("[0.0, 0.5]"), &part("[0.5, 1.0]")]);
    let good = coco_streets(&folder, 0..3);
    for (place, value, expected) in cases {
        let mut wrong = good.clone();
        *wrong.pointer_mut(place).unwrap() = value;
        fs::write(folder.join("instances.json"), wrong.to_string()).unwrap();
        let error = trained(data.path(), &text).unwrap_err();
        assert!(
            error.starts_with("DATA/recipe.toml:5: set[0].pictures: ") && error.contains(expected),
            "{error}"
        );
    }
}

#[test]
fn wrong_folders_are_reported() {
    let data = tempfile::tempdir().unwrap();
    let data = data.path();
    kitti_streets(&data.join("kitti"), 0..4);
    let part = |share: &str| of("kitti", &format!("format = \"kitti\", share = {share}"));
    let text = recipe([&of("cut", "format = \"folders\""), &part("[0.0, 0.5]"), &part("[0.5, 1.0]")]);
    let error = |folders: &[&str]| {
        folders.iter().for_each(|name| fs::create_dir_all(data.join("cut").join(name)).unwrap());
        trained(data, &text).unwrap_err()
    };
    let named = error(&[]);
    assert!(named.contains("set[0].pictures: reading DATA/cut: "), "{named}");
    let named = error(&["cars"]);
    assert!(
        named.contains(
            "DATA/cut/cars: expected folders named \"pedestrian\", \"car\", \"truck\", \"cyclist\""
        ),
        "{named}"
    );
    assert!(named.contains("did you mean `car`?"), "{named}");
    fs::remove_dir(data.join("cut/cars")).unwrap();
    let named = error(&["car"]);
    assert!(named.contains("DATA/cut/car: expected PNG or JPEG files in it"), "{named}");
    cut_outs(&data.join("cut"));
    fs::remove_dir_all(data.join("cut/background")).unwrap();
    let named = error(&[]);
    assert!(
        named.contains("window[0]: expected images for training with room for windows without a car"),
        "{named}"
    );
}

#[test]
fn share_without_a_picture_is_reported() {
    let data = tempfile::tempdir().unwrap();
    kitti_streets(&data.path().join("kitti"), 0..4);
    let part = |share: &str| of("kitti", &format!("format = \"kitti\", share = {share}"));
    let error =
        trained(data.path(), &recipe([&part("[0.0, 0.5]"), &part("[0.5, 0.6]"), &part("[0.6, 1.0]")]));
    let error = error.unwrap_err();
    assert!(
        error.contains("set[1].pictures: share: expected at least one picture from 0.5 to 0.6 of"),
        "{error}"
    );
}

#[test]
fn picture_is_not_both_trained_on_and_held_out() {
    let data = tempfile::tempdir().unwrap();
    kitti_streets(&data.path().join("kitti"), 0..4);
    let whole = of("kitti", "format = \"kitti\"");
    let detour = of("other/../kitti/.", "format = \"kitti\", share = [0.5, 1.0]");
    let error = trained(data.path(), &recipe([&whole, &detour, &detour])).unwrap_err();
    assert!(
        error.contains("set[1].pictures: expected pictures that are not both trained on and held out"),
        "{error}"
    );
    // The same files by another name.
    let instances = coco_streets(&data.path().join("coco"), 0..4).to_string();
    fs::write(
        data.path().join("coco/instances.json"),
        instances.replace(".jpg", ".png").replace("00", "../kitti/image_2/00"),
    )
    .unwrap();
    let by_coco = of("coco", "format = \"coco\", categories = { car = [\"automobile\"] }");
    let error = trained(data.path(), &recipe([&whole, &by_coco, &by_coco])).unwrap_err();
    assert!(error.contains("000.png: expected an image that is not both trained on and held out"), "{error}");
}

#[test]
fn wrong_recipes_of_pictures_are_reported_with_their_line() {
    let set = of("a", "format = \"kitti\", share = [0.0, 0.5]");
    let held_out = of("a", "format = \"kitti\", share = [0.5, 1.0]");
    let good = recipe([&set, &held_out, &held_out]);
    assert_eq!(problem_of(&good), "nothing");
    let cases = [
        ("share = [0.0, 0.5]", "share = [0.5, 0.5]", "set[0].pictures.share: expected from and to, 0 to 1"),
        ("share = [0.0, 0.5]", "share = [0.0, nan]", "set[0].pictures.share: expected from and to, 0 to 1"),
        (
            "share = [0.0, 0.5]",
            "share = [0.0, 0.6]",
            "set[0].pictures: expected pictures that are not both trained on",
        ),
        (
            "share = [0.0, 0.5]",
            "labels = \"a\"",
            "set[0].pictures.labels: expected only with `format = \"coco\"`",
        ),
        (
            "share = [0.0, 0.5]",
            "margin = [0.1, 0.1]",
            "set[0].pictures.margin: expected only with `format = \"folders\"`",
        ),
        ("share = [0.0, 0.5]", "shares = 1", "did you mean `share`?"),
        ("\"kitti\"", "\"kiti\"", "set[0].pictures.format: expected one of"),
        (
            "\"kitti\", share = [0.0, 0.5]",
            "\"folders\", margin = [0.1, 0.5]",
            "set[0].pictures.margin: expected two shares",
        ),
        (
            "\"kitti\", share = [0.0, 0.5]",
            "\"coco\", categories = { cars = [\"auto\"] }",
            "set[0].pictures.categories.cars: expected \"pedestrian\", \"car\"",
        ),
        (
            "pictures = { folder = \"a\", format = \"kitti\", share = [0.0, 0.5] }",
            "seed = 1",
            "set[0].streets: expected `streets`: a set has",
        ),
        (
            "reject = -1.0",
            "reject = -1.0\ntolerance_deg = 1.0",
            "rung[0].tolerance_deg: expected the table `[camera]`",
        ),
        (
            "overlap = 0.4",
            "overlap = 0.4\nheight_min_px = -1",
            "learning.height_min_px: expected 0 to 4096 pixels",
        ),
    ];
    for (from, to, expected) in cases {
        let text = good.replacen(from, to, 1);
        assert_ne!(text, good, "{from}");
        let problem = problem_of(&text);
        assert!(
            problem.contains(expected) && problem.starts_with("recipe.toml:"),
            "{problem}\nexpected: {expected}"
        );
    }
}

#[test]
fn recipe_of_the_page_is_that_of_the_script() {
    let recipe = include_str!("../../../../../../tests/reference/vision/own_pictures.toml");
    let page = include_str!("../../../../../../docs/howto/train_a_detector.md");
    assert_eq!(problem_of(recipe), "nothing");
    assert!(page.contains(&format!("```text\n{recipe}```")), "the page shows another recipe");
}

/// Frames of KITTI's tracking benchmark, of two sizes, in the layout of its object benchmark.
#[test]
fn kitti_frames_are_read_with_regions_without_labels() {
    let Some(frames) = swerve_tests::data_or_skip("perception/kitti_frames") else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in ["image_2", "label_2"] {
        fs::create_dir_all(folder.path().join(name)).unwrap();
    }
    for (sequence, frame) in [(1, 10), (1, 15), (1, 20), (16, 2), (16, 7), (16, 12)] {
        let name = format!("t_{sequence:04}_{frame:06}");
        fs::copy(frames.join(format!("{name}.png")), folder.path().join(format!("image_2/{name}.png")))
            .unwrap();
        let text = fs::read_to_string(frames.join(format!("t_{sequence:04}.txt"))).unwrap();
        let of_frame = text.lines().filter_map(|line| line.strip_prefix(&format!("{frame} ")));
        let labels: String = of_frame.map(|line| line.split_once(' ').unwrap().1.to_owned() + "\n").collect();
        fs::write(folder.path().join(format!("label_2/{name}.txt")), labels).unwrap();
    }
    let images = kitti::read(folder.path(), [0.0, 1.0]).unwrap();
    let sizes: std::collections::BTreeSet<[usize; 2]> = images.iter().map(|image| image.size()).collect();
    assert_eq!(sizes.len(), 2, "{sizes:?}");
    let truths = || images.iter().flat_map(|image| image.truths());
    let count = |kind: &str| truths().filter(|truth| truth.extent == Extent::Object(kind.into())).count();
    // As in the table of docs/howto/train_a_detector.md.
    assert_eq!([count("Pedestrian"), count("Car")], [24, 39]);
    let regions: Vec<_> = truths().filter(|truth| truth.extent == Extent::Region(None)).collect();
    assert!(regions.len() > 10 && regions.iter().all(|region| region.bbox[2] > 0.0));
    // A detection in a region is ignored for each class; a large one around it is not.
    for class in Class::ALL {
        let image = images.iter().find(|image| image.truths()[0].extent == Extent::Region(None)).unwrap();
        let [left, top, width, height] = image.truths()[0].bbox;
        assert!(image.is_ignored(class, [left + 1.0, top + 1.0, 0.5 * width, 0.5 * height]));
        assert!(!image.is_ignored(class, [left - 200.0, top - 100.0, width + 400.0, height + 200.0]));
    }
}
