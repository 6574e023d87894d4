//! Index of a log by operator: its inputs, steps and lost frames.

use std::collections::{BTreeMap, BTreeSet};

use swerve_core::{Span, Time};
use swerve_flow::{GraphInfo, InputInfo, InputKind, OperatorInfo, Payload, PayloadType};
use swerve_log::{Log, MessageHeader, PublicationRecord, Record, StepRecord};
use swerve_msg::EgoState;

/// A message: its stamp, and when it was published.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Seen {
    pub(super) stamp: Time,
    pub(super) at: Time,
}

/// Reason why a frame of an operator has no result in time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Loss {
    Dropped,
    Missed,
}

/// Records of a log, indexed by operator or stream, and stamp.
pub(super) struct Timeline<'a> {
    graph: GraphInfo,
    messages: BTreeMap<&'a str, BTreeMap<Time, &'a PublicationRecord>>,
    steps: BTreeMap<&'a str, BTreeMap<Time, &'a StepRecord>>,
    losses: BTreeMap<&'a str, BTreeMap<Time, Loss>>,
}

impl<'a> Timeline<'a> {
    pub(super) fn new(log: &'a Log, graph: GraphInfo) -> Self {
        let (mut messages, mut steps, mut losses) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        for record in &log.records {
            match record {
                Record::Publication(p) => {
                    let of: &mut BTreeMap<_, _> = messages.entry(p.stream.stream.as_str()).or_default();
                    of.insert(p.header.stamp, p);
                }
                Record::Step(step) => {
                    let of: &mut BTreeMap<_, _> = steps.entry(step.operator.as_str()).or_default();
                    of.insert(step.stamp, step);
                }
                Record::Miss(miss) => {
                    let of: &mut BTreeMap<_, _> = losses.entry(miss.operator.as_str()).or_default();
                    of.insert(miss.stamp, Loss::Missed);
                }
                Record::Drop(dropped) => {
                    let of: &mut BTreeMap<_, _> = losses.entry(dropped.operator.as_str()).or_default();
                    of.entry(dropped.stamp).or_insert(Loss::Dropped);
                }
                _ => {}
            }
        }
        Self { graph, messages, steps, losses }
    }

    fn operator(&self, name: &str) -> Option<&OperatorInfo> {
        self.graph.operators.iter().find(|operator| operator.name == name)
    }

    pub(super) fn operators(&self) -> impl Iterator<Item = String> {
        self.graph.operators.iter().map(|operator| operator.name.clone())
    }

    /// True if an operator derives the car's state from streams of these operators alone.
    pub(super) fn is_own(&self, operator: &str, of: &BTreeSet<String>) -> bool {
        let mut read = self.inputs(operator).filter_map(|input| input.from.as_ref()).peekable();
        let tells = self.stream_of::<EgoState>(operator).is_some() && read.peek().is_some();
        tells && read.all(|from| of.contains(from))
    }

    pub(super) fn inputs(&self, operator: &str) -> impl Iterator<Item = &InputInfo> {
        self.operator(operator).into_iter().flat_map(|operator| &operator.inputs)
    }

    /// Operator that publishes a stream.
    pub(super) fn publisher(&self, stream: &str) -> &str {
        let publishes = |o: &&OperatorInfo| o.outputs.iter().any(|(name, _)| name == stream);
        self.graph.operators.iter().find(publishes).map_or("", |operator| &operator.name)
    }

    /// Stream of an operator that carries messages of a type.
    pub(super) fn stream_of<T: Payload>(&self, operator: &str) -> Option<&str> {
        let name = PayloadType::of::<T>().name();
        let carries = |(_, payload): &&(String, String)| *payload == name;
        self.operator(operator)?.outputs.iter().find(carries).map(|(stream, _)| stream.as_str())
    }

    /// Nearest upstream stream of messages of a type.
    pub(super) fn upstream<T: Payload>(&self, operator: &str) -> Option<String> {
        let inputs = || self.inputs(operator).filter(|input| !is_feedback(input));
        let is_of = |input: &&InputInfo| {
            let stream = input.from.as_deref().and_then(|from| self.stream_of::<T>(from));
            stream.is_some() && stream == input.stream.as_deref()
        };
        let direct = inputs().find(is_of).and_then(|input| input.stream.clone());
        direct
            .or_else(|| inputs().filter_map(|i| i.from.as_deref()).find_map(|from| self.upstream::<T>(from)))
    }

    /// Operators on a path from one to an input of another over a feedback edge, both excluded.
    pub(super) fn path(&self, from: &str, to: &str) -> Vec<String> {
        let ends =
            self.inputs(to).filter(|input| is_feedback(input)).filter_map(|input| input.from.as_deref());
        ends.filter_map(|end| self.way(from, end)).next().unwrap_or_default()
    }

