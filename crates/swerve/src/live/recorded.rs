//! A recorded drive in the place of a vehicle: the same topics, types, mapping and clocks, in virtual time.
//!
//! What the recorder's host noted as the time of receipt is the time at which a message comes. All that is computed is
//! logged; commands go nowhere. The result is a function of the recording, the configuration and the seed.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, mpsc};

use anyhow::Context as _;
use serde::Serialize;
use swerve_core::{Span, Time};
use swerve_flow::{Observer, PlaybackRecord, RunOptions, run_virtual};
use swerve_log::{Bag, BagMessage, BagTopic, Recorder, TraceWriter};
use swerve_msg::Switch;
use swerve_ros2::Kind;
use swerve_ros2::bridge::Direction;
use swerve_ros2::cdr::{self, DecodeError};
use swerve_ros2::mapping::Role;

use super::graph::LiveGraph;
use super::intake::{Arrived, Input, Intake, Refusals};
use super::vehicle::interface;
use super::watch::{DriveFigures, Lamp, Outlet};
use super::{Drive, LiveArgs, wire};
use crate::config::source::SourceConfig;
use crate::output::align;

/// A message this much earlier than the newest before it came out of turn; one that is earlier still has no true time.
const EARLIER_MAX: Span = Span::from_ms(1000);
/// No more than this lies between two messages of a drive.
const GAP_MAX: Span = Span::from_ms(60_000);
/// So many messages in a row whose times agree with one another are a clock that was set, or a pause.
const AGREE: u32 = 20;
/// Between the first time at which all that is needed was heard, and the press on the simulated switch.
const PRESS_AFTER: Span = Span::from_ms(200);

/// From the recorder's time to the time of the run, which never runs backwards.
#[derive(Default)]
struct Clock {
    /// What the recorder's clock shows at the run's time zero, ns; nothing before the first message.
    zero_ns: Option<i128>,
    newest_ns: i128,
    /// The newest time that could not be, and how many before it agreed with it.
    odd: Option<(i128, u32)>,
    earlier: u64,
    jumps: u64,
}

impl Clock {
    /// When a message comes; nothing where its time cannot be true.
    fn time(&mut self, received_ns: u64) -> Option<Time> {
        let received_ns = i128::from(received_ns);
        let zero_ns = *self.zero_ns.get_or_insert(received_ns);
        let lead_ns = received_ns - zero_ns - self.newest_ns;
        let may_be = -i128::from(EARLIER_MAX.ns())..=i128::from(GAP_MAX.ns());
        if may_be.contains(&lead_ns) {
            self.odd = None;
            self.earlier += u64::from(lead_ns < 0);
            self.newest_ns += lead_ns.max(0);
        } else {
            let agreeing = match self.odd {
                Some((before_ns, n)) if may_be.contains(&(received_ns - before_ns)) => n + 1,
                _ => 1,
            };
            self.odd = Some((received_ns, agreeing));
            if agreeing < AGREE {
                return None;
            }
            self.odd = None;
            self.jumps += 1;
            self.zero_ns = Some(received_ns - self.newest_ns);
        }
        i64::try_from(self.newest_ns).ok().map(Time::from_ns)
    }
}

/// What became of the messages of a topic.
#[derive(Serialize, Clone, Debug, Default)]
pub struct TopicReport {
    /// Its name in ROS.
    pub topic: String,
    /// Its type, as the recording says.
    #[serde(rename = "type")]
    pub kind: String,
    /// What it is called in the mapping; nothing where nobody asks for it.
    pub name: Option<String>,
    /// Messages in the recording.
    pub messages: u64,
    /// Messages that were used.
    pub used: u64,
    /// Messages of another type than the mapping's, or not in plain CDR.
    pub wrong_type: u64,
    /// Bytes that are no such message.
    pub malformed: u64,
    /// Messages whose time of receipt cannot be.
    pub impossible_time: u64,
    /// Messages that were refused for what they say.
    #[serde(flatten)]
    pub refused: Refusals,
    /// Why the newest was not used.
    pub last_refusal: Option<String>,
    /// The recorder's clock minus the stamps' clock, ms: of the fastest message.
    pub clock_offset_ms: Option<f64>,
    /// What is not known of that, ms.
    pub clock_spread_ms: Option<f64>,
}

impl TopicReport {
    fn of(topic: &BagTopic, name: Option<String>) -> Self {
        let (topic, kind) = (topic.name.clone(), topic.type_name.clone());
        Self { topic, kind, name, ..Self::default() }
    }
}

