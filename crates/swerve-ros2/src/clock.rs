//! Estimates the offset between a sensor's clock and the host's from the stream itself.
//!
//! A message with stamp `s` received at host time `r` gives `r - s = offset + delay`, and a delay is never
//! negative. The smallest difference in a window is therefore the offset plus the least delay, regardless of how
//! the other delays are distributed (the lower envelope of Moon, Skelly and Towsley, 1999, without the slope). The
//! window has ten buckets, so that slow drift is followed; the spread of the buckets' minima is the uncertainty of
//! the offset.
//!
//! Once the offset is known, stamps are judged: stamps in the future, in the distant past, or running backwards are
//! rejected. A clock that was set is detected by several consecutive rejected stamps that agree with each other; it
//! is followed, or rejected while the estimator is held.
//!
//! Pure: no clock is read here, both times are inputs.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use swerve_core::Span;

/// Parameters of the plausibility checks.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ClockParams {
    /// Duration of a bucket.
    pub bucket: Span,
    /// Number of buckets in the window.
    pub buckets: usize,
    /// Number of stamps accepted before judging starts.
    pub learning: u32,
    /// Maximum time by which a stamp may be newer than the fastest message allows: drift, jitter.
    pub ahead_max: Span,
    /// Maximum age of a stamp; older messages are useless.
    pub behind_max: Span,
    /// Number of consecutive, agreeing rejected stamps that indicate that the clock was set.
    pub jump_after: u32,
    /// Maximum spread of agreeing stamps; on the order of the delays.
    pub agree_within: Span,
}

impl Default for ClockParams {
    fn default() -> Self {
        Self {
            bucket: Span::from_ms(1000),
            buckets: 10,
            learning: 5,
            ahead_max: Span::from_ms(50),
            behind_max: Span::from_ms(1000),
            jump_after: 5,
            agree_within: Span::from_ms(200),
        }
    }
}

/// Verdict on a stamp.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum StampVerdict {
    /// Consistent with the previous stamps.
    Plausible,
    /// Too few stamps so far to judge.
    Learning,
    /// The clock was set; the offset is estimated anew.
    Jumped,
    /// The clock was set while the offset is held.
    JumpRefused,
    /// Zero or negative: not set.
    Unset,
    /// Older than the newest one before.
    Backwards,
    /// In the future.
    Ahead,
    /// In the distant past.
    Behind,
}

impl StampVerdict {
    /// Returns true if the message must be rejected.
    pub fn is_refused(self) -> bool {
        matches!(self, Self::JumpRefused | Self::Unset | Self::Backwards | Self::Ahead | Self::Behind)
    }
}

/// Estimated offset of a clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ClockOffset {
    /// Host time minus sensor time for the message with the least delay: add it to a stamp.
    pub offset: Span,
    /// Uncertainty: largest minus smallest of the buckets' minima.
    pub spread: Span,
    /// Median delay above the least, over the newest 64 messages.
    pub delay: Span,
    /// Number of stamps used.
    pub stamps: u64,
    /// Number of times that the clock was set.
    pub jumps: u32,
}

/// Estimator of the offset of one clock.
#[derive(Clone, Debug)]
pub struct ClockEstimator {
    params: ClockParams,
    /// Start and least difference of each bucket, ns, oldest first.
    minima: VecDeque<(i64, i64)>,
    /// Newest differences, ns.
    recent: VecDeque<i64>,
    newest_stamp_ns: Option<i64>,
    /// Differences of consecutive rejected stamps, ns.
    odd: Vec<i64>,
    is_held: bool,
    stamps: u64,
    jumps: u32,
}

const RECENT: usize = 64;

impl ClockEstimator {
    /// Creates an estimator without data.
    pub fn new(params: ClockParams) -> Self {
        Self {
            params,
            minima: VecDeque::new(),
            recent: VecDeque::new(),
            newest_stamp_ns: None,
            odd: Vec::new(),
            is_held: false,
            stamps: 0,
            jumps: 0,
        }
    }

    /// Holds or releases the offset: while held, stamps of a clock that was set are rejected. Drift is followed as
    /// before.
    pub fn hold(&mut self, is_held: bool) {
        self.is_held = is_held;
    }

