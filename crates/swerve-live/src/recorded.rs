//! Recorded drives instead of a vehicle: the same topics, types, mapping and clocks, in virtual time.
//!
//! Messages are played in order of their reception by the recorder. Everything computed is logged; commands are not
//! sent. The result is a function of the recording, the configuration and the seed.

mod clock;
mod order;
mod summary;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, mpsc};

use anyhow::Context as _;
use swerve_core::{Span, Time};
use swerve_drive::process::Processes;
use swerve_flow::{Observer, PlaybackRecord, RunOptions, run_virtual};
use swerve_log::{Bag, BagMessage, BagTopic};
use swerve_msg::Switch;
use swerve_ros2::Kind;
use swerve_ros2::bridge::Direction;
use swerve_ros2::cdr::{self, DecodeError};
use swerve_ros2::mapping::Role;

use super::graph::LiveGraph;
use super::intake::{Arrived, Input, Intake, TopicSummary, names};
use super::vehicle::interface;
use super::watch::{DriveStatus, Outlet};
use super::{Drive, DriveFiles, LiveArgs, wire};
use clock::Clock;
use order::Order;
use summary::Operator;

pub use summary::{Summary, TopicReport};
use swerve_stack::config::source::SourceConfig;
use swerve_stack::pipeline::Pipeline;

/// Delay from the first instant at which all required topics were heard to the simulated enabling request.
const PRESS_AFTER: Span = Span::from_ms(200);

/// A recording, converted to inputs.
#[derive(Default)]
pub struct Recording {
    /// Inputs for the graph, by source.
    records: BTreeMap<String, Vec<PlaybackRecord>>,
    last: BTreeMap<String, Time>,
    /// Counts by ROS topic name.
    pub topics: BTreeMap<String, TopicReport>,
    clock: Clock,
    /// Messages with an earlier time than a preceding one in the files.
    earlier: u64,
    /// Messages on channels that the recording does not describe.
    pub strays: u64,
    /// Messages that reached a stream no later than their predecessor.
    pub late: u64,
    /// Reasons why reading ended before the recording did.
    pub cut_off: Vec<String>,
    pressed: Option<Time>,
    end: Time,
}

/// Topics that are read, by ROS name, each with its name in the mapping and its type.
fn wanted(drive: &Drive) -> BTreeMap<String, (String, Kind)> {
    let Drive { live, mapping, .. } = drive;
    let mut wanted = BTreeMap::new();
    for endpoint in wire::options(mapping, live).endpoints {
        // Recorded switches are ignored; the simulated one is used.
        let role = mapping.topic(&endpoint.name).map(|topic| topic.role);
        let switch = matches!(role, Some(Role::Enable | Role::Disable | Role::Emergency));
        if endpoint.direction == Direction::Receive && !switch {
            wanted.insert(endpoint.topic, (endpoint.name, endpoint.kind));
        }
    }
    wanted
}

impl Recording {
    /// Reads the files of a recording, in order.
    ///
    /// # Errors
    /// If the first file cannot be read or contains no message.
    pub fn read(files: &[PathBuf], drive: &Drive) -> anyhow::Result<Self> {
        let Drive { config, mapping, .. } = drive;
        let wanted = wanted(drive);
        let mut recording = Self::default();
        let order = recording.in_order(files, &wanted)?;
        recording.earlier = order.earlier;
        let mut intake = None;
        for (topic, message) in order.sorted() {
            let intake = intake.get_or_insert_with(|| {
                let epoch_ns = i64::try_from(message.received_ns).unwrap_or(i64::MAX);
                Intake::new(mapping, interface(mapping.vehicle, config), config, epoch_ns)
            });
            recording.take(&topic, &message, &wanted, intake);
        }
        let why = recording.cut_off.join("; ");
        let none = || match why.is_empty() {
            true => format!(
                "{}: no messages",
                files.first().map_or_else(String::new, |f| f.display().to_string())
            ),
            false => format!("no messages that can be read: {why}"),
        };
        let intake = intake.with_context(none)?;
        recording.conclude(&intake);
        Ok(recording)
    }

    /// Messages of all files in order. Data is kept only for topics that are read.
    fn in_order(
        &mut self,
        files: &[PathBuf],
        wanted: &BTreeMap<String, (String, Kind)>,
    ) -> anyhow::Result<Order> {
        let mut order = Order::default();
        for file in files {
            let mut bag = Bag::open(file)?;
            let mut topics = Vec::new();
            loop {
                match bag.next_message() {
                    Ok(None) => break,
                    Ok(Some(mut message)) => {
                        topics.extend(bag.topics()[topics.len()..].iter().cloned().map(Arc::new));
                        let topic = &topics[message.topic];
                        if !wanted.contains_key(&topic.name) {
                            message.data = Vec::new();
                        }
                        order.add(topic, message);
                    }
                    // The messages before the damage are usable.
                    Err(error) => {
                        self.cut_off.push(error.to_string());
                        break;
                    }
                }
            }
            self.strays += bag.strays();
        }
        Ok(order)
    }

    /// Collects the intake's counts and adds the simulated enabling request.
    fn conclude(&mut self, intake: &Intake) {
        for TopicSummary { name, tally, clock, .. } in intake.tallies() {
            if let Some(topic) = self.topics.values_mut().find(|t| t.name.as_deref() == Some(name)) {
                topic.used = tally.used;
                topic.refused.add(&tally.refused);
                topic.last_refusal = tally.last_refusal.clone().or(topic.last_refusal.take());
                let known = clock.offset();
                topic.clock_offset_ms = known.map(|known| known.offset.as_ms());
                topic.clock_spread_ms = known.map(|known| known.spread.as_ms());
            }
        }
        self.press();
    }

