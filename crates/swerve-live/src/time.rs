//! From a sensor's clock to run time.

use swerve_core::{Span, Time};
use swerve_ros2::clock::{ClockEstimator, ClockOffset, ClockParams, StampVerdict};

/// Converts the stamps of one topic to run time, by the clock offset observed on that topic.
///
/// The fastest message so far is assumed to have arrived without delay; any other is assigned the delay by which it
/// was slower. A stamp is therefore never in the future, and is accurate to the minimum delay, which cannot be
/// observed. The estimate improves with every faster message, which would move stamps backwards: each stamp is kept
/// at least one nanosecond after its predecessor.
#[derive(Clone, Debug)]
pub struct TopicClock {
    estimator: ClockEstimator,
    last: Option<Time>,
    held: u64,
    /// Set for simulated time: the newest stamp so far, ns.
    simulated: Option<i64>,
    params: ClockParams,
}

/// Minimum time between two stamps of a stream.
const LEAST: Span = Span::from_ns(1);

impl TopicClock {
    /// Creates a clock without an estimate.
    pub fn new(params: ClockParams) -> Self {
        Self { estimator: ClockEstimator::new(params), last: None, held: 0, simulated: None, params }
    }

    /// Holds or releases the offset: while held, stamps of a clock that was set are rejected.
    pub fn hold(&mut self, is_held: bool) {
        self.estimator.hold(is_held);
    }

    /// Judges stamps by run time, instead of an estimated offset: both are simulated time.
    pub fn use_simulated_time(&mut self) {
        self.simulated = Some(i64::MIN);
    }

    /// Run time of a stamp in simulated time.
    fn simulated_time(&mut self, stamp_ns: i64, now: Time, epoch_ns: i64) -> Result<Time, StampVerdict> {
        let time = Time::from_ns(stamp_ns.saturating_sub(epoch_ns));
        let is_older = self.simulated.is_some_and(|newest| stamp_ns < newest);
        if stamp_ns <= 0 {
            Err(StampVerdict::Unset)
        } else if time > now.saturating_add(self.params.ahead_max) {
            Err(StampVerdict::Ahead)
        } else if time.saturating_add(self.params.behind_max) < now {
            Err(StampVerdict::Behind)
        } else if is_older {
            Err(StampVerdict::Backwards)
        } else {
            self.simulated = Some(stamp_ns);
            Ok(self.after_last(time.min(now)))
        }
    }

    /// Run time of a stamp received at `now`; `epoch_ns` is the host's clock at run time zero.
    ///
    /// # Errors
    /// If the stamp is implausible.
    pub fn time(&mut self, stamp_ns: i64, now: Time, epoch_ns: i64) -> Result<Time, StampVerdict> {
        if self.simulated.is_some() {
            return self.simulated_time(stamp_ns, now, epoch_ns);
        }
        let verdict = self.estimator.judge(stamp_ns, epoch_ns.saturating_add(now.ns()));
        if verdict.is_refused() {
            return Err(verdict);
        }
        let offset_ns = self.estimator.offset().map_or(0, |known| known.offset.ns());
        let ns = stamp_ns.saturating_add(offset_ns).saturating_sub(epoch_ns);
        Ok(self.after_last(Time::from_ns(ns).min(now)))
    }

    /// Run time of a message without a stamp.
    pub fn unstamped(&mut self, now: Time) -> Time {
        self.after_last(now)
    }

    fn after_last(&mut self, time: Time) -> Time {
        // Measurements from before the run are assigned to its start.
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

    /// Offset of the clock, if known.
    pub fn offset(&self) -> Option<ClockOffset> {
        self.estimator.offset()
    }

    /// Number of stamps that had to be moved to follow their predecessor.
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
    fn topic_clock_converts_stamps_to_increasing_run_times() {
        for offset_ns in [0, 40_000 * MS, -3_600_000 * MS] {
            let mut clock = clock();
            let told = feed(&mut clock, 1, 200, offset_ns);
            let mut last = Time::MIN;
            for (i, (measured, time)) in told.iter().enumerate() {
                let time = time.unwrap();
                assert!(time > last, "{i}");
                last = time;
                // After the fastest message, the remaining error is the minimum delay.
                if i > 11 {
                    assert_eq!(time, Time::from_ns(measured + 2 * MS));
                }
            }
            assert_eq!(clock.offset().unwrap().offset.ns(), offset_ns + 2 * MS);
        }
    }

    #[test]
    fn topic_clock_stays_monotonic_on_a_faster_message() {
        let mut clock = clock();
        let at = |ms: i64| Time::from_ns(ms * MS);
        // Two messages within a millisecond, the second much faster.
        let first = clock.time(EPOCH_NS + 100 * MS, at(130), EPOCH_NS).unwrap();
        let second = clock.time(EPOCH_NS + 101 * MS, at(130), EPOCH_NS).unwrap();
        let third = clock.time(EPOCH_NS + 102 * MS, at(131), EPOCH_NS).unwrap();
        assert_eq!(first, at(130));
        assert_eq!(second, first + LEAST);
        assert_eq!(third, at(131));
        assert_eq!(clock.held(), 1);
    }

    #[test]
    fn topic_clock_takes_simulated_stamps_without_an_offset() {
        let mut clock = clock();
        clock.use_simulated_time();
        let mut time = |stamp_ms: i64, now_ms: i64| {
            clock.time(EPOCH_NS + stamp_ms * MS, Time::from_ms(now_ms), EPOCH_NS)
        };
        // Delays of any length in simulated time change nothing.
        assert_eq!(time(100, 100), Ok(Time::from_ms(100)));
        assert_eq!(time(150, 900), Ok(Time::from_ms(150)));
        assert_eq!(time(940, 900), Ok(Time::from_ms(900)), "never in the future");
        assert_eq!(time(951, 900), Err(StampVerdict::Ahead));
        assert_eq!(time(100, 1200), Err(StampVerdict::Behind));
        assert_eq!(time(930, 1000), Err(StampVerdict::Backwards));
        assert_eq!(time(-EPOCH_NS / MS, 1000), Err(StampVerdict::Unset));
        assert_eq!(time(1000, 1000), Ok(Time::from_ms(1000)));
        assert_eq!(clock.offset(), None);
    }

    #[test]
    fn topic_clock_rejects_implausible_stamps() {
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
    fn topic_clock_follows_a_jump_monotonically() {
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