    /// Judges a stamp received at this host time, and learns from it if it is plausible.
    pub fn judge(&mut self, stamp_ns: i64, received_ns: i64) -> StampVerdict {
        if stamp_ns <= 0 {
            return StampVerdict::Unset;
        }
        let difference = received_ns.saturating_sub(stamp_ns);
        let verdict = self.verdict(stamp_ns, difference);
        if !verdict.is_refused() {
            self.odd.clear();
            self.learn(stamp_ns, difference, received_ns);
            return verdict;
        }
        if verdict == StampVerdict::Backwards && self.stamps >= u64::from(self.params.learning) {
            // Consistent with the offset, so it does not indicate another one, however often it occurs.
            return verdict;
        }
        self.odd.push(difference);
        if !self.agree() {
            return verdict;
        }
        if self.is_held {
            return StampVerdict::JumpRefused;
        }
        self.jumps += 1;
        let odd = std::mem::take(&mut self.odd);
        self.minima.clear();
        self.recent.clear();
        self.newest_stamp_ns = None;
        for difference in odd {
            self.learn(stamp_ns, difference, received_ns);
        }
        StampVerdict::Jumped
    }

    fn verdict(&self, stamp_ns: i64, difference: i64) -> StampVerdict {
        let Some(offset_ns) = self.offset_ns().filter(|_| self.stamps >= u64::from(self.params.learning))
        else {
            return match self.newest_stamp_ns {
                Some(newest) if stamp_ns < newest => StampVerdict::Backwards,
                _ => StampVerdict::Learning,
            };
        };
        let delay = difference.saturating_sub(offset_ns);
        if delay < -self.params.ahead_max.ns() {
            StampVerdict::Ahead
        } else if delay > self.params.behind_max.ns() {
            StampVerdict::Behind
        } else if self.newest_stamp_ns.is_some_and(|newest| stamp_ns < newest) {
            StampVerdict::Backwards
        } else {
            StampVerdict::Plausible
        }
    }

    /// Returns true if enough consecutive rejected stamps agree.
    fn agree(&mut self) -> bool {
        let n = self.params.jump_after.max(1) as usize;
        if self.odd.len() > n {
            self.odd.remove(0);
        }
        let (least, most) = self.odd.iter().fold((i64::MAX, i64::MIN), |(a, b), d| (a.min(*d), b.max(*d)));
        self.odd.len() == n && most.saturating_sub(least) <= self.params.agree_within.ns()
    }

    fn learn(&mut self, stamp_ns: i64, difference: i64, received_ns: i64) {
        self.stamps += 1;
        self.newest_stamp_ns = Some(self.newest_stamp_ns.map_or(stamp_ns, |newest| newest.max(stamp_ns)));
        if self.recent.len() == RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back(difference);
        let start = received_ns - received_ns.rem_euclid(self.params.bucket.ns().max(1));
        match self.minima.back_mut() {
            Some((at, least)) if *at == start => *least = (*least).min(difference),
            _ => self.minima.push_back((start, difference)),
        }
        while self.minima.len() > self.params.buckets.max(1) {
            self.minima.pop_front();
        }
    }

    fn offset_ns(&self) -> Option<i64> {
        self.minima.iter().map(|(_, least)| *least).min()
    }

