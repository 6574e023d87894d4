//! Data from outside or from another process never makes a decoder panic: truncated, bit-flipped, shuffled.
//!
//! `SWERVE_FUZZ=1` runs many more cases.
#![expect(clippy::unwrap_used, reason = "a failed test says where")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use proptest::prelude::*;
use proptest::sample::Index;
use proptest::test_runner::RngSeed;
use serde::de::DeserializeOwned;
use swerve_core::Time;
use swerve_drive::{drive_pipeline, read_scenario, run_start};
use swerve_flow::{Decision, Event, Observer};
use swerve_log::{Log, Recorder};
use swerve_msg::truth::{PointInstances, WorldState};
use swerve_msg::{
    Closures, Command, Detections, EgoState, GateOutput, Gnss, Image, Imu, MotionCommand, ObstacleList, Plan,
    PointCloud, PredictionList, RadarScan, ResponseBudget, Route, RungTaken, SensorHealth, Supervision,
    Switch, TrackList, TrafficLights, VehicleReport, WheelOdometry, WireAlarm,
};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::config::execution::parse_policy;
use swerve_stack::pipeline::Pipeline;
use swerve_study::grid::Study;
use swerve_text::{Document, parse_assignment};

fn cases(short: u32) -> ProptestConfig {
    let cases = if std::env::var_os("SWERVE_FUZZ").is_some() { 200 * short } else { short };
    ProptestConfig {
        cases,
        failure_persistence: None,
        rng_seed: RngSeed::Fixed(7),
        ..ProptestConfig::default()
    }
}

/// A mutation of bytes.
#[derive(Clone, Debug)]
enum Change {
    Flip(Index, u8),
    Set(Index, u8),
    Cut(Index),
    Remove(Index, usize),
    /// Repeats a slice at another place.
    Repeat(Index, Index, usize),
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let change = prop_oneof![
        4 => (any::<Index>(), 0..8_u8).prop_map(|(at, bit)| Change::Flip(at, bit)),
        4 => (any::<Index>(), any::<u8>()).prop_map(|(at, value)| Change::Set(at, value)),
        1 => any::<Index>().prop_map(Change::Cut),
        1 => (any::<Index>(), 1..40_usize).prop_map(|(at, n)| Change::Remove(at, n)),
        1 => (any::<Index>(), any::<Index>(), 1..40_usize).prop_map(|(a, b, n)| Change::Repeat(a, b, n)),
    ];
    prop::collection::vec(change, 1..8)
}

fn changed(bytes: &[u8], changes: &[Change]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for change in changes {
        let len = bytes.len();
        if len == 0 {
            break;
        }
        match change {
            Change::Flip(at, bit) => bytes[at.index(len)] ^= 1 << bit,
            Change::Set(at, value) => bytes[at.index(len)] = *value,
            Change::Cut(at) => bytes.truncate(at.index(len)),
            Change::Remove(at, n) => {
                let at = at.index(len);
                bytes.drain(at..(at + n).min(len));
            }
            Change::Repeat(from, to, n) => {
                let from = from.index(len);
                let piece = bytes[from..(from + n).min(len)].to_vec();
                let to = to.index(len);
                bytes.splice(to..to, piece);
            }
        }
    }
    bytes
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// One second of a drive with a camera and a lidar.
struct Drive {
    /// One message of each stream, in the wire format and the log format.
    messages: Vec<(Vec<u8>, Vec<u8>)>,
    log: Vec<u8>,
}

#[derive(Default)]
struct Taker(BTreeMap<String, (Vec<u8>, Vec<u8>)>);

impl Observer for Taker {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        if let Some(payload) = publication.payload {
            let (mut wire, mut cbor) = (Vec::new(), Vec::new());
            payload.to_wire(&mut wire);
            payload.to_cbor(&mut cbor);
            self.0.insert(publication.stream.to_owned(), (wire, cbor));
        }
    }
}

