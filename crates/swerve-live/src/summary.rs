//! Summary of a drive, for `metrics.json` and the terminal.

use std::fmt::Write as _;

use serde::Serialize;
use swerve_core::{Span, Time};
use swerve_flow::{OperatorReport, TickReport};
use swerve_msg::{GateMode, StopCause};
use swerve_report::output::align;
use swerve_ros2::bridge::{Refused, TopicStatistics};

use super::drive::{Drive, Driven, located_by};
use super::intake::{TopicSummary, TopicTally};
use super::reason::mode_words;
use super::sink::SinkReport;
use super::time::TopicClock;
use super::watch::{DriveFigures, ModeChange};

/// Offset from which a clock is considered to have another origin than the host's, milliseconds.
const OTHER_BEGINNING_MS: f64 = 60e3;

/// Time within which a stop is noticed, seconds.
const NOTICED_S: f64 = 1.0;

/// Metrics of a drive, with the reason of each stop at the change of the mode.
fn with_reasons(driven: &Driven) -> DriveFigures {
    let mut figures = driven.figures.clone();
    let mut latest = None;
    for change in &mut figures.modes {
        if let GateMode::Stopping(cause) = change.mode {
            let is_it = |(at, of, _): &&(Time, StopCause, String)| {
                *of == cause && (at.as_secs() - change.at_s).abs() < NOTICED_S
            };
            latest = driven.feed.reasons.iter().find(is_it);
        }
        if change.mode.brakes() {
            change.reason = latest.map(|(_, _, reason)| reason.clone());
        }
    }
    figures
}

/// Result of a drive.
#[derive(Serialize, Debug)]
pub struct Summary {
    configuration: String,
    vehicle: &'static str,
    /// Reason for the end.
    ended: String,
    /// Digest of all messages, as in a simulated run.
    digest: Option<String>,
    seconds: f64,
    /// True if all required topics were present at the same time.
    was_ready: bool,
    drive: DriveFigures,
    sink: SinkReport,
    /// Messages dropped because the engine did not keep up.
    not_taken: u64,
    /// Number of times that the transport process ended or hung and was restarted.
    transports_lost: u64,
    topics: Vec<Topic>,
    /// Accuracy of timers on the real clock, by operator.
    timers: Vec<Timer>,
    operators: Vec<Operator>,
}

#[derive(Serialize, Debug)]
struct Timer {
    operator: String,
    #[serde(flatten)]
    ticks: TickReport,
}

#[derive(Serialize, Debug)]
struct Operator {
    operator: String,
    steps: u64,
    drops: u64,
    mean_ms: f64,
}

/// Counts of a topic.
#[derive(Serialize, Debug)]
struct Topic {
    name: String,
    topic: String,
    /// Number of matched peers.
    matched: usize,
    /// Peers with incompatible quality of service.
    incompatible: u64,
    /// Description of a peer whose type or quality of service differs.
    mismatch: Option<String>,
    needed: bool,
    received: u64,
    used: u64,
    published: u64,
    not_published: u64,
    rate_hz: Option<f64>,
    latency_p50_ms: Option<f64>,
    latency_p99_ms: Option<f64>,
    lost: u64,
    overwritten: u64,
    over_rate: u64,
    refused: RefusedBy,
    last_refusal: Option<String>,
    clock: Option<Clock>,
}

impl Topic {
    /// Name of the topic, and the reason why nothing of it was usable, as far as it is known.
    fn described(&self) -> String {
        let Self { name, topic, .. } = self;
        match self.mismatch.as_ref().or(self.last_refusal.as_ref()) {
            Some(why) if why.contains(topic.as_str()) => format!("{name}: {why}"),
            Some(why) => format!("{name} ({topic}): {why}"),
            None => format!("{name} ({topic})"),
        }
    }
}

