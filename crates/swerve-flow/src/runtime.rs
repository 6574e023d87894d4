//! Run-time models: the modelled duration of a step.

use core::fmt;
use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use swerve_core::{Rng, Span, Time};

/// Model of the duration of an operator's steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum RuntimeModel {
    /// Zero run time.
    #[default]
    Zero,
    /// Constant run time.
    Fixed(Span),
    /// The listed times in turn, by the number of steps started so far.
    Cycle(Vec<Span>),
    /// Normally distributed, clamped at zero.
    Normal {
        /// Mean before the clamping.
        mean: Span,
        /// Standard deviation before the clamping.
        deviation: Span,
    },
    /// Log-normally distributed.
    LogNormal {
        /// Median: half of the steps take less.
        median: Span,
        /// Standard deviation of the logarithm.
        sigma: f64,
    },
    /// Percentiles in increasing order, 0 to 100, with their times. Linear in between; the first time below the first
    /// percentile, the last above the last.
    Percentiles(Vec<(f64, Span)>),
    /// `base + per_unit_ns * units`, with the units that the step counts by [`Context::spend`](crate::Context::spend).
    Work {
        /// Run time before the first unit.
        base: Span,
        /// Nanoseconds per unit.
        per_unit_ns: f64,
    },
    /// Run times of an earlier run, by stamp; a stamp without a record draws from the recorded times.
    Recorded(Arc<RecordedTimes>),
    /// Measured duration of the step on this host, times a factor. Not repeatable without its log.
    Measured {
        /// Ratio of modelled to measured time.
        scale: f64,
    },
}

/// Duration of a unit of work of an operator on a ladder.
pub(crate) const UNIT_NS: u64 = 1000;

/// Run times of one operator in an earlier run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordedTimes {
    by_stamp: BTreeMap<Time, Span>,
    sorted: Vec<Span>,
}

impl FromIterator<(Time, Span)> for RecordedTimes {
    fn from_iter<I: IntoIterator<Item = (Time, Span)>>(records: I) -> Self {
        let by_stamp: BTreeMap<Time, Span> = records.into_iter().collect();
        let mut sorted: Vec<Span> = by_stamp.values().copied().collect();
        sorted.sort_unstable();
        Self { by_stamp, sorted }
    }
}

/// Result of a model when a step starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Draw {
    /// The run time is known before the step is executed.
    Known(Span),
    /// As `Known`, but drawn because there was no record.
    Unrecorded(Span),
    /// Known once the step has counted its units; at least this.
    Work(Span),
    /// Known once the step has been executed.
    Measured,
}

impl RuntimeModel {
    /// Run time of an operator on a [`Ladder`](crate::Ladder) whose rungs set it: a microsecond per unit, of which a step
    /// spends those of its rung.
    pub const LADDER: Self = Self::Work { base: Span::ZERO, per_unit_ns: UNIT_NS as f64 };

    /// Draws the run time of a step of `operator` for `stamp`, after `started` started steps.
    pub(crate) fn draw(&self, seed: u64, operator: &str, stamp: Time, started: u64) -> Draw {
        // A separate key, so that the random numbers of a step and its run time are independent.
        let rng = || Rng::keyed(seed, operator, &[stamp.ns(), i64::from_le_bytes(*b"run time")]);
        match self {
            Self::Zero => Draw::Known(Span::ZERO),
            Self::Fixed(span) => Draw::Known(*span),
            Self::Cycle(spans) => Draw::Known(spans[(started % spans.len() as u64) as usize]),
            Self::Normal { mean, deviation } => {
                let ns = mean.ns() as f64 + deviation.ns() as f64 * rng().normal();
                Draw::Known(whole(ns))
            }
            Self::LogNormal { median, sigma } => {
                Draw::Known(whole(median.ns() as f64 * libm::exp(sigma * rng().normal())))
            }
            Self::Percentiles(points) => Draw::Known(percentile(points, 100.0 * rng().unit())),
            Self::Work { base, .. } => Draw::Work(*base),
            Self::Recorded(times) => match times.by_stamp.get(&stamp) {
                Some(span) => Draw::Known(*span),
                None => Draw::Unrecorded(
                    times.sorted.get(rng().below(times.sorted.len())).copied().unwrap_or(Span::ZERO),
                ),
            },
            Self::Measured { .. } => Draw::Measured,
        }
    }