    fn take(
        &mut self,
        topic: &BagTopic,
        message: &BagMessage,
        wanted: &BTreeMap<String, (String, Kind)>,
        intake: &mut Intake,
    ) {
        let known = wanted.get(&topic.name);
        let report = self
            .topics
            .entry(topic.name.clone())
            .or_insert_with(|| TopicReport::new(topic, known.map(|(name, _)| name.clone())));
        report.messages += 1;
        let Some((name, kind)) = known else { return };
        if topic.encoding != "cdr" || topic.type_name != kind.type_name() {
            report.wrong_type += 1;
            let BagTopic { type_name, encoding, .. } = topic;
            report.last_refusal = Some(format!("it is {type_name} in {encoding}, not {kind} in cdr"));
            return;
        }
        let Some(now) = self.clock.time(message.received_ns) else {
            report.impossible_time += 1;
            return;
        };
        self.end = self.end.max(now);
        let message = match cdr::decode_any(*kind, &message.data) {
            Ok(message) => message,
            Err(error) => {
                let invalid = matches!(error, DecodeError::Invalid { .. });
                *(if invalid { &mut report.refused.implausible } else { &mut report.malformed }) += 1;
                report.last_refusal = Some(error.to_string());
                return;
            }
        };
        let mut out = Vec::new();
        intake.take(name, &message, now, &mut out);
        out.into_iter().for_each(|arrived| self.keep(arrived));
    }

    fn keep(&mut self, arrived: Arrived) {
        let source = arrived.source().to_owned();
        // Two topics may provide the same quantity: the stream takes the newer message.
        if self.last.get(&source).is_some_and(|last| arrived.stamp <= *last) {
            self.late += 1;
            return;
        }
        self.last.insert(source.clone(), arrived.stamp);
        let needed = [names::POSE, names::REPORT].iter().all(|source| self.last.contains_key(*source));
        if needed && self.pressed.is_none() {
            self.pressed = Some(arrived.at + PRESS_AFTER);
        }
        self.records.entry(source).or_default().push(arrived.record());
    }

    /// Adds the simulated enabling request, once.
    fn press(&mut self) {
        for (at, enable) in [(Some(Time::ZERO), false), (self.pressed, true)] {
            if let Some(at) = at {
                let switch = Switch { enable, emergency: false };
                self.keep(Arrived { at, stamp: at, input: Input::Switch(switch) });
            }
        }
    }
}

/// Lists the files of a recording in the order of their numbers.
///
/// # Errors
/// If there are no files.
pub fn files(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let reading = || format!("reading {}", path.display());
    let mut files = Vec::new();
    for entry in path.read_dir().with_context(reading)? {
        let file = entry.with_context(reading)?.path();
        if file.extension().is_some_and(|extension| extension == "mcap") {
            files.push(file);
        }
    }
    // rosbag2 numbers files without leading zeros.
    files.sort_by_key(|file| (file.as_os_str().len(), file.clone()));
    anyhow::ensure!(!files.is_empty(), "{}: there is no .mcap file in this folder", path.display());
    Ok(files)
}

/// Runs `swerve live` on a recorded drive.
pub(super) fn run(
    args: &LiveArgs,
    drive: &Drive,
    source: &SourceConfig,
    mut written: DriveFiles,
) -> anyhow::Result<()> {
    let folder = args.config.parent().unwrap_or(Path::new(""));
    let path = folder.join(&source.rosbag);
    let recording = files(&path).and_then(|files| Recording::read(&files, drive));
    let mut recording = recording.map_err(|error| args.wrong_file("source.rosbag", &error))?;
    let LiveGraph { mut pipeline, inputs } = LiveGraph::build(&drive.config, &drive.scenario)?;
    let _processes = Processes::start_all(&drive.config, &mut pipeline)?;
    let Pipeline { mut graph, route, .. } = pipeline;
    let sources: Vec<String> = graph.sources().map(str::to_owned).collect();
    for name in sources {
        graph.playback(&name, recording.records.remove(&name).unwrap_or_default())?;
    }
    drop(inputs);
    let mut end = recording.end;
    if let Some(seconds) = args.seconds {
        end = end.min(Time::ZERO + Span::from_secs(seconds));
    }
    let (orders, nobody) = mpsc::channel();
    drop(nobody);
    let mut outlet = Outlet::new(orders, Arc::new(Mutex::new(DriveStatus::default())), route);
    let options = RunOptions::until(end).seed(drive.config.seed).threads(args.threads);
    let report = {
        let observers: Vec<&mut dyn Observer> = vec![&mut outlet, &mut written.recorder, &mut written.trace];
        run_virtual(graph, &options, observers)
    };
    let part = written.finish()?;
    let report = report?;
    let out = part.name_whole()?;
    let operators = report.operators.iter().map(|o| Operator {
        operator: o.name.clone(),
        steps: o.steps,
        drops: o.drops.total(),
    });
    let summary = Summary {
        configuration: args.config.display().to_string(),
        rosbag: path.display().to_string(),
        cut_off: recording.cut_off,
        digest: report.digest.to_string(),
        seconds: end.as_secs(),
        earlier: recording.earlier,
        clock_jumps: recording.clock.jumps,
        strays: recording.strays,
        late: recording.late,
        topics: recording.topics.into_values().collect(),
        drive: outlet.conclude(),
        operators: operators.collect(),
    };
    let json = serde_json::to_string_pretty(&summary)? + "\n";
    let place = out.conclude("report.html, log.mcap, trace.json", &json)?;
    drive.report(&out.path)?;
    swerve_report::output::print(&if args.json { json } else { summary.text() + &place })
}

#[cfg(test)]
mod tests;