/// Rejected messages by reason: by the transport, and by the intake.
#[derive(Serialize, Debug, Default, Clone, Copy)]
struct RefusedBy {
    malformed: u64,
    wrong_type: u64,
    implausible: u64,
    backwards: u64,
    ahead: u64,
    behind: u64,
    unset: u64,
    not_usable: u64,
    transport: u64,
}

impl RefusedBy {
    fn new(wire: Refused, tally: &TopicTally) -> Self {
        let here = tally.refused;
        Self {
            malformed: wire.malformed,
            wrong_type: wire.wrong_type,
            implausible: wire.implausible + here.implausible,
            backwards: wire.backwards + here.backwards,
            ahead: wire.ahead + here.ahead,
            behind: wire.behind + here.behind,
            unset: wire.unset + here.unset,
            not_usable: here.not_usable,
            transport: wire.transport,
        }
    }

    fn words(&self) -> String {
        let all = [
            (self.malformed, "malformed"),
            (self.wrong_type, "wrong type"),
            (self.implausible, "implausible"),
            (self.backwards, "backwards"),
            (self.ahead, "ahead"),
            (self.behind, "behind"),
            (self.unset, "unset"),
            (self.not_usable, "not usable"),
            (self.transport, "transport"),
        ];
        let some = all.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}"));
        some.collect::<Vec<_>>().join(", ")
    }
}

/// Clock of a topic's stamps.
#[derive(Serialize, Debug)]
struct Clock {
    /// Host clock minus stamp clock, ms, for the message with the least delay.
    offset_ms: f64,
    /// Uncertainty of the offset, ms.
    spread_ms: f64,
    /// Median delay relative to the fastest message, ms.
    delay_ms: f64,
    /// Number of times that the clock was set.
    jumps: u32,
    /// Number of stamps that were moved to follow their predecessor.
    held: u64,
}

impl Clock {
    fn from_topic(clock: &TopicClock) -> Option<Self> {
        let known = clock.offset()?;
        Some(Self {
            offset_ms: known.offset.as_ms(),
            spread_ms: known.spread.as_ms(),
            delay_ms: known.delay.as_ms(),
            jumps: known.jumps,
            held: clock.held(),
        })
    }
}

