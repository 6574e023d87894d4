//! Trace writer in the Trace Event Format, for <https://ui.perfetto.dev> and `chrome://tracing`.

use std::collections::{BTreeMap, VecDeque};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use swerve_core::{Span, Time};
use swerve_flow::Event;

use crate::LogError;
use crate::arrows::{Arrow, Arrows};
use crate::record::{reaction_name, reason_name};

/// Times of a message.
#[derive(Clone, Copy, Debug)]
struct Published {
    /// Instant that the message describes.
    stamp: Time,
    /// Stamp of the newest sensor frame from which it derives.
    origin: Option<Time>,
    /// Instant at which it became visible.
    at: Time,
}

/// Writes the steps of a run as a trace in run time.
///
/// - Every operator has a track, or several if its steps overlap; each step is a slice from its
///   start to its modelled end, with its stamp and its units of work. A step without run time is shown with 1 ns,
///   because arrows need a slice to attach to.
/// - Missed deadlines and dropped frames are instants on the operator's first track.
/// - Arrows lead from the step that received a sensor frame through all readers of derived data to the
///   first step of a command operator; a counter shows the frame's age there.
///
/// Events are written in order of time. The trace is valid JSON once [`finish`](Self::finish) was called or the
/// writer dropped, however the run ended.
/// the writer dropped, however the run ended.
pub struct TraceWriter<W: Write = BufWriter<File>> {
    path: PathBuf,
    out: Option<W>,
    failed: Option<io::Error>,
    trace: Trace,
}

/// Trace formatter without the output: compiled once, not for every type of output.
struct Trace {
    /// Formatted text, not written out yet.
    text: String,
    first: bool,
    operators: Vec<Track>,
    tids: u32,
    running: Vec<Running>,
    arrows: Arrows,
    /// Events that earlier ones may still precede, by time and order.
    pending: BTreeMap<(Time, Rank, u64), String>,
    order: u64,
    now: Time,
}

/// Order of events of one instant: slices first, because arrows attach to existing slices.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Rank {
    Slice,
    Mark,
}

/// Number of ended steps remembered per operator, for messages that they publish later.
const ENDED: usize = 64;

/// Tracks of an operator.
struct Track {
    name: String,
    /// The name as a JSON string.
    quoted: String,
    /// Thread number of each lane, and true if a step is running in it.
    lanes: Vec<(u32, bool)>,
    /// Stamp, thread number and last instant of the slices of the most recent steps.
    ended: VecDeque<(Time, u32, Time)>,
}

/// A step that has started but not ended.
struct Running {
    operator: usize,
    lane: usize,
    stamp: Time,
    start: Time,
}

impl TraceWriter {
    /// Creates the file, which must not exist. Arrows end at the operators named in `commands`.
    pub fn create(path: &Path, commands: &[&str]) -> Result<Self, LogError> {
        let file = File::create_new(path).map_err(|source| LogError::Create { path: path.into(), source })?;
        Ok(Self::to(path, BufWriter::with_capacity(64 << 10, file), commands))
    }
}

/// Text is written out in pieces of at least this many bytes.
const PASSED_ON: usize = 16 << 10;

impl<W: Write> TraceWriter<W> {
    /// Writes to any sink; `path` is its name in errors.
    pub fn to(path: &Path, out: W, commands: &[&str]) -> Self {
        Self { path: path.into(), out: Some(out), failed: None, trace: Trace::new(commands) }
    }

    /// Records a step that started at `at`; `reads` lists its input streams with the stamps of their newest
    /// messages.
    pub fn step_start<'a>(
        &mut self,
        operator: &str,
        stamp: Time,
        at: Time,
        reads: impl Iterator<Item = (&'a str, Option<Time>)>,
    ) {
        self.trace.step_start(operator, stamp, at, reads);
        self.pass_on(PASSED_ON);
    }

    /// Records the modelled end of a step.
    pub fn step_end(&mut self, operator: &str, stamp: Time, end: Time, units: u64, late: bool) {
        self.trace.step_end(operator, stamp, end, units, late);
        self.pass_on(PASSED_ON);
    }

    /// Records a missed deadline.
    pub fn miss(&mut self, operator: &str, stamp: Time, at: Time, reaction: &str) {
        self.trace.miss(operator, stamp, at, reaction);
        self.pass_on(PASSED_ON);
    }