static DRIVE: LazyLock<Drive> = LazyLock::new(|| {
    const SENSORS: &str = "
[camera.front]
width_px = 40
height_px = 20
period_ms = 200
[lidar.roof]
preset = 'vlp_32'
[monitor.eye]
sensor = 'front'
[monitor.ear]
sensor = 'roof'
";
    let config = Setup::from_document(&Document::parse("sensors", SENSORS).unwrap(), &[]).unwrap();
    let file = root().join("scenarios/person_behind_truck.toml");
    let mut pipeline = Pipeline::build(&config, &read_scenario(&file).unwrap()).unwrap();
    pipeline.until = Time::from_ms(400);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let mut recorder = Recorder::create(&path, &run_start(&config, &pipeline.scenario, &file)).unwrap();
    recorder.leave_out(|payload| payload.is::<PointCloud>() || payload.is::<PointInstances>());
    let mut taker = Taker::default();
    drive_pipeline(pipeline, 1, 1, &mut [&mut taker, &mut recorder]).unwrap();
    recorder.finish().unwrap();
    Drive { messages: taker.0.into_values().collect(), log: std::fs::read(&path).unwrap() }
});

/// Decodes both formats as one type. The result is not larger than the input allows.
fn read_as<T: DeserializeOwned>(wire: &[u8], cbor: &[u8]) {
    let _either_way = postcard::from_bytes::<T>(wire).is_ok();
    let _either_way = ciborium::from_reader::<T, _>(cbor).is_ok();
}

fn read_as_each(wire: &[u8], cbor: &[u8]) {
    macro_rules! each {
        ($($message:ty),* $(,)?) => { $(read_as::<$message>(wire, cbor);)* };
    }
    each!(
        swerve_msg::Decision,
        Closures,
        Command,
        Detections,
        EgoState,
        GateOutput,
        Gnss,
        Image,
        Imu,
        MotionCommand,
        ObstacleList,
        Plan,
        PointCloud,
        PredictionList,
        RadarScan,
        ResponseBudget,
        Route,
        RungTaken,
        SensorHealth,
        Supervision,
        Switch,
        TrackList,
        TrafficLights,
        VehicleReport,
        WheelOdometry,
        WireAlarm,
        WorldState,
        PointInstances,
        Decision,
    );
}

proptest! {
    #![proptest_config(cases(150))]

    /// A message mutated in transit decodes as another one or is refused.
    #[test]
    fn changed_messages_of_every_type_never_panic(which in any::<Index>(), changes in changes()) {
        let (wire, cbor) = which.get(&DRIVE.messages);
        read_as_each(&changed(wire, &changes), &changed(cbor, &changes));
    }

    #[test]
    fn random_messages_of_every_type_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        read_as_each(&bytes, &bytes);
    }
}

proptest! {
    #![proptest_config(cases(60))]

    /// A log yields its readable part and the run times in it.
    #[test]
    fn changed_logs_never_panic(changes in changes()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        std::fs::write(&path, changed(&DRIVE.log, &changes)).unwrap();
        if let Ok((log, _damage)) = Log::salvage(&path) {
            let _times = log.run_times();
            let _decisions = log.decisions().count();
        }
        let _either_way = Log::read(&path).is_ok();
    }
}

fn texts(folder: &str) -> Vec<String> {
    let mut files: Vec<_> =
        std::fs::read_dir(root().join(folder)).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let of_toml = files.into_iter().filter(|file| file.extension().is_some_and(|end| end == "toml"));
    of_toml.map(|file| std::fs::read_to_string(file).unwrap()).collect()
}

static SCENARIOS: LazyLock<Vec<String>> = LazyLock::new(|| texts("scenarios"));
static CONFIGS: LazyLock<Vec<String>> = LazyLock::new(|| [texts("configs"), texts("configs/live")].concat());
static STUDIES: LazyLock<Vec<String>> = LazyLock::new(|| texts("configs/studies"));

/// Replacements for a number.
const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "nan",
    "inf",
    "1e-300",
    "9223372036854775807",
    "-9223372036854775808",
    "0.1",
    "1000000",
    "\"\"",
    "[]",
    "true",
];

/// Replaces a number. The result is usually still TOML.
fn with_number(text: &str, which: Index, number: &str) -> String {
    let starts: Vec<usize> = text
        .match_indices(|c: char| c.is_ascii_digit())
        .map(|(at, _)| at)
        .filter(|at| text[..*at].ends_with([' ', '-', '[', '=']))
        .collect();
    if starts.is_empty() {
        return text.to_owned();
    }
    let start = starts[which.index(starts.len())];
    let rest = &text[start..];
    let end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || "._+-".contains(c))).unwrap_or(rest.len());
    format!("{}{number}{}", &text[..start], &rest[end..])
}

