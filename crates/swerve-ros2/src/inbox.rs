//! Queue of one topic's messages: bounded in depth and rate, and always containing the newest.

use std::collections::VecDeque;

use swerve_core::Span;

/// Number of messages that may arrive in a burst.
const BURST: i64 = 5;

/// A bounded queue that keeps the newest messages.
#[derive(Debug)]
pub(crate) struct Inbox<T> {
    waiting: VecDeque<T>,
    depth: usize,
    /// Minimum mean period of messages, ns; 0 for no limit.
    period_ns: i64,
    /// Theoretical arrival time of the next message at that rate, ns (generic cell rate algorithm, ITU-T I.371).
    expected_ns: i64,
    /// Messages replaced by newer ones before they were read.
    pub(crate) overwritten: u64,
    /// Messages above the rate limit; each replaced its predecessor.
    pub(crate) over_rate: u64,
}

impl<T> Inbox<T> {
    pub(crate) fn new(depth: usize, rate_max_hz: Option<f64>) -> Self {
        let period_ns = rate_max_hz.map_or(0, |hz| Span::from_secs(1.0 / hz).ns());
        let expected_ns = i64::MIN;
        Self {
            waiting: VecDeque::new(),
            depth: depth.max(1),
            period_ns,
            expected_ns,
            overwritten: 0,
            over_rate: 0,
        }
    }

    /// Adds a message received at `at_ns`.
    pub(crate) fn push(&mut self, message: T, at_ns: i64) {
        let slack = self.period_ns.saturating_mul(BURST);
        // A host clock that was set back must not block the stream for that time.
        if self.expected_ns.saturating_sub(at_ns) > slack.saturating_mul(2) {
            self.expected_ns = at_ns;
        }
        if at_ns < self.expected_ns.saturating_sub(slack) {
            self.over_rate += 1;
            self.waiting.pop_back();
        } else {
            self.expected_ns = self.expected_ns.max(at_ns).saturating_add(self.period_ns);
            if self.waiting.len() == self.depth {
                self.waiting.pop_front();
                self.overwritten += 1;
            }
        }
        self.waiting.push_back(message);
    }

    /// Removes the oldest message.
    pub(crate) fn pop(&mut self) -> Option<T> {
        self.waiting.pop_front()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn inbox_keeps_the_newest_in_order() {
        let mut inbox = Inbox::new(3, None);
        (0..10).for_each(|i| inbox.push(i, 0));
        assert_eq!((inbox.overwritten, inbox.over_rate), (7, 0));
        assert_eq!(std::iter::from_fn(|| inbox.pop()).collect::<Vec<_>>(), [7, 8, 9]);
        assert!(inbox.is_empty());
    }

    /// A topic limited to 20 messages per second gets 1,000: a burst passes, then one every 50 ms, and the waiting
    /// message is always the newest.
    #[test]
    fn inbox_counts_a_flood_and_keeps_the_newest() {
        let mut inbox = Inbox::new(1000, Some(20.0));
        for i in 0..1000 {
            inbox.push(i, i * MS);
        }
        let waiting: Vec<i64> = std::iter::from_fn(|| inbox.pop()).collect();
        assert!((20..=27).contains(&waiting.len()), "{}", waiting.len());
        assert_eq!(waiting.last(), Some(&999));
        assert_eq!(inbox.over_rate, 1000 - waiting.len() as u64);
    }

    #[test]
    fn inbox_passes_a_stream_with_jitter_at_its_rate() {
        let mut inbox = Inbox::new(1000, Some(20.0));
        for i in 0..400 {
            inbox.push(i, i * 50 * MS + (i * 37 % 90) * MS);
        }
        assert_eq!((inbox.over_rate, inbox.overwritten), (0, 0));
    }

    #[test]
    fn inbox_tolerates_a_host_clock_that_is_set_back() {
        let mut inbox = Inbox::new(1000, Some(20.0));
        inbox.push(0, 1_000_000 * MS);
        for i in 0..20 {
            inbox.push(i, i * 50 * MS);
        }
        assert_eq!(inbox.over_rate, 0);
    }
}