    /// Records a dropped frame or result.
    pub fn dropped(&mut self, operator: &str, stamp: Time, at: Time, reason: &str) {
        self.trace.dropped(operator, stamp, at, reason);
        self.pass_on(PASSED_ON);
    }

    /// Marks the steps of a causal chain, by instant (seconds) and name, across all tracks.
    pub fn mark_chain<'a>(&mut self, steps: impl Iterator<Item = (f64, &'a str)>, actor: &str) {
        self.trace.mark_chain(steps, actor);
        self.pass_on(PASSED_ON);
    }

    /// Completes the trace: running steps end at the last instant.
    pub fn finish(mut self) -> Result<(), LogError> {
        self.complete();
        match self.failed.take() {
            None => Ok(()),
            Some(error) => Err(LogError::Write { path: self.path.clone(), reason: error.to_string() }),
        }
    }

    /// Records an event of the run.
    pub(crate) fn take(&mut self, event: &Event<'_>) {
        self.trace.event(event);
        self.pass_on(PASSED_ON);
    }

    /// Writes out the formatted text if it has at least `least` bytes.
    fn pass_on(&mut self, least: usize) {
        if self.trace.text.len() < least {
            return;
        }
        if let Some(out) = &mut self.out
            && let Err(error) = out.write_all(self.trace.text.as_bytes())
        {
            self.failed.get_or_insert(error);
            self.out = None;
        }
        self.trace.text.clear();
    }

    fn complete(&mut self) {
        if self.out.is_some() {
            self.trace.complete();
        }
        self.pass_on(0);
        if let Some(mut out) = self.out.take()
            && let Err(error) = out.flush()
        {
            self.failed.get_or_insert(error);
        }
    }
}

impl<W: Write> Drop for TraceWriter<W> {
    fn drop(&mut self) {
        self.complete();
    }
}

impl Trace {
    fn new(commands: &[&str]) -> Self {
        let mut trace = Self {
            text: String::new(),
            first: true,
            operators: Vec::new(),
            tids: 0,
            running: Vec::new(),
            arrows: Arrows::new(commands),
            pending: BTreeMap::new(),
            order: 0,
            now: Time::ZERO,
        };
        trace.text.push_str("{\"displayTimeUnit\":\"ms\",\"traceEvents\":[\n");
        trace.emit(
            "{\"ph\":\"M\",\"pid\":1,\"name\":\"process_name\",\"args\":{\"name\":\"swerve, run time\"}}",
        );
        trace
    }