impl Summary {
    /// Summarises a drive.
    pub fn new(drive: &Drive, driven: &Driven, statistics: &[TopicStatistics]) -> Self {
        let (needs, located_by) = (driven.feed.intake.needs(), located_by(&drive.config));
        let topic = |TopicSummary { name, role, tally, clock }: TopicSummary<'_>| {
            let wire = statistics.iter().find(|s| s.name == name);
            let ms = |latency: Option<Span>| latency.map(|latency| latency.as_ms());
            let latency = wire.and_then(|s| s.latency);
            Topic {
                name: name.to_owned(),
                topic: drive.mapping.topic(name).map_or_else(String::new, |t| t.topic.clone()),
                matched: wire.map_or(0, |s| s.matched),
                incompatible: wire.map_or(0, |s| s.incompatible),
                mismatch: wire.and_then(|s| s.mismatch.clone()),
                needed: located_by.contains(&role) || needs.contains(&role),
                received: wire.map_or(tally.received, |s| s.received),
                used: tally.used,
                published: wire.map_or(0, |s| s.published),
                not_published: wire.map_or(0, |s| s.not_published),
                rate_hz: wire.and_then(|s| s.rate_hz),
                latency_p50_ms: ms(latency.map(|l| l.median)),
                latency_p99_ms: ms(latency.map(|l| l.p99)),
                lost: wire.map_or(0, |s| s.lost),
                overwritten: wire.map_or(0, |s| s.overwritten),
                over_rate: wire.map_or(0, |s| s.over_rate),
                refused: RefusedBy::new(wire.map_or_else(Refused::default, |s| s.refused), tally),
                last_refusal: tally
                    .last_refusal
                    .clone()
                    .or_else(|| wire.and_then(|s| s.last_refusal.clone())),
                clock: Clock::from_topic(clock),
            }
        };
        let topics = driven.feed.intake.tallies().map(topic).collect();
        let report = driven.report.as_ref().ok();
        let operators: &[OperatorReport] = report.map_or(&[], |report| &report.operators);
        let timer = |o: &OperatorReport| Some(Timer { operator: o.name.clone(), ticks: o.ticks? });
        let operator = |o: &OperatorReport| Operator {
            operator: o.name.clone(),
            steps: o.steps,
            drops: o.drops.total(),
            mean_ms: if o.ended > 0 { o.busy.as_ms() / o.ended as f64 } else { 0.0 },
        };
        Self {
            configuration: drive.route.display().to_string(),
            vehicle: drive.mapping.vehicle.name(),
            ended: match &driven.report {
                Ok(_) => driven.feed.why.to_owned(),
                Err(error) => error.to_string(),
            },
            digest: report.map(|report| report.digest.to_string()),
            seconds: report.map_or(0.0, |report| report.at.as_secs()),
            was_ready: driven.feed.was_ready,
            drive: with_reasons(driven),
            sink: driven.sink,
            not_taken: driven.feed.not_taken,
            transports_lost: 0,
            topics,
            timers: operators.iter().filter_map(timer).collect(),
            operators: operators.iter().filter(|o| o.steps > 0).map(operator).collect(),
        }
    }

    /// The summary with the number of lost transport processes.
    #[must_use]
    pub fn with_lost(self, transports_lost: u64) -> Self {
        Self { transports_lost, ..self }
    }

    /// Required topics that never provided usable data.
    pub fn missing(&self) -> String {
        let missing = self.topics.iter().filter(|topic| topic.needed && topic.used == 0);
        let missing: Vec<String> = missing.map(Topic::described).collect();
        if missing.is_empty() { "not at the same time".into() } else { missing.join(", ") }
    }

    /// Formats the summary for the terminal.
    pub fn text(&self) -> String {
        let mut text = format!("{}, along {}\n", self.vehicle, self.configuration);
        let _ = writeln!(text, "{} after {:.1} s", self.ended, self.seconds);
        self.drive_text(&mut text);
        self.topics_text(&mut text);
        self.times_text(&mut text);
        text
    }

    fn drive_text(&self, text: &mut String) {
        let mut row = |name: &str, value: String| {
            let _ = writeln!(text, "  {name:<18} {value}");
        };
        let DriveFigures { driving_s, driven_m, speed_max_mps, modes, refused, limited, outputs, .. } =
            &self.drive;
        row("driven", format!("{driven_m:.1} m in {driving_s:.1} s, at most {speed_max_mps:.1} m/s"));
        let (p50, p99, max) = (self.drive.beside_p50_m, self.drive.beside_p99_m, self.drive.beside_max_m);
        row("cross-track error", format!("p50 {p50:.3}  p99 {p99:.3}  max {max:.3} m"));
        let changes = modes.iter().map(|ModeChange { at_s, mode, reason }| {
            format!("from {at_s:.2} s {}", mode_words(*mode, reason.as_deref()))
        });
        row("gate", changes.collect::<Vec<_>>().join(", "));
        for (name, check) in &self.drive.monitors {
            row("monitor", format!("{name}: {} messages{}", check.messages, check.words()));
        }
        row("commands", format!("{outputs}, {} refused, {limited} limited", refused.total()));
        let SinkReport { sent, not_sent, skipped, silences, stop_commands, stood_at_end, released } =
            self.sink;
        row("to the vehicle", format!("{sent} messages sent, {not_sent} not, {skipped} outputs skipped"));
        if self.transports_lost > 0 {
            row(
                "transport",
                format!("its process was lost {} times, and started again", self.transports_lost),
            );
        }
        if silences > 0 || stop_commands > 0 {
            let stood = match stood_at_end {
                Some(true) => "; it stood at the end",
                Some(false) => "; it did not come to a standstill in time",
                None => "",
            };
            row(
                "stopped without it",
                format!("gate silent {silences} times, {stop_commands} commands to stop{stood}"),
            );
        }
        if released == Some(false) {
            row("", "the vehicle never reported that it was released".into());
        }
        if modes.iter().all(|change| change.mode == GateMode::Manual) {
            row("", "the stack never drove".into());
        }
        if self.not_taken > 0 {
            row("not taken", format!("{} messages: the engine did not keep up", self.not_taken));
        }
        if !self.was_ready {
            row("waited for", self.missing());
        }
    }

    fn topics_text(&self, text: &mut String) {
        let heads = [
            "topic",
            "received",
            "used",
            "Hz",
            "p50 ms",
            "p99 ms",
            "lost",
            "over rate",
            "offset ms",
            "uncertainty ms",
        ];
        let reference = self.reference();
        let offset_ms = |clock: &Clock| clock.offset_ms - reference.map_or(0.0, |(_, offset_ms)| offset_ms);
        let ms = |x: Option<f64>| x.map_or_else(|| "-".into(), |x| format!("{x:.2}"));
        let heard = self.topics.iter().filter(|topic| topic.received > 0).map(|topic| {
            vec![
                topic.name.clone(),
                topic.received.to_string(),
                topic.used.to_string(),
                topic.rate_hz.map_or_else(|| "-".into(), |hz| format!("{hz:.1}")),
                ms(topic.latency_p50_ms),
                ms(topic.latency_p99_ms),
                topic.lost.to_string(),
                (topic.over_rate + topic.overwritten).to_string(),
                ms(topic.clock.as_ref().map(offset_ms)),
                ms(topic.clock.as_ref().map(|clock| clock.spread_ms)),
            ]
        });
        let heads = heads.map(str::to_owned).to_vec();
        *text += &align(&std::iter::once(heads).chain(heard).collect::<Vec<_>>());
        if let Some((name, offset_ms)) = reference {
            let _ = writeln!(
                text,
                "offsets: to the clock of {name}, which is {:.3} s {} this host's",
                offset_ms.abs() * 1e-3,
                if offset_ms > 0.0 { "behind" } else { "ahead of" }
            );
        }
        for topic in &self.topics {
            if let Some(mismatch) = &topic.mismatch {
                let _ = writeln!(text, "{}: {mismatch}", topic.name);
            }
            let refused = topic.refused.words();
            if !refused.is_empty() {
                let why = topic.last_refusal.as_deref().unwrap_or("");
                let _ = writeln!(text, "{}: refused {refused} ({why})", topic.name);
            }
            if let Some(clock) = topic.clock.as_ref().filter(|clock| clock.jumps > 0) {
                let _ = writeln!(text, "{}: its clock was set {} times", topic.name, clock.jumps);
            }
        }
    }

    /// First topic with a known clock, and its offset, milliseconds, if that clock has another origin than the
    /// host's: then only differences are meaningful.
    fn reference(&self) -> Option<(&str, f64)> {
        let mut heard = self.topics.iter().filter(|topic| topic.received > 0);
        let first = heard.find_map(|topic| Some((topic.name.as_str(), topic.clock.as_ref()?.offset_ms)));
        first.filter(|(_, offset_ms)| offset_ms.abs() >= OTHER_BEGINNING_MS)
    }

    fn times_text(&self, text: &mut String) {
        let heads =
            ["timer", "ticks", "missed", "late p50 ms", "p99 ms", "max ms"].map(str::to_owned).to_vec();
        let lines = self.timers.iter().map(|Timer { operator, ticks }| {
            let ms = |ns: u64| format!("{:.2}", ns as f64 * 1e-6);
            let counts = [ticks.ticks.to_string(), ticks.missed.to_string()];
            let late = [ticks.p50_ns, ticks.p99_ns, ticks.max_ns].map(ms);
            std::iter::once(operator.clone()).chain(counts).chain(late).collect()
        });
        *text += &align(&std::iter::once(heads).chain(lines).collect::<Vec<_>>());
    }
}
