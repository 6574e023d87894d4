//! From the recorder's time to run time.

use swerve_core::{Span, Time};

/// Messages up to this much earlier than the newest one are out of order; earlier times are implausible.
const EARLIER_MAX: Span = Span::from_ms(1000);
/// Largest plausible gap between two messages of a drive.
const GAP_MAX: Span = Span::from_ms(60_000);
/// Number of consecutive implausible but mutually consistent times after which the clock was set, or recording
/// paused.
const AGREE: u32 = 20;
/// Converts the recorder's time to run time, which never runs backwards.
#[derive(Default)]
pub(super) struct Clock {
    /// Recorder's time at run time zero, ns; `None` before the first message.
    zero_ns: Option<i128>,
    newest_ns: i128,
    /// Latest implausible time, and the number of consecutive times consistent with it.
    odd: Option<(i128, u32)>,
    /// Number of times that the clock was set or the recording paused.
    pub(super) jumps: u64,
}

impl Clock {
    /// Run time of a message; `None` if its recorded time is implausible.
    pub(super) fn time(&mut self, received_ns: u64) -> Option<Time> {
        let received_ns = i128::from(received_ns);
        let zero_ns = *self.zero_ns.get_or_insert(received_ns);
        let lead_ns = received_ns - zero_ns - self.newest_ns;
        let may_be = -i128::from(EARLIER_MAX.ns())..=i128::from(GAP_MAX.ns());
        if may_be.contains(&lead_ns) {
            self.odd = None;
            self.newest_ns += lead_ns.max(0);
        } else {
            let agreeing = match self.odd {
                Some((before_ns, n)) if may_be.contains(&(received_ns - before_ns)) => n + 1,
                _ => 1,
            };
            self.odd = Some((received_ns, agreeing));
            if agreeing < AGREE {
                return None;
            }
            self.odd = None;
            self.jumps += 1;
            self.zero_ns = Some(received_ns - self.newest_ns);
        }
        i64::try_from(self.newest_ns).ok().map(Time::from_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn recorder_clock_is_monotonic_and_follows_a_jump() {
        let mut clock = Clock::default();
        let mut at = |ns: u64| clock.time(ns).map(|time| time.as_secs());
        assert_eq!(at(100 * S), Some(0.0));
        assert_eq!(at(102 * S), Some(2.0));
        assert_eq!(at(101 * S + S / 2), Some(2.0), "out of turn");
        assert_eq!((at(90 * S), at(u64::MAX), at(0)), (None, None, None));
        assert_eq!(at(103 * S), Some(3.0));
        // One hour later, permanently.
        let later: Vec<_> = (0..25).map(|i| at(3700 * S + i * S)).collect();
        assert!(later[..19].iter().all(Option::is_none), "{later:?}");
        assert_eq!((later[19], later[24]), (Some(3.0), Some(8.0)));
        assert_eq!(clock.jumps, 1);
    }
}