    /// True if the output of an operator leads to an input of another over a feedback edge.
    pub(super) fn leads(&self, from: &str, to: &str) -> bool {
        let mut ends =
            self.inputs(to).filter(|input| is_feedback(input)).filter_map(|input| input.from.as_deref());
        ends.any(|end| self.way(from, end).is_some())
    }

    fn way(&self, from: &str, to: &str) -> Option<Vec<String>> {
        if from == to {
            return Some(Vec::new());
        }
        let before = self.inputs(to).filter(|input| !is_feedback(input)).filter_map(|i| i.from.as_deref());
        let mut way = before.filter_map(|before| self.way(from, before)).next()?;
        way.push(to.to_owned());
        Some(way)
    }

    /// All operators on paths from one to an input of another over a feedback edge, both excluded.
    pub(super) fn between(&self, from: &str, to: &str) -> BTreeSet<String> {
        let mut found = BTreeSet::new();
        let mut open: Vec<&str> =
            self.inputs(to).filter(|input| is_feedback(input)).filter_map(|i| i.from.as_deref()).collect();
        while let Some(name) = open.pop() {
            if name != from && self.way(from, name).is_some() && found.insert(name.to_owned()) {
                let inputs = self.inputs(name).filter(|input| !is_feedback(input));
                open.extend(inputs.filter_map(|input| input.from.as_deref()));
            }
        }
        found
    }

    /// Delay between publication and reading of the streams of an operator.
    pub(super) fn delay(&self, operator: &str) -> Span {
        Span::from_ns(self.operator(operator).map_or(0, |operator| operator.delay_ns))
    }

    pub(super) fn is_timed(&self, operator: &str) -> bool {
        self.inputs(operator).any(|input| matches!(input.kind, InputKind::Every { .. }))
    }

    pub(super) fn has_deadline(&self, operator: &str) -> bool {
        self.operator(operator).is_some_and(|operator| operator.deadline.is_some())
    }

    pub(super) fn is_measured(&self, operator: &str) -> bool {
        self.operator(operator).is_some_and(|operator| operator.runtime.contains("measured"))
    }

    /// Header of the message of a stream with this stamp.
    pub(super) fn header(&self, stream: &str, stamp: Time) -> Option<&MessageHeader> {
        Some(&self.messages.get(stream)?.get(&stamp)?.header)
    }

    pub(super) fn seen(&self, stream: &str, stamp: Time) -> Option<Seen> {
        self.header(stream, stamp).map(|header| Seen { stamp, at: header.visible_at })
    }

    /// True if the result of a frame was published before an instant as the answer to the deadline of another one.
    pub(super) fn is_repeated(&self, stream: &str, stamp: Time, before: Time) -> bool {
        let later = self.messages.get(stream).into_iter().flat_map(|of| of.range(stamp..));
        later
            .map(|(_, message)| &message.header)
            .any(|h| h.reused_from == Some(stamp) && h.visible_at < before)
    }

    /// Messages of a stream, in order of their stamps.
    pub(super) fn all(&self, stream: &str) -> impl Iterator<Item = Seen> {
        let of = self.messages.get(stream).into_iter().flatten();
        of.map(|(stamp, message)| Seen { stamp: *stamp, at: message.header.visible_at })
    }

    /// Newest message of a stream with a stamp at or before an instant.
    pub(super) fn newest(&self, stream: &str, at: Time) -> Option<&'a PublicationRecord> {
        self.messages.get(stream)?.range(..=at).next_back().map(|(_, message)| *message)
    }

    pub(super) fn step(&self, operator: &str, stamp: Time) -> Option<&StepRecord> {
        self.steps.get(operator)?.get(&stamp).copied()
    }

    pub(super) fn loss(&self, operator: &str, stamp: Time) -> Option<Loss> {
        self.losses.get(operator)?.get(&stamp).copied()
    }

    /// Frames of an operator from one stamp up to, excluding, another, with the loss of those without a result.
    pub(super) fn frames(&self, stream: &str, from: Time, to: Time) -> BTreeMap<Time, Option<Loss>> {
        let results = self.messages.get(stream).into_iter().flat_map(|of| of.range(from..to));
        let losses = self.losses.get(self.publisher(stream)).into_iter().flat_map(|of| of.range(from..to));
        let mut frames: BTreeMap<Time, Option<Loss>> = results.map(|(stamp, _)| (*stamp, None)).collect();
        frames.extend(losses.map(|(stamp, loss)| (*stamp, Some(*loss))));
        frames
    }
}

fn is_feedback(input: &InputInfo) -> bool {
    matches!(input.kind, InputKind::Latest { feedback: true, .. })
}