    /// Largest number of units that end within `left` under `Work`; 0 if not even the base does.
    pub(crate) fn units_within(&self, left: Span) -> u64 {
        let Self::Work { base, per_unit_ns } = self else { return u64::MAX };
        let room = left.ns().saturating_sub(base.ns());
        if room <= 0 {
            return 0;
        }
        if *per_unit_ns <= 0.0 {
            return u64::MAX;
        }
        // Rounding can put the quotient past the last unit that ends in time by the model itself.
        let units = (room as f64 / per_unit_ns) as u64;
        if self.worked(units) > left { units.saturating_sub(1) } else { units }
    }

    /// Run time of `units` under `Work`.
    pub(crate) fn worked(&self, units: u64) -> Span {
        match self {
            Self::Work { base, per_unit_ns } => {
                let own = whole(per_unit_ns * units as f64);
                Span::from_ns(base.ns().saturating_add(own.ns()))
            }
            _ => Span::ZERO,
        }
    }

    /// Modelled time of a step that took `host_ns` on this host, under `Measured`.
    pub(crate) fn measured(&self, host_ns: u64) -> Span {
        match self {
            Self::Measured { scale } => whole(host_ns as f64 * scale),
            _ => Span::ZERO,
        }
    }

    /// Error in the model's numbers, if there is one.
    pub(crate) fn problem(&self) -> Option<&'static str> {
        let finite = |x: f64| x.is_finite() && x >= 0.0;
        match self {
            Self::Fixed(span) if *span < Span::ZERO => Some("a fixed run time is below zero"),
            Self::Cycle(spans) if spans.is_empty() => Some("a cycle of run times is empty"),
            Self::Cycle(spans) if spans.iter().any(|s| *s < Span::ZERO) => {
                Some("a run time of the cycle is below zero")
            }
            Self::Normal { mean, deviation } if *mean < Span::ZERO || *deviation < Span::ZERO => {
                Some("mean or deviation of the run time is below zero")
            }
            Self::LogNormal { median, sigma } if *median <= Span::ZERO || !finite(*sigma) => {
                Some("a log-normal run time needs a median above zero and a finite sigma not below zero")
            }
            Self::Percentiles(points) => problem_of_percentiles(points),
            Self::Work { base, per_unit_ns } if *base < Span::ZERO || !finite(*per_unit_ns) => {
                Some("base and time per unit have to be finite and not below zero")
            }
            Self::Measured { scale } if !finite(*scale) => {
                Some("the scale of measured run times has to be finite and not below zero")
            }
            _ => None,
        }
    }
}

fn whole(ns: f64) -> Span {
    Span::from_ns(ns.round().max(0.0) as i64)
}

fn percentile(points: &[(f64, Span)], percent: f64) -> Span {
    let above = points.partition_point(|(p, _)| *p <= percent);
    match (above.checked_sub(1).map(|i| points[i]), points.get(above)) {
        (Some((p0, s0)), Some((p1, s1))) => {
            let part = (percent - p0) / (p1 - p0);
            whole(s0.ns() as f64 + part * (*s1 - s0).ns() as f64)
        }
        (Some((_, span)), None) => span,
        (None, Some((_, span))) => *span,
        (None, None) => Span::ZERO,
    }
}

fn problem_of_percentiles(points: &[(f64, Span)]) -> Option<&'static str> {
    if points.is_empty() {
        return Some("a run time by percentiles needs at least one");
    }
    if !points.iter().all(|(p, s)| (0.0..=100.0).contains(p) && *s >= Span::ZERO) {
        return Some("percentiles lie between 0 and 100, and their times are not below zero");
    }
    if !points.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 <= w[1].1) {
        return Some("percentiles have to increase, and their times must not decrease");
    }
    None
}

impl fmt::Display for RuntimeModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Zero => f.write_str("zero"),
            Self::Fixed(span) => write!(f, "fixed {span}"),
            Self::Cycle(spans) => write!(f, "cycle of {}", spans.len()),
            Self::Normal { mean, deviation } => write!(f, "normal {mean} +- {deviation}"),
            Self::LogNormal { median, sigma } => write!(f, "log-normal {median}, sigma {sigma}"),
            Self::Percentiles(points) => {
                f.write_str("percentiles")?;
                points.iter().try_for_each(|(p, s)| write!(f, " p{p} {s}"))
            }
            Self::Work { base, per_unit_ns } => write!(f, "work {base} + {per_unit_ns} ns per unit"),
            Self::Recorded(times) => write!(f, "recorded ({} steps)", times.by_stamp.len()),
            Self::Measured { scale } => write!(f, "measured x {scale}"),
        }
    }
}
