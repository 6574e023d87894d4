//! Black boxes for test graphs, and a log of their events.

use std::sync::{Arc, Mutex};

use swerve_core::{Span, Time};

use crate::*;

pub(super) fn ms(ms: i64) -> Span {
    Span::from_ms(ms)
}

pub(super) fn at(ms: i64) -> Time {
    Time::from_ms(ms)
}

pub(super) fn fixed(ms: i64) -> RuntimeModel {
    RuntimeModel::Fixed(Span::from_ms(ms))
}

/// Publishes its stamp in nanoseconds for every frame.
pub(super) struct Stage;

impl Operator for Stage {
    type In = (Vec<Every>, Vec<At<i64>>, Vec<Latest<i64>>);
    type Out = Port<i64>;

    fn step(&mut self, cx: &mut Context<'_>, _: &Self::In, out: &mut Self::Out) {
        out.send(cx.stamp().ns());
    }
}

/// Sources of the ports of a [`Stage`].
#[derive(Default)]
pub(super) struct Inputs {
    timers: Vec<Timer>,
    at: Vec<Stream<i64>>,
    latest: Vec<Source<i64>>,
}

pub(super) fn tick(period_ms: i64) -> Inputs {
    Inputs { timers: vec![every(ms(period_ms))], ..Inputs::default() }
}

pub(super) fn join(streams: &[Stream<i64>]) -> Inputs {
    Inputs { at: streams.to_vec(), ..Inputs::default() }
}

impl Inputs {
    pub(super) fn phase(mut self, phase_ms: i64) -> Self {
        self.timers = self.timers.into_iter().map(|timer| timer.phase(ms(phase_ms))).collect();
        self
    }

    pub(super) fn and_tick(mut self, period_ms: i64) -> Self {
        self.timers.push(every(ms(period_ms)));
        self
    }

    pub(super) fn latest(mut self, source: impl Into<Source<i64>>) -> Self {
        self.latest.push(source.into());
        self
    }
}

/// A graph of black boxes.
#[derive(Default)]
pub(super) struct Net {
    pub(super) graph: Graph,
}

impl Net {
    pub(super) fn new() -> Self {
        Self::default()
    }

    pub(super) fn stage(&mut self, name: &str, inputs: Inputs) -> OperatorRef<'_, Port<i64>> {
        self.graph.add(name, Stage, (inputs.timers, inputs.at, inputs.latest))
    }

    /// Adds a stream with the listed publications: (visible at, stamp if any, watermark), in ms.
    pub(super) fn script(&mut self, name: &str, publications: &[(i64, Option<i64>, i64)]) -> Stream<i64> {
        let record = |&(visible, stamp, watermark): &(i64, Option<i64>, i64)| {
            let mut record = match stamp {
                Some(stamp) => PlaybackRecord::message(at(visible), at(stamp), at(stamp).ns()),
                None => PlaybackRecord::bare(at(visible), at(watermark)),
            };
            record.watermark = at(watermark);
            record
        };
        self.graph.script(name, publications.iter().map(record).collect())
    }

    /// Adds a stream of messages stamped 0, `period`, ..., up to `last`, each visible at its stamp.
    pub(super) fn instant_messages(&mut self, name: &str, period: i64, last: i64) -> Stream<i64> {
        let records: Vec<_> =
            (0..=last / period).map(|k| (k * period, Some(k * period), k * period)).collect();
        self.script(name, &records)
    }

    pub(super) fn run(self, until_ms: i64) -> Log {
        let log = Log::default();
        let mut recorder = log.clone();
        run_virtual(self.graph, &RunOptions::until(at(until_ms)), vec![&mut recorder])
            .expect("the graph runs");
        log
    }
}

/// One publication, instants in nanoseconds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Published {
    pub(super) operator: String,
    pub(super) stamp: Option<i64>,
    pub(super) watermark: i64,
    pub(super) visible_at: i64,
    pub(super) reused_from: Option<i64>,
    pub(super) origin: Option<i64>,
    pub(super) reads: Vec<(String, Option<i64>)>,
}

#[derive(Default)]
struct Lines {
    published: Vec<Published>,
    lines: Vec<String>,
    report: Option<RunReport>,
}

/// All events that observers received.
#[derive(Clone, Default)]
pub(super) struct Log(Arc<Mutex<Lines>>);

