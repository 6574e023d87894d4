//! Tracks of sensors against the true road users, over the scenarios whose outcome depends on seeing the actor `hazard`:
//! time from its first sight to a track and to its velocity, purity, duplicates and ghosts. Drives each scenario once
//! per configuration, at seeds that nothing was tuned on; `-- 3` drives each three times.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use swerve_benches::{Goal, Rows, Sample, asked_number, is_asked_to_measure, print};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Configurations, and their goals: the longest time from first sight to a velocity of 90 % of the drives, ms.
const CONFIGS: [(&str, f64); 3] =
    [("fused_objects", 120.0), ("lidar_objects", 250.0), ("camera_objects", 200.0)];

/// First seed.
const SEED: u64 = 7701;
/// Target speed, m/s.
const SPEED: &str = "ego.speed_mps=14";
/// First sight up to which a hazard is in sight from the start, and hidden only later, seconds.
const FROM_START_S: f64 = 0.5;
/// Delay of a drive without a right velocity, ms: longer than any drive.
const NEVER_MS: f64 = 99_999.0;

fn scenarios() -> anyhow::Result<Vec<PathBuf>> {
    let files = std::fs::read_dir(Path::new(ROOT).join("scenarios/seeing"))?;
    let mut files: Vec<PathBuf> = files.map(|file| Ok(file?.path())).collect::<anyhow::Result<_>>()?;
    files.sort();
    Ok(files)
}

/// Metrics of a drive.
fn driven(config: &str, scenario: &Path, seed: u64) -> anyhow::Result<Value> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("tracks");
    let mut call = Command::new(env!("CARGO"));
    call.current_dir(ROOT).args(["run", "--locked", "--release", "-q", "-p", "swerve", "--", "run"]);
    call.arg(scenario).arg("-c").arg(format!("configs/{config}.toml")).args(["--set", SPEED]);
    if scenario.ends_with("cyclist_at_dusk.toml") {
        call.args(["--set", "render.weather=clear_sunset"]);
    }
    call.args(["--seed", &seed.to_string(), "--overwrite", "--out"]).arg(&folder);
    // A drive that does not end as its scenario expects is one as well.
    call.output()?;
    Ok(serde_json::from_slice(&std::fs::read(folder.join("metrics.json"))?)?)
}

/// Delays of the hazard in ms: from its first sight to its first track, and to its velocity.
fn delays_ms(metrics: &Value) -> Option<[f64; 2]> {
    let hazard = metrics["actors"].as_array()?.iter().find(|actor| actor["name"] == "hazard")?;
    let sight_s = hazard["first_sight_s"].as_f64().filter(|sight_s| *sight_s > FROM_START_S)?;
    let since = |key: &str| hazard[key].as_f64().map_or(NEVER_MS, |at_s| (at_s - sight_s) * 1e3);
    Some([since("tracked_s"), since("velocity_known_s")])
}

fn main() -> anyhow::Result<()> {
    if !is_asked_to_measure() {
        return Ok(());
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "tracks");
    let seeds = asked_number(1);
    for (config, goal_ms) in CONFIGS {
        let (mut delays, mut shares) = ([Vec::new(), Vec::new()], [0.0; 3]);
        let mut drives = 0.0;
        for scenario in scenarios()? {
            for seed in SEED..SEED + seeds {
                let metrics = driven(config, &scenario, seed)?;
                let Some(of) = delays_ms(&metrics) else {
                    print(&format!(
                        "{}, seed {seed}: no first sight of the hazard on the way",
                        scenario.display()
                    ));
                    continue;
                };
                delays.iter_mut().zip(of).for_each(|(all, one)| all.push(one));
                let share = |key: &str| metrics["tracks"][key].as_f64().unwrap_or(0.0);
                for (sum, key) in shares.iter_mut().zip(["purity", "duplicate_share", "ghost_share"]) {
                    *sum += share(key);
                }
                drives += 1.0;
            }
        }
        let [tracked, known] = delays.map(Sample::new);
        let reads = |delays: &Sample| format!("p50 {:.0}, p90 {:.0} ms", delays.at(0.5), delays.at(0.9));
        rows.row(&format!("{config}: first sight to track"), tracked.at(0.9), &reads(&tracked), Goal::None);
        rows.row(
            &format!("{config}: to a velocity within 0.6 m/s"),
            known.at(0.9),
            &reads(&known),
            Goal::Most(goal_ms),
        );
        let [purity, duplicates, ghosts] = shares.map(|sum| sum / drives);
        rows.row(&format!("{config}: purity"), purity, &format!("{purity:.3}"), Goal::Least(0.7));
        rows.row(
            &format!("{config}: share of duplicates"),
            duplicates,
            &format!("{duplicates:.3}"),
            Goal::Most(0.1),
        );
        rows.row(&format!("{config}: share of ghosts"), ghosts, &format!("{ghosts:.3}"), Goal::None);
    }
    rows.finish();
    Ok(())
}
