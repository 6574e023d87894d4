use std::path::Path;

use swerve_measure::picture::read_png;
use swerve_report::progress::Progress;

use super::pictures::kitti;
use super::recipe::Recipe;
use super::{learn, score};
mod drawn;

pub(super) use drawn::Drawing;

use crate::train::by_recipe::source;
use crate::train::images::camera_text;

const RECIPE: &str = include_str!("../../../../swerve-vision/detectors/street.toml");

/// Problems of a recipe, or `nothing`.
pub(super) fn problem_of(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recipe.toml");
    std::fs::write(&path, text).unwrap();
    let error = Recipe::read(&path).err().map_or_else(|| "nothing".to_owned(), |error| format!("{error:#}"));
    error.replace(&path.display().to_string(), "recipe.toml")
}

#[test]
fn wrong_recipes_are_reported_with_their_line() {
    assert_eq!(problem_of(RECIPE), "nothing");
    let cases = [
        ("shrink = 2", "shrink = 0", "learning.shrink: expected 1 to 8"),
        ("depth = 3", "deepth = 3", "did you mean `depth`?"),
        (
            "cells = [9, 17]",
            "cells = [2, 17]",
            "window[0].cells: expected 1 to 64 cells, room for the object",
        ),
        ("streets = [900, 903]", "streets = [3, 5]", "streets that are not both trained on and held out"),
        ("class = \"truck\"", "class = \"lorry\"", "found \"lorry\""),
        ("weather = \"clear_noon\"", "weather = \"clear_moon\"", "unknown weather `clear_moon`"),
        ("within_m = 40.0", "within_m = nan", "learning.within_m: expected more than 0, at most 1000"),
        (
            "aspects = [",
            "aspects = [nan, 1.0] # [",
            "window[0].aspects: expected from and to, neither below 0",
        ),
        ("object_px = [", "object_px = [-9.5, 0.0] # [", "window[0].object_px: expected 4 to 512 pixels"),
        ("name = \"training_clear_noon\"", "name = \"../noon\"", "set[0].name: expected letters, digits"),
        ("per_octave = 4", "per_octave = 0", "rung[0]"),
        ("tolerance_deg = 0.7", "tolerance_deg = nan", "rung[0].tolerance_deg: expected 0 to 45"),
        ("reject = -0.5", "reject = nan", "rung[0].reject: expected a finite number"),
    ];
    for (from, to, expected) in cases {
        let text = RECIPE.replacen(from, to, 1);
        assert_ne!(text, RECIPE, "{from}");
        let said = problem_of(&text);
        let line = text.lines().position(|line| line.contains(to)).unwrap() + 1;
        assert!(said.contains(expected) && said.starts_with("recipe.toml:"), "{said}");
        // A problem of a whole table is reported at the table's line.
        assert!(
            expected.starts_with("rung") || said.contains(&format!("recipe.toml:{line}:")),
            "{line}: {said}"
        );
    }
}

#[test]
fn built_in_detectors_match_their_recipes() {
    for name in ["street", "hog_street"] {
        is_of_its_recipe(name);
    }
}

fn is_of_its_recipe(detector: &str) {
    let path = Path::new("../swerve-vision/detectors").join(detector).with_extension("toml");
    let (recipe, text) = Recipe::read(&path).unwrap();
    let weights = swerve_vision::shipped::detector(detector).unwrap().unwrap();
    assert_eq!(
        weights.source,
        source::<Recipe>(&path, &text),
        "train the detector again: its recipe has changed"
    );
    assert_eq!(weights.models.len(), recipe.window.len());
    let names: Vec<String> = recipe.rung.iter().map(|rung| rung.rung().name).collect();
    assert!(weights.rungs.iter().map(|rung| &rung.name).eq(&names), "{names:?}");
    assert!(camera_text(recipe.camera.as_ref().unwrap()).contains("fov_deg = 70.0"));
}

#[test]
fn non_image_file_is_reported() {
    let error = read_png(Path::new("Cargo.toml")).unwrap_err();
    assert!(format!("{error:#}").starts_with("reading Cargo.toml: "), "{error:#}");
}

/// Bytes of weights trained on drawn images of two sizes by a method, on a number of threads.
fn learnt(method: &str, threads: usize) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tiny.toml");
    let tiny = RECIPE.replace("trees = { depth = 3, rounds = [64, 1024], one_of = 8 }", method);
    assert!(tiny.contains(method));
    std::fs::write(&path, tiny).unwrap();
    let (mut recipe, _) = Recipe::read(&path).unwrap();
    recipe.window.retain(|window| window.class.name() == "car");
    let drawn = |k| Drawing::new([176 + 16 * (k as usize % 2), 88], k);
    (0..7).for_each(|k| drawn(k).kitti(folder.path(), &format!("{k}")));
    let images = kitti::read(folder.path(), [0.0, 1.0]).unwrap();
    let mut weights = learn::untrained(&recipe, "drawn".to_owned());
    let last = weights.rungs.len() - 1;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        learn::learn(&recipe, &images, &mut weights, &Progress::learning(1, "rounds of learning")).unwrap();
        let found = score::detect(&recipe, &weights, &weights.rungs[last], &images).unwrap();
        let car = (0, recipe.window[0].class);
        let judged = score::judged(&found, &images, car, &recipe.learning);
        weights.rungs[last].calibrations = vec![score::calibrate(&judged)];
        let (ap, wanted) = score::average_precision(&found, &images, car, &recipe.learning);
        assert!(wanted == 21 && ap.unwrap() > 0.5, "{ap:?} of {wanted}: nothing was learnt");
    });
    weights.write()
}

#[test]
fn weights_do_not_depend_on_the_number_of_threads() {
    for method in ["trees = { depth = 3, rounds = [16, 64], one_of = 8 }", "svm = { cost = 0.1, rounds = 2 }"]
    {
        let one = learnt(method, 1);
        assert!(one.len() > 300);
        assert!(one == learnt(method, 4), "{method}");
    }
}