impl Observer for Log {
    fn event(&mut self, event: &Event<'_>) {
        let mut log = self.0.lock().unwrap();
        if let Event::Publication(p) = event {
            let ns = |time: Time| time.ns();
            log.published.push(Published {
                operator: p.operator.into(),
                stamp: p.stamp.map(ns),
                watermark: p.watermark.ns(),
                visible_at: p.visible_at.ns(),
                reused_from: p.reused_from.map(ns),
                origin: p.origin.map(ns),
                reads: p.reads.iter().map(|(name, stamp)| (name.into(), stamp.map(ns))).collect(),
            });
        }
        if let Event::End(report) = event {
            log.report = Some((*report).clone());
        }
        log.lines.extend(line(event));
    }
}

/// Formats an event as a line of text, instants in milliseconds.
fn line(event: &Event<'_>) -> Option<String> {
    let ms = |time: Time| time.ns() as f64 / 1e6;
    Some(match event {
        Event::Publication(p) => {
            let stamp = p.stamp.map_or("-".into(), |stamp| ms(stamp).to_string());
            let reused = p.reused_from.map_or(String::new(), |from| format!(" from {}", ms(from)));
            format!("{} {stamp}@{}{reused}", p.operator, ms(p.visible_at))
        }
        Event::StepStart(s) => format!("{} starts {}@{}", s.operator, ms(s.stamp), ms(s.at)),
        Event::StepEnd(s) => format!("{} ends {}@{}", s.operator, ms(s.stamp), ms(s.end)),
        Event::Miss(m) => format!("{} misses {}@{}", m.operator, ms(m.stamp), ms(m.at)),
        Event::Drop(d) => format!("{} drops {}@{} {:?}", d.operator, ms(d.stamp), ms(d.at), d.reason),
        Event::Decision(_) | Event::End(_) => return None,
    })
}

impl Log {
    /// Messages of an operator, as (stamp, instant) in ms.
    pub(super) fn messages(&self, operator: &str) -> Vec<(i64, i64)> {
        let of = |p: &&Published| p.operator == operator;
        let ms = |p: &Published| p.stamp.map(|stamp| (stamp / 1_000_000, p.visible_at / 1_000_000));
        self.0.lock().unwrap().published.iter().filter(of).filter_map(ms).collect()
    }

    /// Publications of an operator.
    pub(super) fn published(&self, operator: &str) -> Vec<Published> {
        self.0.lock().unwrap().published.iter().filter(|p| p.operator == operator).cloned().collect()
    }

    /// All publications of an operator, as (stamp, watermark, instant) in ns.
    pub(super) fn watermarks(&self, operator: &str) -> Vec<(Option<i64>, i64, i64)> {
        self.published(operator).iter().map(|p| (p.stamp, p.watermark, p.visible_at)).collect()
    }

    /// Inputs of an operator's message, by stamp in ms.
    pub(super) fn reads(&self, operator: &str, stamp_ms: i64) -> Vec<(String, Option<i64>)> {
        let stamp = Some(stamp_ms * 1_000_000);
        let published = self.published(operator);
        let message = published.iter().find(|p| p.stamp == stamp).expect("the operator published the stamp");
        message.reads.iter().map(|(name, stamp)| (name.clone(), stamp.map(|ns| ns / 1_000_000))).collect()
    }

    /// Number of missed deadlines that were answered by the step's own result.
    pub(super) fn own_results_at_misses(&self, operator: &str) -> usize {
        let lines = self.lines(operator);
        let own = |line: &&String| lines.contains(&line.replacen(" misses ", " ", 1));
        lines.iter().filter(|line| line.contains(" misses ")).filter(own).count()
    }

    /// Lines about an operator.
    pub(super) fn lines(&self, operator: &str) -> Vec<String> {
        let prefix = format!("{operator} ");
        self.0.lock().unwrap().lines.iter().filter(|line| line.starts_with(&prefix)).cloned().collect()
    }

    /// All lines.
    pub(super) fn all(&self) -> Vec<String> {
        self.0.lock().unwrap().lines.clone()
    }

    pub(super) fn report(&self) -> RunReport {
        self.0.lock().unwrap().report.clone().expect("the run is over")
    }

    pub(super) fn tally(&self, operator: &str) -> OperatorReport {
        self.report().operator(operator).expect("the operator exists").clone()
    }
}
