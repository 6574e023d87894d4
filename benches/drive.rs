//! Closed loop: real-time factor of one core, cost of all sensors at once on one thread and on all, and duration of the
//! paper's Table I. `--bench drive -- loops sensors showcase study` measures only those parts.

use std::path::{Path, PathBuf};

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use swerve_benches::{Goal, Rows, Sample, cores, is_asked, is_asked_to_measure, now};
use swerve_drive::{drive_observed, drive_pipeline, problems_error, read_scenario, set_up};
use swerve_flow::Observer;
use swerve_gpu::{AdapterKind, Gpu};
use swerve_log::{Recorder, RunStart};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;
use swerve_study::Bench;
use swerve_text::Document;

const ROUNDS: usize = 5;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Processor time of this process so far, all threads, seconds; zero if the system does not report it.
fn cpu_s() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = text.rsplit_once(')').map_or("", |(_, after)| after);
    let ticks = after.split_whitespace().skip(11).take(2).filter_map(|n| n.parse::<f64>().ok());
    ticks.sum::<f64>() / 100.0
}

/// Drives once on this many threads; returns the simulated seconds.
fn drive(config: &Setup, scenario: &Scenario, threads: usize, log: Option<&Path>) -> anyhow::Result<f64> {
    let Some(log) = log else {
        return Ok(drive_observed(config, scenario, threads, &mut [])?.report.at.as_secs());
    };
    let start = RunStart {
        version: env!("CARGO_PKG_VERSION").into(),
        seed: config.seed,
        config: config.to_text(),
        ..RunStart::default()
    };
    let mut recorder = Recorder::create(log, &start)?;
    let pipeline = Pipeline::build(config, scenario)?;
    set_up(&mut recorder, config, &pipeline);
    let outcome = drive_pipeline(pipeline, config.seed, threads, &mut [&mut recorder as &mut dyn Observer])?;
    recorder.finish()?;
    Ok(outcome.report.at.as_secs())
}

/// Simulated seconds per processor second and per second, over drives of half a second in total.
fn rates(
    config: &Setup,
    scenario: &Scenario,
    threads: usize,
    log: Option<&Path>,
) -> anyhow::Result<(f64, f64)> {
    let (began, began_cpu_s) = (now(), cpu_s());
    let mut simulated_s = 0.0;
    while began.elapsed().as_secs_f64() < 0.5 {
        simulated_s += drive(config, scenario, threads, log)?;
    }
    let (wall_s, used_s) = (began.elapsed().as_secs_f64(), cpu_s() - began_cpu_s);
    let used_s = if began_cpu_s > 0.0 { used_s } else { wall_s };
    Ok((simulated_s / used_s.max(0.01), simulated_s / wall_s))
}

/// Parses command-line assignments.
fn assignments(set: &[&str]) -> anyhow::Result<Vec<(String, toml::Value)>> {
    Ok(set.iter().map(|one| swerve_text::parse_assignment(one)).collect::<Result<_, _>>()?)
}

fn loops(rows: &mut Rows) -> anyhow::Result<()> {
    let scenario = read_scenario(&root().join("scenarios/person_behind_truck.toml"))?;
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("drive.mcap");
    for planner in ["waypoint", "fot"] {
        let kinds =
            [("off", None, false), ("without Foxglove", Some(&*file), false), ("on", Some(&*file), true)];
        for (logging, log, foxglove) in kinds {
            let foxglove = format!("log.foxglove={foxglove}");
            let set = assignments(&[&format!("planning.planner={planner}"), &foxglove])?;
            let config = Setup::load(None, &set).map_err(|problems| problems_error(&problems))?;
            let (mut core, mut wall) = (vec![], vec![]);
            for _ in 0..ROUNDS {
                let (per_core, per_wall) = rates(&config, &scenario, 1, log)?;
                core.push(per_core);
                wall.push(per_wall);
            }
            let (core, wall) = (Sample::new(core), Sample::new(wall));
            let what = format!("person behind truck, {planner}, logging {logging}: times real time per core");
            let reads = format!("{}, wall {:.0} x", core.text(0, "x"), wall.median());
            let goal = if log.is_some() { Goal::Least(250.0) } else { Goal::None };
            rows.row(&what, core.median(), &reads, goal);
        }
    }
    let _unneeded = std::fs::remove_file(file);
    Ok(())
}

/// A camera at 20 Hz and a lidar of 32 x 1800 at 10 Hz in the loop. The digest reads every byte of each message.
const SENSORS: &str = "
[log]
sensors = ['front', 'roof']
[camera.front]
width_px = WIDTH
height_px = HEIGHT
period_ms = 50
[lidar.roof]
preset = 'vlp_32'
";

