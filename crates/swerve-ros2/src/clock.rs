//! How far a sensor's clock is from the host's, from the stream itself.
//!
//! A message with stamp `s` that is received at host time `r` gives `r - s = offset + delay`, and a delay is never
//! negative. So the smallest difference of a while is the offset and the least delay, however the others are
//! spread (the lower envelope of Moon, Skelly and Towsley, 1999, without the slope). The while is ten buckets
//! long, so that a slow drift is followed; the spread over the buckets' minima says how well the offset is known.
//!
//! Once that is known a stamp can be judged: one from the future or long past is refused, as is one that runs
//! backwards. A clock that was set is noticed by some refused stamps in a row that agree with one another: it is
//! followed, or refused as long as the estimator is held.
//!
//! Pure: no clock is read here, both times are inputs.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};
use swerve_core::Span;

/// Limits of what is plausible.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ClockParams {
    /// Length of a bucket.
    pub bucket: Span,
    /// How many buckets are looked at.
    pub buckets: usize,
    /// How many stamps are taken as they are before any is judged.
    pub learning: u32,
    /// A stamp that is newer than the fastest message before it allows is refused beyond this: drift, jitter.
    pub ahead_max: Span,
    /// A stamp that is older is refused beyond this: no message is worth anything after it.
    pub behind_max: Span,
    /// So many refused stamps in a row that agree are a clock that was set.
    pub jump_after: u32,
    /// How far they may be apart to agree: as far as delays are.
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

/// The worth of a stamp.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum StampVerdict {
    /// It fits what came before it.
    Plausible,
    /// Too little came before it to judge.
    Learning,
    /// The clock was set: from here on this is the time.
    Jumped,
    /// The clock was set while its offset is held.
    JumpRefused,
    /// It is zero or before that: nobody set it.
    Unset,
    /// It is older than the newest before it.
    Backwards,
    /// It is from the future.
    Ahead,
    /// It is from long ago.
    Behind,
}

impl StampVerdict {
    /// Whether the message is to be refused.
    pub fn is_refused(self) -> bool {
        matches!(self, Self::JumpRefused | Self::Unset | Self::Backwards | Self::Ahead | Self::Behind)
    }
}

/// The offset of a clock, as far as it is known.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ClockOffset {
    /// Host's time minus sensor's time for the message with the least delay: add it to a stamp.
    pub offset: Span,
    /// Largest minus smallest of the buckets' least differences: what is not known of the offset.
    pub spread: Span,
    /// Median of the delays above the least, over the newest 64 messages.
    pub delay: Span,
    /// How many stamps this is from.
    pub stamps: u64,
    /// How often the clock was set.
    pub jumps: u32,
}

/// Follows the offset of one clock.
#[derive(Clone, Debug)]
pub struct ClockEstimator {
    params: ClockParams,
    /// Start of the bucket and the least difference in it, ns, oldest first.
    minima: VecDeque<(i64, i64)>,
    /// The newest differences, ns.
    recent: VecDeque<i64>,
    newest_stamp_ns: Option<i64>,
    /// Differences of refused stamps in a row, ns.
    odd: Vec<i64>,
    is_held: bool,
    stamps: u64,
    jumps: u32,
}

const RECENT: usize = 64;

impl ClockEstimator {
    /// Knows nothing yet.
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

    /// Holds the offset: a clock that was set is refused until it is released. Drift is followed as before.
    pub fn hold(&mut self, is_held: bool) {
        self.is_held = is_held;
    }

    /// Judges a stamp, received at this host time, and learns from it if it is plausible.
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
            // It fits the offset, so that it is no sign of another one, however often it comes.
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

    /// Whether the newest refused stamps say the same, and together.
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

    /// The offset, as far as it is known; `None` before the first stamp.
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
    fn the_offset_is_that_of_the_fastest_message() {
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
    fn a_drift_of_fifty_ppm_is_followed() {
        let mut clock = ClockEstimator::new(ClockParams::default());
        for i in 0..20 * 600_i64 {
            let stamp = S + i * 50 * MS;
            let drift = (stamp as f64 * 50e-6) as i64;
            let verdict = clock.judge(stamp, stamp + drift + 2 * MS + (i * 13 % 20) * MS);
            assert!(!verdict.is_refused());
        }
        // 600 s at 50 ppm are 30 ms; the window is 10 s long, half a millisecond.
        let known = clock.offset().unwrap();
        assert!((known.offset - Span::from_ms(32)).as_ms().abs() < 1.0, "{known:?}");
        assert!(known.spread < Span::from_ms(2));
    }

    #[test]
    fn single_odd_stamps_are_refused_and_change_nothing() {
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
    fn a_clock_that_was_set_is_believed_after_some_stamps_that_agree() {
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

    /// Stamps of one writer, good ones and ones that are off by the given seconds; every one is received 2 ms after
    /// its instant.
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
            // The writer's old time is still its time.
            assert_eq!(mixed(&mut clock, 100_006 * S, &[0; 3]), [StampVerdict::Plausible; 3]);
            mixed(&mut clock, 100_007 * S, &[step; 20]);
            clock.hold(false);
            let after = mixed(&mut clock, 100_008 * S, &[step; 3]);
            assert_eq!(after, [StampVerdict::Jumped, StampVerdict::Plausible, StampVerdict::Plausible]);
            assert_eq!(clock.offset().unwrap().jumps, 1);
        }
    }

    #[test]
    fn wrong_stamps_among_good_ones_are_refused_each() {
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
        // 200 ppm, ten times that of a poor quartz, for an hour: 0.72 s in all.
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
    fn repeats_of_what_was_overtaken_are_no_clock_that_was_set() {
        let mut clock = ClockEstimator::new(ClockParams::default());
        feed(&mut clock, 100 * S, 50, 0);
        let now = 102 * S + 460 * MS;
        for i in 0..20 {
            assert_eq!(clock.judge(now - 60 * MS, now + i * MS), StampVerdict::Backwards);
        }
        assert_eq!(clock.offset().unwrap().jumps, 0);
    }

    #[test]
    fn time_that_runs_backwards_is_no_clock_that_was_set() {
        let mut clock = ClockEstimator::new(ClockParams::default());
        feed(&mut clock, 100 * S, 50, 0);
        let (mut refused, now) = (0, 103 * S);
        for i in 0..100 {
            // Each stamp is older than the one before it.
            refused += i32::from(clock.judge(now - 600 * MS - i * 50 * MS, now + i * 50 * MS).is_refused());
        }
        assert_eq!((refused, clock.offset().unwrap().jumps), (100, 0));
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(3), ..ProptestConfig::default() })]

        /// Whatever comes: no panic, and what is plausible never runs backwards.
        #[test]
        fn any_stream_is_judged(stream in prop::collection::vec((any::<i64>(), any::<i64>()), 0..200), near in any::<bool>(), is_held in any::<bool>()) {
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