    /// Estimated offset; `None` before the first stamp.
    pub fn offset(&self) -> Option<ClockOffset> {
        let offset_ns = self.offset_ns()?;
        let most = self.minima.iter().map(|(_, least)| *least).max()?;
        let mut delays: Vec<i64> = self.recent.iter().map(|d| d - offset_ns).collect();
        delays.sort_unstable();
        Some(ClockOffset {
            offset: Span::from_ns(offset_ns),
            spread: Span::from_ns(most - offset_ns),
            delay: Span::from_ns(delays[delays.len() / 2]),
            stamps: self.stamps,
            jumps: self.jumps,
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const MS: i64 = 1_000_000;
    const S: i64 = 1_000 * MS;

    /// Feeds `n` stamps at 20 Hz from `start_ns` of the sensor's clock; delays follow a fixed pattern of 2 to 40 ms.
    fn feed(clock: &mut ClockEstimator, start_ns: i64, n: i64, offset_ns: i64) -> Vec<StampVerdict> {
        let stamps = (0..n).map(|i| start_ns + i * 50 * MS);
        let delay = |i: i64| if i % 7 == 3 { 2 * MS } else { (5 + (i * 13) % 36) * MS };
        stamps.enumerate().map(|(i, s)| clock.judge(s, s + offset_ns + delay(i as i64))).collect()
    }

    #[test]
    fn clock_offset_is_that_of_the_fastest_message() {
        for offset in [0, -3 * S, 1_700_000_000 * S / 1000] {
            let mut clock = ClockEstimator::new(ClockParams::default());
            let verdicts = feed(&mut clock, 10 * S, 100, offset);
            assert!(verdicts[..5].iter().all(|v| *v == StampVerdict::Learning));
            assert!(verdicts[5..].iter().all(|v| *v == StampVerdict::Plausible), "{verdicts:?}");
            let known = clock.offset().unwrap();
            assert_eq!(known.offset.ns(), offset + 2 * MS);
            assert!(known.spread < Span::from_ms(5) && known.delay > Span::from_ms(5), "{known:?}");
            assert_eq!((known.stamps, known.jumps), (100, 0));
        }
    }

    #[test]
    fn clock_estimator_follows_a_drift_of_fifty_ppm() {
        let mut clock = ClockEstimator::new(ClockParams::default());
        for i in 0..20 * 600_i64 {
            let stamp = S + i * 50 * MS;
            let drift = (stamp as f64 * 50e-6) as i64;
            let verdict = clock.judge(stamp, stamp + drift + 2 * MS + (i * 13 % 20) * MS);
            assert!(!verdict.is_refused());
        }
        // 600 s at 50 ppm are 30 ms; over the window of 10 s, 0.5 ms.
        let known = clock.offset().unwrap();
        assert!((known.offset - Span::from_ms(32)).as_ms().abs() < 1.0, "{known:?}");
        assert!(known.spread < Span::from_ms(2));
    }

    #[test]
    fn clock_estimator_rejects_single_outliers() {
        let mut clock = ClockEstimator::new(ClockParams::default());
        feed(&mut clock, 1000 * S, 50, 0);
        let (before, now) = (clock.offset(), 1000 * S + 50 * 50 * MS);
        assert_eq!(clock.judge(now + 60 * S, now), StampVerdict::Ahead);
        assert_eq!(clock.judge(now - 60 * S, now), StampVerdict::Behind);
        assert_eq!(clock.judge(now - 200 * MS, now), StampVerdict::Backwards);
        assert_eq!(clock.judge(0, now), StampVerdict::Unset);
        assert_eq!(clock.judge(i64::MIN, now), StampVerdict::Unset);
        assert_eq!(clock.judge(i64::MAX, now), StampVerdict::Ahead);
        assert_eq!(clock.judge(now, now + 10 * MS), StampVerdict::Plausible);
        let after = clock.offset();
        assert_eq!(after.map(|o| (o.offset, o.jumps)), before.map(|o| (o.offset, o.jumps)));
    }

    #[test]
    fn clock_estimator_follows_a_jump_after_agreeing_stamps() {
        for step in [3600 * S, -3600 * S] {
            let mut clock = ClockEstimator::new(ClockParams::default());
            feed(&mut clock, 100_000 * S, 50, 0);
            let verdicts = feed(&mut clock, 100_003 * S + step, 20, -step);
            let wrong = if step > 0 { StampVerdict::Ahead } else { StampVerdict::Behind };
            assert!(verdicts[..4].iter().all(|v| *v == wrong), "{verdicts:?}");
            assert_eq!(verdicts[4], StampVerdict::Jumped);
            assert!(verdicts[5..].iter().all(|v| *v == StampVerdict::Plausible), "{verdicts:?}");
            let known = clock.offset().unwrap();
            assert_eq!((known.offset.ns(), known.jumps), (-step + 2 * MS, 1));
        }
    }

    /// Stamps of one writer, correct or off by the given seconds; each is received 2 ms after its instant.
    fn mixed(clock: &mut ClockEstimator, start_ns: i64, off_s: &[i64]) -> Vec<StampVerdict> {
        let one = |(i, off_s): (usize, &i64)| {
            let now = start_ns + i as i64 * 10 * MS;
            clock.judge(now + off_s * S, now + 2 * MS)
        };
        off_s.iter().enumerate().map(one).collect()
    }

    #[test]
    fn set_clock_is_refused_while_the_offset_is_held_and_followed_once_released() {
        for step in [3600, -3600] {
            let mut clock = ClockEstimator::new(ClockParams::default());
            feed(&mut clock, 100_000 * S, 50, 0);
            clock.hold(true);
            let known = clock.offset();
            let wrong = if step > 0 { StampVerdict::Ahead } else { StampVerdict::Behind };
            let verdicts = mixed(&mut clock, 100_003 * S, &[step; 200]);
            assert!(verdicts[..4].iter().all(|v| *v == wrong), "{verdicts:?}");
            assert!(verdicts[4..].iter().all(|v| *v == StampVerdict::JumpRefused), "{verdicts:?}");
            assert_eq!(clock.offset(), known);
            // The writer's previous clock remains valid.
            assert_eq!(mixed(&mut clock, 100_006 * S, &[0; 3]), [StampVerdict::Plausible; 3]);
            mixed(&mut clock, 100_007 * S, &[step; 20]);
            clock.hold(false);
            let after = mixed(&mut clock, 100_008 * S, &[step; 3]);
            assert_eq!(after, [StampVerdict::Jumped, StampVerdict::Plausible, StampVerdict::Plausible]);
            assert_eq!(clock.offset().unwrap().jumps, 1);
        }
    }

    #[test]
    fn clock_estimator_rejects_each_wrong_stamp_among_good_ones() {
        for off in [[0, 3600], [3600, -3600], [-3600, 0]] {
            let mut clock = ClockEstimator::new(ClockParams::default());
            feed(&mut clock, 100_000 * S, 50, 0);
            clock.hold(true);
            let verdicts = mixed(&mut clock, 100_003 * S, &off.repeat(100));
            for (i, verdict) in verdicts.iter().enumerate() {
                assert_eq!(verdict.is_refused(), off[i % 2] != 0, "{i} of {off:?}: {verdict:?}");
                assert_ne!(*verdict, StampVerdict::JumpRefused, "{i} of {off:?}: no five in a row agree");
            }
        }
    }

    #[test]
    fn drift_is_followed_while_the_offset_is_held() {
        // 200 ppm, ten times that of a poor quartz oscillator, for an hour: 0.72 s in total.
        for ppm in [200, -200] {
            let mut clock = ClockEstimator::new(ClockParams::default());
            clock.hold(true);
            for i in 0..36_000 {
                let stamp = 10 * S + i * 100 * MS;
                let verdict =
                    clock.judge(stamp, stamp + i * 100 * MS * ppm / 1_000_000 + (2 + i * 7 % 20) * MS);
                assert!(!verdict.is_refused(), "{i}: {verdict:?}");
            }
        }
    }

    #[test]
    fn repeated_stale_messages_are_not_a_clock_jump() {
        let mut clock = ClockEstimator::new(ClockParams::default());
        feed(&mut clock, 100 * S, 50, 0);
        let now = 102 * S + 460 * MS;
        for i in 0..20 {
            assert_eq!(clock.judge(now - 60 * MS, now + i * MS), StampVerdict::Backwards);
        }
        assert_eq!(clock.offset().unwrap().jumps, 0);
    }

    #[test]
    fn backwards_stamps_are_not_a_clock_jump() {
        let mut clock = ClockEstimator::new(ClockParams::default());
        feed(&mut clock, 100 * S, 50, 0);
        let (mut refused, now) = (0, 103 * S);
        for i in 0..100 {
            // Each stamp is older than its predecessor.
            refused += i32::from(clock.judge(now - 600 * MS - i * 50 * MS, now + i * 50 * MS).is_refused());
        }
        assert_eq!((refused, clock.offset().unwrap().jumps), (100, 0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(3), ..ProptestConfig::default() })]

        /// Any input: no panic, and plausible stamps never run backwards.
        #[test]
        fn clock_estimator_handles_any_stream(stream in prop::collection::vec((any::<i64>(), any::<i64>()), 0..200), near in any::<bool>(), is_held in any::<bool>()) {
            let mut clock = ClockEstimator::new(ClockParams::default());
            clock.hold(is_held);
            let mut newest = i64::MIN;
            for (stamp, received) in stream {
                let (stamp, received) = if near { (stamp.rem_euclid(S) + S, received.rem_euclid(S) + S) } else { (stamp, received) };
                match clock.judge(stamp, received) {
                    StampVerdict::Jumped => {
                        prop_assert!(!is_held);
                        newest = stamp;
                    }
                    StampVerdict::Plausible | StampVerdict::Learning => {
                        prop_assert!(stamp >= newest);
                        newest = stamp;
                    }
                    _ => {}
                }
                prop_assert!(clock.minima.len() <= 10 && clock.recent.len() <= RECENT && clock.odd.len() <= 5);
            }
        }
    }
}
