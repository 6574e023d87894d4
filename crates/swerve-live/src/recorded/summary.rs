//! Result of a recorded drive, for `metrics.json` and the terminal.

use std::fmt::Write as _;

use serde::Serialize;
use swerve_log::BagTopic;
use swerve_report::output::align;

use crate::intake::Refusals;
use crate::watch::DriveFigures;

/// Message counts of a topic.
#[derive(Serialize, Clone, Debug, Default)]
pub struct TopicReport {
    /// ROS name.
    pub topic: String,
    /// Type according to the recording.
    #[serde(rename = "type")]
    pub kind: String,
    /// Name in the mapping; `None` if the mapping does not contain it.
    pub name: Option<String>,
    /// Messages in the recording.
    pub messages: u64,
    /// Messages used.
    pub used: u64,
    /// Messages of another type than in the mapping, or not in plain CDR.
    pub wrong_type: u64,
    /// Messages that cannot be decoded.
    pub malformed: u64,
    /// Messages with an implausible time of reception.
    pub impossible_time: u64,
    /// Messages rejected for their content.
    #[serde(flatten)]
    pub refused: Refusals,
    /// Reason for the latest rejection.
    pub last_refusal: Option<String>,
    /// Recorder's clock minus stamp clock, ms, for the message with the least delay.
    pub clock_offset_ms: Option<f64>,
    /// Uncertainty of the offset, ms.
    pub clock_spread_ms: Option<f64>,
}

impl TopicReport {
    pub(super) fn new(topic: &BagTopic, name: Option<String>) -> Self {
        let (topic, kind) = (topic.name.clone(), topic.type_name.clone());
        Self { topic, kind, name, ..Self::default() }
    }
}

/// Result of a recorded drive.
#[derive(Serialize, Debug)]
pub struct Summary {
    pub(super) configuration: String,
    pub(super) rosbag: String,
    /// Reasons why not all of it was read.
    pub(super) cut_off: Vec<String>,
    /// Digest of all messages, reproducible between runs.
    pub(super) digest: String,
    pub(super) seconds: f64,
    /// Messages with an earlier time than a preceding one in the files; they are sorted by time.
    pub(super) earlier: u64,
    /// Number of times that the recorder's clock was set or the recording paused.
    pub(super) clock_jumps: u64,
    /// Messages on channels that the recording does not describe.
    pub(super) strays: u64,
    /// Messages that reached a stream no later than their predecessor.
    pub(super) late: u64,
    pub(super) topics: Vec<TopicReport>,
    pub(super) drive: DriveFigures,
    pub(super) operators: Vec<Operator>,
}

#[derive(Serialize, Debug)]
pub(super) struct Operator {
    pub(super) operator: String,
    pub(super) steps: u64,
    pub(super) drops: u64,
}

impl Summary {
    pub(super) fn text(&self) -> String {
        let mut text = format!("{}, {:.1} s of {}\n", self.configuration, self.seconds, self.rosbag);
        for cut_off in &self.cut_off {
            let _ = writeln!(text, "not read to its end: {cut_off}");
        }
        let Self { earlier, clock_jumps, strays, late, .. } = self;
        for (n, what) in [
            (earlier, "messages were not recorded in order of time and were sorted"),
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
            let _ = writeln!(
                text,
                "{}: no operator reads it ({} of {})",
                topic.topic, topic.messages, topic.kind
            );
        }
        let head = ["operator", "steps", "drops"].map(str::to_owned).to_vec();
        let row = |o: &Operator| vec![o.operator.clone(), o.steps.to_string(), o.drops.to_string()];
        text += &align(&std::iter::once(head).chain(self.operators.iter().map(row)).collect::<Vec<_>>());
        let _ = writeln!(text, "digest {}", self.digest);
        text
    }
}
