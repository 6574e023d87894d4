//! The queue of one topic's messages: never more than its depth, never faster than its rate, always the newest.

use std::collections::VecDeque;

use swerve_core::Span;

/// How many messages fit into a window of the rate.
const BURST: i64 = 5;

/// A bounded queue that keeps the newest.
#[derive(Debug)]
pub(crate) struct Inbox<T> {
    waiting: VecDeque<T>,
    depth: usize,
    /// Least time between messages on the mean, ns; 0 for any.
    period_ns: i64,
    /// When the message after the newest would come at that rate, ns (the "theoretical arrival time" of the
    /// generic cell rate algorithm, ITU-T I.371).
    expected_ns: i64,
    /// Messages that nobody read before newer ones took their place.
    pub(crate) overwritten: u64,
    /// Messages that came faster than the rate, and replaced the one before them.
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

    /// Takes a message that was received at `at_ns`.
    pub(crate) fn push(&mut self, message: T, at_ns: i64) {
        let slack = self.period_ns.saturating_mul(BURST);
        // A host clock that was set back must not stop the stream for that long.
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

    /// The oldest that waits.
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
    fn the_newest_are_kept_in_order() {
        let mut inbox = Inbox::new(3, None);
        (0..10).for_each(|i| inbox.push(i, 0));
        assert_eq!((inbox.overwritten, inbox.over_rate), (7, 0));
        assert_eq!(std::iter::from_fn(|| inbox.pop()).collect::<Vec<_>>(), [7, 8, 9]);
        assert!(inbox.is_empty());
    }

    /// A topic that may have 20 messages a second gets 1,000: it passes a burst and then every 50 ms, and what
    /// waits is always the newest.
    #[test]
    fn a_flood_is_counted_and_the_newest_waits() {
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
    fn a_stream_at_its_rate_passes_with_jitter() {
        let mut inbox = Inbox::new(1000, Some(20.0));
        for i in 0..400 {
            inbox.push(i, i * 50 * MS + (i * 37 % 90) * MS);
        }
        assert_eq!((inbox.over_rate, inbox.overwritten), (0, 0));
    }

    #[test]
    fn a_host_clock_that_is_set_back_stops_nothing() {
        let mut inbox = Inbox::new(1000, Some(20.0));
        inbox.push(0, 1_000_000 * MS);
        for i in 0..20 {
            inbox.push(i, i * 50 * MS);
        }
        assert_eq!(inbox.over_rate, 0);
    }
}