fn sensors(rows: &mut Rows) -> anyhow::Result<()> {
    let scenario = read_scenario(&root().join("scenarios/person_behind_truck.toml"))?;
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("sensors.mcap");
    let sizes = [(640, 360, 6.0), (800, 600, 1.5)];
    let cases = sizes.into_iter().flat_map(|size| ["none", "jpeg", "lossless"].map(|images| (size, images)));
    for ((width, height, goal), images) in cases {
        let text = SENSORS.replace("WIDTH", &width.to_string()).replace("HEIGHT", &height.to_string());
        let document = Document::parse("sensors", text)?;
        let set = assignments(&[&format!("log.images={images}")])?;
        let config = Setup::from_document(&document, &set).map_err(|problems| problems_error(&problems))?;
        let (mut core, mut wall) = (vec![], vec![]);
        for _ in 0..ROUNDS {
            let (per_core, per_wall) = rates(&config, &scenario, 2, Some(&file))?;
            core.push(per_core);
            wall.push(per_wall);
        }
        let (core, wall) = (Sample::new(core), Sample::new(wall));
        let what = format!(
            "camera {width}x{height} at 20 Hz, lidar 32x1800 at 10 Hz, 2 threads, images = {images}: times real time"
        );
        let size_mb = std::fs::metadata(&file).map_or(0.0, |data| data.len() as f64 * 1e-6);
        let reads = format!("{}, per core {:.1} x, log {size_mb:.1} MB", wall.text(1, "x"), core.median());
        // The goal applies to a run that logs no images; the cost of logging them is listed beside it.
        let goal = if images == "none" { Goal::Least(goal) } else { Goal::None };
        rows.row(&what, wall.median(), &reads, goal);
    }
    let _unneeded = std::fs::remove_file(file);
    Ok(())
}

/// Six cameras and 64 beams: on one thread, on all, and with cameras on a GPU if available.
fn showcase(rows: &mut Rows) -> anyhow::Result<()> {
    let scenario = read_scenario(&root().join("scenarios/street.toml"))?;
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join("showcase.mcap");
    let cores = cores();
    let times_real_time = |set: &[&str], threads: usize, rounds: usize| -> anyhow::Result<Sample> {
        let config = Setup::load(Some(&root().join("configs/showcase.toml")), &assignments(set)?)
            .map_err(|problems| problems_error(&problems))?;
        let mut rates = vec![];
        for _ in 0..rounds {
            let began = now();
            let simulated_s = drive(&config, &scenario, threads, Some(&file))?;
            rates.push(simulated_s / began.elapsed().as_secs_f64());
        }
        Ok(Sample::new(rates))
    };
    let one = times_real_time(&["log.images=none"], 1, 2)?;
    rows.row("showcase, 1 thread: times real time", one.median(), &one.text(2, "x"), Goal::None);
    let all = times_real_time(&["log.images=none"], cores, ROUNDS)?;
    let goal = if cores == 2 { Goal::Least(1.5) } else { Goal::None };
    rows.row(&format!("showcase, {cores} threads: times real time"), all.median(), &all.text(2, "x"), goal);
    let (ratio, goal) =
        (all.median() / one.median(), if cores >= 16 { Goal::Least(8.0) } else { Goal::None });
    rows.row(&format!("showcase, {cores} threads over 1"), ratio, &format!("{ratio:.2} x"), goal);
    let what = format!("showcase, cameras on a graphics processor, {cores} threads: times real time");
    if let Err(none) = Gpu::shared(AdapterKind::Gpu) {
        rows.skipped(&what, &none.to_string());
    } else {
        let gpu = times_real_time(&["log.images=none", "render.backend=gpu"], cores, ROUNDS)?;
        rows.row(&what, gpu.median(), &gpu.text(2, "x"), Goal::Least(10.0));
    }
    let _unneeded = std::fs::remove_file(file);
    Ok(())
}

fn study(rows: &mut Rows) -> anyhow::Result<()> {
    let bench =
        Bench::open(&swerve::Registry::standard(), &root().join("configs/studies/planners.toml"), &[])?;
    let cells = &bench.study.cells;
    let (began, began_cpu_s) = (now(), cpu_s());
    cells.par_iter().try_for_each(|cell| bench.run_cell(cell, None).map(drop))?;
    let (wall_s, used_s) = (began.elapsed().as_secs_f64(), cpu_s() - began_cpu_s);
    let what = format!("Table I, {} runs on {} threads", cells.len(), cores());
    let goal = match cores() {
        2 => Goal::Most(8.0),
        16.. => Goal::Most(1.5),
        _ => Goal::None,
    };
    rows.row(&what, wall_s, &format!("{wall_s:.1} s ({used_s:.1} s of processor time)"), goal);
    Ok(())
}

fn main() -> anyhow::Result<()> {
    if !is_asked_to_measure() {
        return Ok(());
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "drive");
    type Part = fn(&mut Rows) -> anyhow::Result<()>;
    let parts: [(&str, Part); 4] =
        [("loops", loops), ("sensors", sensors), ("showcase", showcase), ("study", study)];
    for (_, part) in parts.into_iter().filter(|(name, _)| is_asked(name)) {
        part(&mut rows)?;
    }
    rows.finish();
    Ok(())
}
