//! Shared parts of the fuzz targets. `run` in this folder runs them.

use std::path::{Path, PathBuf};

use clap::Parser;
use serde::de::DeserializeOwned;
use swerve_core::{Hasher, Time};
use swerve_flow::{Decision, Worker};
use swerve_map::LaneIndex;
use swerve_map_io::lane_map::LaneMap;
use swerve_map_io::overview::Overview;
use swerve_map_io::picture;
use swerve_measure::evaluate::{self, EvalArgs};
use swerve_msg::truth::{PointInstances, WorldState};
use swerve_msg::{
    Command, Detections, EgoState, GateOutput, Gnss, Image, Imu, MotionCommand, ObstacleList, Plan,
    PointCloud, PredictionList, RadarScan, ResponseBudget, RungTaken, SensorHealth, Supervision, Switch,
    TrackList, VehicleReport, WheelOdometry,
};
use swerve_planning::{Budget, Progress};
use swerve_scenario::Scenario;
use swerve_stack::pipeline::Pipeline;
use swerve_stack::{Registry, Setup};
use swerve_text::Document;
use tempfile::TempDir;

/// Describes and draws a lane map, and makes its index.
pub fn shown(lanes: &LaneMap, bytes: usize) {
    let overview = Overview::of(&lanes.map, bytes);
    let _text = overview.text("fuzz", lanes);
    let _json = overview.json("fuzz", lanes);
    let _index = LaneIndex::new(&lanes.map);
    if let Some(extent_m) = overview.extent_m {
        let _picture = picture::lanes::draw(&lanes.map, extent_m, "fuzz", None);
    }
    for lane in lanes.map.lanes() {
        let width_m = lane.width_m(0.5 * lane.line.length());
        assert!(width_m.is_finite() && width_m >= 0.0 && lane.line.length() > 0.0);
    }
}

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
    let config = Setup::from_document(&config, &[]).expect("it is a configuration");
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

fn evaluated(what: &[&str], files: &[&Path]) {
    let paths: Vec<String> = files.iter().map(|path| path.display().to_string()).collect();
    let words = ["eval"].iter().chain(what).copied().chain(paths.iter().map(String::as_str));
    let eval = Eval::try_parse_from(words).expect("these are its arguments");
    let _either_way = evaluate::run(&eval.args, &Registry::standard()).is_ok();
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
    evaluated(what, &[truth.path(), found.path()]);
}

/// `swerve eval` of one file.
pub fn evaluate_one(what: &[&str], ending: &str, text: &str) {
    let file = Scratch::file(&format!("records.{ending}"), text.as_bytes());
    evaluated(what, &[file.path()]);
}

/// `swerve eval` of two folders with a file each.
pub fn evaluate_folders(what: &[&str], text: &str) {
    let (truth, found) = sides(text);
    let file = |text: &str| Scratch::file("000000.txt", text.as_bytes());
    let (truth, found) = (file(truth), file(found));
    evaluated(what, &[truth.folder(), found.folder()]);
}

/// A drive of two cars and a person for a second, in CommonRoad's rows.
pub fn recording() -> String {
    let mut text = "scenario,id,type,length_m,width_m,step,x_m,y_m,heading_rad,speed_mps\n".to_owned();
    for step in 0..10 {
        for (id, row) in ["car,4.5,1.8", "truck,9,2.5", "pedestrian,0.5,0.5"].iter().enumerate() {
            let (x_m, y_m) = (2.0 + 0.9 * f64::from(step) / (1.0 + id as f64), 1.75 - 1.5 * id as f64);
            text += &format!("A-1,{id},{row},{step},{x_m},{y_m},0,9\n");
        }
    }
    text
}

// A changed byte would be refused by its checksum alone: what lies behind that is reached with checksums that are right.

/// A map's file with the digest of its bytes.
pub fn map_with_digest(mut bytes: Vec<u8>) -> Vec<u8> {
    if let Some((body, digest)) = bytes.split_last_chunk_mut::<8>() {
        let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        *digest = body.iter().fold(0xcbf2_9ce4_8422_2325, step).to_le_bytes();
    }
    bytes
}

/// A predictor's weights with the digest of its bytes, which stands behind eight letters and a version.
pub fn weights_with_digest(mut bytes: Vec<u8>) -> Vec<u8> {
    if let Some((digest, rest)) = bytes.get_mut(9..).and_then(|bytes| bytes.split_first_chunk_mut::<8>()) {
        let mut hasher = Hasher::new();
        hasher.bytes(rest);
        *digest = hasher.digest().0.to_le_bytes();
    }
    bytes
}

/// A zip archive with the checksums of its members that are not packed.
pub fn zip_with_checksums(mut bytes: Vec<u8>) -> Vec<u8> {
    let entries = (0..bytes.len()).filter(|at| bytes[*at..].starts_with(b"PK\x01\x02"));
    for at in entries.collect::<Vec<_>>() {
        if let Some(checksum) = checksum(&bytes, at) {
            bytes[at + 16..at + 20].copy_from_slice(&checksum.to_le_bytes());
        }
    }
    bytes
}

/// That of the member which the directory of an archive lists at a place.
fn checksum(bytes: &[u8], at: usize) -> Option<u32> {
    let number = |at: usize, count: usize| {
        let read = bytes.get(at..at + count)?;
        Some(read.iter().rev().fold(0, |n, byte| n << 8 | usize::from(*byte)))
    };
    let header = number(at + 42, 4)?;
    let data = header + 30 + number(header + 26, 2)? + number(header + 28, 2)?;
    bytes.get(data..data + number(at + 20, 4)?).map(crc32fast::hash)
}
