//! From a sensor's clock to the time of the run.

use swerve_core::{Span, Time};
use swerve_ros2::clock::{ClockEstimator, ClockOffset, ClockParams, StampVerdict};

/// Stamps of one topic, moved by the offset that the topic itself shows.
///
/// The message that was fastest so far is taken to have come at once; any other is as much older than its receipt as
/// it was slower. So a stamp is never from the future, and as good as the least delay, which nobody can know.
/// The estimate gets better with every faster message, which would set stamps back: each is kept after the one
/// before it, at the least by a nanosecond.
#[derive(Clone, Debug)]
pub struct TopicClock {
    estimator: ClockEstimator,
    last: Option<Time>,
    held: u64,
}

/// The least time between two stamps of a stream.
const LEAST: Span = Span::from_ns(1);

impl TopicClock {
    /// Knows nothing yet.
    pub fn new(params: ClockParams) -> Self {
        Self { estimator: ClockEstimator::new(params), last: None, held: 0 }
    }

    /// Holds the offset: a clock that was set is refused until it is released.
    pub fn hold(&mut self, is_held: bool) {
        self.estimator.hold(is_held);
    }

    /// The run's time of a stamp that was received at `now`; host's clock stood at `epoch_ns` when the run began.
    ///
    /// # Errors
    /// The stamp is not plausible.
    pub fn time(&mut self, stamp_ns: i64, now: Time, epoch_ns: i64) -> Result<Time, StampVerdict> {
        let verdict = self.estimator.judge(stamp_ns, epoch_ns.saturating_add(now.ns()));
        if verdict.is_refused() {
            return Err(verdict);
        }
        let offset_ns = self.estimator.offset().map_or(0, |known| known.offset.ns());
        let ns = stamp_ns.saturating_add(offset_ns).saturating_sub(epoch_ns);
        Ok(self.after_last(Time::from_ns(ns).min(now)))
    }

    /// The run's time of a message without a stamp.
    pub fn unstamped(&mut self, now: Time) -> Time {
        self.after_last(now)
    }

    fn after_last(&mut self, time: Time) -> Time {
        // What was measured before the run is of its beginning.
        let time = time.max(Time::ZERO);
        let time = match self.last {
            Some(last) if time <= last => {
                self.held += 1;
                last.saturating_add(LEAST)
            }
            _ => time,
        };
        self.last = Some(time);
        time
    }

    /// The clock's offset, as far as it is known.
    pub fn offset(&self) -> Option<ClockOffset> {
        self.estimator.offset()
    }

    /// How many stamps would not have been after the one before them.
    pub fn held(&self) -> u64 {
        self.held
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const EPOCH_NS: i64 = 1_700_000_000_000 * MS;

    fn clock() -> TopicClock {
        TopicClock::new(ClockParams::default())
    }

    /// A sensor at 50 Hz whose clock is `offset_ns` behind the host's, with delays of 2 to 12 ms.
    fn feed(
        clock: &mut TopicClock,
        from: i64,
        n: i64,
        offset_ns: i64,
    ) -> Vec<(i64, Result<Time, StampVerdict>)> {
        let one = |i: i64| {
            let (measured, delay) = (i * 20 * MS, (2 + (i * 7) % 11) * MS);
            let now = Time::from_ns(measured + delay);
            (measured, clock.time(EPOCH_NS + measured - offset_ns, now, EPOCH_NS))
        };
        (from..from + n).map(one).collect()
    }

    #[test]
    fn stamps_are_moved_to_the_time_of_the_run_and_increase() {
        for offset_ns in [0, 40_000 * MS, -3_600_000 * MS] {
            let mut clock = clock();
            let told = feed(&mut clock, 1, 200, offset_ns);
            let mut last = Time::MIN;
            for (i, (measured, time)) in told.iter().enumerate() {
                let time = time.unwrap();
                assert!(time > last, "{i}");
                last = time;
                // Once the fastest has come, what is left is the least delay.
                if i > 11 {
                    assert_eq!(time, Time::from_ns(measured + 2 * MS));
                }
            }
            assert_eq!(clock.offset().unwrap().offset.ns(), offset_ns + 2 * MS);
        }
    }

    #[test]
    fn a_faster_message_sets_no_stamp_back() {
        let mut clock = clock();
        let at = |ms: i64| Time::from_ns(ms * MS);
        // Two within a millisecond of one another, the second much faster.
        let first = clock.time(EPOCH_NS + 100 * MS, at(130), EPOCH_NS).unwrap();
        let second = clock.time(EPOCH_NS + 101 * MS, at(130), EPOCH_NS).unwrap();
        let third = clock.time(EPOCH_NS + 102 * MS, at(131), EPOCH_NS).unwrap();
        assert_eq!(first, at(130));
        assert_eq!(second, first + LEAST);
        assert_eq!(third, at(131));
        assert_eq!(clock.held(), 1);
    }

    #[test]
    fn what_is_not_plausible_is_refused() {
        let mut clock = clock();
        feed(&mut clock, 1, 50, 0);
        let (now, stamp) = (Time::from_ms(1100), EPOCH_NS + 1090 * MS);
        for (moved, verdict) in
            [(60_000, StampVerdict::Ahead), (-60_000, StampVerdict::Behind), (-200, StampVerdict::Backwards)]
        {
            assert_eq!(clock.time(stamp + moved * MS, now, EPOCH_NS), Err(verdict));
        }
        assert_eq!(clock.time(0, now, EPOCH_NS), Err(StampVerdict::Unset));
        assert!(clock.time(stamp, now, EPOCH_NS).is_ok());
    }

    #[test]
    fn a_clock_that_was_set_is_followed_and_time_goes_on() {
        for jump_ms in [3_600_000, -3_600_000] {
            let mut clock = clock();
            let before = feed(&mut clock, 1, 50, 0).last().unwrap().1.unwrap();
            let told = feed(&mut clock, 51, 50, jump_ms * MS);
            assert_eq!(told.iter().filter(|(_, time)| time.is_err()).count(), 4);
            assert!(told.iter().filter_map(|(_, time)| time.ok()).all(|time| time > before));
            let (measured, last) = told.last().unwrap();
            assert_eq!(last.unwrap(), Time::from_ns(measured + 2 * MS));
            assert_eq!(clock.offset().unwrap().jumps, 1);
        }
    }
}
