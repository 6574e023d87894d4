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
    let mut words = vec!["train", path.to_str().unwrap()];
    if !more.contains(&"--data") {
        words.extend(["--data", data.to_str().unwrap()]);
    }
    let args = Cli::try_parse_from(words.into_iter().chain(more.iter().copied()))?.args;
    super::super::by_recipe::run::<Recipe>(&args, &Registry::default())
}

#[test]
fn recipe_trains_the_same_weights_each_time() {
    let dir = tempfile::tempdir().unwrap();
    let walk: String = (0..20).map(|k| format!("{} 1 {} 0\n", 10 * k, 0.5 * f64::from(k))).collect();
    std::fs::write(dir.path().join("walk.txt"), walk).unwrap();
    run(dir.path(), RECIPE, &[]).unwrap();
    let written = std::fs::read(dir.path().join("small.weights")).unwrap();
    let weights = Weights::read(&written).unwrap();
    assert!(weights.source.starts_with("swerve train prediction small.toml (recipe "), "{}", weights.source);
    // Only tests the weights.
    let path = dir.path().join("small.weights");
    run(dir.path(), RECIPE, &["--test", path.to_str().unwrap()]).unwrap();
    run(dir.path(), RECIPE, &["--out", dir.path().join("again.weights").to_str().unwrap()]).unwrap();
    assert_eq!(std::fs::read(dir.path().join("again.weights")).unwrap(), written, "the same bytes");
    let said = run(dir.path(), RECIPE, &["--out", dir.path().to_str().unwrap()]).unwrap_err().to_string();
    assert!(said.contains("it is a folder"), "{said}");
}

/// Pedestrians of ETH and vehicles of US-101, each with a user's recipe; skipped if the recordings are missing.
#[test]
fn predictor_trains_on_recorded_files_of_both_formats() {
    for (format, folder, file, stride) in [
        ("eth_ucy", "eth_ucy", "biwi_eth.txt", 4),
        ("commonroad_csv", "ngsim_commonroad", "US101.csv.gz", 60),
    ] {
        let Some(path) = swerve_tests::data_or_skip(&format!("prediction/{folder}/{file}")) else { continue };
        let set = |purpose: &str, more: &str| {
            format!(
                "[[set]]\nname = \"{file}\"\npurpose = \"{purpose}\"\nstride = {stride}\n{more}\
                 recorded = {{ format = \"{format}\", files = [\"{file}\"] }}\n"
            )
        };
        let head = RECIPE.split("[[set]]").next().unwrap().replace("steps = 5\nbatch", "steps = 60\nbatch");
        let head =
            head.replace("noise = 0.01", "noise = 0.01\nnoise_spread = 0.5\naverage = 0.9\nmixed = 0.5");
        let recipe = head + &set("training", "played = [1.0, -1.0]\n") + &set("test", "");
        let dir = tempfile::tempdir().unwrap();
        let folder = path.parent().unwrap();
        run(dir.path(), &recipe, &["--data", folder.to_str().unwrap()]).unwrap();
        let weights = Weights::read(&std::fs::read(dir.path().join("small.weights")).unwrap()).unwrap();
        let (recordings, learnt) =
            (file_of(&path, format), |tracks: &TrackList, horizon: &Horizon, _: Ground<'_>| {
                predict_by(&weights, tracks, horizon, Ground::Open)
            });
        let each = if format == "eth_ucy" { 1 } else { 4 };
        let protocol = Protocol { stride: 10 * stride, ..Protocol::whole(7 * each + 1, 5 * each) };
        let found = judged(&recordings, &learnt, (&protocol, BEST_OF)).figures();
        assert!(found.windows > 20 && found.fde_m < 6.0, "{format}: {} {}", found.windows, found.fde_m);
    }
}

fn file_of(path: &Path, format: &str) -> Vec<Recording> {
    let format = if format == "eth_ucy" { Format::EthUcy } else { Format::CommonroadCsv };
    file(path, format).unwrap().recordings()
}

#[test]
fn wrong_recipe_is_reported_by_its_key() {
    let dir = tempfile::tempdir().unwrap();
    let said = |from: &str, to: &str| {
        assert!(RECIPE.contains(from));
        run(dir.path(), &RECIPE.replacen(from, to, 1), &[]).unwrap_err().to_string()
    };
    assert!(said("seeds = [1, 1]", "seeds = [2, 1]").contains("set[0].made.seeds"));
    assert!(said("stride = 10", "stride = 0").contains("set[0].stride"));
    assert!(said("\"training\"", "\"test\"").contains("expected a set for training and one to test by"));
    assert!(said("stride = 10", "played = [0.0]").contains("set[0].played"));
    assert!(said("hidden = 8", "hidden = 8\nlayers = 3").contains("layers"));
    assert!(said("made = {", "recorded = { format = \"eth_ucy\", files = [] }\nmade = {").contains("either"));
    assert!(
        format!("{:#}", run(dir.path(), &RECIPE.replace("modes = 2", "modes = 99"), &[]).unwrap_err())
            .contains("`modes` is 99, expected 1 to 32")
    );
    // The track file is missing.
    assert!(run(dir.path(), RECIPE, &[]).unwrap_err().to_string().contains("walk.txt"));
}
