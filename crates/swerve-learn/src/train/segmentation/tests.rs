use std::path::Path;

use super::*;
use crate::train::by_recipe::source;

const PATH: &str = "../swerve-vision/segmentations/street.toml";
const RECIPE: &str = include_str!("../../../../swerve-vision/segmentations/street.toml");

fn written(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("recipe.toml");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

/// The recipe's text with values replaced.
fn changed(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(RECIPE.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    })
}

#[test]
fn wrong_recipes_are_reported_with_their_line() {
    for (from, to, expected) in [
        ("\"sidewalk\"]", "\"sidewolk\"]", "no class `sidewolk` of Cityscapes; did you mean `sidewalk`?"),
        ("cells = 40", "cells = 0", "learning.cells: expected 1 to 10000"),
        ("trees = 8", "trees = 80", "learning.trees: expected 1 to 16"),
        ("power =", "powre =", "did you mean `power`?"),
        (
            "seed = 77",
            "pictures = { folder = \"a\", format = \"kitti\" }",
            "pictures: expected `streets`, `seed` and `weather`: only detectors learn from pictures",
        ),
        ("streets = [900, 903]", "streets = [3, 5]", "streets that are not both trained on and held out"),
    ] {
        let text = changed(&[(from, to)]);
        let (_folder, path) = written(&text);
        let said = format!("{:#}", Recipe::read(&path).unwrap_err());
        let line = text.lines().position(|line| line.contains(to)).unwrap() + 1;
        assert!(said.contains(expected) && said.contains(&format!("recipe.toml:{line}:")), "{said}");
    }
}

#[test]
fn built_in_segmentation_matches_its_recipe_and_is_small() {
    let (recipe, text) = Recipe::read(Path::new(PATH)).unwrap();
    let weights = swerve_vision::shipped::segmentation("street").unwrap().unwrap();
    let expected = source::<Recipe>(Path::new(PATH), &text);
    assert_eq!(weights.source, expected, "train the segmentation again: its recipe has changed");
    assert_eq!(weights.classes, learn::untrained(&recipe, String::new()).classes);
    assert!(weights.write().len() < 300_000);
}

/// Recipe with few images of few streets.
fn tiny(size: [&str; 2], period_ms: &str) -> String {
    let (before, sets) = RECIPE.split_once("[[set]]").unwrap();
    let (_, classes) = sets.split_once("[[class]]").unwrap();
    let set = |purpose: &str, streets: &str, seed: u32| {
        format!(
            "[[set]]\nname = \"{purpose}\"\npurpose = \"{purpose}\"\nstreets = {streets}\nseed = {seed}\nweather = \"clear_noon\"\n"
        )
    };
    let before = before.replace("800", size[0]).replace("600", size[1]).replace("500.0", period_ms);
    let sets = set("training", "[0, 2]", 1) + &set("test", "[901, 902]", 77);
    before + &sets + "[[class]]" + classes
}

#[test]
fn weights_do_not_depend_on_the_number_of_threads() {
    let (folder, path) = written(&tiny(["160", "120"], "4000.0").replace("trees = 8", "trees = 3"));
    let (recipe, _) = Recipe::read(&path).unwrap();
    let args = RecipeArgs::of(&path, &folder.path().join("data"));
    let train = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| recipe.train("a test".into(), &args, &Registry::standard())).unwrap()
    };
    let (one, four) = (train(1), train(4));
    assert_eq!(one.write(), four.write());
    assert!(one.trees.iter().all(|tree| tree.thresholds.len() > 20));
}

/// Minimum accuracy of the built-in weights on a street, seed and drive that they were not trained on.
#[test]
fn held_out_street_is_segmented() {
    let (folder, path) = written(&tiny(["800", "600"], "4000.0"));
    let (recipe, _) = Recipe::read(&path).unwrap();
    let args = RecipeArgs::of(&path, &folder.path().join("data"));
    let weights = swerve_vision::shipped::segmentation("street").unwrap().unwrap();
    let lines = recipe.test(&weights, &args, &Registry::standard()).unwrap();
    assert_eq!(lines[0][..3], ["set", "mean IoU", "road"]);
    let [mean, road] = [1, 2].map(|k| lines[1][k].parse::<f64>().unwrap());
    assert!(mean >= 0.65 && road >= 0.93, "{lines:?}");
}
