//! Tracks of sensors against the true road users, over the scenarios whose outcome depends on seeing the actor `hazard`:
//! time from its first sight to a track and to its velocity, purity, duplicates and ghosts. Drives each scenario once
//! per configuration, at seeds that nothing was tuned on; `-- 3` drives each three times.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Context;
use serde_json::Value;
use swerve_benches::{Goal, Rows, Sample, asked_number, is_asked_to_measure, print};
use swerve_eval::TrackComparison;
use swerve_log::Log;
use swerve_msg::Detections;
use swerve_msg::truth::WorldState;
use swerve_perception::{Tracker, tracker};
use swerve_text::overridden;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Configurations, the stream that their tracker reads, and their goals: the longest time from first sight to a velocity
/// of 90 % of the drives, ms.
const CONFIGS: [(&str, &str, f64); 3] = [
    ("fused_objects", "fused", 120.0),
    ("lidar_objects", "lidar_objects", 250.0),
    ("camera_objects", "camera_objects.boxes", 200.0),
];

/// First seed.
const SEED: u64 = 7711;
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

/// Folder of a drive.
fn folder() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("tracks")
}

/// Metrics of a drive.
fn driven(config: &str, scenario: &Path, seed: u64) -> anyhow::Result<Value> {
    let folder = folder();
    // A drive that is refused shall not have the metrics of the one before.
    let _ = std::fs::remove_dir_all(&folder);
    let mut call = Command::new(env!("CARGO"));
    call.current_dir(ROOT).args(["run", "--locked", "--release", "-q", "-p", "swerve", "--", "run"]);
    call.arg(scenario).arg("-c").arg(format!("configs/{config}.toml")).args(["--set", SPEED]);
    if scenario.ends_with("cyclist_at_dusk.toml") {
        call.args(["--set", "render.weather=clear_sunset"]);
    }
    call.args(["--seed", &seed.to_string(), "--out"]).arg(&folder);
    // A drive that does not end as its scenario expects is one as well.
    call.output()?;
    Ok(serde_json::from_slice(&std::fs::read(folder.join("metrics.json"))?)?)
}

/// Normalized squared errors (NEES) of the tracks of the actor `hazard`, if it has some, and of all tracks, with the boxes
/// of the last drive tracked once more: messages of tracks have no covariance. The filter's velocity counts, not the part
/// of it that exceeds its error.
fn nees(config: &str, boxes: &str, hazard: u64) -> anyhow::Result<[Option<f64>; 2]> {
    let text = std::fs::read_to_string(Path::new(ROOT).join(format!("configs/{config}.toml")))?;
    let table: toml::Table = text.parse()?;
    let own = table["perception"]["tracker"].as_table().context("no table")?;
    let params = overridden(&tracker::Params::default(), own);
    let params = params.map_err(|problems| anyhow::anyhow!("{problems:?}"))?;
    let mut tracker = Tracker::new(tracker::Params { velocity_doubt: 0.0, ..params })?;
    let log = Log::read(&folder().join("log.mcap"))?;
    let truth: Vec<WorldState> = log.publications("world").map(|p| p.decode()).collect::<Result<_, _>>()?;
    let (mut of_hazard, mut of_all) = (TrackComparison::default(), TrackComparison::default());
    for found in log.publications(boxes) {
        let found: Detections = found.decode()?;
        let now = truth.partition_point(|world| world.stamp <= found.stamp);
        let world = &truth[now.saturating_sub(1)];
        let list = tracker.update(&found, world.ego.state.pose);
        of_all.add((&list, found.stamp), world, &[], |id| tracker.covariance(id));
        let mut world = world.clone();
        world.actors.retain(|actor| u64::from(actor.id.0) == hazard);
        of_hazard.add((&list, found.stamp), &world, &[], |id| tracker.covariance(id));
    }
    Ok([of_hazard, of_all].map(|compared| compared.metrics().nees))
}

/// Number of the hazard, and its delays in ms: from its first sight to its first track, and to its velocity.
fn delays_ms(metrics: &Value) -> Option<(u64, [f64; 2])> {
    let hazard = metrics["actors"].as_array()?.iter().find(|actor| actor["name"] == "hazard")?;
    let sight_s = hazard["first_sight_s"].as_f64().filter(|sight_s| *sight_s > FROM_START_S)?;
    let since = |key: &str| hazard[key].as_f64().map_or(NEVER_MS, |at_s| (at_s - sight_s) * 1e3);
    Some((hazard["actor"].as_u64()?, [since("tracked_s"), since("velocity_known_s")]))
}

fn main() -> anyhow::Result<()> {
    if !is_asked_to_measure() {
        return Ok(());
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "tracks");
    let seeds = asked_number(1);
    for (config, boxes, goal_ms) in CONFIGS {
        let (mut delays, mut shares) = ([Vec::new(), Vec::new()], [0.0; 3]);
        let mut squares = [Vec::new(), Vec::new()];
        let mut drives = 0.0;
        for scenario in scenarios()? {
            for seed in SEED..SEED + seeds {
                let metrics = driven(config, &scenario, seed)?;
                let Some((hazard, of)) = delays_ms(&metrics) else {
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
                let of = nees(config, boxes, hazard)?;
                squares.iter_mut().zip(of).for_each(|(all, one)| all.extend(one));
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
        let [hazard, all] = squares.map(|squares| Sample::new(squares).at(0.5));
        rows.row(
            &format!("{config}: NEES of the hazard, 4 is right"),
            hazard,
            &format!("median {hazard:.1}"),
            Goal::Most(8.0),
        );
        rows.row(&format!("{config}: NEES of all tracks"), all, &format!("median {all:.1}"), Goal::None);
    }
    rows.finish();
    Ok(())
}