/// A recording, taken in.
#[derive(Default)]
pub struct Recording {
    /// What the graph is fed with, by source.
    records: BTreeMap<String, Vec<PlaybackRecord>>,
    last: BTreeMap<String, Time>,
    /// What became of the topics, by their names in ROS.
    pub topics: BTreeMap<String, TopicReport>,
    clock: Clock,
    /// Messages of channels that the recording does not describe.
    pub strays: u64,
    /// Messages that came to a stream no later than the one before them.
    pub late: u64,
    /// Why reading ended before the recording did.
    pub cut_off: Vec<String>,
    pressed: Option<Time>,
    end: Time,
}

/// The topics that are heard, by their names in ROS: what each is called in the mapping, and its type.
fn wanted(drive: &Drive) -> BTreeMap<String, (String, Kind)> {
    let Drive { live, mapping, .. } = drive;
    let mut wanted = BTreeMap::new();
    for endpoint in wire::options(mapping, live).endpoints {
        // A person's switch that was recorded presses nothing: the simulated one does.
        let role = mapping.topic(&endpoint.name).map(|topic| topic.role);
        let switch = matches!(role, Some(Role::Enable | Role::Disable | Role::Emergency));
        if endpoint.direction == Direction::Receive && !switch {
            wanted.insert(endpoint.topic, (endpoint.name, endpoint.kind));
        }
    }
    wanted
}

impl Recording {
    /// Takes in the files of a recording, in order.
    ///
    /// # Errors
    /// The first file cannot be read, or holds no message.
    pub fn read(files: &[PathBuf], drive: &Drive) -> anyhow::Result<Self> {
        let Drive { config, mapping, .. } = drive;
        let wanted = wanted(drive);
        let mut recording = Self::default();
        let mut intake = None;
        for file in files {
            let mut bag = Bag::open(file)?;
            loop {
                match bag.next_message() {
                    Ok(None) => break,
                    Ok(Some(message)) => {
                        let intake = intake.get_or_insert_with(|| {
                            let epoch_ns = i64::try_from(message.received_ns).unwrap_or(i64::MAX);
                            Intake::new(mapping, interface(mapping.vehicle, config), config, epoch_ns)
                        });
                        recording.take(&bag.topics()[message.topic], &message, &wanted, intake);
                    }
                    // What came before is a drive, too.
                    Err(error) => {
                        recording.cut_off.push(error.to_string());
                        break;
                    }
                }
            }
            recording.strays += bag.strays();
        }
        let told = || recording.cut_off.join("; ");
        let intake = intake.with_context(|| format!("there is no message in it; {}", told()))?;
        recording.conclude(&intake);
        Ok(recording)
    }

    /// Counts what the intake made of the messages, and has the switch pressed.
    fn conclude(&mut self, intake: &Intake) {
        for (name, _, tally, clock) in intake.tallies() {
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
            .or_insert_with(|| TopicReport::of(topic, known.map(|(name, _)| name.clone())));
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
        // Two topics may tell the same: the stream takes what is newer.
        if self.last.get(&source).is_some_and(|last| arrived.stamp <= *last) {
            self.late += 1;
            return;
        }
        self.last.insert(source.clone(), arrived.stamp);
        let needed = ["pose", "vehicle"].iter().all(|source| self.last.contains_key(*source));
        if needed && self.pressed.is_none() {
            self.pressed = Some(arrived.at + PRESS_AFTER);
        }
        self.records.entry(source).or_default().push(arrived.record());
    }

    /// The simulated person presses the switch once.
    fn press(&mut self) {
        for (at, enable) in [(Some(Time::ZERO), false), (self.pressed, true)] {
            if let Some(at) = at {
                let switch = Switch { enable, emergency: false };
                self.keep(Arrived { at, stamp: at, input: Input::Switch(switch) });
            }
        }
    }
}

/// What a recorded drive came to.
#[derive(Serialize, Debug)]
pub struct Summary {
    configuration: String,
    rosbag: String,
    /// Why not all of it was read.
    cut_off: Vec<String>,
    /// Over all messages: the same from one call to the next.
    digest: String,
    seconds: f64,
    /// Messages that came out of turn by the recorder's clock.
    earlier: u64,
    /// How often the recorder's clock was set, or the recording paused.
    clock_jumps: u64,
    /// Messages of channels that the recording does not describe.
    strays: u64,
    /// Messages that came to a stream no later than the one before them.
    late: u64,
    topics: Vec<TopicReport>,
    drive: DriveFigures,
    operators: Vec<Operator>,
}

#[derive(Serialize, Debug)]
struct Operator {
    operator: String,
    steps: u64,
    drops: u64,
}

/// The files of a recording, in the order in which they were written.
///
/// # Errors
/// There are none.
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
    // rosbag2 numbers them without leading zeros.
    files.sort_by_key(|file| (file.as_os_str().len(), file.clone()));
    anyhow::ensure!(!files.is_empty(), "{}: there is no .mcap file in this folder", path.display());
    Ok(files)
}

