//! What the fuzz targets share. `run` in this folder runs them.

use std::path::{Path, PathBuf};

use clap::Parser;
use serde::de::DeserializeOwned;
use swerve_core::Time;
use swerve_flow::{Decision, Worker};
use swerve_msg::truth::{PointInstances, WorldState};
use swerve_msg::{
    Command, Detections, EgoState, GateOutput, Gnss, Image, Imu, MotionCommand, ObstacleList, Plan,
    PointCloud, PredictionList, RadarScan, ResponseBudget, RungTaken, SensorHealth, Supervision, Switch,
    TrackList, VehicleReport, WheelOdometry,
};
use swerve_planning::{Budget, Progress};
use swerve_scenario::Scenario;
use swerve_stack::config::Config;
use swerve_stack::pipeline::Pipeline;
use swerve_study::evaluate::{self, EvalArgs};
use swerve_text::Document;
use tempfile::TempDir;

/// A file in a folder of its own, for readers that take a path; it is gone when dropped.
pub struct Scratch {
    folder: TempDir,
    path: PathBuf,
}

impl Scratch {
    /// A file with these bytes.
    pub fn file(name: &str, bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().expect("the folder of temporary files takes one");
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("the folder of temporary files takes one");
        Self { folder, path }
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// A budget of so many units.
pub struct Limited(pub u64);

impl Budget for Limited {
    fn spend(&mut self, units: u64) -> Progress {
        self.0 = self.0.saturating_sub(units);
        if self.0 == 0 { Progress::Stop } else { Progress::Continue }
    }
}

/// A second of a drive with a camera and a lidar.
pub fn pipeline() -> Pipeline {
    const SENSORS: &str = "[camera.front]\nwidth_px = 16\nheight_px = 8\nperiod_ms = 200\n\
                           [lidar.roof]\npreset = 'vlp_32'\n[monitor.eye]\nsensor = 'front'\n";
    let config = Document::parse("sensors", SENSORS).expect("it is TOML");
    let config = Config::from_document(&config, &[]).expect("it is a configuration");
    let scenario = include_str!("../../scenarios/person_behind_truck.toml");
    let scenario = Scenario::parse("scenario", scenario).expect("it is a scenario");
    let mut pipeline = Pipeline::build(&config, &scenario).expect("it can be built");
    pipeline.until = Time::from_ms(400);
    pipeline
}

/// Operators whose steps a worker takes.
pub const WORKERS: [&str; 4] = ["tracker", "predictor", "planner", "controller"];

/// A worker with operators of the stack.
pub fn worker() -> Worker {
    pipeline().graph.into_worker(&WORKERS.map(str::to_owned)).expect("the pipeline has them")
}

fn read_as<T: DeserializeOwned>(bytes: &[u8]) {
    let _either_way = postcard::from_bytes::<T>(bytes).is_ok();
    let _either_way = ciborium::from_reader::<T, _>(bytes).is_ok();
}

/// Reads them as a message of each type, in both forms.
pub fn read_as_each(bytes: &[u8]) {
    macro_rules! each {
        ($($message:ty)*) => { $(read_as::<$message>(bytes);)* };
    }
    each!(Command Detections EgoState GateOutput Gnss Image Imu MotionCommand ObstacleList Plan PointCloud
          PredictionList RadarScan ResponseBudget RungTaken SensorHealth Supervision Switch TrackList VehicleReport
          WheelOdometry WorldState PointInstances Decision);
}

/// A comparison as `swerve eval` makes it.
#[derive(Parser)]
struct Eval {
    #[command(flatten)]
    args: EvalArgs,
}

fn evaluated(what: &[&str], truth: &Path, found: &Path) {
    let paths = [truth, found].map(|path| path.display().to_string());
    let words = ["eval"].iter().chain(what).copied().chain(paths.iter().map(String::as_str));
    let eval = Eval::try_parse_from(words).expect("these are its arguments");
    let _either_way = evaluate::run(&eval.args).is_ok();
}

/// The two sides of a text, parted by a line of `---`.
fn sides(text: &str) -> (&str, &str) {
    text.split_once("\n---\n").unwrap_or((text, text))
}

/// `swerve eval` of two files.
pub fn evaluate(what: &[&str], ending: &str, text: &str) {
    let (truth, found) = sides(text);
    let file = |name: &str, text: &str| Scratch::file(&format!("{name}.{ending}"), text.as_bytes());
    let (truth, found) = (file("truth", truth), file("found", found));
    evaluated(what, truth.path(), found.path());
}

/// `swerve eval` of two folders with a file each.
pub fn evaluate_folders(what: &[&str], text: &str) {
    let (truth, found) = sides(text);
    let file = |text: &str| Scratch::file("000000.txt", text.as_bytes());
    let (truth, found) = (file(truth), file(found));
    evaluated(what, truth.folder(), found.folder());
}
