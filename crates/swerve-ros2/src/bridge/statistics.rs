//! Statistics of a bridge's topics.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use swerve_core::Span;

use super::Endpoint;
use crate::clock::{ClockOffset, StampVerdict};
use crate::message::Kind;

/// Statistics of a topic.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct TopicStatistics {
    /// Name in the mapping.
    pub name: String,
    /// ROS name.
    pub topic: String,
    /// The type of its messages.
    pub kind: Kind,
    /// Number of matched readers or writers.
    pub matched: usize,
    /// Number of readers or writers with incompatible quality of service.
    pub incompatible: u64,
    /// Description of a discovered writer or reader that cannot exchange messages with this node, since its type or its
    /// quality of service differs.
    pub mismatch: Option<String>,
    /// Messages received, valid or not.
    pub received: u64,
    /// Messages taken by the reader.
    pub delivered: u64,
    /// Messages replaced by newer ones before they were taken.
    pub overwritten: u64,
    /// Messages above the rate limit; each replaced its predecessor.
    pub over_rate: u64,
    /// Messages missing according to the writers' sequence numbers.
    pub lost: u64,
    /// Rejected messages by reason.
    pub refused: Refused,
    /// Reason for the latest rejection.
    pub last_refusal: Option<String>,
    /// Messages sent.
    pub published: u64,
    /// Messages that could not be sent.
    pub not_published: u64,
    /// Rate over the newest 256 messages, Hz.
    pub rate_hz: Option<f64>,
    /// Reception minus source timestamp; includes the offset between the hosts' clocks.
    pub latency: Option<Latency>,
    /// Clock of the stamps.
    pub clock: Option<ClockOffset>,
}

impl TopicStatistics {
    /// Empty statistics of a topic.
    pub(crate) fn none(endpoint: &Endpoint) -> Self {
        Counters::default().statistics(endpoint)
    }

    /// Reason why nothing of this topic is usable, as far as it is known: another type or quality of service, or the
    /// reason for the latest rejection if every message was rejected.
    pub fn fault(&self) -> Option<&str> {
        let rejected = self.last_refusal.as_deref().filter(|_| self.delivered == 0);
        self.mismatch.as_deref().or(rejected)
    }

    /// Adds earlier statistics.
    pub(crate) fn add(&mut self, earlier: &Self) {
        self.incompatible += earlier.incompatible;
        self.received += earlier.received;
        self.delivered += earlier.delivered;
        self.overwritten += earlier.overwritten;
        self.over_rate += earlier.over_rate;
        self.lost += earlier.lost;
        self.refused.add(earlier.refused);
        self.published += earlier.published;
        self.not_published += earlier.not_published;
        self.last_refusal = self.last_refusal.take().or_else(|| earlier.last_refusal.clone());
    }
}

/// Rejected messages by reason.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Refused {
    /// The payload cannot be decoded.
    pub malformed: u64,
    /// The writer has another type.
    pub wrong_type: u64,
    /// Implausible numbers, sizes or names.
    pub implausible: u64,
    /// Stamp older than the newest one before.
    pub backwards: u64,
    /// Stamp in the future.
    pub ahead: u64,
    /// Stamp in the distant past.
    pub behind: u64,
    /// Stamp not set.
    pub unset: u64,
    /// Failure of the transport.
    pub transport: u64,
}

impl Refused {
    fn add(&mut self, more: Self) {
        let Self { malformed, wrong_type, implausible, backwards, ahead, behind, unset, transport } = more;
        self.malformed += malformed;
        self.wrong_type += wrong_type;
        self.implausible += implausible;
        self.backwards += backwards;
        self.ahead += ahead;
        self.behind += behind;
        self.unset += unset;
        self.transport += transport;
    }

    /// Sum over all reasons.
    pub fn total(&self) -> u64 {
        let Self { malformed, wrong_type, implausible, backwards, ahead, behind, unset, transport } = *self;
        malformed + wrong_type + implausible + backwards + ahead + behind + unset + transport
    }
}

/// Transport latency.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Latency {
    /// Median.
    pub median: Span,
    /// 99th percentile.
    pub p99: Span,
    /// Maximum over the newest 256 messages.
    pub max: Span,
}

#[derive(Default)]
pub(super) struct Counters {
    pub(super) received: u64,
    pub(super) delivered: u64,
    pub(super) lost: u64,
    pub(super) incompatible: u64,
    pub(super) refused: Refused,
    pub(super) last_refusal: Option<String>,
    received_ns: Newest,
    latencies_ns: Newest,
}

impl Counters {
    pub(super) fn receive(&mut self, received_ns: i64, source_ns: Option<i64>) {
        self.received += 1;
        self.received_ns.push(received_ns);
        if let Some(source_ns) = source_ns {
            self.latencies_ns.push(received_ns.saturating_sub(source_ns));
        }
    }

    pub(super) fn refuse_stamp(&mut self, verdict: StampVerdict) {
        let (counter, why) = match verdict {
            StampVerdict::Backwards => {
                (&mut self.refused.backwards, "its stamp is older than the one before it")
            }
            StampVerdict::Ahead => (&mut self.refused.ahead, "its stamp is from the future"),
            StampVerdict::Behind => (&mut self.refused.behind, "its stamp is from long ago"),
            _ => (&mut self.refused.unset, "it has no stamp"),
        };
        *counter += 1;
        self.last_refusal = Some(why.to_owned());
    }

    pub(super) fn statistics(&self, endpoint: &Endpoint) -> TopicStatistics {
        let latencies = self.latencies_ns.sorted();
        let at = |share: f64| Span::from_ns(latencies[((latencies.len() - 1) as f64 * share) as usize]);
        let latency =
            (!latencies.is_empty()).then(|| Latency { median: at(0.5), p99: at(0.99), max: at(1.0) });
        let rate_hz = self.received_ns.ends().and_then(|(first, last, n)| {
            let seconds = Span::from_ns(last - first).as_secs();
            (n > 1 && seconds > 0.0).then(|| (n - 1) as f64 / seconds)
        });
        TopicStatistics {
            name: endpoint.name.clone(),
            topic: endpoint.topic.clone(),
            kind: endpoint.kind,
            matched: 0,
            incompatible: self.incompatible,
            mismatch: None,
            received: self.received,
            delivered: self.delivered,
            overwritten: 0,
            over_rate: 0,
            lost: self.lost,
            refused: self.refused,
            last_refusal: self.last_refusal.clone(),
            published: 0,
            not_published: 0,
            rate_hz,
            latency,
            clock: None,
        }
    }
}

/// The newest values of a series, for medians.
#[derive(Default)]
struct Newest(VecDeque<i64>);

impl Newest {
    const MAX: usize = 256;

    fn push(&mut self, value: i64) {
        if self.0.len() == Self::MAX {
            self.0.pop_front();
        }
        self.0.push_back(value);
    }

    fn sorted(&self) -> Vec<i64> {
        let mut values: Vec<i64> = self.0.iter().copied().collect();
        values.sort_unstable();
        values
    }

    fn ends(&self) -> Option<(i64, i64, usize)> {
        Some((*self.0.front()?, *self.0.back()?, self.0.len()))
    }
}