/// Runs `swerve live` on a recorded drive.
pub(super) fn run(
    args: &LiveArgs,
    drive: &Drive,
    source: &SourceConfig,
    (mut recorder, mut trace, out): (Recorder, TraceWriter, &Path),
) -> anyhow::Result<()> {
    let folder = args.config.parent().unwrap_or(Path::new(""));
    let path = folder.join(&source.rosbag);
    let mut recording = Recording::read(&files(&path)?, drive)
        .with_context(|| format!("source.rosbag: {}", path.display()))?;
    let LiveGraph { mut graph, inputs, route } = LiveGraph::build(&drive.config, &drive.scenario)?;
    for name in inputs.sources() {
        graph.playback(name, recording.records.remove(name).unwrap_or_default())?;
    }
    drop(inputs);
    let mut end = recording.end;
    if let Some(seconds) = args.seconds {
        end = end.min(Time::ZERO + Span::from_secs(seconds));
    }
    let (orders, nobody) = mpsc::channel();
    drop(nobody);
    let mut outlet = Outlet::new(orders, Arc::new(Mutex::new(Lamp::default())), route);
    let options = RunOptions::until(end).seed(drive.config.seed).threads(args.threads);
    let report = {
        let observers: Vec<&mut dyn Observer> = vec![&mut outlet, &mut recorder, &mut trace];
        run_virtual(graph, &options, observers)
    };
    // What was recorded until a failure is kept, readable.
    recorder.finish()?;
    trace.finish()?;
    let report = report?;
    super::name_whole(out)?;
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
        earlier: recording.clock.earlier,
        clock_jumps: recording.clock.jumps,
        strays: recording.strays,
        late: recording.late,
        topics: recording.topics.into_values().collect(),
        drive: outlet.conclude(),
        operators: operators.collect(),
    };
    let json = serde_json::to_string_pretty(&summary)? + "\n";
    crate::files::write_whole(&out.join("metrics.json"), json.as_bytes())?;
    crate::output::print(&if args.json { json } else { summary.text(out) })
}