fn changed_text(text: &str, numbers: &[(Index, Index)], changes: &[Change]) -> String {
    let text = numbers.iter().fold(text.to_owned(), |text, (which, number)| {
        with_number(&text, *which, NUMBERS[number.index(NUMBERS.len())])
    });
    String::from_utf8_lossy(&changed(text.as_bytes(), changes)).into_owned()
}

fn numbers() -> impl Strategy<Value = Vec<(Index, Index)>> {
    prop::collection::vec(any::<(Index, Index)>(), 0..3)
}

/// No change in half of the cases.
fn some_changes() -> impl Strategy<Value = Vec<Change>> {
    prop_oneof![Just(Vec::new()), changes()]
}

proptest! {
    #![proptest_config(cases(250))]

    #[test]
    fn changed_scenarios_never_panic(which in any::<Index>(), numbers in numbers(), changes in some_changes()) {
        let text = changed_text(which.get::<String>(&SCENARIOS), &numbers, &changes);
        let _either_way = Scenario::parse("changed.toml", &text).is_ok();
    }

    #[test]
    fn changed_configurations_never_panic(which in any::<Index>(), numbers in numbers(), changes in some_changes()) {
        let text = changed_text(which.get::<String>(&CONFIGS), &numbers, &changes);
        if let Ok(document) = Document::parse("changed.toml", text) {
            let _either_way = Setup::from_document(&document, &[]).is_ok();
        }
    }

    #[test]
    fn changed_studies_never_panic(which in any::<Index>(), numbers in numbers(), changes in some_changes()) {
        // Written beside the shipped ones, because a study resolves its scenarios and configurations relative to its
        // file.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("changed.toml");
        std::fs::write(&path, changed_text(which.get::<String>(&STUDIES), &numbers, &changes)).unwrap();
        let _either_way = Study::read(&path, &[]).is_ok();
    }

    #[test]
    fn any_words_on_the_command_line_never_panic(words in ".{0,60}") {
        let _either_way = parse_assignment(&words).is_ok();
        let _either_way = parse_policy(&words).is_ok();
    }
}

/// The log without the seals in its last metadata record, as after tampering.
fn without_seals(log: &[u8]) -> Vec<u8> {
    const MAGIC: usize = 8;
    let (mut at, mut out) = (MAGIC, log[..MAGIC].to_vec());
    loop {
        let length = u64::from_le_bytes(log[at + 1..at + 9].try_into().unwrap()) as usize;
        let (opcode, mut body) = (log[at], log[at + 9..at + 9 + length].to_vec());
        at += 9 + length;
        let key = body.windows(9).position(|key| key == b"\x05\0\0\0seals").filter(|_| opcode == 0x0c);
        if let Some(key) = key {
            let of = |at: usize| u32::from_le_bytes(body[at..at + 4].try_into().unwrap()) as usize;
            let (map, value) = (4 + of(0), key + 9);
            let after = value + 4 + of(value);
            let rest = (of(map) - (after - key)) as u32;
            body[map..map + 4].copy_from_slice(&rest.to_le_bytes());
            body.drain(key..after);
        }
        out.push(opcode);
        out.extend((body.len() as u64).to_le_bytes());
        out.extend(body);
        if key.is_some() {
            break;
        }
    }
    for (opcode, body) in [(0x0f_u8, vec![0; 4]), (0x02, vec![0; 20])] {
        out.push(opcode);
        out.extend((body.len() as u64).to_le_bytes());
        out.extend(body);
    }
    [&out[..], &log[..MAGIC]].concat()
}

#[test]
fn verification_of_a_log_without_seals_fails_with_a_reason() {
    let bench = crate::support::Bench::new();
    bench.good(&["run", "short.toml", "--out", "o"]);
    bench.good(&["replay", "--verify", "o/log.mcap"]);
    let log = std::fs::read(bench.path("o/log.mcap")).unwrap();
    std::fs::write(bench.path("bare.mcap"), without_seals(&log)).unwrap();
    let said = bench.swerve(&["replay", "--verify", "bare.mcap"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(
        said.stderr.contains("bare.mcap: the log has no seals") && said.stdout.contains("tracker"),
        "{said:?}"
    );
    bench.good(&["replay", "bare.mcap"]);
}