    /// Records an event of the run.
    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::Publication(p) => {
                if let Some(stamp) = p.stamp {
                    // A repeat derives from the inputs of the repeated step, not from its own stamp.
                    let published = Published { stamp, origin: p.origin, at: p.visible_at };
                    self.message(p.operator, p.stream, published, p.reads.iter());
                }
            }
            Event::StepStart(e) => self.step_start(e.operator, e.stamp, e.at, e.reads.iter()),
            Event::StepEnd(e) => self.step_end(e.operator, e.stamp, e.end, e.units, e.late),
            Event::Miss(e) => self.miss(e.operator, e.stamp, e.at, reaction_name(e.reaction)),
            Event::Drop(e) => self.dropped(e.operator, e.stamp, e.at, reason_name(e.reason)),
            Event::Decision(_) => {}
            Event::End(report) => self.reach(report.at),
        }
    }

    /// Records a step that started at `at`; `reads` lists its input streams with the stamps of their newest
    /// messages.
    fn step_start<'a>(
        &mut self,
        operator: &str,
        stamp: Time,
        at: Time,
        reads: impl Iterator<Item = (&'a str, Option<Time>)>,
    ) {
        self.reach(at);
        let index = self.operator(operator);
        let lane = self.lane(index);
        self.running.push(Running { operator: index, lane, stamp, start: at });
        let tid = self.operators[index].lanes[lane].0;
        for arrow in self.arrows.step(operator, reads) {
            self.arrow(&arrow, tid, at);
        }
    }

    /// Records the modelled end of a step.
    fn step_end(&mut self, operator: &str, stamp: Time, end: Time, units: u64, late: bool) {
        self.reach(end);
        let index = self.operator(operator);
        let found = self.running.iter().position(|r| r.operator == index && r.stamp == stamp);
        if let Some(place) = found {
            let step = self.running.remove(place);
            self.slice(&step, end, if late { "late" } else { "" }, units);
            let track = &mut self.operators[index];
            track.lanes[step.lane].1 = false;
            track.ended.push_back((stamp, track.lanes[step.lane].0, last_within(step.start, end)));
            if track.ended.len() > ENDED {
                track.ended.pop_front();
            }
        }
    }

    /// Records a message that became visible; `reads` as for the step that computed it.
    fn message<'a>(
        &mut self,
        operator: &str,
        stream: &str,
        Published { stamp, origin, at }: Published,
        reads: impl Iterator<Item = (&'a str, Option<Time>)>,
    ) {
        self.reach(at);
        if let Some(arrow) = self.arrows.message(operator, stream, stamp, origin, reads) {
            let index = self.operator(operator);
            let (tid, from) = self.slice_of(index, stamp, at);
            self.arrow(&arrow, tid, from);
        }
    }

    /// Records a missed deadline.
    fn miss(&mut self, operator: &str, stamp: Time, at: Time, reaction: &str) {
        self.instant(operator, at, &format!("missed, {reaction}"), stamp);
    }

    /// Records a dropped frame or result.
    fn dropped(&mut self, operator: &str, stamp: Time, at: Time, reason: &str) {
        self.instant(operator, at, &format!("dropped, {reason}"), stamp);
    }

    /// Marks the steps of a causal chain, by instant (seconds) and name, across all tracks.
    fn mark_chain<'a>(&mut self, steps: impl Iterator<Item = (f64, &'a str)>, actor: &str) {
        self.tids += 1;
        let tid = self.tids;
        let head = format!("{{\"ph\":\"M\",\"pid\":1,\"tid\":{tid},\"name\":");
        self.emit(&format!("{head}\"thread_name\",\"args\":{{\"name\":\"why\"}}}}"));
        for (at_s, what) in steps {
            let event = format!(
                "{{\"ph\":\"i\",\"s\":\"g\",\"pid\":1,\"tid\":{tid},\"name\":{},\"cat\":\"why\",\"ts\":{}}}",
                serde_json::Value::from(format!("{actor}: {what}")),
                Micros((Time::ZERO + Span::from_secs(at_s)).ns()),
            );
            self.emit(&event);
        }
    }

    /// Advances the time to `at` and writes all events that no later one can precede.
    fn reach(&mut self, at: Time) {
        self.now = self.now.max(at);
        let running = self.running.iter().map(|r| r.start).min();
        // Arrows are moved back by one nanosecond.
        let safe = running.unwrap_or(self.now).min(self.now) - Span::from_ns(1);
        while let Some(entry) = self.pending.first_entry() {
            if entry.key().0 >= safe {
                break;
            }
            let event = entry.remove();
            self.emit(&event);
        }
    }

    fn operator(&mut self, name: &str) -> usize {
        if let Some(index) = self.operators.iter().position(|o| o.name == name) {
            return index;
        }
        let quoted = serde_json::Value::from(name).to_string();
        self.operators.push(Track { name: name.into(), quoted, lanes: Vec::new(), ended: VecDeque::new() });
        self.operators.len() - 1
    }

    /// Occupies the first free lane of an operator.
    fn lane(&mut self, operator: usize) -> usize {
        let free = self.operators[operator].lanes.iter().position(|(_, busy)| !busy);
        let lane = free.unwrap_or_else(|| self.add_lane(operator));
        self.operators[operator].lanes[lane].1 = true;
        lane
    }

    /// Thread number of the slice of a step that publishes at `at`, and the last instant within that slice.
    fn slice_of(&mut self, operator: usize, stamp: Time, at: Time) -> (u32, Time) {
        let track = &self.operators[operator];
        if let Some(step) = self.running.iter().find(|r| r.operator == operator && r.stamp == stamp) {
            return (track.lanes[step.lane].0, last_within(step.start, at));
        }
        match track.ended.iter().rev().find(|(of, ..)| *of == stamp) {
            Some(&(_, tid, last)) => (tid, last),
            None => (self.first_lane(operator), at),
        }
    }

    fn first_lane(&mut self, operator: usize) -> u32 {
        if self.operators[operator].lanes.is_empty() {
            self.add_lane(operator);
        }
        self.operators[operator].lanes[0].0
    }

    fn add_lane(&mut self, operator: usize) -> usize {
        self.tids += 1;
        let tid = self.tids;
        let track = &mut self.operators[operator];
        let lane = track.lanes.len();
        track.lanes.push((tid, false));
        let label = if lane == 0 { track.name.clone() } else { format!("{} ({})", track.name, lane + 1) };
        let label = serde_json::Value::from(label);
        let sort = operator * 1000 + lane;
        let head = format!("{{\"ph\":\"M\",\"pid\":1,\"tid\":{tid},\"name\":");
        self.emit(&format!("{head}\"thread_name\",\"args\":{{\"name\":{label}}}}}"));
        self.emit(&format!("{head}\"thread_sort_index\",\"args\":{{\"sort_index\":{sort}}}}}"));
        lane
    }

    fn slice(&mut self, step: &Running, end: Time, note: &str, units: u64) {
        let track = &self.operators[step.operator];
        let run_time = end - step.start;
        let shown = run_time.max(Span::from_ns(1));
        let event = format!(
            "{{\"ph\":\"X\",\"pid\":1,\"tid\":{},\"name\":{},\"cat\":\"step\",\"ts\":{},\"dur\":{},\
             \"args\":{{\"stamp_ms\":{},\"run_time_ms\":{},\"units\":{units}{}}}}}",
            track.lanes[step.lane].0,
            track.quoted,
            Micros(step.start.ns()),
            Micros(shown.ns()),
            step.stamp.ns() as f64 / 1e6,
            run_time.ns() as f64 / 1e6,
            if note.is_empty() { String::new() } else { format!(",\"note\":\"{note}\"") },
        );
        self.hold(step.start, Rank::Slice, event);
    }

    fn instant(&mut self, operator: &str, at: Time, name: &str, stamp: Time) {
        self.reach(at);
        let index = self.operator(operator);
        let tid = self.first_lane(index);
        let event = format!(
            "{{\"ph\":\"i\",\"s\":\"t\",\"pid\":1,\"tid\":{tid},\"name\":{},\"cat\":\"loss\",\"ts\":{},\
             \"args\":{{\"stamp_ms\":{}}}}}",
            serde_json::Value::from(name),
            Micros(at.ns()),
            stamp.ns() as f64 / 1e6,
        );
        self.hold(at, Rank::Mark, event);
    }

    fn arrow(&mut self, arrow: &Arrow, tid: u32, at: Time) {
        let phase = match arrow {
            Arrow::Start { .. } => "s",
            Arrow::Through { .. } => "t",
            Arrow::End { .. } => "f",
        };
        let mut event = format!(
            "{{\"ph\":\"{phase}\",\"pid\":1,\"tid\":{tid},\"id\":{},\"name\":\"frame\",\"cat\":\"frame\",\
             \"ts\":{}",
            arrow.chain(),
            Micros(at.ns()),
        );
        event.push_str(if phase == "f" { ",\"bp\":\"e\"}" } else { "}" });
        self.hold(at, Rank::Mark, event);
        if let Arrow::End { sensor, stamp, .. } = arrow {
            let name = serde_json::Value::from(format!("age of {sensor} when used"));
            let age_ms = (at - *stamp).ns() as f64 / 1e6;
            let counter = format!(
                "{{\"ph\":\"C\",\"pid\":1,\"name\":{name},\"ts\":{},\"args\":{{\"ms\":{age_ms}}}}}",
                Micros(at.ns())
            );
            self.hold(at, Rank::Mark, counter);
        }
    }

    fn hold(&mut self, at: Time, place: Rank, event: String) {
        self.order += 1;
        self.pending.insert((at, place, self.order), event);
    }

    fn emit(&mut self, event: &str) {
        if !core::mem::take(&mut self.first) {
            self.text.push_str(",\n");
        }
        self.text.push_str(event);
    }

    fn complete(&mut self) {
        for step in core::mem::take(&mut self.running) {
            self.slice(&step, self.now, "unfinished", 0);
        }
        for event in core::mem::take(&mut self.pending).into_values() {
            self.emit(&event);
        }
        self.text.push_str("\n]}\n");
    }
}

/// Last nanosecond of a slice.
fn last_within(start: Time, end: Time) -> Time {
    start.max(end - Span::from_ns(1))
}

/// Nanoseconds, formatted as microseconds without loss.
struct Micros(i64);

impl core::fmt::Display for Micros {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let ns = self.0.unsigned_abs();
        if self.0 < 0 {
            f.write_char('-')?;
        }
        write!(f, "{}.{:03}", ns / 1000, ns % 1000)
    }
}

#[cfg(test)]
mod tests;