impl Summary {
    fn text(&self, out: &Path) -> String {
        let mut text = format!("{}, {:.1} s of {}\n", self.configuration, self.seconds, self.rosbag);
        for cut_off in &self.cut_off {
            let _ = writeln!(text, "not read to its end: {cut_off}");
        }
        let Self { earlier, clock_jumps, strays, late, .. } = self;
        for (n, what) in [
            (earlier, "messages came out of turn"),
            (clock_jumps, "times the recorder's clock was set, or the recording paused"),
            (strays, "messages of channels that are not described"),
            (late, "messages were no newer than what their stream had"),
        ] {
            if *n > 0 {
                let _ = writeln!(text, "{n} {what}");
            }
        }
        let head = ["topic", "messages", "used", "refused", "clock ms", "spread ms"];
        let (known, unknown): (Vec<_>, Vec<_>) = self.topics.iter().partition(|topic| topic.name.is_some());
        let row = |t: &&TopicReport| {
            let ms = |ms: Option<f64>| ms.map_or_else(|| "-".into(), |ms| format!("{ms:.2}"));
            let refused = t.refused.total() + t.wrong_type + t.malformed + t.impossible_time;
            let counts = [t.messages, t.used, refused].map(|n| n.to_string());
            let clock = [ms(t.clock_offset_ms), ms(t.clock_spread_ms)];
            std::iter::once(t.topic.clone()).chain(counts).chain(clock).collect()
        };
        text += &align(
            &std::iter::once(head.map(str::to_owned).to_vec())
                .chain(known.iter().map(row))
                .collect::<Vec<_>>(),
        );
        for topic in &known {
            if let Some(why) = &topic.last_refusal {
                let _ = writeln!(text, "{}: {why}", topic.topic);
            }
        }
        for topic in unknown {
            let _ =
                writeln!(text, "{}: nobody asks for it ({} of {})", topic.topic, topic.messages, topic.kind);
        }
        let head = ["operator", "steps", "drops"].map(str::to_owned).to_vec();
        let row = |o: &Operator| vec![o.operator.clone(), o.steps.to_string(), o.drops.to_string()];
        text += &align(&std::iter::once(head).chain(self.operators.iter().map(row)).collect::<Vec<_>>());
        let _ = writeln!(text, "digest {}", self.digest);
        let _ = writeln!(text, "in {}: log.mcap, trace.json, metrics.json", out.display());
        text
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::Rng;
    use swerve_ros2::AnyMessage;
    use swerve_ros2::samples::sample;
    use swerve_text::Document;

    use super::*;
    use crate::config::Config;

    const S: u64 = 1_000_000_000;

    #[test]
    fn time_never_runs_backwards_and_goes_on_after_a_jump() {
        let mut clock = Clock::default();
        let mut at = |ns: u64| clock.time(ns).map(|time| time.as_secs());
        assert_eq!(at(100 * S), Some(0.0));
        assert_eq!(at(102 * S), Some(2.0));
        assert_eq!(at(101 * S + S / 2), Some(2.0), "out of turn");
        assert_eq!((at(90 * S), at(u64::MAX), at(0)), (None, None, None));
        assert_eq!(at(103 * S), Some(3.0));
        // An hour later, and it stays so.
        let later: Vec<_> = (0..25).map(|i| at(3700 * S + i * S)).collect();
        assert!(later[..19].iter().all(Option::is_none), "{later:?}");
        assert_eq!((later[19], later[24]), (Some(3.0), Some(8.0)));
        assert_eq!((clock.earlier, clock.jumps), (1, 1));
    }

    fn drive() -> Drive {
        let text = "[live]\nroute = \"lane.toml\"\n[control]\ncontroller = \"stanley\"\n[camera.camera]\n[lidar.lidar]\n";
        let config = Config::from_document(&Document::parse("c.toml", text).unwrap(), &[]).unwrap();
        let mapping = config.ros2_mapping().unwrap();
        let live = config.live.clone().unwrap();
        let route = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/lane.toml"));
        let scenario = crate::run::read_scenario(&route).unwrap();
        Drive { config, live, mapping, scenario, route }
    }

    /// Messages of all topics, sound and with bytes changed or cut off, at times that are true or not: what is used
    /// has increasing stamps, the rest is counted, and the graph runs on it.
    #[test]
    fn whatever_a_log_holds_is_used_or_counted() {
        let drive = drive();
        let wanted = wanted(&drive);
        let mut rng = Rng::keyed(7, "bag", &[]);
        let epoch = 1_700_000_000 * S;
        let mut intake = Intake::new(
            &drive.mapping,
            interface(drive.mapping.vehicle, &drive.config),
            &drive.config,
            epoch as i64,
        );
        let mut recording = Recording::default();
        let kinds: Vec<(&String, &(String, Kind))> = wanted.iter().collect();
        for i in 0..4000_u64 {
            let (topic, (_, kind)) = kinds[(rng.bits() % kinds.len() as u64) as usize];
            let mut message = sample(*kind);
            let stamp = swerve_ros2::msg::builtin_interfaces::Time::from_ns((epoch + i * S / 100) as i64);
            match &mut message {
                AnyMessage::Odometry(m) => {
                    (m.header.stamp, m.header.frame_id, m.child_frame_id) =
                        (stamp, "map".into(), "base_link".into());
                }
                AnyMessage::VelocityReport(m) => m.header.stamp = stamp,
                AnyMessage::SteeringReport(m) => m.stamp = stamp,
                AnyMessage::ControlModeReport(m) => m.stamp = stamp,
                AnyMessage::PointCloud2(m) => m.header.stamp = stamp,
                _ => {}
            }
            let mut data = cdr::encode(&message);
            for _ in 0..rng.bits() % 3 {
                let at = (rng.bits() % data.len() as u64) as usize;
                data[at] ^= rng.bits() as u8;
            }
            if rng.bits().is_multiple_of(8) {
                data.truncate((rng.bits() % data.len() as u64) as usize);
            }
            let received_ns = if rng.bits().is_multiple_of(50) { rng.bits() } else { epoch + i * S / 100 };
            let topic = BagTopic { name: topic.clone(), type_name: kind.type_name(), encoding: "cdr".into() };
            recording.take(&topic, &BagMessage { topic: 0, received_ns, data }, &wanted, &mut intake);
        }
        recording.conclude(&intake);
        for topic in recording.topics.values() {
            let refused = topic.refused.total() + topic.wrong_type + topic.malformed + topic.impossible_time;
            assert_eq!(topic.used + refused, topic.messages, "{topic:?}");
        }
        let all: u64 = recording.topics.values().map(|topic| topic.messages).sum();
        let used: u64 = recording.topics.values().map(|topic| topic.used).sum();
        assert!(all == 4000 && used > 500, "{used} of {all}");
        assert!(recording.records["pose"].len() > 50 && recording.records["lidar"].len() > 10);
        let LiveGraph { mut graph, inputs, .. } = LiveGraph::build(&drive.config, &drive.scenario).unwrap();
        for name in inputs.sources() {
            graph.playback(name, recording.records.remove(name).unwrap_or_default()).unwrap();
        }
        run_virtual(graph, &RunOptions::until(recording.end), Vec::new()).unwrap();
    }
}
