//! `swerve map`: voxel maps from simulated or logged drives, the accuracy of lidar localization on them, and road
//! networks.

mod located;
mod logged;
mod show;
mod turns;

use std::path::PathBuf;

use anyhow::{Context as _, anyhow, bail};
use swerve_drive::overwrite::OverwriteArgs;
use swerve_drive::trust::CodeArgs;
use swerve_drive::{drive_observed, load_config, read_scenario};
use swerve_localization::map_file::MapFile;
use swerve_localization::ndt::Vector3;
use swerve_localization::voxels::VoxelSums;
use swerve_report::files::{read_whole, write_whole};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::sensors::LidarConfig;

use logged::{Logged, is_log};
use turns::{Turn, Turns};

/// `swerve map`.
#[derive(clap::Args, Debug)]
pub struct MapArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand, Debug)]
enum What {
    /// Build a map of the static surroundings of drives: of scenarios, driven with a lidar at its true pose, or of logs
    Build(BuildArgs),
    /// Drive a scenario and localize the lidar with a map and without one: errors against the ground truth
    Check(CheckArgs),
    /// Show a road network: what it contains, its defects, a picture, samples of its lanes, a route
    Show(show::ShowArgs),
}

/// Configuration of the drives.
#[derive(clap::Args, Debug)]
struct Driven {
    /// Configuration file with one lidar; several: the later over the earlier [default: a lidar on the roof]
    #[arg(short, long)]
    config: Vec<PathBuf>,
    /// Set a configuration key
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    code: CodeArgs,
}

#[derive(clap::Args, Debug)]
struct BuildArgs {
    /// Scenario files (TOML), or logs (MCAP) of drives that recorded a lidar's clouds
    #[arg(required = true, value_name = "SCENARIO|LOG")]
    drives: Vec<PathBuf>,
    /// Map file to write
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteArgs,
    /// Lidar of a log that has clouds of several
    #[arg(long, value_name = "NAME")]
    lidar: Option<String>,
    /// Edge of a voxel, metres
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    resolution_m: f64,
    #[command(flatten)]
    driven: Driven,
}

#[derive(clap::Args, Debug)]
struct CheckArgs {
    /// Scenario file (TOML)
    scenario: PathBuf,
    /// Map file
    #[arg(long, value_name = "FILE")]
    map: PathBuf,
    /// Also localize from this many other starts at each turn, 2 m and 5° off in random directions drawn from a seed
    #[arg(long, value_name = "N", default_value_t = 0)]
    starts: u8,
    #[command(flatten)]
    driven: Driven,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
}

/// Runs `swerve map`.
///
/// # Errors
/// If a file cannot be read or written or has another format, or if the configuration has no lidar.
pub fn run(args: &MapArgs, registry: &Registry) -> anyhow::Result<()> {
    let text = match &args.what {
        What::Build(args) => build(args, registry)?,
        What::Check(args) => check(args, registry)?,
        What::Show(args) => show::show(args)?,
    };
    swerve_report::output::print(&text)
}

fn build(args: &BuildArgs, registry: &Registry) -> anyhow::Result<String> {
    if !(0.1..=10.0).contains(&args.resolution_m) {
        bail!("--resolution-m: expected 0.1 to 10, found {}", args.resolution_m);
    }
    let logs = args.drives.iter().filter(|path| is_log(path)).count();
    if logs == args.drives.len() && !(args.driven.config.is_empty() && args.driven.set.is_empty()) {
        bail!("--config, --set: expected none with logs: each has the configuration that it was driven with");
    }
    if logs == 0 && args.lidar.is_some() {
        bail!("--lidar: expected with a log; a configuration for scenarios has one lidar");
    }
    args.overwrite.check([args.out.as_path()])?;
    let config = config(&args.driven, registry)?;
    let mut sums = VoxelSums::new(args.resolution_m);
    let (mut turns, mut points) = (0, 0_usize);
    for path in &args.drives {
        let mut add = |at: &Vector3<f64>| {
            points += 1;
            sums.add(at);
        };
        if is_log(path) {
            let logged = Logged::read(path, registry, args.lidar.as_deref())?;
            let all = logged.turns(&mut |turn: &[Vector3<f64>]| turn.iter().for_each(&mut add));
            turns += all.with_context(|| path.display().to_string())?;
        } else {
            let mut all = |turn: &Turn| {
                turns += 1;
                turn.points.iter().filter(|(_, instance)| *instance == 0).for_each(|(at, _)| add(at));
            };
            drive(&config, path, &mut all)?;
        }
    }
    let map = MapFile::new(args.resolution_m, sums.voxels());
    let bytes = map.write();
    write_whole(&args.out, &bytes)?;
    let (voxels, tiles, out) = (map.voxels().len(), map.tiles(), args.out.display());
    Ok(format!(
        "{out}: {voxels} voxels in {tiles} tiles of {points} points of {turns} turns, {} bytes\n",
        bytes.len()
    ))
}

fn check(args: &CheckArgs, registry: &Registry) -> anyhow::Result<String> {
    let at = args.map.display();
    let bytes = read_whole(&args.map)?;
    let map = MapFile::read(&bytes).map_err(|error| anyhow!("{at}: {error}"))?;
    let config = config(&args.driven, registry)?;
    let mut located = located::Located::new(&map, args.starts);
    drive(&config, &args.scenario, &mut |turn: &Turn| located.take(turn))?;
    let report = located
        .report()
        .ok_or_else(|| anyhow!("{}: it ends before two turns of the lidar", args.scenario.display()))?;
    if args.json { Ok(serde_json::to_string_pretty(&report)? + "\n") } else { Ok(report.to_string()) }
}

fn config(driven: &Driven, registry: &Registry) -> anyhow::Result<Setup> {
    let mut config = load_config(registry, &driven.config, &driven.set, driven.code)?;
    if driven.config.is_empty() && config.lidar.is_empty() {
        config.lidar.insert("roof".into(), LidarConfig::default());
    }
    if config.lidar.len() != 1 {
        bail!("a map is of one lidar, the configuration has {}", config.lidar.len());
    }
    // Wheel odometry provides the lidar's motion during a turn.
    config.log.sensors = config.lidar.keys().cloned().chain(["odometry".to_owned()]).collect();
    Ok(config)
}

fn drive(
    config: &Setup,
    scenario: &std::path::Path,
    each: &mut (dyn FnMut(&Turn) + Send),
) -> anyhow::Result<()> {
    let scenario = read_scenario(scenario)?;
    let Some((name, lidar)) = config.lidar.iter().next() else { bail!("a map is of one lidar") };
    let ego_from_lidar = lidar.ego_from_lidar(&config.sim.vehicle.shape);
    let mut turns = Turns::new(name, ego_from_lidar, each);
    drive_observed(config, &scenario, 1, &mut [&mut turns])?;
    Ok(())
}
