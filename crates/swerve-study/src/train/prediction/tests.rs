use clap::Parser;

use super::*;

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    args: RecipeArgs,
}

const RECIPE: &str = r#"
[net]
model = "multipath"
modes = 2
hidden = 8
steps = 5
step_ms = 400

[learning]
seed = 1
steps = 5
batch = 8
rate = 0.002
stretch = 0.2
noise = 0.01

[[set]]
name = "crossing"
purpose = "training"
made = { seeds = [1, 1], people = 4 }
stride = 10

[[set]]
name = "walk"
purpose = "test"
recorded = { format = "eth_ucy", files = ["walk.txt"] }
"#;

fn run(dir: &Path, recipe: &str, more: &[&str]) -> anyhow::Result<()> {
    std::fs::write(dir.join("small.toml"), recipe)?;
    let (path, data) = (dir.join("small.toml"), dir.to_owned());
    let words = ["train", path.to_str().unwrap(), "--data", data.to_str().unwrap()];
    let args = Cli::try_parse_from(words.into_iter().chain(more.iter().copied()))?.args;
    super::super::by_recipe::run::<Recipe>(&args, &Registry::default())
}

#[test]
fn a_recipe_makes_the_same_weights_each_time() {
    let dir = tempfile::tempdir().unwrap();
    let walk: String = (0..20).map(|k| format!("{} 1 {} 0\n", 10 * k, 0.5 * f64::from(k))).collect();
    std::fs::write(dir.path().join("walk.txt"), walk).unwrap();
    run(dir.path(), RECIPE, &[]).unwrap();
    let written = std::fs::read(dir.path().join("small.weights")).unwrap();
    let weights = Weights::read(&written).unwrap();
    assert!(weights.source.starts_with("swerve train prediction small.toml (recipe "), "{}", weights.source);
    // The weights alone are tested.
    let path = dir.path().join("small.weights");
    run(dir.path(), RECIPE, &["--test", path.to_str().unwrap()]).unwrap();
    run(dir.path(), RECIPE, &["--out", dir.path().join("again.weights").to_str().unwrap()]).unwrap();
    assert_eq!(std::fs::read(dir.path().join("again.weights")).unwrap(), written, "the same bytes");
    let said = run(dir.path(), RECIPE, &["--out", dir.path().to_str().unwrap()]).unwrap_err().to_string();
    assert!(said.contains("it is a folder"), "{said}");
}

#[test]
fn what_is_wrong_with_a_recipe_is_said_by_its_key() {
    let dir = tempfile::tempdir().unwrap();
    let said = |from: &str, to: &str| {
        assert!(RECIPE.contains(from));
        run(dir.path(), &RECIPE.replacen(from, to, 1), &[]).unwrap_err().to_string()
    };
    assert!(said("seeds = [1, 1]", "seeds = [2, 1]").contains("set[0].made.seeds"));
    assert!(said("stride = 10", "stride = 0").contains("set[0].stride"));
    assert!(said("\"training\"", "\"test\"").contains("expected a set for training and one to test by"));
    assert!(said("hidden = 8", "hidden = 8\nlayers = 3").contains("layers"));
    assert!(said("made = {", "recorded = { format = \"eth_ucy\", files = [] }\nmade = {").contains("either"));
    assert!(
        format!("{:#}", run(dir.path(), &RECIPE.replace("modes = 2", "modes = 99"), &[]).unwrap_err())
            .contains("`modes` is 99, expected 1 to 32")
    );
    // The file of tracks is not there.
    assert!(run(dir.path(), RECIPE, &[]).unwrap_err().to_string().contains("walk.txt"));
}
